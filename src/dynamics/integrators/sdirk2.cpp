/// Singly diagonally implicit Runge-Kutta method of two stages (Alexander 1977), g = 1 - 1/sqrt 2, L-stable and stiffly accurate:
///   v1 = d1/(g h),                       a1 = (v1 - v_n)/(g h)                       at t_n + g h
///   v2 = (d2 - (1 - g) h v1)/(g h),      a2 = (v2 - v_n - (1 - g) h a1)/(g h)        at t_n + h
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

constexpr double g = 1 - std::numbers::sqrt2 / 2;

class Sdirk2 final : public Integrator {
public:
  int stages(const State &) const override { return 2; }

  StageRule stage(const State &start, double h, const Stages &done) const override {
    StageRule rule;
    rule.dt = rule.damping_dt = g * h;
    rule.acceleration.add(-1, start);
    if (done.empty()) {
      rule.fraction = g;
      rule.guess.add(g * h, start);
      return rule;
    }
    rule.velocity.add(-(1 - g) / g, done[0].velocity);
    rule.acceleration.add(-(1 - g) * h, done[0].acceleration);
    rule.guess.add(h, done[0].velocity).add(g * (1 - g) * h * h, done[0].acceleration);
    if (done[0].strains.empty()) return rule;
    rule.strains = &done[0].strains;
    rule.damping_memory = -(1 - g) / g;
    return rule;
  }

  /// (1/6 - 3 g^2 + 2 g^3) h^3 x''', by the second difference of v_n, v1 and v2; v1 is off by (g h)^2/2 x''', which a factor allows for.
  Combination error(const State &start, double h, const Stages &done) const override {
    const double constant = 3 * g * g - 2 * g * g * g - 1.0 / 6, third = 2 * (1 - g) / (1 - 2 * g) * constant * h;
    return Combination().add(third / g, start).add(-third / (g * (1 - g)), done[0].velocity).add(third / (1 - g), done[1].velocity);
  }

  void finish(State &state, double, const Stages &done) const override {
    state.velocity = done[1].velocity.vertex;
    state.twist_rate = done[1].velocity.edge;
  }
};

} // namespace

std::unique_ptr<Integrator> makeSdirk2(const IntegratorSettings &) { return std::make_unique<Sdirk2>(); }

} // namespace tendril
