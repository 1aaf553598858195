/// Generalized-alpha (Chung and Hulbert 1993) with forces in balance at the ends of steps (Arnold and Bruels 2007),
/// docs/theory.md (15.7) to (15.10), where b and c here are B and G. Accelerations a of the motion and A of the method:
///   (1 - am) A_n+1 + am A_n = (1 - af) a_n+1 + af a_n
///   d = h v_n + h^2 ((1/2 - b) A_n + b A_n+1),   v_n+1 = v_n + h ((1 - c) A_n + c A_n+1)
/// am = (2 rho - 1)/(rho + 1), af = rho/(rho + 1), c = 1/2 - am + af, b = (1 - am + af)^2/4. A lags behind a by (af -
/// am) h.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class GeneralizedAlpha final : public Integrator {
public:
  explicit GeneralizedAlpha(const IntegratorSettings &settings)
      : am_((2 * settings.rho_inf - 1) / (settings.rho_inf + 1)), af_(settings.rho_inf / (settings.rho_inf + 1)),
        c_(0.5 - am_ + af_), b_(0.25 * (1 - am_ + af_) * (1 - am_ + af_)) {}

  int remembersStrains() const override { return 1; }
  int remembersActions() const override { return 1; }
  std::vector<double> forceWeights(const State &, double, std::size_t) const override { return {0.5, 0.5}; }

  PetscErrorCode begin(StepSolver &solver, double h, State &state) const override {
    PetscFunctionBeginUser;
    const Rates a = startAcceleration(solver, h, state);
    state.memory = {a, a};
    state.last_dt = h;
    PetscFunctionReturn(0);
  }

  StageRule stage(const State &start, double h, const Stages &) const override {
    StageRule rule;
    rule.dt = b_ / c_ * h;
    rule.mass = b_ * (1 - am_) / (c_ * c_ * (1 - af_));
    auto method = [&](Combination &sum, double weight) { lagged(sum, weight, start, h); };
    rule.velocity.add(1 - c_ / b_, start);
    method(rule.velocity, h * (1 - 0.5 * c_ / b_));
    rule.acceleration.add(-rule.mass, start).add(-rule.dt * af_ / (1 - af_), start.memory[motion]);
    method(rule.acceleration, -rule.mass * h * (1 - c_) + rule.dt * am_ / (1 - af_));
    rule.guess.add(h, start);
    method(rule.guess, 0.5 * h * h);
    // The strain rate is that of bdf2: it needs no accelerations of strains.
    rule.damping_dt = h;
    if (start.strains.empty()) return rule;
    const double w = h / start.last_dt;
    rule.damping_dt = h * (1 + w) / (1 + 2 * w);
    rule.damping_past = {{w * w / (1 + 2 * w), start.strains.data()}};
    return rule;
  }

  /// (15.14), from the leading error of its frequencies, (b - 1/12 - (af - am) af) h^2 x'' x''/2: a half of that h^3
  /// x''' in a step.
  Combination error(const State &start, double h, const Stages &done) const override {
    const double third = 0.5 * (b_ - 1.0 / 12 + (am_ - af_) * af_) * h * h;
    return Combination().add(third, done[0].acceleration).add(-third, start.memory[motion]);
  }

  std::vector<Combination> remembers(const State &start, double h, const Stages &done) const override {
    Combination next;
    next.add((1 - af_) / (1 - am_), done[0].acceleration).add(af_ / (1 - am_), start.memory[motion]);
    lagged(next, -am_ / (1 - am_), start, h);
    return {Combination().add(1, done[0].acceleration), next};
  }

private:
  enum : std::size_t { motion, method_ }; ///< accelerations
  double am_, af_, c_, b_;

  /// A of the start as it would be had the last step been as long as this one: its lag behind a goes with the step.
  static void lagged(Combination &sum, double weight, const State &start, double h) {
    const double w = h / start.last_dt;
    sum.add(weight * w, start.memory[method_]).add(weight * (1 - w), start.memory[motion]);
  }
};

} // namespace

std::unique_ptr<Integrator> makeGeneralizedAlpha(const IntegratorSettings &settings) {
  return std::make_unique<GeneralizedAlpha>(settings);
}

} // namespace tendril
