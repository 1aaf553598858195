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

/// Whether the residual of an island has fallen enough at the trial, or is at most so many times what it was.
bool NewtonSolver::residualFalls(RodSet island, double length, double most) {
  constexpr double sufficient = 1e-4;
  Configuration &kept = work_->kept;
  if (kept.empty()) kept = potential_->iterate();
  for (int r = island.begin; r < island.end; ++r) {
    kept.copyRod(potential_->elements(), r, potential_->iterate());
    potential_->accept(work_->trial, r);
  }
  potential_->gradient(island.begin);
  double size = 0, size_before = 0;
  bool finite = true, answer = true;
  for (int r = island.begin; r < island.end; ++r) {
    const Residual now = potential_->residual(r, work_->tried[r]), before = work_->residual[r];
    finite = finite && now.isFinite();
    answer = answer && (excess(now, rtol_) <= 1 || isAtNoise(now, rtol_));
    size = std::hypot(size, std::hypot(now.force, now.moment));
    size_before = std::hypot(size_before, std::hypot(before.force, before.moment));
  }
  for (int r = island.begin; r < island.end; ++r) potential_->accept(kept, r);
  return finite && (size <= most * (1 - sufficient * length) * size_before || answer);
}

/// Trial of joined rods at a length of their increment. Going straight, edges get longer by squares, which stiff ones
/// must not: the factored Hessian takes that back, as a second-order correction does for constraints (Nocedal and
/// Wright 2006, 18.3), wherever the rods are joined and held. False where it is impossible.
bool NewtonSolver::tryCorrected(RodSet island, double length, double *free) {
  constexpr int sweeps = 2;
  constexpr double little = 1e-10, too_long = 0.1; // of an edge; as strains are asked for
  const DofMap &dofs = potential_->dofs();
  Planes &step = work_->corrected, &response = work_->response;
  if (step.size() == 0) step = response = potential_->dofs().makePlanes();
  auto each = [&](auto visit) { // slots with unknowns
    for (int r = island.begin; r < island.end; ++r) {
      const RodRange &rod = dofs.rods()[r];
      for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); ++s) visit(s);
      dofs.forBeside({r, r + 1}, visit);
    }
  };
  each([&](int s) {
    for (int a = 0; a < slot_size; ++a) step[a][s] = length * work_->increment[a][s];
  });
  for (int sweep = 0;; ++sweep) {
    const bool possible = potential_->tryMove(step, 1, island, RetractionKind::additive, work_->trial, free);
    for (int r = island.begin; r < island.end && possible; ++r)
      potential_->setTrialForces(work_->increment, length, r, RetractionKind::length, work_->trial);
    if (!possible) return false;
    each([&](int s) { response.setVector(0, s, Vec3::Zero()), response[3][s] = 0; });
    double most = 0;
    for (int r = island.begin; r < island.end; ++r) {
      most = std::max(most, potential_->addExcess(work_->increment, length, work_->trial, r, response));
      dofs.fold(dofs.rods()[r], response);
    }
    dofs.foldJoined(island, response);
    if (most < little) return true;
    if (sweep == sweeps) return most < too_long; // where energies may rise, nothing else would stop it
    if (solveLinear(response, response)) return true;
    each([&](int s) {
      for (int a = 0; a < slot_size; ++a) step[a][s] -= response[a][s];
    });
  }
}

/// Trial of an island at a length of its increment, and its energy: sums over its rods.
IncrementalPotential::RodEnergy NewtonSolver::tryLength(RodSet island, double length) {
  IncrementalPotential::RodEnergy sum{0, 0};
  sum.steepness = 0;
  report_.trials += island.end - island.begin;
  (void)PetscLogEventBegin(events().configuration, 0, 0, 0, 0);
  double free = 1;
  const RetractionKind kind = potential_->settings.retraction;
  const bool joined = potential_->dofs().isCoupled(island),
             possible = joined && kind == RetractionKind::length
                            ? tryCorrected(island, length, &free)
                            : potential_->tryMove(work_->increment, length, island, kind, work_->trial, &free);
  for (int r = island.begin; r < island.end && possible && joined; ++r)
    potential_->setTermForces(work_->increment, length, r, work_->trial);
  (void)PetscLogEventEnd(events().configuration, 0, 0, 0, 0);
  (void)PetscLogEventBegin(events().energy, 0, 0, 0, 0);
  for (int r = island.begin; r < island.end; ++r) {
    IncrementalPotential::RodEnergy &energy = work_->tried[r];
    energy = possible ? potential_->rodEnergy(work_->trial, r) : IncrementalPotential::RodEnergy{};
    sum.include(energy);
  }
  sum.free = free;
  (void)PetscLogEventEnd(events().energy, 0, 0, 0, 0);
  return sum;
}

/// Whether the trial of an island at a length is good. Wolfe's conditions take two trials more.
NewtonSolver::Length NewtonSolver::judgeLength(RodSet island, double length, const Descent &d,
                                               const IncrementalPotential::RodEnergy &there) {
  constexpr double sufficient = 1e-4;
  if (!std::isfinite(there.value)) return Length::too_long;
  // Supports that move do work: the energy may rise with them, and only has to be finite.
  if (work_->moving[island.begin] || (d.free && !d.circulates)) return Length::good;
  constexpr double rise = 4; // on the way of full steps to an equilibrium that minimises nothing
  if (d.free) return residualFalls(island, length, rise) ? Length::good : Length::too_long;
  const LineSearchKind kind = potential_->settings.line_search;
  if (kind == LineSearchKind::residual) return residualFalls(island, length) ? Length::good : Length::too_long;
  if (!(there.value <= d.before.value + sufficient * length * d.slope + d.before.noise)) return Length::too_long;
  constexpr double apart = 1e-3, flat = 0.9;
  if (kind != LineSearchKind::wolfe || -d.slope * length * apart < 10 * d.before.noise) return Length::good;
  const double beyond = tryLength(island, length * (1 + apart)).value,
               ahead = tryLength(island, length * (1 - apart)).value;
  tryLength(island, length); // is the trial again
  const double slope = (beyond - ahead) / (2 * apart * length);
  return slope < flat * d.slope ? Length::too_short : slope > -flat * d.slope ? Length::too_long : Length::good;
}

/// A length that is good; false where none is found. The trial is there, then.
bool NewtonSolver::findLength(RodSet island, const Descent &d, double *lambda, IncrementalPotential::RodEnergy *there) {
  double low = 0, high = HUGE_VAL;
  *lambda = 1;
  for (int trial = 0; trial < most_trials; ++trial) {
    *there = tryLength(island, *lambda);
    const Length length = judgeLength(island, *lambda, d, *there);
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

/// What an island does for which no length is good; false where that is a failure.
bool NewtonSolver::standStill(RodSet island, double *lambda) {
  *lambda = 0; // where the rods stay
  for (int r = island.begin; r < island.end; ++r) {
    Standstill &standstill = work_->standstill[r];
    double size;
    if (excess(work_->residual[r], rtol_) <= 1) continue;
    if (!fresh_) return renew_ = true;
    if (!standstill.known) return false;
    if (!isLittle(r, &size) && !isNeutral(r)) {
      if (isAtNoise(work_->residual[r], 0)) lost_ = roundingMessage(r, size);
      return false;
    }
    standstill.iterations = most_trials; // what energies can tell is spent
  }
  return true;
}

/// A full step that gained clearly more than a quadratic would: the minimum lies beyond, as on the way down from a
/// barrier.
void NewtonSolver::goBeyond(RodSet island, const Descent &d, double *lambda, IncrementalPotential::RodEnergy *there) {
  const double gain = (there->value - d.before.value) / d.slope;
  if (potential_->settings.line_search != LineSearchKind::energy || d.free || *lambda != 1 ||
      !(gain > 0.6 && gain < 1) || !(-d.slope > 1e3 * d.before.noise))
    return;
  const double longer = std::min(2.0, 0.5 / (1 - gain));
  const std::vector<IncrementalPotential::RodEnergy> before(work_->tried.begin() + island.begin,
                                                            work_->tried.begin() + island.end);
  const IncrementalPotential::RodEnergy beyond = tryLength(island, longer);
  if (beyond.value < there->value) {
    *there = beyond;
    *lambda = longer;
    return;
  }
  report_.trials -= island.end - island.begin; // it has been counted
  tryLength(island, 1);
  std::copy(before.begin(), before.end(), work_->tried.begin() + island.begin);
}

/// Moves an island along its increment; false when no length of the step lowers its energy enough.
bool NewtonSolver::search(RodSet island, double *lambda) {
  const DofMap &dofs = potential_->dofs();
  const bool moving = work_->moving[island.begin];
  Descent d;
  const Planes &gradient = potential_->gradient(island.begin).gradient;
  d.slope = -dofs.dot(island, gradient, work_->increment);
  if (!std::isfinite(d.slope)) return false;
  d.before = {0, 0};
  // Where the symmetric part is indefinite, couples have nothing that an equilibrium would minimise.
  const bool circulates = work_->negative[island.begin] > 0 && this->circulates(island);
  d.free = seek_ == Seek::equilibrium || circulates;
  d.circulates = circulates && !potential_->elements().followers(island).empty();
  for (int r = island.begin; r < island.end; ++r) {
    const RodRange &rod = potential_->elements().rods[r];
    Standstill &standstill = work_->standstill[r];
    standstill.known = fresh_ && !work_->indefinite[r] && !moving;
    standstill.partial = work_->zero[r] > 0;
    standstill.energy = -dot(rod, gradient, work_->increment);
    for (const JoinedBody &b : dofs.bodies({r, r + 1}))
      for (const int s : {b.position, b.rotation})
        standstill.energy -= gradient.vector(0, s).dot(work_->increment.vector(0, s));
    for (int a = 0; a < slot_size; ++a)
      for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); s += lanes) {
        const Pack step = read<Pack>(work_->increment[a] + s);
        write(work_->increment[a] + s, moving ? Pack(read<Pack>(work_->motion[a] + s) - step) : Pack(-step));
      }
    dofs.forBeside({r, r + 1}, [&](int s) {
      const Vec3 step = work_->increment.vector(0, s);
      work_->increment.setVector(0, s, moving ? Vec3(work_->motion.vector(0, s) - step) : Vec3(-step));
    });
    d.before.include(energyAtIterate(r));
  }
  IncrementalPotential::RodEnergy after;
  if (!findLength(island, d, lambda, &after)) return standStill(island, lambda);
  for (int r = island.begin; r < island.end; ++r)
    work_->standstill[r].tiny = work_->indefinite[r] && *lambda >= 1 && sizeOf(r, work_->increment) < 1e-3;
  if (*lambda < 0.1) fill(work_->last_shift, island, 16 * work_->last_shift[island.begin]); // it left too long a step
  goBeyond(island, d, lambda, &after);
  for (int r = island.begin; r < island.end; ++r) {
    potential_->accept(work_->trial, r);
    work_->energy[r] = work_->tried[r];
    work_->energy_known[r] = potential_->hasPotential(); // the work of couples is counted from the iterate
  }
  potential_->carryTrees(island);
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
    lengths_.assign(islands_.size(), 0.0);
  }
  for (std::size_t n = 0; n < islands_.size() && accepted; ++n) {
    const RodSet island = islands_[n];
    if (!work_->active[island.begin]) continue;
    double lambda;
    accepted = this->search(island, &lambda);
    if (!before.empty()) lengths_[n] = lambda;
    shortest = std::min(shortest, lambda);
    for (int r = island.begin; r < island.end; ++r) report_.edge_iterations += potential_->elements().rods[r].edges;
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
    PetscCall(secants_.add(potential_->dofs(), islands_, right_, lengths_, before, f));
  }
  PetscReal norm = 0; // only monitors look at it; those of x and y serve tests that are not used here
  if (snes_.object()->numbermonitors > 0) PetscCall(VecNorm(f, NORM_2, &norm));
  PetscCall(SNESLineSearchSetNorms(search, 0, norm, 0));
  PetscFunctionReturn(0);
}

/// Starts every island from where its velocities lead when that is lower than the start.
void NewtonSolver::predict() {
  const DofMap &dofs = potential_->dofs();
  const double *freedom = potential_->elements().freedom();
  const StageRule &rule = *potential_->step().rule;
  const RetractionKind kind =
      potential_->settings.retraction == RetractionKind::length ? rule.lengths : potential_->settings.retraction;
  for (const RodSet island : islands_) {
    for (int r = island.begin; r < island.end; ++r) {
      const RodRange &rod = dofs.rods()[r];
      for (int i = 0; i < rod.vertices; ++i)
        work_->increment.setVector(0, rod.slot(i), freedom[rod.slot(i)] * rule.guess.atVertex(rod.first_vertex + i));
      for (int i = 0; i < rod.edges; ++i)
        work_->increment[3][rod.slot(i)] = rod.twist ? rule.guess.atEdge(rod.first_edge + i) : 0;
      dofs.copyBehindRing(rod, work_->increment);
    }
    potential_->setBodies(island, work_->increment, [&](const JoinedBody &b) { return rule.guess.ofBody(b.body); });
    dofs.copyJoined(island, work_->increment);
    potential_->turnFrames(island, work_->increment);
    if (!potential_->tryMove(work_->increment, 1, island, kind, work_->trial)) continue;
    if (dofs.isCoupled(island)) // whose edges get longer by squares: forces as if they did not
      for (int r = island.begin; r < island.end; ++r)
        potential_->setTrialForces(work_->increment, 1, r, kind, work_->trial);
    double before = 0, after = 0;
    for (int r = island.begin; r < island.end; ++r) {
      work_->tried[r] = potential_->rodEnergy(work_->trial, r);
      after += work_->tried[r].value - potential_->violation(work_->trial, r);
      before += energyAtIterate(r).value - potential_->violation(potential_->iterate(), r);
    }
    if (!(after < before)) continue;
    for (int r = island.begin; r < island.end; ++r) {
      potential_->accept(work_->trial, r);
      if (rule.lengths == RetractionKind::additive) potential_->resetAxialForces(r);
      work_->energy[r] = work_->tried[r];
      work_->energy_known[r] = potential_->hasPotential();
    }
  }
}

} // namespace tendril
