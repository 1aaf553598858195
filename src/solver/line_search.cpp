/// The line search `retraction`: along the manifold, rod by rod.
#include "tendril/solver/events.hpp"
#include "tendril/solver/newton.hpp"

#include <petsc/private/snesimpl.h>

#include <algorithm>

namespace tendril {

constexpr int most_trials = 40; // of lengths in a line search

const IncrementalPotential::RodEnergy &NewtonSolver::energyAtIterate(int r) {
  if (!work_->energy_known[r]) work_->energy[r] = potential_->rodEnergy(potential_->iterate(), r);
  work_->energy_known[r] = true;
  return work_->energy[r];
}

/// Whether the residual of a rod has fallen enough at the trial.
bool NewtonSolver::residualFalls(int r, double length, const IncrementalPotential::RodEnergy &trial) {
  constexpr double sufficient = 1e-4;
  Configuration &kept = work_->kept;
  if (kept.empty()) kept = potential_->iterate();
  kept.copyRod(potential_->elements(), r, potential_->iterate());
  potential_->accept(work_->trial, r);
  potential_->gradient(r);
  const Residual now = potential_->residual(r, trial), before = work_->residual[r];
  potential_->accept(kept, r);
  auto size = [](const Residual &residual) { return std::hypot(residual.force, residual.moment); };
  return now.isFinite() &&
         (size(now) <= (1 - sufficient * length) * size(before) || excess(now, rtol_) <= 1 || isAtNoise(now, rtol_));
}

/// Trial of one rod at a length of its increment, and its energy.
IncrementalPotential::RodEnergy NewtonSolver::tryLength(int r, double length) {
  ++report_.trials;
  (void)PetscLogEventBegin(events().configuration, 0, 0, 0, 0);
  double free = 1;
  const bool possible = potential_->tryMove(work_->increment, length, r, work_->trial, &free);
  (void)PetscLogEventEnd(events().configuration, 0, 0, 0, 0);
  (void)PetscLogEventBegin(events().energy, 0, 0, 0, 0);
  IncrementalPotential::RodEnergy energy =
      possible ? potential_->rodEnergy(work_->trial, r) : IncrementalPotential::RodEnergy{};
  energy.free = free;
  (void)PetscLogEventEnd(events().energy, 0, 0, 0, 0);
  return energy;
}

/// Whether the trial of a rod at a length is good. Wolfe's conditions take two trials more.
NewtonSolver::Length NewtonSolver::judgeLength(int r, double length, const Descent &d,
                                               const IncrementalPotential::RodEnergy &there) {
  constexpr double sufficient = 1e-4;
  if (!std::isfinite(there.value)) return Length::too_long;
  // Supports that move do work: the energy may rise with them, and only has to be finite.
  if (work_->moving[r] || d.free) return Length::good;
  const LineSearchKind kind = potential_->settings.line_search;
  if (kind == LineSearchKind::residual) return residualFalls(r, length, there) ? Length::good : Length::too_long;
  if (!(there.value <= d.before.value + sufficient * length * d.slope + d.before.noise)) return Length::too_long;
  constexpr double apart = 1e-3, flat = 0.9;
  if (kind != LineSearchKind::wolfe || -d.slope * length * apart < 10 * d.before.noise) return Length::good;
  const double beyond = tryLength(r, length * (1 + apart)).value, ahead = tryLength(r, length * (1 - apart)).value;
  tryLength(r, length); // is the trial again
  const double slope = (beyond - ahead) / (2 * apart * length);
  return slope < flat * d.slope ? Length::too_short : slope > -flat * d.slope ? Length::too_long : Length::good;
}

/// A length that is good; false where none is found. The trial is there, then.
bool NewtonSolver::findLength(int r, const Descent &d, double *lambda, IncrementalPotential::RodEnergy *there) {
  double low = 0, high = HUGE_VAL;
  *lambda = 1;
  for (int trial = 0; trial < most_trials; ++trial) {
    *there = tryLength(r, *lambda);
    const Length length = judgeLength(r, *lambda, d, *there);
    if (length == Length::good) return true;
    (length == Length::too_short ? low : high) = *lambda;
    if (there->free < 1) { // up to short of what is in the way
      *lambda *= std::max(0.95 * there->free, 0.2);
      continue;
    }
    if (potential_->settings.line_search == LineSearchKind::wolfe && std::isfinite(there->value)) {
      *lambda = std::isfinite(high) ? 0.5 * (low + high) : 2 * *lambda;
      continue;
    }
    // Minimum of the parabola through both energies and the slope, kept within a fifth and a half.
    const double curvature = there->value - d.before.value - *lambda * d.slope;
    const double best =
        std::isfinite(there->value) && curvature > 0 ? -d.slope * *lambda * *lambda / (2 * curvature) : 0.5 * *lambda;
    *lambda = std::clamp(best, 0.2 * *lambda, 0.5 * *lambda);
  }
  return false;
}

/// What a rod does for which no length is good; false where that is a failure.
bool NewtonSolver::standStill(int r, double *lambda) {
  Standstill &standstill = work_->standstill[r];
  double size;
  *lambda = 0; // where the rod stays
  if (excess(work_->residual[r], rtol_) <= 1) return true;
  if (!fresh_) return renew_ = true;
  if (!standstill.known) return false;
  if (!isLittle(r, &size) && !isNeutral(r)) {
    if (isAtNoise(work_->residual[r], 0)) lost_ = roundingMessage(r, size);
    return false;
  }
  standstill.iterations = most_trials; // what energies can tell is spent
  return true;
}

/// A full step that gained clearly more than a quadratic would: the minimum lies beyond, as on the way down from a
/// barrier.
void NewtonSolver::goBeyond(int r, const Descent &d, double *lambda, IncrementalPotential::RodEnergy *there) {
  const double gain = (there->value - d.before.value) / d.slope;
  if (potential_->settings.line_search != LineSearchKind::energy || d.free || *lambda != 1 ||
      !(gain > 0.6 && gain < 1) || !(-d.slope > 1e3 * d.before.noise))
    return;
  const double longer = std::min(2.0, 0.5 / (1 - gain));
  const IncrementalPotential::RodEnergy beyond = tryLength(r, longer);
  if (beyond.value < there->value) {
    *there = beyond;
    *lambda = longer;
  } else
    potential_->tryMove(work_->increment, 1, r, work_->trial);
}

/// Moves one rod along its increment; false when no length of the step lowers its energy enough.
bool NewtonSolver::searchRod(int r, double *lambda) {
  const RodRange &rod = potential_->elements().rods[r];
  Descent d;
  d.slope = -dot(rod, potential_->gradient(r).gradient, work_->increment);
  if (!std::isfinite(d.slope)) return false;
  for (int a = 0; a < slot_size; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); s += lanes) {
      const Pack step = read<Pack>(work_->increment[a] + s);
      write(work_->increment[a] + s, work_->moving[r] ? Pack(read<Pack>(work_->motion[a] + s) - step) : Pack(-step));
    }
  d.before = energyAtIterate(r);
  // Where the symmetric part is indefinite, couples have nothing that an equilibrium would minimise.
  d.free = seek_ == Seek::equilibrium ||
           (potential_->step().isStatic() && circulatory_ && circulatory_->acts(r) && work_->negative[r] > 0);
  Standstill &standstill = work_->standstill[r];
  standstill.known = fresh_ && !work_->indefinite[r] && !work_->moving[r];
  standstill.partial = work_->zero[r] > 0;
  standstill.energy = d.slope;
  IncrementalPotential::RodEnergy after;
  if (!findLength(r, d, lambda, &after)) return standStill(r, lambda);
  standstill.tiny = work_->indefinite[r] && *lambda >= 1 && sizeOf(r, work_->increment) < 1e-3;
  if (*lambda < 0.1) work_->last_shift[r] *= 16; // a shift that leaves too long a step is too small
  goBeyond(r, d, lambda, &after);
  potential_->accept(work_->trial, r);
  work_->energy[r] = after;
  work_->energy_known[r] = potential_->scene().moments.empty(); // the work of couples is counted from the iterate
  return true;
}

PetscErrorCode NewtonSolver::lineSearch(SNESLineSearch search) {
  Vec x, f, y;
  PetscBool changed;
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchGetVecs(search, &x, &f, &y, nullptr, nullptr));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(SNESLineSearchPreCheck(search, x, y, &changed));
  PetscCall(potential_->dofs().scatter(y, rods_, work_->increment));
  PetscCall(PetscLogEventBegin(events().line_search, 0, 0, 0, 0));
  double shortest = 1;
  bool accepted = true;
  std::vector<double> before; // the gradient, where secants are wanted
  if (potential_->settings.quasi_newton > 1) {
    PetscCall(copyValues(f, &before));
    lengths_.assign(rods_.end - rods_.begin, 0.0);
  }
  for (int r = rods_.begin; r < rods_.end && accepted; ++r) {
    if (!work_->active[r]) continue;
    double lambda;
    accepted = searchRod(r, &lambda);
    if (!before.empty()) lengths_[r - rods_.begin] = lambda;
    shortest = std::min(shortest, lambda);
    report_.edge_iterations += potential_->elements().rods[r].edges;
  }
  PetscCall(PetscLogEventEnd(events().line_search, 0, 0, 0, 0));
  PetscCall(SNESLineSearchSetLambda(search, shortest));
  if (!accepted) {
    PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_FAILED_REDUCT));
    PetscFunctionReturn(0);
  }
  PetscCall(writeIterate(x));
  PetscCall(SNESComputeFunction(snes_, x, f));
  if (!before.empty()) {
    PetscCall(potential_->dofs().gather(work_->increment, rods_, right_));
    PetscCall(secants_.add(potential_->dofs(), rods_, right_, lengths_, before, f));
  }
  PetscReal norm = 0; // only monitors look at it; those of x and y serve tests that are not used here
  if (snes_.object()->numbermonitors > 0) PetscCall(VecNorm(f, NORM_2, &norm));
  PetscCall(SNESLineSearchSetNorms(search, 0, norm, 0));
  PetscFunctionReturn(0);
}

/// Starts every rod from where its velocities lead when that is lower than the start.
void NewtonSolver::predict() {
  const DofMap &dofs = potential_->dofs();
  const double *freedom = potential_->elements().freedom();
  const StageRule &rule = *potential_->step().rule;
  const RetractionKind kind =
      potential_->settings.retraction == RetractionKind::length ? rule.lengths : potential_->settings.retraction;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int i = 0; i < rod.vertices; ++i)
      work_->increment.setVector(0, rod.slot(i), freedom[rod.slot(i)] * rule.guess.atVertex(rod.first_vertex + i));
    for (int i = 0; i < rod.edges; ++i)
      work_->increment[3][rod.slot(i)] = rod.twist ? rule.guess.atEdge(rod.first_edge + i) : 0;
    dofs.copyBehindRing(rod, work_->increment);
    if (!potential_->tryMove(work_->increment, 1, r, kind, work_->trial)) continue;
    const IncrementalPotential::RodEnergy energy = potential_->rodEnergy(work_->trial, r);
    if (!(energy.value < energyAtIterate(r).value)) continue;
    potential_->accept(work_->trial, r);
    if (rule.lengths == RetractionKind::additive) potential_->resetAxialForces(r);
    work_->energy[r] = energy;
    work_->energy_known[r] = potential_->scene().moments.empty();
  }
}

} // namespace tendril
