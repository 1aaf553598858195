#include "tendril/dynamics/bifurcation.hpp"

#include "tendril/solver/activity.hpp"

#include <algorithm>

namespace tendril {

double distanceBetween(const State &a, const State &b) {
  Vec3 low = a.position[0], high = low;
  double apart = 0;
  for (std::size_t v = 0; v < a.position.size(); ++v) {
    low = low.cwiseMin(a.position[v]);
    high = high.cwiseMax(a.position[v]);
    apart = std::max(apart, (a.position[v] - b.position[v]).norm());
  }
  return apart / (high - low).norm();
}

constexpr double sharp = 1e-11; // of the load

bool SharpTolerance::isMet(const Residual &residual) {
  constexpr double enough = 100 * sharp;
  return excess(residual, enough) <= 1 || isAtNoise(residual, enough);
}

SharpTolerance::SharpTolerance(StepSolver &solver) : solver_(solver) {
  (void)SNESGetTolerances(solver.snes(), nullptr, &before_, nullptr, nullptr, nullptr);
  set(std::min(before_, sharp));
}

SharpTolerance::~SharpTolerance() { set(before_); }

void SharpTolerance::set(PetscReal rtol) {
  for (NewtonSolver &block : solver_.blocks()) {
    PetscReal atol, stol;
    PetscInt iterations, evaluations;
    (void)SNESGetTolerances(block.snes(), &atol, nullptr, &stol, &iterations, &evaluations);
    (void)SNESSetTolerances(block.snes(), atol, rtol, stol, iterations, evaluations);
  }
}

constexpr double neutral =
    1e-8; // of the softest bending: above what Newton and rounding leave of a motion that costs nothing

PetscErrorCode countUnstable(StepSolver &solver, int *unstable) {
  PetscFunctionBeginUser;
  PetscCall(solver.inertiaAtIterate(unstable, neutral));
  PetscFunctionReturn(0);
}

/// Makes an equilibrium the iterate.
static void goTo(StepSolver &solver, const State &state, Step step) {
  step.time = step.load_factor = state.time;
  solver.begin(state, step);
}

/// Whether a motion loses its stiffness towards a critical point: at `there`, which is much nearer to it than `before`,
/// the softest one that is stable has a small `part` of what it has at `before`. Where Newton only fails, or jumps, or
/// where a motion costs nothing, none does.
static PetscErrorCode softens(StepSolver &solver, const Step &step, const BranchPoint &before, const BranchPoint &there,
                              double part, bool *softer) {
  constexpr double first = 1e-7, grows = 4, highest = 1e12; // of the softest bending
  PetscFunctionBeginUser;
  int softest, count; // motions that cost nothing are counted in both
  double stiffness = first;
  goTo(solver, before.state, step);
  PetscCall(solver.inertiaAtIterate(&softest, -stiffness));
  for (count = softest; count == softest && stiffness < highest;)
    PetscCall(solver.inertiaAtIterate(&count, -(stiffness *= grows)));
  goTo(solver, there.state, step);
  PetscCall(solver.inertiaAtIterate(&count, -part * stiffness));
  *softer = count > softest;
  PetscFunctionReturn(0);
}

PetscErrorCode criticalMode(StepSolver &solver, const CriticalPoint &point, Step step, Planes *mode, bool *found) {
  PetscFunctionBeginUser;
  *found = false;
  if (!point.lost) PetscFunctionReturn(0);
  goTo(solver, *point.lost, step);
  PetscCall(solver.criticalMode(point.stable_count, neutral, mode, found));
  PetscFunctionReturn(0);
}

bool areNear(const BranchPoint &a, const BranchPoint &b, double width) {
  return distanceBetween(a.state, b.state) <= std::sqrt(std::abs(a.parameter - b.parameter) / width);
}

/// Bisection. Steps begin at `base`, the last point that is not within `aside` of the critical one, where the Hessian
/// is nearly singular and Newton strays.
static PetscErrorCode bisect(const Follow &follow, BranchPoint *low, BranchPoint *base, double high, double interval,
                             double aside, double width) {
  PetscFunctionBeginUser;
  *base = *low;
  while (high - low->parameter > interval) {
    const double middle = 0.5 * (low->parameter + high);
    if (middle <= low->parameter || middle >= high) break;
    BranchPoint point;
    PetscCall(follow(*base, middle, &point));
    auto goesOn = [&] { return point.found && areNear(*low, point, width); };
    if (!goesOn() && base->parameter != low->parameter)
      PetscCall(follow(*low, middle, &point)); // towards a limit point, the nearest start is best
    // What cannot be found counts as beyond: past a limit point there is nothing near to converge to.
    if (goesOn() && point.unstable == low->unstable) {
      *low = point;
      if (high - middle > aside) *base = point;
    } else
      high = middle;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode locateCritical(StepSolver &solver, const Step &step, const Follow &follow, BranchPoint low, double high,
                              double scale, CriticalPoint *point, bool *found) {
  constexpr int most_rounds = 12;
  constexpr double interval = 1e-9, agreement = 1e-7,
                   part = 1e-3; // of the scale, of the load factor, of the first interval
  PetscFunctionBeginUser;
  *found = false;
  const Doing here([](std::ostream &out) { out << "a critical load is searched for"; });
  const double start = low.parameter, end = high, width = end - start, aside = std::max(part * width, 1e-5 * scale);
  double last = std::nan(""); // what the round before found
  bool ahead = false;         // whether the branch was found beyond
  BranchPoint before, beyond;
  PetscCall(follow(low, end, &beyond));
  for (int round = 0; round < most_rounds && !(beyond.found && beyond.unstable == low.unstable); ++round) {
    BranchPoint base;
    auto goOn = [&] { // from where the branch goes on, for there is nothing here
      low = beyond;
      last = std::nan("");
      high = end;
      return follow(low, end, &beyond);
    };
    PetscCall(bisect(follow, &low, &base, high, interval * scale, aside, width));
    if (std::abs(low.state.time - last) <= agreement * std::abs(last)) {
      if (low.parameter > start)
        PetscCall(softens(solver, step, before, low, 3 * std::sqrt(interval * scale / aside),
                          found)); // the root is that of limit points
      if (!*found && !ahead) break;
      if (!*found) {
        PetscCall(goOn());
        continue;
      }
      point->load_factor = low.state.time;
      point->limit = !ahead;
      point->state = low.state;
      point->lost.reset();
      if (ahead) point->lost = (beyond.unstable > low.unstable ? beyond : before).state;
      point->stable_count = std::min(low.unstable, beyond.unstable);
      point->beyond = std::move(beyond);
      PetscFunctionReturn(0);
    }
    last = low.state.time;
    PetscCall(follow(base, low.parameter - aside, &before));
    if (!before.found || before.unstable != low.unstable) break; // no branch that leads here
    const double behind = std::min(low.parameter + aside, end);
    PetscCall(follow(before, behind, &beyond));
    if (beyond.found &&
        beyond.unstable == low.unstable) { // the step had gone over to another branch: on along this one
      if (behind == end) break;
      PetscCall(goOn());
    } else {
      ahead = beyond.found;
      high = behind;
      low = before;
    }
  }
  PetscFunctionReturn(0);
}

} // namespace tendril
