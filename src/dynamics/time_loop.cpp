#include "tendril/dynamics/time_loop.hpp"

#include <algorithm>
#include <petsctime.h>
#include <sstream>

namespace tendril {

Step TimeLoop::stepOf(const LoopSettings &settings, const State &state, double dt) {
  Step step;
  step.dt = settings.dynamic ? dt : 0;
  step.time = state.time + dt;
  if (std::abs(step.time - settings.t_end) < 1e-9 * settings.dt) step.time = settings.t_end; // no sliver of a step from rounding
  step.load_factor = settings.dynamic ? 1 : step.time;
  step.mixed = settings.mixed;
  step.hessian = settings.hessian;
  return step;
}

/// Stability was lost within the step: finds where, and moves `start` there when the run is to end.
PetscErrorCode TimeLoop::locate(State &start, const Step &step, bool *stop) {
  PetscFunctionBeginUser;
  CriticalPoint point;
  bool found;
  PetscCall(locateCritical(solver_, start, step, &point, &found));
  if (!found) PetscFunctionReturn(0);
  located_ = point.load_factor;
  if (on_critical) PetscCall(on_critical(point));
  *stop = settings_.bifurcation == Bifurcation::stop;
  if (*stop) start = *point.state;
  PetscFunctionReturn(0);
}

PetscErrorCode TimeLoop::run(State &state, const Observer &observe, bool *finished) {
  PetscFunctionBeginUser;
  const IncrementalPotential &potential = solver_.potential();
  const double dt_min = settings_.dt_min > 0 ? settings_.dt_min : settings_.dt / 1024;
  if (control.dt == 0) control.dt = settings_.dt;
  auto &[dt, good, stable] = control;
  int rejected = 0;
  PetscLogDouble begin, now;
  PetscCall(PetscTime(&begin));
  EnergyBudget before = energyBudget(potential.scene(), potential.elements(), state, settings_.dynamic ? 1 : state.time);
  *finished = false;
  State next = state; // what the blocks that have converged come to; the state itself stays as it is until all have
  EnergyBudget energy;
  while (state.time < settings_.t_end) {
    const double h = std::min(dt, settings_.t_end - state.time);
    const Step step = stepOf(settings_, state, h);
    NewtonReport report;
    energy = {};
    solver_.on_block = [&](RodSet rods) {
      potential.commit(next, rods);
      for (int r = rods.begin; r < rods.end; ++r)
        energy += energyBudget(potential.scene(), potential.elements(), next, potential.iterate(), settings_.dynamic ? 1 : step.time, r);
    };
    PetscCall(solver_.solve(state, step, &report));
    solver_.on_block = nullptr;
    // Couples have no potential: the inertia of the symmetric part says nothing about stability.
    const bool detects = !settings_.dynamic && settings_.bifurcation != Bifurcation::off && potential.scene().moments.empty();
    if (detects && stable && report.first_negative_pivots > 0 && located_ <= state.time) {
      bool stop = false;
      PetscCall(locate(state, step, &stop));
      *finished = stop;
      if (stop) PetscFunctionReturn(0);
    }
    if (report.converged) {
      next.time = step.time;
      next.step = state.step + 1;
      std::swap(state, next);
    }
    if (!report.converged) { // the state was not touched
      ++rejected;
      good = 0;
      dt = 0.5 * h;
      if (dt >= std::min(dt_min, (settings_.t_end - state.time) / 1024)) continue; // a short last step may be halved as often
      std::ostringstream message;
      message << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " failed with " << (settings_.dynamic ? "dt " : "increment ")
              << h << ": " << report.reason << " (" << report.iterations << " iterations; residual " << report.residual.force << " of the load, "
              << report.residual.moment << " of its moment, where -snes_rtol is asked for)";
      failure_ = message.str();
      PetscFunctionReturn(0);
    }
    stable = report.negative_pivots == 0;
    if (!settings_.dynamic && report.iterations <= 4 && report.escapes == 0) // load steps grow where they are easy
      dt = std::min(2 * dt, 4 * settings_.dt);
    else if (dt < settings_.dt && ++good >= 4) {
      dt = std::min(2 * dt, settings_.dt);
      good = 0;
    }
    Diagnostics row;
    row.time = state.time;
    row.dt = h;
    row.energy = energy;
    row.dissipated = before.total() - row.energy.total();
    before = row.energy;
    row.newton_iterations = report.iterations;
    row.line_search_trials = report.trials;
    row.negative_pivots = report.negative_pivots;
    row.rejected_steps = rejected;
    PetscCall(PetscTime(&now));
    row.wall_seconds = now - begin;
    rejected = 0;
    PetscCall(observe(state, row));
  }
  *finished = true;
  PetscFunctionReturn(0);
}

} // namespace tendril
