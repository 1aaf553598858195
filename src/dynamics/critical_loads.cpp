/// Critical loads within a load step: where they are, and the branch that leaves there.
#include "tendril/dynamics/time_loop.hpp"

#include <algorithm>

namespace tendril {

/// Whether to look also where Newton only met indefinite Hessians, and behind a critical point for more. It costs some
/// solves of the step.
bool TimeLoop::isThorough() const {
  return settings_.bifurcation != Bifurcation::locate || solver_.potential().scene().edges() <= most_searched_edges;
}

/// Stability may be lost within the step: finds where, as often as the way that the run takes loses it, and moves
/// `start` there when the run is to end or to go on along another branch.
PetscErrorCode TimeLoop::locate(State &start, const Step &step, bool *moved) {
  constexpr double growth =
      8; // of the parts of a step behind a critical point: the shape changes by the root of the way there
  PetscFunctionBeginUser;
  State from = start, ahead;
  Step part = step;
  double reach = located_ > 0 ? growth * (start.time - located_) : step.time - start.time;
  auto settle = [&](const State &at, double factor, NewtonReport *report) { // the way that the run takes
    PetscFunctionBeginUser;
    part.time = part.load_factor = factor;
    PetscCall(solver_.solve(at, part, report));
    ahead = at;
    if (report->converged) solver_.potential().commit(ahead);
    PetscFunctionReturn(0);
  };
  for (bool more = true; more; more = part.time < step.time) {
    NewtonReport report;
    report.shifts = 1; // of the whole step that is known
    const double end = std::min(step.time, from.time + reach);
    if (from.time > start.time || end < step.time) {
      PetscCall(settle(from, end, &report));
      if (!report.converged) break;
    }
    CriticalPoint point;
    bool found = false;
    if (report.mayPassCritical()) PetscCall(locateNext(from, part, &point, &found));
    reach = growth * (end - from.time);
    if (found) {
      point.state->step = start.step;
      located_ = point.load_factor;
      if (on_critical) PetscCall(on_critical(point));
      bool leaves = false;
      Planes mode;
      if (settings_.bifurcation == Bifurcation::switch_branch)
        PetscCall(criticalMode(solver_, point, step, &mode, &leaves));
      if (leaves) mode_ = std::move(mode);
      *moved = settings_.bifurcation == Bifurcation::stop || leaves;
      if (*moved) start = *point.state;
      if (*moved || !point.lost || !isThorough()) break;
      PetscCall(settle(*point.lost, point.lost->time, &report));
      if (!report.converged) break;
      reach = growth * (part.time - point.load_factor);
    }
    from = ahead;
  }
  PetscFunctionReturn(0);
}

/// Where stability is lost first between an equilibrium and the end of the step.
PetscErrorCode TimeLoop::locateNext(const State &start, const Step &step, CriticalPoint *point, bool *found) {
  PetscFunctionBeginUser;
  const double width = step.time - start.time;
  const SharpTolerance sharp(solver_);
  auto follow = [&](const BranchPoint &from, double factor, BranchPoint *to) -> PetscErrorCode {
    PetscFunctionBeginUser;
    *to = from;
    to->parameter = factor;
    to->found = false;
    if (factor <= 0) PetscFunctionReturn(0); // without loads a rod may be in any position
    Step there = step;
    there.time = there.load_factor = factor;
    NewtonReport report;
    PetscCall(solver_.solve(from.state, there, &report, Seek::equilibrium));
    to->found = report.converged && SharpTolerance::isMet(report.residual);
    if (!to->found) PetscFunctionReturn(0);
    PetscCall(countUnstable(solver_, &to->unstable));
    solver_.potential().commit(to->state);
    to->found = to->unstable >= 0 && areNear(solver_.team(), from, *to, width);
    PetscFunctionReturn(0);
  };
  BranchPoint low;
  low.parameter = start.time;
  low.state = start;
  PetscCall(locateCritical(solver_, step, follow, low, step.time, std::abs(step.time), located_, point, found));
  constexpr double early = 0.1; // of the way: a short one leaves the factor as many digits
  for (double high = step.time; *found && point->load_factor - start.time < early * (high - start.time);) {
    CriticalPoint again;
    bool same;
    high = 2 * point->load_factor - start.time;
    PetscCall(locateCritical(solver_, step, follow, low, high, std::abs(high), located_, &again, &same));
    if (!same) break;
    *point = std::move(again);
  }
  PetscFunctionReturn(0);
}

static bool tryTogether(StepSolver &solver, const Planes &increment, double scale, Configuration &trial) {
  return solver.team().all(solver.potential().tryMove(increment, scale, trial));
}

static double energyOfAll(const StepSolver &solver, const Configuration &c) {
  ExactSum sum;
  for (int r = 0; r < solver.potential().all().end; ++r) sum.add(solver.potential().energy(c, {r, r + 1}));
  Tally tally;
  solver.team().combine(tally.sum(sum));
  return sum.value();
}

/// Displacements along the critical mode from which Newton begins a step: as long, and to the side, as lowers the
/// energy most.
Guess TimeLoop::alongMode(const State &start, const Step &step) {
  IncrementalPotential &potential = solver_.potential();
  solver_.begin(start, step);
  Configuration trial = potential.iterate();
  double best = HUGE_VAL, best_scale = 0;
  for (double scale = 1e-6; scale < 2; scale *= 2)
    for (const double s : {scale, -scale}) {
      const double energy = tryTogether(solver_, *mode_, s, trial) ? energyOfAll(solver_, trial) : HUGE_VAL;
      if (!(energy < best) || best - energy < 1e-12 * std::abs(energy)) continue; // the first of two that are alike
      best = energy;
      best_scale = s;
    }
  Guess guess{potential.dofs().makePlanes(), {}};
  if (!tryTogether(solver_, *mode_, best_scale, trial)) return guess;
  potential.accept(trial);
  potential.coordinates(guess.unknowns);
  return guess;
}

} // namespace tendril
