/// Where a path begins, and the critical points on it.
#include "tendril/dynamics/arc_length.hpp"

#include "tendril/solver/activity.hpp"

#include <algorithm>

namespace tendril {

void requireDeadLoads(const Scene &scene) {
  for (const Support &support : scene.supports)
    if (support.motion.moves())
      throw SceneError(
          "the support of rod '" + scene.rods[support.rod].name + "' at vertex " + std::to_string(support.vertex) +
          " moves: -continuation arclength scales dead loads only; hold the support still or use -continuation load");
  for (const Constraint &c : scene.constraints)
    if (c.motion.moves())
      throw SceneError(
          "constraint '" + c.name +
          "' moves: -continuation arclength scales dead loads only; hold it still or use -continuation load");
  for (const Joint &j : scene.joints)
    if (j.motion.moves() || j.target_motion.moves())
      throw SceneError("joint '" + j.name +
                       "' is moved, by its parent or its drive: -continuation arclength scales dead loads only; hold "
                       "it still or use -continuation load");
  if (scene.tendonsRub())
    throw SceneError("tendons have friction, whose forces depend on the way: -continuation arclength goes back and "
                     "forth; take their 'friction' away or use -continuation load");
  for (const Tendon &t : scene.tendons)
    if (t.isMoved())
      throw SceneError("tendon '" + t.name +
                       "' is given a table, or a point of it moves: -continuation arclength scales dead loads only; "
                       "hold it still or use -continuation load");
  const bool heavy = !scene.gravity.isZero(0),
             weight =
                 heavy && std::any_of(scene.rods.begin(), scene.rods.end(), [](const Rod &r) { return r.gravity; }),
             on_bodies = std::any_of(scene.bodies.begin(), scene.bodies.end(), [&](const Body &b) {
               return (heavy && b.gravity) || !b.force.isZero(0) || !b.torque.isZero(0);
             });
  if (!weight && !on_bodies && scene.rotation.angular_velocity.isZero(0) && scene.forces.empty() &&
      scene.followers.empty() && scene.moments.empty())
    throw SceneError("-continuation arclength needs a load to follow: gravity, a force, a torque or a moment");
}

/// Equilibrium at the load factor the run begins with: rods need not be at rest as drawn.
PetscErrorCode ArcLength::findStart(State &state) {
  PetscFunctionBeginUser;
  Step step;
  step.time = step.load_factor = state.time;
  step.mixed = settings_.mixed;
  NewtonReport report;
  PetscCall(solver_.solve(state, step, &report));
  if (!report.converged) {
    std::ostringstream message;
    message << "no equilibrium at load factor " << state.time << " to start the path from: " << report.reason
            << "; draw the rods nearer to their shape without load, or use -continuation load";
    failure_ = message.str();
    PetscFunctionReturn(0);
  }
  const std::int64_t number = state.step;
  solver_.potential().commit(state);
  state.step = number;
  PetscFunctionReturn(0);
}

/// Makes a state the start of a step, and the tangent of the path there.
PetscErrorCode ArcLength::begin(const State &state, Point *direction) {
  PetscFunctionBeginUser;
  Step step;
  step.time = step.load_factor = state.time;
  step.mixed = settings_.mixed;
  PetscCall(solver_.begin(state, step));
  PetscCall(tangent(direction));
  PetscFunctionReturn(0);
}

/// Motions at the iterate that cost next to nothing: of stiffness below `little` of the softest bending, of either
/// sign.
PetscErrorCode ArcLength::countNeutral(double little, int *count) {
  PetscFunctionBeginUser;
  int low, high;
  PetscCall(solver_.inertiaAtIterate(&low, -little));
  PetscCall(solver_.inertiaAtIterate(&high, little));
  *count = low - high;
  PetscFunctionReturn(0);
}

/// Where a motion costs nothing, solves the start of a step and its tangent again, and what follows, to a sharper
/// tolerance: a turn about an axis that costs nothing in equilibrium has a stiffness of the residual, which may be
/// larger than what holds it and of the other sign. Then steps go along it.
PetscErrorCode ArcLength::refine(State &state, Point *direction, bool *refined) {
  constexpr double little = 1e-4; // of the softest bending
  PetscFunctionBeginUser;
  PetscCall(begin(state, direction));
  if (negative_ < 0) PetscFunctionReturn(0);
  int neutral;
  PetscCall(countNeutral(little, &neutral));
  if (neutral <= 0) PetscFunctionReturn(0);
  sharpness_ = 1e-2;
  PetscCall(correct(state.time, *direction, 0, refined));
  if (!*refined) PetscFunctionReturn(0);
  const std::int64_t number = state.step;
  solver_.potential().commit(state);
  state.step = number;
  PetscCall(tangent(direction));
  PetscFunctionReturn(0);
}

/// Says so where the loads move what costs nothing at the start of the path: a rod that hangs from one pin has no
/// position without them.
PetscErrorCode ArcLength::refuseFreeStart(const State &state) {
  constexpr double little = 1e-5; // of the softest bending
  PetscFunctionBeginUser;
  Point direction;
  PetscCall(begin(state, &direction));
  int neutral;
  PetscCall(countNeutral(little, &neutral));
  if (neutral <= 0) PetscFunctionReturn(0);
  std::ostringstream message;
  message << "the path cannot start at load factor " << state.time
          << ": without loads a rod is free to move, as one that hangs from one pin is; hold it by a "
             "clamp or a second pin, or use -continuation load";
  failure_ = message.str();
  PetscFunctionReturn(0);
}

/// The point between the ends of a step where the load factor turns: false position (Illinois) on the slope of the load
/// factor along the path, by steps of other lengths from the same start.
PetscErrorCode ArcLength::locateLimit(const State &start, const Point &before, const std::array<double, 2> &slopes,
                                      double length, std::vector<CriticalPoint> *located) {
  constexpr int most_steps = 20;
  constexpr double flat = 1e-4; // of the slope at the start: the load factor is off by its square
  PetscFunctionBeginUser;
  const Point after = std::exchange(last_, before);
  const int iterations = iterations_, negative = negative_;
  const Doing here([](std::ostream &out) { out << "a limit point is searched for"; });
  const SharpTolerance sharp(solver_);
  std::array<double, 2> ends{0, length}, values = slopes;
  CriticalPoint point;
  point.limit = true;
  for (int k = 0, kept = -1; k < most_steps; ++k) {
    const double middle = (ends[0] * values[1] - ends[1] * values[0]) / (values[1] - values[0]);
    last_ = before;
    bool converged;
    PetscCall(step(start, middle, &converged));
    if (!converged) break;
    Point direction;
    PetscCall(tangent(&direction));
    State state = start;
    solver_.potential().commit(state);
    state.step = start.step;
    point.load_factor = state.time;
    point.state = state;
    if (std::abs(direction.factor) < flat * std::abs(slopes[0])) break;
    const int side = direction.factor * values[0] > 0 ? 0 : 1;
    ends[side] = middle;
    values[side] = direction.factor;
    if (kept == side) values[1 - side] *= 0.5;
    kept = side;
  }
  last_ = after;
  iterations_ = iterations;
  negative_ = negative;
  if (point.state) located->push_back(std::move(point));
  PetscFunctionReturn(0);
}

/// The points between the ends of a step where the count of unstable motions changes while the load factor does not
/// turn.
PetscErrorCode ArcLength::locateBifurcation(const State &start, const State &end, const Point &before, double length,
                                            std::vector<CriticalPoint> *located) {
  constexpr double no_load = 1e-4; // of the step
  PetscFunctionBeginUser;
  const Point after = std::exchange(last_, before);
  const int iterations = iterations_, negative = negative_;
  const SharpTolerance sharp(solver_);
  auto follow = [&](const BranchPoint &, double end, BranchPoint *to) -> PetscErrorCode {
    PetscFunctionBeginUser;
    last_ = before;
    to->parameter = end;
    to->state = start;
    PetscCall(step(start, end, &to->found));
    if (!to->found) PetscFunctionReturn(0);
    PetscCall(countUnstable(solver_, &to->unstable));
    solver_.potential().commit(to->state);
    to->found = to->unstable >= 0;
    PetscFunctionReturn(0);
  };
  BranchPoint low;
  low.state = start;
  Point direction;
  PetscCall(begin(start, &direction));
  PetscCall(countUnstable(solver_, &low.unstable));
  Step settings;
  settings.mixed = settings_.mixed;
  for (bool found = low.unstable >= 0; found;) {
    CriticalPoint point;
    PetscCall(locateCritical(solver_, settings, follow, low, length, length, low.parameter, &point, &found));
    if (!found) break;
    found = point.beyond.found;
    low = point.beyond;
    point.state->step = start.step;
    point.limit = false;
    // Where the load passes zero, what may turn about an axis costs nothing and becomes unstable, or stable: that is no
    // critical load.
    if (std::abs(point.load_factor) >= no_load * std::abs(start.time - end.time)) located->push_back(std::move(point));
  }
  last_ = after;
  iterations_ = iterations;
  negative_ = negative;
  PetscFunctionReturn(0);
}

/// The rod farthest from equilibrium at the iterate, in words.
std::string ArcLength::imbalance() {
  PetscReal rtol;
  (void)SNESGetTolerances(solver_.snes(), nullptr, &rtol, nullptr, nullptr, nullptr);
  IncrementalPotential &potential = solver_.potential();
  const Asked asked{rtol * sharpness_, sharpness_};
  return tellImbalance(potential, farthestRod(potential, potential.all(), asked), asked);
}

/// Takes the equilibrium where the potential is for the start of the path.
PetscErrorCode ArcLength::beginWalk(const State &state, Walk *walk) {
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  Step load;
  load.load_factor = 1;
  for (int r = 0; r < potential.all().end; ++r)
    for (const auto &of : loads_) of->beginStep(state, potential.iterate(), load, r);
  PetscCall(tangent(&walk->direction));
  rounding_ = 0;
  for (int r = 0; r < potential.all().end; ++r)
    rounding_ =
        std::max(rounding_, 4 * std::numeric_limits<double>::epsilon() *
                                std::max(1.0, potential.rodEnergy(potential.iterate(), r).reach / potential.length(r)));
  load_reach_ = size(walk->direction) / std::abs(walk->direction.factor);
  walk->first = settings_.dt / walk->direction.factor; // as long as a load step of dt
  walk->shortest = walk->first * (settings_.dt_min > 0 ? settings_.dt_min / settings_.dt : 1.0 / 1024);
  walk->length = walk->first;
  walk->energy = energyOf(state).total();
  PetscFunctionReturn(0);
}

/// Looks for critical points within the step just taken, tells them, and does with them what is asked for: `ends` where
/// the run stops at one, `switched` where it goes on along the branch that leaves there.
PetscErrorCode ArcLength::passCritical(const Tried &now, const Walk &walk, State &state, bool *ends, bool *switched) {
  PetscFunctionBeginUser;
  *ends = *switched = false;
  if (settings_.bifurcation == Bifurcation::off) PetscFunctionReturn(0);
  std::vector<CriticalPoint> critical;
  if (now.turns(walk))
    PetscCall(locateLimit(now.start, now.before, {walk.direction.factor, now.end.factor}, walk.length, &critical));
  else if (now.crossed && !solver_.potential().scene().hasCouples())
    PetscCall(locateBifurcation(now.start, state, now.before, walk.length, &critical));
  if (settings_.bifurcation != Bifurcation::locate && critical.size() > 1)
    critical.resize(1); // the run goes no further this way
  for (const CriticalPoint &point : critical)
    if (on_critical) PetscCall(on_critical(point));
  if (critical.empty()) PetscFunctionReturn(0);
  const CriticalPoint &first = critical.front();
  *ends = settings_.bifurcation == Bifurcation::stop;
  if (*ends) state = *first.state;
  if (first.limit || settings_.bifurcation != Bifurcation::switch_branch) PetscFunctionReturn(0);
  PetscCall(switchBranch(first, walk.length, walk.shortest, &state, switched));
  if (*switched) PetscFunctionReturn(0);
  std::ostringstream message;
  message << "no branch was found along the critical mode at load factor " << first.load_factor << ": " << obstacle_;
  failure_ = message.str();
  state = *first.state;
  PetscFunctionReturn(0);
}

} // namespace tendril
