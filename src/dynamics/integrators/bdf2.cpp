/// Backward differentiation of second order with steps h after h/w, L-stable, docs/theory.md (15.3). With r =
/// (1 + 2w)/(1 + w) and c = w^2/(1 + w),
///   v = (r d - c d_last)/h,   a = (r (v - v_n) - c (v_n - v_last))/h
/// A state without memory is left by a step of sdirk2.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class Bdf2 final : public Integrator {
public:
  explicit Bdf2(const IntegratorSettings &settings) : first_(makeSdirk2(settings)) {}

  int stages(const State &start) const override { return start.memory.empty() ? first_->stages(start) : 1; }
  int remembersStrains() const override { return 1; }
  int remembersActions() const override { return 1; }
  std::vector<double> forceWeights(const State &start, double h, std::size_t stages) const override {
    return start.memory.empty() ? first_->forceWeights(start, h, stages) : std::vector<double>{0.5, 0.5};
  }

  StageRule stage(const State &start, double h, const Stages &done) const override {
    if (start.memory.empty()) return first_->stage(start, h, done);
    const double w = h / start.last_dt, r = (1 + 2 * w) / (1 + w), c = w * w / (1 + w);
    StageRule rule;
    rule.dt = rule.damping_dt = h / r;
    rule.wants_accelerations = false;
    rule.velocity.add(-c / w, start.memory[chord]);
    rule.acceleration.add(-1 - c / r, start).add(c / r, start.memory[velocity]);
    rule.guess.add(h * (1 + 0.5 * w), start).add(-0.5 * h * w, start.memory[velocity]);
    if (!start.strains.empty()) rule.damping_past = {{c / r, start.strains.data()}};
    return rule;
  }

  /// h^2 (h + h/w)/(6 r) x''' (15.14), by the second difference of the velocities.
  Combination error(const State &start, double h, const Stages &done) const override {
    if (start.memory.empty()) return first_->error(start, h, done);
    const double w = h / start.last_dt, r = (1 + 2 * w) / (1 + w), third = h * h / (3 * r);
    return Combination()
        .add(third / h, done[0].velocity)
        .add(-third * (1 + w) / h, start)
        .add(third * w / h, start.memory[velocity]);
  }

  std::vector<Combination> remembers(const State &start, double h, const Stages &done) const override {
    return {Combination().add(1 / h, done.back().displacement), Combination().add(1, start)};
  }

private:
  enum : std::size_t { chord, velocity }; ///< over the last step and at its start
  std::unique_ptr<Integrator> first_;
};

} // namespace

std::unique_ptr<Integrator> makeBdf2(const IntegratorSettings &settings) { return std::make_unique<Bdf2>(settings); }

} // namespace tendril
