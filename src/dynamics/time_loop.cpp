#include "tendril/dynamics/time_loop.hpp"

#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <petsctime.h>
#include <sstream>

namespace tendril {

Step TimeLoop::stepOf(const LoopSettings &settings, const State &state, double dt) {
  Step step;
  step.dt = settings.dynamic ? dt : 0;
  step.time = state.time + dt;
  if (std::abs(step.time - settings.t_end) < 1e-9 * settings.dt)
    step.time = settings.t_end; // no sliver of a step from rounding
  step.load_factor = settings.dynamic ? 1 : step.time;
  step.mixed = settings.mixed;
  step.hessian = settings.hessian;
  return step;
}

void StepControl::share(const Team &team) {
  double numbers[] = {dt, double(good), double(stable), error, error_sum, rounding_sum, energy};
  team.share(numbers);
  *this = {numbers[0], int(numbers[1]), numbers[2] != 0, numbers[3], numbers[4], numbers[5], numbers[6]};
}

/// Length of the next step [s]: no sliver is left before a time at which a step has to end.
double TimeLoop::nextStep(double time, double *landing) const {
  *landing = settings_.t_end;
  const bool fixed = settings_.adapt == Adaptation::none;
  const double interval = settings_.output_interval;
  if (interval > 0) *landing = std::min(settings_.t_end, interval * (1 + std::floor(time / interval * (1 + 1e-12))));
  const double left = *landing - time, parts = std::max(1.0, std::ceil(left / control.dt * (1 - 1e-9))),
               h = left / parts;
  if (!fixed) return h;
  if (interval == 0) return std::min(control.dt, left);
  return std::abs(h - control.dt) < 1e-9 * control.dt ? control.dt : h; // dt itself where it divides the interval
}

/// Proportional-integral control of the step (Gustafsson, Lundh and Soederlind 1988): sets the next one, and tells
/// whether this one is good enough.
bool TimeLoop::adapt(double h, double dt_min, const StepError &error) {
  if (!error.known) return true;
  const double power = 1.0 / (integrator_->order() + 1);
  const double ratio = std::max(error.error / (settings_.dt_atol + settings_.dt_rtol * error.moved), 1e-10);
  const bool accept = ratio <= 1 || h <= dt_min * (1 + 1e-9);
  double factor = std::clamp(0.9 * std::pow(ratio, -power), 0.1, 0.9);
  if (ratio <= 1)
    factor = std::clamp(0.9 * std::pow(ratio, -0.7 * power) *
                            std::pow(control.error > 0 ? control.error : ratio, 0.4 * power),
                        0.5, 2.0);
  double next = factor * h;
  if (accept && factor >= 1)
    next = std::max(next, control.dt); // a step cut short to land says nothing against the length asked for
  if (settings_.dt_max > 0) next = std::min(next, settings_.dt_max);
  control.dt = std::max(next, dt_min);
  if (accept) control.error = ratio;
  return accept;
}

/// The longest step, and the shortest one.
double TimeLoop::longest() const {
  return settings_.dt_max > 0 ? std::min(settings_.dt, settings_.dt_max) : settings_.dt;
}
double TimeLoop::shortest() const { return settings_.dt_min > 0 ? settings_.dt_min : longest() / 1024; }

/// The next step, not yet solved.
TimeLoop::Attempt TimeLoop::attemptFrom(const State &state) const {
  Attempt now;
  double landing;
  now.h = nextStep(state.time, &landing);
  now.step = stepOf(settings_, state, now.h);
  if (std::abs(now.step.time - landing) < 1e-9 * now.h) now.step.time = landing;
  if (!settings_.dynamic) now.step.load_factor = now.step.time;
  return now;
}

/// Solves the step. What it leads to is in `next`, block by block where the last stage is the end of the step; the
/// state is not touched.
PetscErrorCode TimeLoop::attempt(const State &state, State *next, Attempt *now) {
  PetscFunctionBeginUser;
  if (settings_.dynamic) {
    PetscCall(solveStages(state, next, now));
    if (!now->report.converged) PetscFunctionReturn(0);
    next->time = now->step.time;
    measure(state, *next, now);
    now->too_coarse = adapts() && !adapt(now->h, shortest(), now->error);
    PetscFunctionReturn(0);
  }
  solver_.on_block = [&](RodSet rods) { now->commit(solver_.potential(), rods, next); };
  solver_.on_again = [now] { now->forget(); };
  std::optional<Guess> guess;
  if (mode_) guess = alongMode(state, now->step);
  PetscCall(solver_.solve(state, now->step, &now->report, Seek::minimum, guess ? &*guess : nullptr));
  solver_.on_block = nullptr;
  solver_.on_again = nullptr;
  next->time = now->step.time;
  if (!now->report.converged) PetscFunctionReturn(0);
  measure(state, *next, now); // here, for a search for critical points within the step moves the iterate
  PetscFunctionReturn(0);
}

/// What rods of all ranks add to what is told of a step that has converged, by one reduction.
void TimeLoop::measure(const State &state, const State &next, Attempt *now) {
  const IncrementalPotential &potential = solver_.potential();
  const Scene &scene = potential.scene();
  if (settings_.dynamic) {
    if (adapts() || settings_.estimate_error) now->error = stepError(state, now->h);
    addDynamicWork(state, now->h, now->work);
    addHeldEnergy(state, now->held_before);
    addHeldEnergy(next, now->held_after);
    addCarriedEnergy(scene, potential.elements(), next, now->carried);
  } else {
    addStaticWork(scene, potential.elements(), state, next, potential.start(), potential.iterate(), now->work);
    for (const Holder &h : moving_)
      if (h.collider)
        now->work.obstacles.add(workOf(h, solver_.potential().actionOf(h), potential.elements(), potential.start(),
                                       potential.iterate(), state.time, next.time));
  }
  now->stops = stops && stops();
  if (solver_.team().isAlone()) return;
  Tally tally;
  for (ExactSum &energy : now->energy.sums) tally.sum(energy);
  now->work.tally(tally);
  tally.sum(now->held_before).sum(now->held_after).sum(now->carried).smallest(now->gap).any(now->stops);
  tally.largest(now->error.error).largest(now->error.moved);
  solver_.team().combine(tally);
}

void TimeLoop::Attempt::commit(const IncrementalPotential &potential, RodSet rods, State *next) {
  potential.commitConfiguration(*next, rods);
  energy.add(potential.energyBudget(*next, potential.iterate(), step.load_factor, rods));
  gap = std::min(gap, potential.smallestGap(rods));
}

/// Whether a critical point may lie within the step. Couples have no potential: the inertia of the symmetric part says
/// nothing about stability. What friction holds begins free, which is no critical point either.
bool TimeLoop::mayPassCritical(const State &state, const NewtonReport &report) const {
  return !settings_.dynamic && settings_.bifurcation != Bifurcation::off && !solver_.potential().scene().hasCouples() &&
         !solver_.potential().scene().hasFriction() && control.stable && located_ <= state.time &&
         (report.first_negative_pivots > 0 || (isThorough() && report.mayPassCritical()));
}

/// Makes the answer of a step the state. Work since the last row adds to `work`.
void TimeLoop::accept(State &state, State &next, Attempt *now, Work *work) {
  mode_.reset();
  *work += now->work.value();
  work->supports += now->held_after.value() - now->held_before.value();
  next.step = state.step + 1;
  if (settings_.dynamic) {
    remember(state, now->h, &next);
    control.error_sum += now->error.error;
  }
  std::swap(state, next);
  control.stable = now->report.negative_pivots == 0;
  control.rounding_sum =
      settings_.dynamic ? control.rounding_sum + now->report.rounding_error : now->report.rounding_error;
}

/// Halves the step after a failure; false, with the reason, where it must not become shorter.
bool TimeLoop::shorten(const State &state, double h, const NewtonReport &report) {
  control.good = 0;
  control.dt = 0.5 * h;
  // A short last step may be halved as often, unless it was said how short steps may be.
  const double least = settings_.dt_min > 0 ? shortest() : std::min(shortest(), (settings_.t_end - state.time) / 1024);
  if (!report.lost && control.dt >= least * (1 - 1e-9)) return true;
  std::ostringstream message;
  message << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " failed with "
          << (settings_.dynamic ? "dt " : "increment ") << h << ": " << report.reason << " (" << report.iterations
          << (report.iterations == 1 ? " iteration)" : " iterations)");
  failure_ = message.str();
  return false;
}

/// Load steps grow where they are easy; steps that a failure shortened come back after some that went well.
void TimeLoop::lengthen(const NewtonReport &report) {
  if (!settings_.dynamic && report.iterations <= 4 && report.escapes == 0)
    control.dt = std::min(2 * control.dt, 4 * settings_.dt);
  else if (!adapts() && control.dt < settings_.dt && ++control.good >= 4) {
    control.dt = std::min(2 * control.dt, settings_.dt);
    control.good = 0;
  }
}

Diagnostics TimeLoop::rowOf(const State &state, const Attempt &now, const Work &work) {
  Diagnostics row;
  row.time = state.time;
  row.dt = now.h;
  row.energy = now.energy.value();
  row.carried = now.carried.value();
  row.contact_gap_min = now.gap;
  row.work = work;
  row.dissipated = control.energy + work.total() - row.energy.total();
  control.energy = row.energy.total();
  row.newton_iterations = now.report.iterations;
  row.line_search_trials = now.report.trials;
  row.negative_pivots = now.report.negative_pivots;
  row.error_estimate = control.error_sum;
  row.rounding_error = control.rounding_sum;
  return row;
}

/// A run that begins has no step behind it, whatever the loop has run before.
void TimeLoop::prepare(const State &state) {
  const IncrementalPotential &potential = solver_.potential();
  const Scene &scene = potential.scene();
  if (control.dt == 0) control.dt = longest();
  const bool goes_on = !std::isnan(control.energy) && (settings_.dynamic || state.time > 0);
  if (!goes_on) {
    const Configuration start = configurationOf(state, scene, potential.elements(), state.time);
    EnergySums energy;
    for (const NewtonSolver &block : solver_.blocks())
      energy.add(potential.energyBudget(state, start, settings_.dynamic ? 1 : state.time, block.rods()));
    Tally tally;
    for (ExactSum &sum : energy.sums) tally.sum(sum);
    solver_.team().combine(tally);
    control.energy = energy.value().total();
  }
  moving_ = movingHolders(scene);
  const std::vector<Holder> obstacles = movingObstacles(scene);
  moving_.insert(moving_.end(), obstacles.begin(), obstacles.end());
  moving_of_.assign(moving_.empty() ? 0 : scene.rods.size(), {});
  for (std::size_t k = 0; k < moving_.size(); ++k) moving_of_[moving_[k].rod].push_back(int(k));
}

/// Has what may touch in the step on one rank, or the scene modelled with more unknowns where the step asks for them:
/// it is taken `anew` then. The loop `ends` where nothing is left to this rank, or that fails.
PetscErrorCode TimeLoop::remodel(State &state, State *next, const Attempt &now, bool *anew, bool *ends) {
  PetscFunctionBeginUser;
  *anew = *ends = false;
  if (now.report.meets) {
    if (now.begins) state.memory.clear(); // of rods that did not know of each other
    if (now.first) control.energy = NAN;
    PetscCall(unite(anew));
    *ends = !*anew;
  } else if (widen && now.report.converged && !now.too_coarse) {
    PetscCall(widen(*next, now.report.first_negative_pivots > 0, anew, &failure_));
    *ends = !failure_.empty();
    if (*anew && !*ends && now.first) control.energy = NAN;
  }
  if (!*anew || *ends) PetscFunctionReturn(0);
  prepare(state);
  *next = state;
  PetscFunctionReturn(0);
}

/// Looks for a critical point within the step. Where there is one, the state has `moved` there, which adds to `work`,
/// or the run is `finished`.
PetscErrorCode TimeLoop::goToCritical(State &state, const Step &step, Work *work, bool *moved, bool *finished) {
  PetscFunctionBeginUser;
  const State before = state;
  *moved = false;
  PetscCall(locate(state, step, moved));
  *finished = *moved && settings_.bifurcation == Bifurcation::stop;
  if (!*moved || *finished) PetscFunctionReturn(0);
  WorkSums way;
  addStaticWork(solver_.potential().scene(), solver_.potential().elements(), before, state, way);
  Tally tally;
  way.tally(tally);
  solver_.team().combine(tally);
  *work += way.value();
  control.stable = false;
  PetscFunctionReturn(0);
}

PetscErrorCode TimeLoop::run(State &state, const Observer &observe, bool *finished) {
  PetscFunctionBeginUser;
  PetscLogDouble begin, now;
  PetscCall(PetscTime(&begin));
  bool begun_here = std::isnan(control.energy); // no step has been taken yet, and the energy of the start is ours
  prepare(state);
  Work work;                     // since the last row
  int rejected = 0, in_vain = 0; // steps since then, and their iterations
  State next = state; // what the blocks that have converged come to; the state itself stays as it is until all have
  *finished = false;
  while (state.time < settings_.t_end) {
    const bool begins = settings_.dynamic && state.memory.empty(); // at the start, and where the state was written
    if (begins) PetscCall(integrator_->begin(solver_, control.dt, state));
    Attempt step = attemptFrom(state);
    step.begins = begins;
    step.first = begun_here;
    const Doing here([&](std::ostream &out) {
      out << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " of " << settings_.t_end
          << (settings_.dynamic ? ", dt " : ", increment ") << step.h;
      if (rejected > 0) out << ", after " << rejected << " that failed";
    });
    PetscCall(attempt(state, &next, &step));
    bool anew, ends;
    PetscCall(remodel(state, &next, step, &anew, &ends));
    if (ends) PetscFunctionReturn(0);
    if (anew) continue;
    if (!step.too_coarse && mayPassCritical(state, step.report)) {
      bool moved;
      PetscCall(goToCritical(state, step.step, &work, &moved, finished));
      if (*finished) PetscFunctionReturn(0);
      if (moved) {
        next = state;
        continue;
      }
    }
    if (!step.report.converged || step.too_coarse) { // the state was not touched
      ++rejected;
      in_vain += step.report.iterations;
      if (step.too_coarse || shorten(state, step.h, step.report)) continue;
      PetscFunctionReturn(0);
    }
    accept(state, next, &step, &work);
    begun_here = false;
    lengthen(step.report);
    Diagnostics row = rowOf(state, step, std::exchange(work, {}));
    row.rejected_steps = std::exchange(rejected, 0);
    row.rejected_iterations = std::exchange(in_vain, 0);
    PetscCall(PetscTime(&now));
    row.wall_seconds = now - begin;
    PetscCall(observe(state, row));
    if (step.stops && state.time < settings_.t_end) PetscFunctionReturn(0);
  }
  *finished = true;
  PetscFunctionReturn(0);
}

} // namespace tendril
