/// Inertia of a stage of a time step with dissipation proportional to mass: sum of weight/2 |q - predicted|^2 over
/// positions and twists.
#include "tendril/energy/edge.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

class Inertia final : public Term {
public:
  Inertia(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), predicted_(slot_size, elements.slots), weight_(scene.rods.size()) {}

  /// With v = d/dt + u and acceleration (mass v + b)/dt (StageRule), inertia and dissipation are m (mass/dt^2 +
  /// alpha/dt) (d - d_hat), d_hat = -dt u - b dt/(mass + alpha dt), docs/theory.md (15.2); the same for the twist
  /// increment, whose derivatives are (14.3).
  void beginStep(const State &, const Configuration &start, const Step &step, int r) override {
    start_ = &start;
    reference_ = step.twist_reference ? step.twist_reference : &start;
    const RodRange &rod = elements_.rods[r];
    const double alpha = scene_.rods[r].material.mass_damping_coefficient;
    const StageRule &rule = *step.rule;
    weight_[r] = rule.mass / (step.dt * step.dt) + alpha / step.dt;
    for (int a = 0; a < slot_size; ++a)
      std::fill_n(predicted_[a] + rod.first_slot, a < 3 ? rod.vertices : rod.edges, 0.0);
    predict(rule.velocity, -step.dt, rod);
    predict(rule.acceleration, -step.dt / (rule.mass + alpha * step.dt), rod);
  }

  [[gnu::flatten]] double energy(const Configuration &c, int r) const override {
    const RodRange &rod = elements_.rods[r];
    Pack total(0.0);
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes)
      total += read<Pack>(elements_.mass() + s) *
               (c.displacements<Pack>(s, *start_) - readVector<Pack>(predicted_, 0, s)).squaredNorm();
    if (rod.twist)
      for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
        const Pack d = spinOver(*reference_, c, s) - read<Pack>(predicted_[3] + s);
        total += read<Pack>(elements_.twistMass() + s) * d * d;
      }
    return 0.5 * weight_[r] * reduce(total);
  }

  [[gnu::flatten]] void addEnergies(const State &state, const Configuration &, double, int r,
                                    EnergyBudget &out) const override {
    const RodRange &rod = elements_.rods[r];
    double kinetic = 0;
    for (int i = 0; i < rod.vertices; ++i)
      kinetic += elements_.mass()[rod.slot(i)] * state.velocity[rod.first_vertex + i].squaredNorm();
    for (int i = 0; i < rod.edges; ++i)
      kinetic += elements_.twistMass()[rod.slot(i)] * state.twist_rate[rod.first_edge + i] *
                 state.twist_rate[rod.first_edge + i];
    out.kinetic += 0.5 * kinetic;
  }

  [[gnu::flatten]] void addDerivatives(const Configuration &c, int r, Derivatives &out,
                                       HessianKind hessian) const override {
    const RodRange &rod = elements_.rods[r];
    const BlockPlanes blocks(out.blocks, rod);
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) {
      const Pack w = read<Pack>(elements_.mass() + s) * Pack(weight_[r]);
      const Vector3<Pack> d = c.displacements<Pack>(s, *start_);
      for (int a = 0; a < 3; ++a) {
        addTo<Pack>(out.equilibrium[a] + s, w * (d[a] - read<Pack>(predicted_[a] + s)));
        if (hessian != HessianKind::none) addTo(blocks.vertex(a, a) + s, w);
      }
    }
    if (!rod.twist) return;
    for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
      const Pack difference = spinOver(*reference_, c, s) - read<Pack>(predicted_[3] + s);
      const auto d = twistInertia<Pack>(reference_->frames<Pack>(s), c.frames<Pack>(s),
                                        Pack(weight_[r]) * read<Pack>(elements_.twistMass() + s), difference);
      // What belongs to the first vertex of the edges before what belongs to the second, whose memory overlaps (see
      // cellDerivatives).
      addTo(out.equilibrium[3] + s, d.gradient[3]);
      for (int a = 0; a < 3; ++a) addTo<Pack>(out.equilibrium[a] + s, -d.gradient[a]);
      if (hessian != HessianKind::none) {
        for (int a = 0, k = 0; a < edge_size; ++a)
          for (int b = a; b < edge_size; ++b, ++k) addTo(blocks.own(a, b) + s, d.hessian[k]);
      }
      for (int a = 0; a < 3; ++a) addTo(out.equilibrium[a] + s + 1, d.gradient[a]);
    }
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  const Configuration *start_ = nullptr,
                      *reference_ = nullptr; ///< what displacements, and what twists are measured from
  Planes predicted_;                         ///< displacements and twists
  std::vector<double> weight_;

  void predict(const Combination &sum, double factor, const RodRange &rod) {
    for (const Combination::Part &part : sum.parts()) {
      const double weight = factor * part.weight;
      for (int a = 0; a < 3; ++a)
        for (int i = 0; i < rod.vertices; ++i)
          predicted_[a][rod.slot(i)] += weight * (*part.vertex)[rod.first_vertex + i][a];
      for (int i = 0; i < rod.edges; ++i) predicted_[3][rod.slot(i)] += weight * (*part.edge)[rod.first_edge + i];
    }
  }
};

} // namespace

std::unique_ptr<Term> makeInertia(const Scene &scene, const Elements &elements) {
  return std::make_unique<Inertia>(scene, elements);
}

} // namespace tendril
