/// Implicit midpoint, docs/theory.md (15.3): v = d/(h/2), a = (v - v_n)/(h/2) in the middle of the step; its end lies
/// as far beyond, v_n+1 = 2 v - v_n. Keeps linear momentum and what is quadratic in the motion; the energy stays within
/// a band. Nothing damps stiff motions. With the axial force of an edge from the mean S of its strains at both ends of
/// the step instead of its strain in the middle, what it does over the step is what the edge stores: strains are
/// quadratic in positions, so that their change is B(middle) times the displacement (15.12) (Simo, Tarnow and Doblare
/// 1995). But S B(middle) is no gradient: d S = (m + de)/L^2, while the force points along the middle's edge m. So a
/// step solves first for the middle, then with |de|^2/(2 L^2), what the mean has on top of the strain in the middle, as
/// the solve before found it, until one iteration of Newton's method is enough. Each is a potential with forces along
/// m.
#include "tendril/dynamics/integrator.hpp"

namespace tendril {
namespace {

class Midpoint final : public Integrator {
public:
  explicit Midpoint(int most) : most_(most) {}

  int stages(const State &) const override { return std::min(most_, 2); }
  bool goesOn(const State &start, const Stages &done, int iterations) const override {
    return int(done.size()) < stages(start) || (iterations > 1 && int(done.size()) < most_);
  }
  bool endsAtStage() const override { return false; }
  int remembersStrains() const override { return 1; }

  PetscErrorCode begin(StepSolver &solver, double h, State &state) const override {
    PetscFunctionBeginUser;
    state.memory = {startAcceleration(solver, h, state)};
    PetscFunctionReturn(0);
  }

  StageRule stage(const State &start, double h, const Stages &done) const override {
    StageRule rule;
    rule.fraction = 0.5;
    rule.keeps_energy = most_ > 1;
    rule.dt = rule.damping_dt = 0.5 * h;
    rule.acceleration.add(-1, start);
    if (done.empty())
      rule.guess.add(0.5 * h, start).add(0.125 * h * h, start.memory[0]);
    else {
      rule.half = &done.back().displacement;
      rule.lengths = RetractionKind::additive;
      rule.guess.add(1, *rule.half);
    }
    if (start.strains.empty()) return rule;
    // Along the chord from the start to the middle strains change with the square of the motion, too, of which the rate
    // in the middle has twice as much: what is missing was, in the last step, half of the difference between the strain
    // at its end and that as far beyond its middle.
    rule.damping_past = {{-0.5 * std::pow(h / start.last_dt, 2), start.strains.data()}};
    return rule;
  }

  StageRule end(const State &, double, const Stages &done) const override {
    StageRule end;
    end.guess.add(2, done.back().displacement);
    return end;
  }

  /// h^3/12 x''' (15.14), by the accelerations in the middles of this step and the last; of the first, in its middle
  /// and at its start.
  Combination error(const State &start, double h, const Stages &done) const override {
    const double third = h * h * h / 12 / (0.5 * (h + start.last_dt));
    return Combination().add(third, done.back().acceleration).add(-third, start.memory[0]);
  }

  Combination velocity(const State &start, double, const Stages &done) const override {
    return Combination().add(2, done.back().velocity).add(-1, start);
  }
  std::vector<Combination> remembers(const State &, double, const Stages &done) const override {
    return {Combination().add(1, done.back().acceleration)};
  }

private:
  int most_; ///< solves of a step
};

} // namespace

std::unique_ptr<Integrator> makeMidpoint(const IntegratorSettings &) { return std::make_unique<Midpoint>(1); }
std::unique_ptr<Integrator> makeEnergyMomentum(const IntegratorSettings &) { return std::make_unique<Midpoint>(5); }

} // namespace tendril
