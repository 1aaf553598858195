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

PetscErrorCode TimeLoop::run(State &state, const Observer &observe, bool *finished) {
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  const double longest = settings_.dt_max > 0 ? std::min(settings_.dt, settings_.dt_max) : settings_.dt;
  const double dt_min = settings_.dt_min > 0 ? settings_.dt_min : longest / 1024;
  const bool adapts = settings_.dynamic && settings_.adapt == Adaptation::error;
  if (control.dt == 0) control.dt = longest;
  double &dt = control.dt;
  int &good = control.good;
  bool &stable = control.stable;
  int rejected = 0, in_vain = 0; // steps since the last one accepted, and their iterations
  PetscLogDouble begin, now;
  PetscCall(PetscTime(&begin));
  // A run that begins has no step behind it, whatever the loop has run before.
  const bool goes_on = !std::isnan(control.energy) && (settings_.dynamic || state.time > 0);
  if (!goes_on)
    control.energy =
        energyBudget(potential.scene(), potential.elements(), state, settings_.dynamic ? 1 : state.time).total();
  moving_ = movingSupports(potential.scene());
  Work work; // since the last row
  *finished = false;
  const bool plain = !settings_.dynamic || (integrator_->leavesChords() && !adapts && !settings_.estimate_error);
  State next = state; // what the blocks that have converged come to; the state itself stays as it is until all have
  EnergyBudget energy;
  while (state.time < settings_.t_end) {
    if (settings_.dynamic && state.memory.empty())
      PetscCall(integrator_->begin(solver_, dt, state)); // at the start, and where the state was written
    double landing;
    const double h = nextStep(state.time, &landing);
    Step step = stepOf(settings_, state, h);
    if (std::abs(step.time - landing) < 1e-9 * h) step.time = landing;
    const Doing here([&](std::ostream &out) {
      out << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " of " << settings_.t_end
          << (settings_.dynamic ? ", dt " : ", increment ") << h;
      if (rejected > 0) out << ", after " << rejected << " that failed";
    });
    NewtonReport report;
    energy = {};
    auto addEnergy = [&](const State &end, int r) {
      energy += potential.energyBudget(end, potential.iterate(), settings_.dynamic ? 1 : step.time, r);
    };
    StepError error;
    if (plain) { // each block is committed while it is in the cache
      solver_.on_block = [&](RodSet rods) {
        potential.commit(next, rods);
        if (settings_.dynamic) noteActions(state, rods);
        for (int r = rods.begin; r < rods.end; ++r) addEnergy(next, r);
      };
      actions_.assign(1, SupportActions(2 * moving_.size()));
      std::optional<Guess> guess;
      if (mode_) guess = alongMode(state, step);
      PetscCall(solver_.solve(state, step, &report, Seek::minimum, guess ? &*guess : nullptr));
      solver_.on_block = nullptr;
    } else {
      PetscCall(solveStages(state, step, &report));
      solver_.on_block = nullptr;
      if (report.converged && (adapts || settings_.estimate_error)) error = stepError(state, h);
      if (report.converged && adapts && !adapt(h, dt_min, error)) { // the state was not touched
        ++rejected;
        in_vain += report.iterations;
        continue;
      }
    }
    // Couples have no potential: the inertia of the symmetric part says nothing about stability.
    const bool detects =
        !settings_.dynamic && settings_.bifurcation != Bifurcation::off && potential.scene().moments.empty();
    const bool passed =
        report.first_negative_pivots > 0 || (settings_.bifurcation != Bifurcation::locate && report.mayPassCritical());
    if (detects && stable && passed && located_ <= state.time) {
      bool moved = false;
      const State before = state;
      PetscCall(locate(state, step, &moved));
      *finished = moved && settings_.bifurcation == Bifurcation::stop;
      if (*finished) PetscFunctionReturn(0);
      if (moved) {
        work += staticWork(potential.scene(), potential.elements(), before, state);
        next = state;
        stable = false;
        continue;
      }
    }
    if (report.converged) mode_.reset();
    if (report.converged && settings_.dynamic) {
      work = dynamicWork(state, h);
      work.supports -= movedKinetic(state);
    }
    if (report.converged && plain) {
      next.time = step.time;
      next.step = state.step + 1;
      if (!settings_.dynamic)
        work +=
            staticWork(potential.scene(), potential.elements(), state, next, potential.start(), potential.iterate());
      std::swap(state, next);
    } else if (report.converged) {
      finishStages(state, h);
      potential.commitConfiguration(state);
      for (int r = 0; r < potential.all().end; ++r) addEnergy(state, r);
      control.error_sum += error.error;
    }
    if (!report.converged) { // the state was not touched
      ++rejected;
      in_vain += report.iterations;
      good = 0;
      dt = 0.5 * h;
      // A short last step may be halved as often, unless it was said how short steps may be.
      const double shortest = settings_.dt_min > 0 ? dt_min : std::min(dt_min, (settings_.t_end - state.time) / 1024);
      if (!report.lost && dt >= shortest * (1 - 1e-9)) continue;
      std::ostringstream message;
      message << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " failed with "
              << (settings_.dynamic ? "dt " : "increment ") << h << ": " << report.reason << " (" << report.iterations
              << (report.iterations == 1 ? " iteration)" : " iterations)");
      failure_ = message.str();
      PetscFunctionReturn(0);
    }
    stable = report.negative_pivots == 0;
    if (!settings_.dynamic && report.iterations <= 4 && report.escapes == 0) // load steps grow where they are easy
      dt = std::min(2 * dt, 4 * settings_.dt);
    else if (!adapts && dt < settings_.dt && ++good >= 4) {
      dt = std::min(2 * dt, settings_.dt);
      good = 0;
    }
    if (settings_.dynamic) work.supports += movedKinetic(state);
    Diagnostics row;
    row.time = state.time;
    row.dt = h;
    row.energy = energy;
    row.work = std::exchange(work, {});
    row.dissipated = control.energy + row.work.total() - row.energy.total();
    control.energy = row.energy.total();
    row.newton_iterations = report.iterations;
    row.line_search_trials = report.trials;
    row.negative_pivots = report.negative_pivots;
    row.rejected_steps = std::exchange(rejected, 0);
    row.rejected_iterations = std::exchange(in_vain, 0);
    PetscCall(PetscTime(&now));
    row.wall_seconds = now - begin;
    row.error_estimate = control.error_sum;
    control.rounding_sum = settings_.dynamic ? control.rounding_sum + report.rounding_error : report.rounding_error;
    row.rounding_error = control.rounding_sum;
    PetscCall(observe(state, row));
    if (stops && state.time < settings_.t_end && stops()) PetscFunctionReturn(0);
  }
  *finished = true;
  PetscFunctionReturn(0);
}

} // namespace tendril
