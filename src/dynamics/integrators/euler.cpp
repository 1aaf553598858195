/// Backward Euler, docs/theory.md (15.3): v = d/h, a = (v - v_n)/h. First order, L-stable, the most dissipative.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class Euler final : public Integrator {
public:
  int order() const override { return 1; }

  StageRule stage(const State &start, double h, const Stages &) const override { return backwardEuler(start, h); }

  /// h^2/2 x'' (15.14), by the difference of the velocities.
  Combination error(const State &start, double h, const Stages &done) const override {
    return Combination().add(0.5 * h, done[0].velocity).add(-0.5 * h, start);
  }
};

} // namespace

std::unique_ptr<Integrator> makeEuler(const IntegratorSettings &) { return std::make_unique<Euler>(); }

} // namespace tendril
