/// Stretching of the edges, with the axial force optionally an unknown of its own (Hellinger-Reissner), condensed edge by edge.
#include "tendril/energy/edge.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

class Stretch final : public Term {
public:
  Stretch(const Elements &elements, const AxialLaw &law) : elements_(elements), law_(law) {}

  void beginStep(const State &, const Configuration &, const Step &step) override { mixed_ = step.mixed; }

  double energy(const Configuration &configuration, int r) const override {
    const RodRange &rod = elements_.rods[r];
    double sum = 0;
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const double s = configuration.strain[i] - law_.rest[i];
      sum += 0.5 * law_.stiffness[i] * s * s * elements_.rest_length[i];
    }
    return sum;
  }

  void addDerivatives(const Configuration &configuration, int r, Rows &rows, HessianKind hessian) const override {
    const RodRange &rod = elements_.rods[r];
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const Frame &f = configuration.frame[i];
      const double inverse = elements_.inverse_rest_length[i];
      const double primal = law_.stiffness[i] * (configuration.strain[i] - law_.rest[i]);
      const double force = mixed_ ? configuration.axial_force[i] : primal;
      const Vec3 g = stretchGradient(f, primal, inverse), e = stretchGradient(f, force, inverse);
      const Mat3 h = stretchHessian(f, law_.stiffness[i], hessian == HessianKind::exact ? force : std::max(force, 0.0), inverse);
      const int row = elements_.edge_row[i], stride = rod.stride;
      for (int a = 0; a < 3; ++a) {
        rows.gradient[row + a] -= g[a];
        rows.gradient[row + stride + a] += g[a];
        rows.equilibrium[row + a] -= e[a];
        rows.equilibrium[row + stride + a] += e[a];
        double *first = &rows.band[std::size_t(row + a) * DofMap::band], *second = &rows.band[std::size_t(row + stride + a) * DofMap::band];
        for (int b = a; b < 3; ++b) {
          first[b - a] += h(a, b);
          second[b - a] += h(a, b);
        }
        for (int b = 0; b < 3; ++b) first[stride + b - a] -= h(a, b);
      }
    }
  }

private:
  const Elements &elements_;
  const AxialLaw &law_;
  bool mixed_ = true;
};

} // namespace

/// Dissipation as in the bending term: a second quadratic around the strain at the start.
void AxialLaw::beginStep(const Scene &scene, const Elements &elements, const Configuration &start, const Step &step) {
  stiffness = elements.axial_stiffness;
  rest.assign(stiffness.size(), 0.0);
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const double beta = scene.rods[r].material.stiffness_damping_coefficient;
    if (beta == 0 || step.isStatic()) continue;
    const double q = beta / step.dt;
    const RodRange &rod = elements.rods[r];
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      stiffness[i] *= 1 + q;
      rest[i] = q / (1 + q) * start.strain[i];
    }
  }
}

std::unique_ptr<Term> makeStretch(const Elements &elements, const AxialLaw &law) { return std::make_unique<Stretch>(elements, law); }

} // namespace tendril
