/// Inertia of a step of backward Euler with dissipation proportional to mass: sum of weight/2 |q - predicted|^2 over positions and twists.
#include "tendril/energy/edge.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

class Inertia final : public Term {
public:
  Inertia(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements) {}

  /// m/(2 dt^2) |x - x_n - dt v_n|^2 + alpha m/(2 dt) |x - x_n|^2 as one quadratic; the same for the twist increment.
  void beginStep(const State &start, const Configuration &configuration, const Step &step) override {
    start_ = configuration.frame;
    predicted_ = start.position;
    twist_predicted_.resize(start.twist_rate.size());
    weight_.resize(elements_.rods.size());
    for (std::size_t r = 0; r < elements_.rods.size(); ++r) {
      const RodRange &rod = elements_.rods[r];
      const double alpha = scene_.rods[r].material.mass_damping_coefficient;
      weight_[r] = 1 / (step.dt * step.dt) + alpha / step.dt;
      const double reach = step.dt / (1 + alpha * step.dt);
      for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) predicted_[v] += reach * start.velocity[v];
      for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) twist_predicted_[i] = reach * start.twist_rate[i];
    }
  }

  double energy(const Configuration &c, int r) const override {
    const RodRange &rod = elements_.rods[r];
    double sum = 0;
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) sum += elements_.mass[v] * (c.position[v] - predicted_[v]).squaredNorm();
    if (hasTwist(rod))
      for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
        const double d = spin(c, i) - twist_predicted_[i];
        sum += elements_.twist_mass[i] * d * d;
      }
    return 0.5 * weight_[r] * sum;
  }

  void addDerivatives(const Configuration &c, int r, Rows &rows, HessianKind) const override {
    const RodRange &rod = elements_.rods[r];
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) {
      const int row = elements_.vertex_row[v];
      const double w = weight_[r] * elements_.mass[v];
      for (int a = 0; a < 3; ++a) {
        rows.gradient[row + a] += w * (c.position[v][a] - predicted_[v][a]);
        rows.band[std::size_t(row + a) * DofMap::band] += w;
      }
    }
    if (!hasTwist(rod)) return;
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      // Whole turns by continuity: the target is moved by them instead of the angle.
      const double turns = spin(c, i) - twistIncrement(start_[i], c.frame[i]);
      const auto d = twistInertia(start_[i], c.frame[i], weight_[r] * elements_.twist_mass[i], twist_predicted_[i] - turns);
      addEdge(d, elements_.edge_row[i], rows);
    }
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  std::vector<Frame> start_;
  std::vector<Vec3> predicted_;
  std::vector<double> twist_predicted_, weight_;

  static bool hasTwist(const RodRange &rod) { return rod.stride == 4; }

  /// Twist of an edge over the step, whole turns by continuity with the sum of the retractions.
  double spin(const Configuration &c, int i) const {
    const double principal = twistIncrement(start_[i], c.frame[i]);
    return principal + 2 * pi * std::round((c.spin[i] - principal) / (2 * pi));
  }

  /// Derivatives over (e, theta) to the rows of v0 (3), theta, v1 (3).
  static void addEdge(const TwistInertiaDerivatives<double> &d, int row, Rows &rows) {
    auto band = [&](int r, int c) -> double & { return rows.band[std::size_t(row + r) * DofMap::band + (c - r)]; };
    rows.gradient[row + 3] += d.gradient[3];
    int k = 0;
    for (int a = 0; a < 3; ++a) {
      rows.gradient[row + a] -= d.gradient[a];
      rows.gradient[row + 4 + a] += d.gradient[a];
      for (int b = a; b < 3; ++b, ++k) {
        band(a, b) += d.hessian[k];
        band(4 + a, 4 + b) += d.hessian[k];
        band(a, 4 + b) -= d.hessian[k];
        if (b != a) band(b, 4 + a) -= d.hessian[k];
      }
      band(a, 3) -= d.hessian[k];
      band(3, 4 + a) += d.hessian[k];
      ++k;
    }
    band(3, 3) += d.hessian[9];
  }
};

} // namespace

std::unique_ptr<Term> makeInertia(const Scene &scene, const Elements &elements) { return std::make_unique<Inertia>(scene, elements); }

} // namespace tendril
