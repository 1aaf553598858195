#include "tendril/dynamics/buckling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tendril {
namespace {

constexpr double early = 1e-3; // of the first step: where the path begins, for without loads a rod may be anywhere

/// How far a state lies from the middle of two others, over how far these are apart; 0 where they are one to rounding.
double bendOf(const Team &team, const State &from, const State &middle, const State &to) {
  constexpr double rounding = 1e-10; // of the coordinates
  State straight = from;
  for (std::size_t v = 0; v < from.position.size(); ++v)
    straight.position[v] = 0.5 * (from.position[v] + to.position[v]);
  for (std::size_t b = 0; b < from.body_position.size(); ++b)
    straight.body_position[b] = 0.5 * (from.body_position[b] + to.body_position[b]);
  const double apart = distanceBetween(team, from, to);
  return apart > rounding ? distanceBetween(team, straight, middle) / apart : 0;
}

/// Makes the largest displacement, or where nothing is displaced the largest twist, one; of both signs that with a
/// positive largest component.
void scaleToOne(Rates &shape, double length) {
  double moved = 0, twisted = 0, component = 0, twist = 0;
  auto note = [](double d, double &largest) {
    if (std::abs(d) > std::abs(largest) * (1 + 1e-6)) largest = d;
  };
  auto displaced = [&](const Vec3 &v) {
    moved = std::max(moved, v.norm());
    for (const double d : v) note(d, component);
  };
  for (const Vec3 &v : shape.vertex) displaced(v);
  for (const BodyRate &b : shape.body) {
    displaced(b.translation);
    twisted = std::max(twisted, b.spin.norm());
    for (const double d : b.spin) note(d, twist);
  }
  for (const double t : shape.edge) note(t, twist);
  twisted = std::max(twisted, std::abs(twist));
  const bool turns = moved < 1e-6 * length * twisted;
  const double scale = std::copysign(1 / (turns ? twisted : moved), turns ? twist : component);
  for (Vec3 &v : shape.vertex) v *= scale;
  for (double &t : shape.edge) t *= scale;
  for (BodyRate &b : shape.body) b = BodyRate().add(scale, b);
}

} // namespace

/// An equilibrium of any kind, by Newton from another one.
PetscErrorCode BucklingPath::balance(const State &start, double factor, State *state, NewtonReport *report,
                                     bool *found) {
  PetscFunctionBeginUser;
  Step step = TimeLoop::stepOf(settings_, start, 0);
  step.time = step.load_factor = factor;
  const SharpTolerance sharp(solver_);
  PetscCall(solver_.solve(start, step, report, Seek::equilibrium));
  *found = report->converged && SharpTolerance::isMet(report->residual);
  *state = start;
  if (*found) solver_.potential().commit(*state);
  PetscFunctionReturn(0);
}

/// Those that do not cost nothing, from the lowest on: as many as that are always there are left out, the smallest.
std::vector<std::size_t> BucklingPath::numbersOf(const Modes &modes) const {
  std::vector<std::size_t> numbers(modes.eigenvalue.size());
  std::iota(numbers.begin(), numbers.end(), std::size_t(0));
  std::stable_sort(numbers.begin(), numbers.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(modes.eigenvalue[a]) < std::abs(modes.eigenvalue[b]);
  });
  numbers.erase(numbers.begin(), numbers.begin() + std::min<std::ptrdiff_t>(free_, std::ptrdiff_t(numbers.size())));
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

/// A point of the path with its softest motions.
PetscErrorCode BucklingPath::reach(const Point &from, double factor, Point *to, Modes *modes) {
  PetscFunctionBeginUser;
  Modes here;
  std::string failure;
  Point point;
  point.factor = factor;
  PetscCall(balance(from.state, factor, &point.state, &point.report, &point.found));
  if (point.found) PetscCall(modesAtIterate(solver_, Metric::shift, asked_, &here, &failure));
  if (point.found && !failure.empty()) point.report.reason = failure;
  point.found = point.found && failure.empty();
  if (point.found) {
    int &free = point.free;
    for (int k = 0; k < here.count(); ++k) free += here.isFree(k);
    const bool all = here.count() > 0 && here.eigenvalue.back() > here.zero.back(); // none is beyond what was asked for
    if (free_ < 0 || all) free_ = free_ < 0 ? free : std::min(free_, free);
    for (const std::size_t k : numbersOf(here)) point.stiffness.push_back(here.eigenvalue[k]);
    point.unstable = int(std::count_if(point.stiffness.begin(), point.stiffness.end(), [](double w) { return w < 0; }));
  }
  if (modes) *modes = std::move(here);
  *to = std::move(point);
  PetscFunctionReturn(0);
}

/// The same along the path: Newton must come there by two steps, too, through a point about in the middle, and back.
/// After a snap to another branch it does not, in either half, however short the step.
PetscErrorCode BucklingPath::advance(const Point &from, double factor, Point *to) {
  constexpr double little = 1e-5; // of the size of the scene
  // That of a parabola whose slope doubles is 1/12; of a root up to a limit point, and over to the branch that comes
  // back from there, it is below and above (sqrt(2) - 1)/2 = 0.207; of a snap a half.
  constexpr double bent = 0.15;
  PetscFunctionBeginUser;
  Point middle;
  PetscCall(balance(from.state, 0.5 * (from.factor + factor), &middle.state, &middle.report, &middle.found));
  *to = {};
  to->factor = factor;
  to->report = middle.report;
  if (!middle.found) PetscFunctionReturn(0);
  PetscCall(reach(middle, factor, to));
  if (!to->found) PetscFunctionReturn(0);
  if (bendOf(solver_.team(), from.state, middle.state, to->state) > bent) {
    to->found = false;
    to->report.reason = "it bends too sharply, or the nearest equilibrium is on another branch";
    PetscFunctionReturn(0);
  }
  State back;
  NewtonReport report;
  bool returned;
  PetscCall(balance(to->state, from.factor, &back, &report, &returned));
  to->found = returned && distanceBetween(solver_.team(), back, from.state) <= little;
  if (!to->found) to->report.reason = "the nearest equilibrium is on another branch";
  PetscFunctionReturn(0);
}

/// Takes roots over in the order of their factors.
PetscErrorCode BucklingPath::note(std::vector<Root> &roots) {
  constexpr double same = 1e-6; // of a factor: told once
  PetscFunctionBeginUser;
  std::stable_sort(roots.begin(), roots.end(), [](const Root &a, const Root &b) { return a.factor < b.factor; });
  double told = -HUGE_VAL;
  for (Root &root : roots) {
    if (modes_.count() == count_) break;
    modes_.load_factor.push_back(root.factor);
    modes_.limit.push_back(root.limit);
    scaleToOne(root.shape, lengthOfAll());
    modes_.shape.push_back(root.shape);
    if (!on_critical || root.factor - told <= same * std::abs(root.factor)) continue;
    told = root.factor;
    CriticalPoint point;
    point.load_factor = root.factor;
    point.state = root.below;
    point.limit = root.limit;
    PetscCall(on_critical(point));
  }
  PetscFunctionReturn(0);
}

double BucklingPath::lengthOfAll() const {
  double length = 0;
  for (int r = 0; r < solver_.potential().all().end; ++r) length += solver_.potential().length(r);
  return length;
}

/// All roots between two points. \param snapped where that is not one piece of a path
PetscErrorCode BucklingPath::locateAll(const Point &at, const Point &next, bool *snapped) {
  PetscFunctionBeginUser;
  std::vector<Root> all, roots;
  const auto [least, most] = std::minmax(at.unstable, next.unstable);
  near_ = {at, next};
  *snapped = false;
  for (int k = least; k < most && int(all.size()) < count_ - modes_.count(); k = least + int(all.size())) {
    PetscCall(locate(k, at, next, true, next.unstable > at.unstable, &roots));
    *snapped = roots.empty() || roots[0].limit; // nothing leads beyond a limit point
    if (*snapped) PetscFunctionReturn(0);
    all.insert(all.end(), roots.begin(), roots.end());
  }
  PetscCall(note(all));
  PetscFunctionReturn(0);
}

PetscErrorCode BucklingPath::begin(State &state, Point *at) {
  PetscFunctionBeginUser;
  const int all = int(solver_.potential().dofs().unknowns(solver_.potential().all()));
  Point rest;
  rest.state = state;
  for (int more = 8;; more *= 4) { // motions that cost nothing, or are unstable from no load on
    asked_ = std::min(all, count_ + more);
    free_ = -1;
    PetscCall(reach(rest, early * settings_.dt, at));
    if (!at->found || at->unstable + free_ + 2 <= more || asked_ == all) break;
  }
  asked_ = std::min(all, count_ + at->unstable + free_ + 2);
  // Unstable there: what is so at any load is none of the modes, others have their critical loads before.
  constexpr int most = 4;
  Point first = *at;
  for (int k = 0; k < most && at->found && first.found && first.unstable > 0; ++k) {
    PetscCall(reach(rest, 1e-3 * first.factor, &first));
    if (first.found && first.unstable < at->unstable && first.free <= at->free) *at = first;
  }
  PetscFunctionReturn(0);
}

/// Goes on to a point.
PetscErrorCode BucklingPath::take(Point &point, Stretch &along, State &state) {
  along.before = std::move(along.at);
  along.at = std::move(point);
  state = along.at.state;
  ++state.step;
  along.at.state.step = state.step;
  return on_step ? on_step(state, along.at.report, along.at.unstable) : PetscErrorCode(0);
}

/// Looks for the critical loads before a point; where there must be some but none is found, neither is the point.
PetscErrorCode BucklingPath::look(const Point &at, Point &next) {
  bool snapped = false;
  PetscFunctionBeginUser;
  if (next.found && next.unstable != at.unstable) PetscCall(locateAll(at, next, &snapped));
  if (snapped)
    next.report.reason = "stability changes before load factor " + shortText(next.factor) +
                         ", but no critical load was found; take more -load_steps";
  next.found = next.found && !snapped;
  PetscFunctionReturn(0);
}

/// Where Newton does not reach a load: at a bifurcation it fails, and beyond it goes on; at a limit point the path
/// ends.
PetscErrorCode BucklingPath::goAround(const Stretch &along, double target, Point *next, State &state) {
  PetscFunctionBeginUser;
  std::vector<Root> roots;
  Point end;
  end.factor = target;
  near_ = {along.at};
  if (along.before.factor < along.at.factor) near_.push_back(along.before);
  PetscCall(locate(along.at.unstable, along.at, end, false, true, &roots));
  if (roots.empty()) PetscFunctionReturn(0);
  bool turns_back = false;
  if (roots[0].limit) PetscCall(isLimit(along.at, roots[0].factor, &turns_back));
  if (turns_back) {
    state = roots[0].below;
    PetscCall(note(roots));
    ending_ = "the load cannot rise beyond the limit point";
    PetscFunctionReturn(0);
  }
  for (double beyond = 1e-3; beyond < 0.05 && !next->found; beyond *= 2)
    PetscCall(advance(along.at, std::max(target, roots[0].factor) * (1 + beyond), next));
  PetscCall(look(along.at, *next));
  PetscFunctionReturn(0);
}

/// Follows the path until all modes are found, it ends, or fails.
PetscErrorCode BucklingPath::follow(Stretch &along, State &state, bool *stopped) {
  constexpr int few = 5; // iterations
  constexpr double short_step = 0.02, shortest = 1e-4;
  PetscFunctionBeginUser;
  *stopped = false;
  const Point &at = along.at;
  double h = at.factor < 0.5 * early * settings_.dt ? 100 * at.factor : settings_.dt - at.factor;
  while (modes_.count() < count_ && at.factor < settings_.t_end && failure_.empty() && ending_.empty()) {
    *stopped = stops && stops();
    if (*stopped) PetscFunctionReturn(0);
    Point next;
    const double target = std::min(at.factor + h, settings_.t_end);
    PetscCall(advance(at, target, &next));
    PetscCall(look(at, next));
    if (next.found) {
      if (next.report.iterations <= few) h *= 2;
      PetscCall(take(next, along, state));
      continue;
    }
    h *= 0.5;
    if (h > short_step * target) continue;
    PetscCall(goAround(along, target, &next, state));
    if (next.found)
      PetscCall(take(next, along, state));
    else if (ending_.empty() && h <= shortest * target)
      failure_ = "the path of equilibria could not be followed beyond load factor " + shortText(at.factor) + ": " +
                 next.report.reason;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode BucklingPath::run(State &state, bool *finished) {
  PetscFunctionBeginUser;
  *finished = false;
  Point first;
  PetscCall(begin(state, &first));
  if (!first.found) {
    failure_ =
        "there is no equilibrium to begin with, at load factor " + shortText(first.factor) + ": " + first.report.reason;
    PetscFunctionReturn(0);
  }
  Stretch along;
  along.at = first; // and so the one before it
  PetscCall(take(first, along, state));
  bool stopped;
  PetscCall(follow(along, state, &stopped));
  if (stopped) PetscFunctionReturn(0);
  if (ending_.empty() && modes_.count() < count_ && failure_.empty())
    ending_ = "the path was followed up to load factor " + shortText(along.at.factor);
  *finished = true;
  PetscFunctionReturn(0);
}

} // namespace tendril
