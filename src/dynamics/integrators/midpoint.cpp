/// Implicit midpoint: v = d/(h/2), a = (v - v_n)/(h/2) in the middle of the step; its end lies as far beyond, v_n+1 = 2 v - v_n. Keeps linear momentum and what is
/// quadratic in the motion; the energy stays within a band. Nothing damps stiff motions.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class Midpoint final : public Integrator {
public:
  bool endsAtStage() const override { return false; }

  StageRule stage(const State &start, double h, const Stages &) const override {
    StageRule rule;
    rule.fraction = 0.5;
    rule.dt = rule.damping_dt = 0.5 * h;
    rule.acceleration.add(-1, start);
    rule.guess.add(0.5 * h, start);
    if (!start.memory.empty()) rule.guess.add(0.125 * h * h, start.memory[0]);
    return rule;
  }

  /// h^3/12 x''', by the accelerations of this step and the last.
  Combination error(const State &start, double h, const Stages &done) const override {
    if (start.memory.empty()) return {};
    const double third = h * h * h / 12 / (0.5 * (h + start.last_dt));
    return Combination().add(third, done[0].acceleration).add(-third, start.memory[0]);
  }

  void finish(State &state, double, const Stages &done) const override {
    for (std::size_t v = 0; v < state.velocity.size(); ++v) state.velocity[v] = 2 * done[0].velocity.vertex[v] - state.velocity[v];
    for (std::size_t e = 0; e < state.twist_rate.size(); ++e) state.twist_rate[e] = 2 * done[0].velocity.edge[e] - state.twist_rate[e];
    state.memory = {done[0].acceleration};
  }
};

} // namespace

std::unique_ptr<Integrator> makeMidpoint(const IntegratorSettings &) { return std::make_unique<Midpoint>(); }

} // namespace tendril
