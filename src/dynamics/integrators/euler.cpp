/// Backward Euler: v = d/h, a = (v - v_n)/h. First order, L-stable, the most dissipative.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class Euler final : public Integrator {
public:
  int order() const override { return 1; }
  bool leavesChords() const override { return true; }

  StageRule stage(const State &start, double h, const Stages &) const override {
    StageRule rule;
    rule.dt = rule.damping_dt = h;
    rule.acceleration.add(-1, start);
    rule.guess.add(h, start);
    return rule;
  }

  /// h^2/2 x''.
  Combination error(const State &, double h, const Stages &done) const override {
    return Combination().add(0.5 * h * h, done[0].acceleration);
  }

  void finish(State &state, double, const Stages &done) const override {
    state.velocity = done[0].velocity.vertex;
    state.twist_rate = done[0].velocity.edge;
  }
};

} // namespace

std::unique_ptr<Integrator> makeEuler(const IntegratorSettings &) { return std::make_unique<Euler>(); }

} // namespace tendril
