#include "tendril/dynamics/arc_length.hpp"

#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <petsctime.h>
#include <sstream>

namespace tendril {

constexpr const char *cannot_factor =
    "the Hessian cannot be factored; take more -load_steps, or look for rods that nothing holds";
constexpr const char *vanishing_edge =
    "an edge vanishes or turns back on itself; use more edges, or a larger axial_stiffness";

ArcLength::ArcLength(StepSolver &solver, const LoopSettings &settings)
    : solver_(solver), settings_(settings),
      circulation_(solver.potential(), {solver.potential().all()}, solver.potential().all()),
      metric_(solver.potential().dofs().makePlanes()), load_derivatives_(solver.potential().dofs().slots()) {
  const IncrementalPotential &potential = solver.potential();
  const Elements &e = potential.elements();
  loads_.push_back(makeLoad(potential.scene(), e));
  if (!potential.scene().bodies.empty()) loads_.push_back(makeBodyMotion(potential.scene(), e, false));
  for (const RodRange &rod : e.rods) {
    double length = 0;
    for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) length += e.restLength()[s];
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      metric_.setVector(0, s, Vec3::Constant(1 / (length * length * e.vertices())));
    if (rod.twist) std::fill(metric_[3] + rod.first_slot, metric_[3] + rod.edgeEnd(), 1.0 / e.edges());
  }
}

double ArcLength::product(const Point &a, const Point &b) const {
  double sum = a.factor * b.factor;
  for (std::size_t k = 0; k < metric_.size(); ++k)
    sum += metric_.data()[k] * a.unknowns.data()[k] * b.unknowns.data()[k];
  return sum;
}

/// Of the positions and twists alone.
double ArcLength::size(const Point &p) const { return std::sqrt(std::max(0.0, product(p, p) - p.factor * p.factor)); }

/// The largest correction that is little: against what a step, or its load, moves, or against the rounding of the
/// coordinates.
double ArcLength::allowance(const Point &moved) const {
  const double by_load = std::min(1.0, load_reach_ * std::abs(solver_.potential().step().load_factor));
  return std::max(solver_.potential().settings.rounding_tolerance * std::max(size(moved), by_load), rounding_);
}

/// At the end of a step, with its Hessian factored and the tangent there: whether what Newton would still move it by,
/// across the path, is little.
PetscErrorCode ArcLength::verify(const Point &direction, bool *little) {
  PetscFunctionBeginUser;
  Point rest;
  PetscCall(solve(solver_.potential().derivatives().gradient, &rest.unknowns));
  const double along = product(direction, rest);
  for (std::size_t k = 0; k < rest.unknowns.size(); ++k)
    rest.unknowns.data()[k] -= along * direction.unknowns.data()[k];
  rest.factor -= along * direction.factor;
  left_ = size(rest);
  *little = left_ <= allowance(last_);
  PetscFunctionReturn(0);
}

/// Change of the equilibrium by unit load factor, K y = -d(gradient)/d(factor), with the Hessian factored last.
PetscErrorCode ArcLength::solveLoad(Planes *response) {
  PetscFunctionBeginUser;
  const IncrementalPotential &potential = solver_.potential();
  load_derivatives_.equilibrium.clear();
  for (int r = 0; r < potential.all().end; ++r) {
    for (const auto &load : loads_) load->addDerivatives(potential.iterate(), r, load_derivatives_, HessianKind::none);
    potential.dofs().fold(potential.elements().rods[r], load_derivatives_.equilibrium);
  }
  potential.dofs().foldJoined(potential.all(), load_derivatives_.equilibrium);
  PetscCall(solve(load_derivatives_.equilibrium, response));
  PetscFunctionReturn(0);
}

/// Factors the whole derivative of the forces at the iterate.
PetscErrorCode ArcLength::factor(int *negative) {
  PetscFunctionBeginUser;
  PetscCall(solver_.inertiaAtIterate(negative, regular_lift));
  if (*negative < 0)
    obstacle_ = cannot_factor;
  else if (!circulation_.isNone())
    PetscCall(circulation_.update([this](const Planes &r, Planes &x) { return solver_.front().solveLinear(r, x); }));
  PetscFunctionReturn(0);
}

/// Newton's step for a gradient, by what was factored last.
PetscErrorCode ArcLength::solve(const Planes &gradient, Planes *step) {
  PetscFunctionBeginUser;
  if (step->size() == 0) *step = solver_.potential().dofs().makePlanes();
  PetscCall(solver_.front().solveLinear(gradient, *step));
  if (!circulation_.isNone()) circulation_.correct(*step);
  for (double &y : *step) y = -y;
  PetscFunctionReturn(0);
}

/// Unit tangent of the path at the iterate, on the side of the last step.
PetscErrorCode ArcLength::tangent(Point *direction) {
  PetscFunctionBeginUser;
  PetscCall(factor(&negative_));
  direction->factor = 1;
  PetscCall(solveLoad(&direction->unknowns));
  const double side = last_.unknowns.size() == 0 ? 1 : product(*direction, last_),
               norm = std::sqrt(product(*direction, *direction));
  const double scale = (side < 0 ? -1 : 1) / norm;
  for (double &d : direction->unknowns) d *= scale;
  direction->factor *= scale;
  PetscFunctionReturn(0);
}

bool ArcLength::move(const Planes &increment, double factor) {
  IncrementalPotential &potential = solver_.potential();
  if (!std::isfinite(factor) || !potential.tryMove(increment, 1.0, trial_)) return false;
  potential.accept(trial_);
  potential.setLoadFactor(factor);
  return true;
}

/// Newton on equilibrium and one constraint: two solves per factorisation, one for the residual and one for the load.
/// The constraint gives the change of the load factor from the way made so far and the two solutions.
PetscErrorCode ArcLength::iterate(
    const std::function<double(const Point &moved, const Point &residual, const Point &load)> &constraint, double start,
    bool *converged) {
  constexpr int most_iterations = 15;
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  PetscReal rtol;
  PetscCall(SNESGetTolerances(solver_.snes(), nullptr, &rtol, nullptr, nullptr, nullptr));
  rtol *= sharpness_;
  *converged = false;
  bool little = false; // the last correction, against what the step has moved
  for (int k = 0; k <= most_iterations; ++k) {
    const Residual residual = potential.residual();
    if (!std::isfinite(residual.force) || !std::isfinite(residual.moment)) {
      obstacle_ = "the forces are not finite; look at the loads and stiffnesses of the scene";
      PetscFunctionReturn(0);
    }
    // Rounding may keep the residual above its tolerance: then what the last correction moved must be little.
    *converged = k > 0 && (excess(residual, rtol) <= 1 || (isAtNoise(residual, rtol) && little));
    if (*converged) PetscFunctionReturn(0);
    if (k == most_iterations) break;
    int negative;
    PetscCall(factor(&negative));
    if (negative < 0) PetscFunctionReturn(0);
    Point moved, correction, load;
    load.factor = 1;
    potential.coordinates(moved.unknowns);
    moved.factor = potential.step().load_factor - start;
    PetscCall(solve(potential.derivatives().gradient, &correction.unknowns));
    PetscCall(solveLoad(&load.unknowns));
    const double change = constraint(moved, correction, load);
    for (std::size_t k = 0; k < metric_.size(); ++k) correction.unknowns.data()[k] += change * load.unknowns.data()[k];
    correction.factor = change;
    little = size(correction) <= allowance(moved);
    ++iterations_;
    if (!move(correction.unknowns, potential.step().load_factor + change)) {
      obstacle_ = vanishing_edge;
      PetscFunctionReturn(0);
    }
  }
  obstacle_ = "the corrector did not converge; take more -load_steps, so that steps begin shorter";
  PetscFunctionReturn(0);
}

/// From the predicted point to the path, in the plane normal to the tangent at the start of the step.
PetscErrorCode ArcLength::correct(double start, const Point &direction, double length, bool *converged) {
  PetscFunctionBeginUser;
  PetscCall(iterate(
      [&](const Point &moved, const Point &residual, const Point &load) {
        return (length - product(direction, moved) - product(direction, residual)) / product(direction, load);
      },
      start, converged));
  PetscFunctionReturn(0);
}

/// To the point of the path nearby that has a given load factor.
PetscErrorCode ArcLength::correctAt(double factor, bool *converged) {
  PetscFunctionBeginUser;
  PetscCall(
      iterate([&](const Point &moved, const Point &, const Point &) { return factor - moved.factor; }, 0, converged));
  if (*converged) solver_.potential().setLoadFactor(factor);
  PetscFunctionReturn(0);
}

/// One step along the path, or `along` another direction; the potential's iterate is its end when it converged.
PetscErrorCode ArcLength::step(const State &state, double length, bool *converged, const Point *along) {
  constexpr double straying =
      1.5; // of the step's length, from tangent to chord below 48 degrees: beyond it may be another branch
  PetscFunctionBeginUser;
  *converged = false;
  iterations_ = 0;
  obstacle_.clear();
  astray_ = false;
  IncrementalPotential &potential = solver_.potential();
  Point direction;
  PetscCall(begin(state, &direction));
  if (!obstacle_.empty()) PetscFunctionReturn(0);
  if (along) direction = *along;
  Point predicted = direction;
  for (double &d : predicted.unknowns) d *= length;
  if (!move(predicted.unknowns, state.time + length * direction.factor)) {
    obstacle_ = vanishing_edge;
    PetscFunctionReturn(0);
  }
  PetscCall(correct(state.time, direction, length, converged));
  if (*converged && potential.step().load_factor > settings_.t_end) PetscCall(correctAt(settings_.t_end, converged));
  if (!*converged) PetscFunctionReturn(0);
  Point moved;
  potential.coordinates(moved.unknowns);
  moved.factor = potential.step().load_factor - state.time;
  const double way =
      along ? size(moved)
            : std::sqrt(product(moved, moved)); // the load may rise as steeply as it will on a branch that leaves
  *converged = way < straying * length;
  if (*converged) last_ = moved;
  astray_ = !*converged;
  if (astray_) obstacle_ = "the step strayed from the path; take more -load_steps, so that steps begin shorter";
  PetscFunctionReturn(0);
}

/// A step from a critical point along its mode, onto the branch that leaves there (Keller 1977): Newton for equilibrium
/// and the plane normal to the mode.
PetscErrorCode ArcLength::switchBranch(const CriticalPoint &critical, double length, double shortest, State *state,
                                       bool *switched) {
  constexpr double least = 1e-3; // what cannot get shorter hardly bends while the load rises a lot
  PetscFunctionBeginUser;
  Step here;
  here.mixed = settings_.mixed;
  Point mode;
  last_ = {};
  *switched = false;
  bool found;
  PetscCall(criticalMode(solver_, critical, here, &mode.unknowns, &found));
  if (!found) {
    obstacle_ = "the path could not be followed past it; take more -load_steps";
    PetscFunctionReturn(0);
  }
  const double norm = size(mode);
  for (double &d : mode.unknowns) d /= norm;
  for (; !*switched && length >= least * shortest; length *= 0.5)
    PetscCall(step(*critical.state, length, switched, &mode));
  if (!*switched) PetscFunctionReturn(0);
  *state = *critical.state;
  solver_.potential().commit(*state);
  PetscFunctionReturn(0);
}

EnergyBudget ArcLength::energyOf(const State &at) const {
  const IncrementalPotential &potential = solver_.potential();
  return potential.energyBudget(at, potential.iterate(), at.time, potential.all());
}

/// Solves the next step, and judges whether its end is the path's; `obstacle_` says what is wrong with it.
PetscErrorCode ArcLength::tryStep(const State &state, const Walk &walk, Tried *now) {
  constexpr double least_alignment = 0.5; // of the tangents at the ends of a step, 60 degrees
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  PetscCall(step(state, walk.length, &now->converged));
  if (now->converged) {
    const int negative = negative_;
    PetscCall(tangent(&now->end));
    // At a limit point an odd number of pivots and the slope change sign together. Pivots alone: a bifurcation, or a
    // turn so sharp that the tangent behind it was taken for the reverse of the tangent before. Short steps tell.
    now->crossed = negative != negative_;
    const bool odd = (negative - negative_) % 2 != 0, turns = now->turns(walk);
    const bool doubtful = odd != turns && !potential.scene().hasCouples() && walk.length > walk.first / 16;
    astray_ = doubtful || product(walk.direction, now->end) < least_alignment;
    if (astray_) {
      now->converged = false;
      obstacle_ = "the path turns too sharply; take more -load_steps, so that steps begin shorter";
    }
  }
  bool little = true;
  if (now->converged) PetscCall(verify(now->end, &little));
  if (!little && sharpness_ > 1e-6) { // a tolerance relative to all loads may be too dull for what they move
    sharpness_ *= 1e-2;
    now->converged = false;
    obstacle_ = "what Newton would still move it by is not little; lower -snes_rtol or use fewer edges";
    PetscFunctionReturn(0);
  }
  if (!little) {
    std::ostringstream message;
    message << "step along the path at load factor " << state.time
            << " is lost in rounding: Newton would still move it by " << left_ << " of the length, it moves "
            << size(last_) << " (-rounding_tolerance " << potential.settings.rounding_tolerance << "); use fewer edges"
            << imbalance();
    failure_ = message.str();
    PetscFunctionReturn(0);
  }
  // Full load lies before a limit point above it: shorter steps end on the near side.
  if (now->converged && now->turns(walk) && potential.step().time >= settings_.t_end) {
    now->converged = false;
    obstacle_ = "a limit point lies just above full load; raise the loads, so that the path passes it";
  }
  PetscFunctionReturn(0);
}

/// Halves the next step, or goes back with a sharper tolerance. The state was not touched.
PetscErrorCode ArcLength::shorten(State &state, const Tried &failed, Walk *walk) {
  PetscFunctionBeginUser;
  last_ = failed.before;
  bool refined = false;
  if (astray_ && sharpness_ == 1) PetscCall(refine(state, &walk->direction, &refined));
  ++walk->rejected;
  walk->in_vain += iterations_;
  if (!refined) walk->length *= 0.5;
  if (walk->length >= walk->shortest) PetscFunctionReturn(0);
  const std::string out_of_balance = astray_ ? "" : imbalance();
  if (walk->taken == 0) PetscCall(refuseFreeStart(state));
  if (!failure_.empty()) PetscFunctionReturn(0);
  std::ostringstream message;
  message << "step along the path at load factor " << state.time << " failed with length " << 2 * walk->length
          << " after " << iterations_ << (iterations_ == 1 ? " iteration: " : " iterations: ") << obstacle_
          << out_of_balance;
  failure_ = message.str();
  PetscFunctionReturn(0);
}

Diagnostics ArcLength::rowOf(const State &state, const EnergyBudget &energy, const Work &work, Walk *walk) const {
  Diagnostics row;
  row.time = state.time;
  row.dt = std::sqrt(product(last_, last_));
  row.energy = energy;
  row.work = work;
  row.dissipated = walk->energy + work.total() - energy.total();
  walk->energy = energy.total();
  row.newton_iterations = iterations_;
  row.negative_pivots = negative_;
  row.rounding_error = left_;
  row.rejected_steps = std::exchange(walk->rejected, 0);
  row.rejected_iterations = std::exchange(walk->in_vain, 0);
  return row;
}

PetscErrorCode ArcLength::run(State &state, const TimeLoop::Observer &observe, bool *finished) {
  constexpr double wanted_iterations = 4, most_growth = 4;
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  PetscLogDouble begin, end;
  PetscCall(PetscTime(&begin));
  *finished = false;
  PetscCall(findStart(state));
  if (!failure_.empty()) PetscFunctionReturn(0);
  Walk walk;
  PetscCall(beginWalk(state, &walk));
  while (walk.taken < settings_.arclength_steps && state.time < settings_.t_end) {
    Tried now{state, last_, {}};
    const Doing here([&](std::ostream &out) {
      out << "step along the path at load factor " << now.start.time << ", length " << walk.length;
      if (walk.rejected > 0) out << ", after " << walk.rejected << " that failed";
    });
    PetscCall(tryStep(state, walk, &now));
    if (failure_.empty() && !now.converged) PetscCall(shorten(state, now, &walk));
    if (!failure_.empty()) PetscFunctionReturn(0);
    if (!now.converged) continue;
    potential.commit(state);
    EnergyBudget energy = energyOf(state);
    WorkSums work;
    addStaticWork(potential.scene(), potential.elements(), now.start, state, potential.start(), potential.iterate(),
                  work);
    ++walk.taken;
    bool switched;
    PetscCall(passCritical(now, walk, state, finished, &switched));
    if (*finished || !failure_.empty()) PetscFunctionReturn(0);
    std::swap(walk.direction, now.end);
    if (switched) {
      PetscCall(tangent(&walk.direction));
      energy = energyOf(state);
      work = {};
      addStaticWork(potential.scene(), potential.elements(), now.start, state, work);
    }
    Diagnostics row = rowOf(state, energy, work.value(), &walk);
    PetscCall(PetscTime(&end));
    row.wall_seconds = end - begin;
    PetscCall(observe(state, row));
    if (stops && state.time < settings_.t_end && stops()) PetscFunctionReturn(0);
    walk.length =
        std::clamp(walk.length * std::clamp(std::sqrt(wanted_iterations / std::max(iterations_, 1)), 0.5, 2.0),
                   walk.shortest, most_growth * walk.first);
  }
  *finished = true;
  PetscFunctionReturn(0);
}

} // namespace tendril
