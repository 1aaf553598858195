/// Backward differentiation of third order, after steps h_1 and h_2: v is the slope, at the end of the step, of the
/// cubic through four positions, and a is that of four velocities. With H1 = h + h_1, H2 = H1 + h_2, r = 1 + h/H1 +
/// h/H2, p = h H1/(H2 (h_1 + h_2)), q = h/H1 + h/H2 + p and the chords d_1/h_1 and d_2/h_2, docs/theory.md (15.3),
/// (15.4),
///   v = (r d/h - q d_1/h_1 + p d_2/h_2),   a = r (v - v_n)/h - q (v_n - v_1)/h_1 + p (v_1 - v_2)/h_2
/// Stable for what decays within 86 degrees of the negative axis; undamped motion at omega h < 1.94 grows, by (omega
/// h)^4/4 in a step where that is small. Two steps of sdirk33 come first.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class Bdf3 final : public Integrator {
public:
  explicit Bdf3(const IntegratorSettings &settings) : first_(makeSdirk33(settings)) {}

  int order() const override { return 3; }
  int stages(const State &start) const override { return begins(start) ? first_->stages(start) : 1; }
  int remembersStrains() const override { return 2; }
  int remembersActions() const override { return 2; }
  /// The mean over the step of the parabola through three ends of steps.
  std::vector<double> forceWeights(const State &start, double h, std::size_t stages) const override {
    if (begins(start)) return first_->forceWeights(start, h, stages);
    const Weights w(start, h);
    const double now = h / (6 * w.H1), before = now * h / w.h1;
    return {0.5 - now, 0.5 + now + before, -before};
  }
  PetscErrorCode begin(StepSolver &solver, double h, State &state) const override {
    return first_->begin(solver, h, state);
  }

  StageRule stage(const State &start, double h, const Stages &done) const override {
    if (begins(start)) return first_->stage(start, h, done);
    const Weights w(start, h);
    const Rates &v1 = start.memory[velocity1], &v2 = start.memory[velocity2];
    StageRule rule;
    rule.dt = rule.damping_dt = h / w.r;
    rule.wants_accelerations = false;
    rule.velocity.add(-w.q, start.memory[chord1]).add(w.p, start.memory[chord2]);
    const double q = rule.dt * w.q / w.h1, p = rule.dt * w.p / w.h2;
    rule.acceleration.add(-1 - q, start).add(q + p, v1).add(-p, v2);
    auto predict = [&](Combination &d, double t) { // by the parabola through the last velocities
      const double first = 0.5 * t * t / w.h1, second = (t * t * t / 3 + 0.5 * w.h1 * t * t) / (w.h1 + w.h2);
      d.add(t + first + second / w.h1, start).add(-first - second / w.h1 - second / w.h2, v1).add(second / w.h2, v2);
    };
    predict(rule.guess, h);
    predict(rule.halfway, 0.5 * h);
    if (!start.strains.empty())
      rule.damping_past = {{q + p, start.strains.data()}, {-p, start.strains.data() + start.strains.size() / 2}};
    return rule;
  }

  /// h^2 H1 H2/(24 r) x'''' (15.14), by the third difference of the velocities.
  Combination error(const State &start, double h, const Stages &done) const override {
    if (begins(start)) return first_->error(start, h, done);
    const Weights w(start, h);
    const double fourth = h * h * w.H1 * w.H2 / (4 * w.r), between = w.h1 + w.h2;
    return Combination()
        .add(fourth / (h * w.H1 * w.H2), done[0].velocity)
        .add(-fourth / (h * w.h1 * between), start)
        .add(fourth / (w.H1 * w.h1 * w.h2), start.memory[velocity1])
        .add(-fourth / (w.H2 * between * w.h2), start.memory[velocity2]);
  }

  std::vector<Combination> remembers(const State &start, double h, const Stages &done) const override {
    std::vector<Combination> memory{Combination().add(1 / h, done.back().displacement), Combination().add(1, start)};
    if (start.memory.size() == 1) // before the second step
      memory.push_back(Combination().add(1, done.back().acceleration));
    else
      memory.insert(memory.end(),
                    {Combination().add(1, start.memory[chord1]), Combination().add(1, start.memory[velocity1])});
    return memory;
  }

private:
  enum : std::size_t {
    chord1,
    velocity1,
    chord2,
    velocity2
  }; ///< over the last step and at its start, and those of the step before
  static bool begins(const State &start) { return start.memory.size() <= velocity2; }
  struct Weights {
    double h1, h2, H1, H2, r, p, q;
    Weights(const State &start, double h)
        : h1(start.last_dt), h2(start.dt_before), H1(h + h1), H2(H1 + h2), r(1 + h / H1 + h / H2),
          p(h * H1 / (H2 * (h1 + h2))), q(h / H1 + h / H2 + p) {}
  };
  std::unique_ptr<Integrator> first_;
};

} // namespace

std::unique_ptr<Integrator> makeBdf3(const IntegratorSettings &settings) { return std::make_unique<Bdf3>(settings); }

} // namespace tendril
