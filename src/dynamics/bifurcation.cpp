#include "tendril/dynamics/bifurcation.hpp"

#include "tendril/solver/activity.hpp"

#include <algorithm>

namespace tendril {

double distanceBetween(const Team &team, const State &a, const State &b) {
  Vec3 low = a.position[0], high = low;
  double apart = 0;
  auto compare = [&](const std::vector<Vec3> &from, const std::vector<Vec3> &to) {
    for (std::size_t v = 0; v < from.size(); ++v) {
      low = low.cwiseMin(from[v]);
      high = high.cwiseMax(from[v]);
      apart = std::max(apart, (from[v] - to[v]).norm());
    }
  };
  compare(a.position, b.position);
  compare(a.body_position, b.body_position);
  Tally tally;
  for (int k = 0; k < 3; ++k) tally.smallest(low[k]).largest(high[k]);
  team.combine(tally.largest(apart));
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

namespace {

/// The softest motion at a point of a branch.
struct Softest {
  double stiffness = 0; ///< as the lift that makes it zero, of the softest bending; negative behind a critical point
  int count = 0;        ///< negative pivots of a lift that leaves this motion out
};

} // namespace

/// `stable`: negative pivots ahead of the critical point; `close`: accuracy, of the stiffness, which is never taken for
/// smaller than it is.
static PetscErrorCode softestMotion(StepSolver &solver, const Step &step, const BranchPoint &point, int stable,
                                    double close, Softest *softest) {
  constexpr double first = 1e-7, grows = 4, highest = 1e12; // of the softest bending
  PetscFunctionBeginUser;
  const bool ahead = point.unstable <= stable;
  const double side = ahead ? -1 : 1;
  softest->count = stable;
  goTo(solver, point.state, step);
  if (ahead) PetscCall(solver.inertiaAtIterate(&softest->count, -first)); // motions that cost nothing are counted, too
  auto reaches = [&](double lift, bool *reached) {
    int count;
    PetscFunctionBeginUser;
    PetscCall(solver.inertiaAtIterate(&count, side * lift));
    *reached = (count > softest->count) == ahead;
    PetscFunctionReturn(0);
  };
  double low = first, high = first;
  for (bool reached = false; !reached && high < highest;) {
    low = std::exchange(high, grows * high);
    PetscCall(reaches(high, &reached));
  }
  while (high - low > close * high) {
    const double middle = 0.5 * (low + high);
    bool reached;
    PetscCall(reaches(middle, &reached));
    (reached ? high : low) = middle;
  }
  softest->stiffness = -side * high;
  PetscFunctionReturn(0);
}

/// Whether a motion loses its stiffness towards a critical point: at `there`, which is much nearer to it than `before`,
/// the softest one that is stable has a small `part` of what it has at `before`. Where Newton only fails, or jumps, or
/// where a motion costs nothing, none does.
static PetscErrorCode softens(StepSolver &solver, const Step &step, const BranchPoint &before, const BranchPoint &there,
                              double part, bool *softer) {
  PetscFunctionBeginUser;
  Softest softest;
  int count;
  PetscCall(softestMotion(solver, step, before, before.unstable, 1, &softest));
  goTo(solver, there.state, step);
  PetscCall(solver.inertiaAtIterate(&count, -part * softest.stiffness));
  *softer = count > softest.count;
  PetscFunctionReturn(0);
}

/// The load factor of a bifurcation near `at`, between points ahead and behind. Right beside it Newton's answers are
/// rough: what is left of forces moves the critical motion far. The stiffness of that motion is smooth, and is known
/// better at some way; near enough for no other motion to be as soft, a straight line through it is exact to the square
/// of the way.
static PetscErrorCode interpolate(StepSolver &solver, const Step &step, const Follow &follow, const BranchPoint &before,
                                  const BranchPoint &beyond, double at, double *load_factor) {
  constexpr double rough = 0.5, close = 1e-5, small = 0.1;
  PetscFunctionBeginUser;
  const int stable = before.unstable;
  Softest ahead, behind;
  PetscCall(softestMotion(solver, step, before, stable, rough, &ahead));
  PetscCall(softestMotion(solver, step, beyond, stable, rough, &behind));
  const double way = small * std::min(1.0, -ahead.stiffness / behind.stiffness) *
                     std::min(at - before.parameter, beyond.parameter - at);
  BranchPoint low, high;
  PetscCall(follow(before, at - way, &low));
  PetscCall(follow(low, at + way, &high));
  if (!low.found || !high.found || low.unstable != stable || high.unstable <= stable) PetscFunctionReturn(0);
  PetscCall(softestMotion(solver, step, low, stable, close, &ahead));
  PetscCall(softestMotion(solver, step, high, stable, close, &behind));
  const double part = ahead.stiffness / (ahead.stiffness - behind.stiffness);
  *load_factor = low.state.time + part * (high.state.time - low.state.time);
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

bool areNear(const Team &team, const BranchPoint &a, const BranchPoint &b, double width) {
  return distanceBetween(team, a.state, b.state) <= std::sqrt(std::abs(a.parameter - b.parameter) / width);
}

/// Bisection. Steps begin at `base`, the last point that is not within `aside` of the critical one, where the Hessian
/// is nearly singular and Newton strays.
static PetscErrorCode bisect(const Team &team, const Follow &follow, BranchPoint *low, BranchPoint *base, double high,
                             double interval, double aside, double width) {
  PetscFunctionBeginUser;
  *base = *low;
  while (high - low->parameter > interval) {
    const double middle = 0.5 * (low->parameter + high);
    if (middle <= low->parameter || middle >= high) break;
    BranchPoint point;
    PetscCall(follow(*base, middle, &point));
    auto goesOn = [&] { return point.found && areNear(team, *low, point, width); };
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
                              double scale, double known, CriticalPoint *point, bool *found) {
  constexpr int most_rounds = 12;
  constexpr double interval = 1e-9, agreement = 1e-7,
                   part = 1e-3; // of the scale, of the load factor, of the first interval
  PetscFunctionBeginUser;
  *found = false;
  const Doing here([](std::ostream &out) { out << "a critical load is searched for"; });
  const double end = high, width = end - low.parameter, aside = std::max(part * width, 1e-5 * scale);
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
    PetscCall(bisect(solver.team(), follow, &low, &base, high, interval * scale, aside, width));
    if (std::abs(low.state.time - last) <= agreement * std::abs(last)) {
      if (low.parameter > known + agreement * std::abs(known))
        PetscCall(softens(solver, step, before, low, 3 * std::sqrt(interval * scale / aside),
                          found)); // the root is that of limit points
      if (!*found && !ahead) break;
      if (!*found) {
        PetscCall(goOn());
        continue;
      }
      point->load_factor = low.state.time;
      point->limit = !ahead;
      if (ahead && beyond.unstable > low.unstable)
        PetscCall(interpolate(solver, step, follow, before, beyond, low.parameter, &point->load_factor));
      point->state = low.state; // in balance at a load as near to the factor as equilibria are solved for
      point->state->time = point->load_factor;
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
