/// Stretching of the edges, with the axial force optionally an unknown of its own (Hellinger-Reissner), condensed edge by edge.
#include "tendril/energy/edge.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

class Stretch final : public Term {
public:
  Stretch(const Elements &elements, const AxialLaw &law) : elements_(elements), law_(law) {}

  void beginStep(const State &, const Configuration &, const Step &step, int) override { mixed_ = step.mixed; }

  double energy(const Configuration &configuration, int r) const override {
    const RodRange &rod = elements_.rods[r];
    Pack total(0.0);
    for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
      const Pack s = read<Pack>(configuration[Configuration::strain] + i) - read<Pack>(law_.rest() + i);
      total += read<Pack>(law_.stiffness() + i) * s * s * read<Pack>(elements_.restLength() + i);
    }
    return 0.5 * reduce(total);
  }

  [[gnu::flatten]] void addDerivatives(const Configuration &configuration, int r, Derivatives &out, HessianKind hessian) const override {
    const RodRange &rod = elements_.rods[r];
    const BlockPlanes blocks(out.blocks, rod);
    for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
      const Pack::mask_type live = firstLanes(rod.edgeEnd() - i); // the copies behind a ring have forces, too
      const Pack stiffness = read<Pack>(law_.stiffness() + i), inverse = read<Pack>(elements_.inverseRestLength() + i);
      const Pack primal = stiffness * (read<Pack>(configuration[Configuration::strain] + i) - read<Pack>(law_.rest() + i));
      const Pack force = select(live, mixed_ ? read<Pack>(configuration[Configuration::axial_force] + i) : primal, Pack(0.0));
      const FrameOf<Pack> f = configuration.frames<Pack>(i);
      const Vector3<Pack> e = stretchGradient(f, force, inverse), g = stretchGradient<Pack>(f, select(live, primal - force, Pack(0.0)), inverse);
      // What belongs to the first vertex of the edges before what belongs to the second, whose memory overlaps: the store has left the pipeline by then.
      for (int a = 0; a < 3; ++a) {
        addTo<Pack>(out.equilibrium[a] + i, -e[a]);
        addTo<Pack>(out.gradient[a] + i, -g[a]);
      }
      if (hessian != HessianKind::none) {
        const Matrix3<Pack> h = stretchHessian<Pack>(f, stiffness, hessian == HessianKind::exact ? force : max(force, Pack(0.0)), inverse);
        for (int a = 0; a < 3; ++a)
          for (int b = a; b < 3; ++b) addTo(blocks.own(a, b) + i, h(a, b));
      }
      for (int a = 0; a < 3; ++a) {
        addTo(out.equilibrium[a] + i + 1, e[a]);
        addTo(out.gradient[a] + i + 1, g[a]);
      }
    }
  }

private:
  const Elements &elements_;
  const AxialLaw &law_;
  bool mixed_ = true;
};

} // namespace

AxialLaw::AxialLaw(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements), planes_(2, elements.slots) {
  std::copy_n(elements.axialStiffness(), elements.slots, planes_[0]);
}

/// Dissipation as in the bending term: a second quadratic around the strain at the start (dampedRest). The mean of the strains at the ends of a step is
/// that in its middle and |de|^2/(2 L^2), de by what the edge moves on either side: known from a solve before, it is a rest strain.
void AxialLaw::beginStep(const Configuration &start, const Step &step, int r) {
  const double beta = scene_.rods[r].material.stiffness_damping_coefficient;
  const Rates *half = step.rule ? step.rule->half : nullptr;
  moved_ = moved_ || half;
  if (beta == 0 && !moved_) return;
  const double q = step.isStatic() ? 0 : beta / step.dampingDt();
  const RodRange &rod = elements_.rods[r];
  for (int k = 0; k < rod.edges; ++k) {
    const int i = rod.slot(k), v = rod.first_vertex;
    planes_[0][i] = elements_.axialStiffness()[i] * (1 + q);
    planes_[1][i] = q / (1 + q) * dampedRest(step, start[Configuration::strain][i], i);
    if (half)
      planes_[1][i] -=
          0.5 / (1 + q) * (half->vertex[v + (k + 1) % rod.vertices] - half->vertex[v + k]).squaredNorm() * std::pow(elements_.inverseRestLength()[i], 2);
  }
}

std::unique_ptr<Term> makeStretch(const Elements &elements, const AxialLaw &law) { return std::make_unique<Stretch>(elements, law); }

} // namespace tendril
