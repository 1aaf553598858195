#include "tendril/solver/newton.hpp"

#include "tendril/solver/banded.hpp"
#include "tendril/solver/events.hpp"

#include <petsc/private/linesearchimpl.h>

#include <algorithm>
#include <cmath>

namespace tendril {
namespace {

constexpr const char *line_search_name = "retraction";

PetscErrorCode functionCallback(SNES, Vec x, Vec f, void *context) { return static_cast<NewtonSolver *>(context)->evaluate(x, f); }

PetscErrorCode jacobianCallback(SNES, Vec, Mat, Mat p, void *context) { return static_cast<NewtonSolver *>(context)->assemble(p); }

PetscErrorCode convergenceCallback(SNES, PetscInt it, PetscReal, PetscReal, PetscReal, SNESConvergedReason *reason, void *context) {
  return static_cast<NewtonSolver *>(context)->testConvergence(it, reason);
}

PetscErrorCode lineSearchApply(SNESLineSearch search) {
  SNES snes;
  void *context;
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchGetSNES(search, &snes));
  PetscCall(SNESGetApplicationContext(snes, &context));
  PetscCall(static_cast<NewtonSolver *>(context)->lineSearch(search));
  PetscFunctionReturn(0);
}

PetscErrorCode createLineSearch(SNESLineSearch search) {
  PetscFunctionBeginUser;
  search->ops->apply = lineSearchApply;
  PetscFunctionReturn(0);
}

/// Diagonal by which an indefinite Hessian is shifted: the mass of each position, and for twists a moment of the same mass over the
/// edge's length, so that both see curvature on the scale of an edge alike. Independent of units and of the time step.
Planes shiftMetric(const Elements &e, const DofMap &dofs) {
  Planes metric = dofs.makePlanes();
  const double *mass = e.mass(), *length = e.restLength();
  for (const RodRange &rod : e.rods) {
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) metric.setVector(0, s, Vec3::Constant(mass[s]));
    if (rod.twist)
      for (int i = 0; i < rod.edges; ++i) metric[3][rod.slot(i)] = 0.5 * (mass[rod.slot(i)] + mass[rod.slot((i + 1) % rod.vertices)]) * std::pow(length[rod.slot(i)], 2);
  }
  return metric;
}

/// Sum over the slots of a rod.
double dot(const RodRange &rod, const Planes &a, const Planes &b) {
  Pack sum(0.0);
  for (int k = 0; k < slot_size; ++k)
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) sum += read<Pack>(a[k] + s) * read<Pack>(b[k] + s);
  return reduce(sum);
}

} // namespace

bool isSmall(const IncrementalPotential::Residual &r, double rtol) {
  return r.force <= std::max(rtol, r.force_floor) && r.moment <= std::max(rtol, r.moment_floor) &&
         r.compatibility <= std::max(1e-4 * rtol, r.compatibility_floor);
}

PetscErrorCode registerSolvers() {
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchRegister(line_search_name, createLineSearch));
  PetscCall(registerBanded());
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::setUp(IncrementalPotential &potential) {
  KSP ksp;
  PC pc;
  SNESLineSearch search;
  PetscFunctionBeginUser;
  potential_ = &potential;
  DofMap &dofs = potential.dofs();
  const std::size_t rods = dofs.rods().size();
  metric_ = shiftMetric(potential.elements(), dofs);
  increment_ = dofs.makePlanes();
  energy_.resize(rods);
  energy_known_.assign(rods, false);
  negative_.assign(rods, 0);
  last_shift_.assign(rods, 0);
  residual_.resize(rods);
  moving_.assign(rods, false);
  system_ = {&dofs, &potential.band(), &metric_, std::vector<char>(rods, true), std::vector<double>(rods, 0)};
  PetscCall(DMCreateGlobalVector(dofs.dm(), x_.out()));
  for (OwnedVec *v : {&f_, &right_, &solution_}) PetscCall(VecDuplicate(x_, v->out()));
  PetscCall(SNESCreate(PETSC_COMM_WORLD, snes_.out()));
  PetscCall(SNESSetDM(snes_, dofs.dm()));
  PetscCall(SNESSetApplicationContext(snes_, this));
  PetscCall(SNESSetType(snes_, SNESNEWTONLS));
  PetscCall(SNESSetFunction(snes_, f_, functionCallback, this));
  PetscCall(SNESSetConvergenceTest(snes_, convergenceCallback, this, nullptr));
  // A step length of zero is never convergence: stol 0. rtol is relative to the load scale of each rod.
  PetscCall(SNESSetTolerances(snes_, 0, 1e-6, 0, 100, PETSC_MAX_INT));
  PetscCall(SNESSetMaxLinearSolveFailures(snes_, PETSC_MAX_INT)); // a singular Hessian is shifted by the line search
  PetscCall(SNESGetLineSearch(snes_, &search));
  PetscCall(SNESLineSearchSetType(search, line_search_name));
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCCHOLESKY));
  PetscCall(PCFactorSetMatSolverType(pc, "banded"));
  PetscCall(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
  PetscCall(PCFactorSetZeroPivot(pc, 1e-250)); // for PETSc's own: pivots have the units of a stiffness, no absolute bound makes sense
  PetscCall(SNESSetFromOptions(snes_));
  MatSolverType type = nullptr;
  PetscBool cholesky;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  PetscCall(PCFactorGetMatSolverType(pc, &type));
  banded_ = cholesky && type && std::string(type) == "banded";
  if (banded_) // factored straight from the band; every other solver gets a matrix of PETSc's own
    PetscCall(createBandedMatrix(&system_, jacobian_.out()));
  else
    PetscCall(dofs.createMatrix(jacobian_.out()));
  PetscCall(SNESSetJacobian(snes_, jacobian_, jacobian_, jacobianCallback, this));
  if (type && std::string(type) == MATSOLVERMUMPS) { // MUMPS counts pivots only when it looks for null ones
    PetscBool given;
    PetscCall(PetscOptionsHasName(nullptr, nullptr, "-mat_mumps_icntl_24", &given));
    if (!given) PetscCall(PetscOptionsSetValue(nullptr, "-mat_mumps_icntl_24", "1"));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::moveTo(Vec x) {
  PetscObjectState state;
  PetscFunctionBeginUser;
  PetscCall(PetscObjectStateGet((PetscObject)x, &state));
  if (x == iterate_vec_ && state == iterate_state_) PetscFunctionReturn(0);
  Planes wanted = potential_->dofs().makePlanes();
  PetscCall(potential_->dofs().scatter(x, wanted));
  potential_->moveTo(wanted);
  forgetEnergies();
  iterate_vec_ = x;
  iterate_state_ = state;
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::writeIterate(Vec x) {
  PetscFunctionBeginUser;
  potential_->coordinates(coordinates_);
  PetscCall(potential_->dofs().gather(coordinates_, x));
  iterate_vec_ = x;
  PetscCall(PetscObjectStateGet((PetscObject)x, &iterate_state_));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::evaluate(Vec x, Vec f) {
  PetscFunctionBeginUser;
  PetscCall(moveTo(x));
  PetscCall(PetscLogEventBegin(events().derivatives, 0, 0, 0, 0));
  const Derivatives &d = potential_->derivatives();
  PetscCall(PetscLogEventEnd(events().derivatives, 0, 0, 0, 0));
  PetscCall(potential_->dofs().gather(d.gradient, f, &system_.wanted));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::assemble(Mat) {
  PetscFunctionBeginUser;
  potential_->derivatives();
  std::fill(system_.shift.begin(), system_.shift.end(), 0.0);
  PetscCall(refill());
  PetscFunctionReturn(0);
}

/// The matrix to the present band and shifts.
PetscErrorCode NewtonSolver::refill() {
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(events().fill, 0, 0, 0, 0));
  if (banded_)
    PetscCall(PetscObjectStateIncrease((PetscObject)jacobian_.object()));
  else {
    PetscCall(potential_->dofs().fillMatrix(potential_->band(), jacobian_));
    if (std::any_of(system_.shift.begin(), system_.shift.end(), [](double shift) { return shift != 0; })) {
      Planes diagonal = metric_;
      for (std::size_t r = 0; r < system_.shift.size(); ++r) {
        const RodRange &rod = potential_->elements().rods[r];
        for (int a = 0; a < slot_size; ++a)
          for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) diagonal[a][s] *= system_.shift[r];
      }
      PetscCall(potential_->dofs().gather(diagonal, right_));
      PetscCall(MatDiagonalSet(jacobian_, right_, ADD_VALUES));
    }
  }
  PetscCall(PetscLogEventEnd(events().fill, 0, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::refactor() {
  KSP ksp;
  PetscFunctionBeginUser;
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(refill());
  PetscCall(KSPSetOperators(ksp, jacobian_, jacobian_));
  PetscCall(KSPSetUp(ksp));
  PetscFunctionReturn(0);
}

/// With the matrix factored last; rods that are not wanted have the solution zero.
PetscErrorCode NewtonSolver::solveLinear(const Planes &right, Planes &solution) {
  KSP ksp;
  PetscFunctionBeginUser;
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(potential_->dofs().gather(right, right_));
  PetscCall(KSPSolve(ksp, right_, solution_));
  PetscCall(potential_->dofs().scatter(solution_, solution));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::testConvergence(PetscInt iteration, SNESConvergedReason *reason) {
  PetscReal rtol;
  PetscInt limit;
  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(snes_, nullptr, &rtol, nullptr, &limit, nullptr));
  rtol *= sharpness_;
  report_.iterations = int(iteration);
  const bool moving = potential_->remainingMotion(motion_);
  bool done = true, finite = true;
  IncrementalPotential::Residual &worst = report_.residual = {};
  for (int r = 0; r < potential_->rods(); ++r) {
    const RodRange &rod = potential_->elements().rods[r];
    IncrementalPotential::Residual &residual = residual_[r];
    if (system_.wanted[r]) { // a rod that has converged takes no part any more
      residual = potential_->residual(r);
      moving_[r] = moving && dot(rod, motion_, motion_) > 0;
      finite = finite && residual.isFinite();
      system_.wanted[r] = moving_[r] || !isSmall(residual, rtol);
      done = done && !system_.wanted[r];
    }
    worst.include(residual);
  }
  report_.history.push_back(worst.force);
  *reason = SNES_CONVERGED_ITERATING;
  if (!finite)
    *reason = SNES_DIVERGED_FNORM_NAN;
  else if (done)
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
  else if (iteration >= limit)
    *reason = SNES_DIVERGED_MAX_IT;
  PetscFunctionReturn(0);
}

/// Negative pivots of the factored matrix, per rod where the factorisation tells; `regular` is false when it broke down. Factorisations without
/// inertia (LU, iterative solvers) report none.
PetscErrorCode NewtonSolver::readInertia(bool *regular) {
  KSP ksp;
  PC pc;
  Mat factor;
  PetscBool cholesky;
  PCFailedReason failed;
  PetscFunctionBeginUser;
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCGetFailedReason(pc, &failed));
  *regular = failed == PC_NOERROR;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  std::fill(negative_.begin(), negative_.end(), 0);
  report_.neutral_pivots = report_.negative_pivots = 0;
  if (!cholesky || !*regular) PetscFunctionReturn(0);
  PetscCall(PCFactorGetMatrix(pc, &factor));
  if (const BandedFactor *banded = banded_ ? bandedFactorOf(factor) : nullptr) {
    for (int r = 0; r < potential_->rods(); ++r) {
      if (system_.wanted[r]) negative_[r] = banded->negativePivots(r);
      report_.negative_pivots += banded->negativePivots(r);
      report_.neutral_pivots += banded->neutralPivots(r);
    }
  } else {
    PetscInt minus, zero, plus;
    PetscCall(MatGetInertia(factor, &minus, &zero, &plus));
    std::fill(negative_.begin(), negative_.end(), int(minus));
    report_.negative_pivots = int(minus);
    report_.neutral_pivots = int(zero);
  }
  PetscFunctionReturn(0);
}

/// Newton direction for supports that still have to move: solves again with their increments on the right-hand side.
PetscErrorCode NewtonSolver::includeMotion(Vec y) {
  KSP ksp;
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  Planes right = dofs.makePlanes();
  for (const RodRange &rod : dofs.rods()) {
    potential_->band().multiply(rod, motion_, right);
    dofs.fold(rod, right);
  }
  const Planes &gradient = potential_->derivatives().gradient;
  for (std::size_t k = 0; k < right.size(); ++k) right.data()[k] += gradient.data()[k];
  PetscCall(dofs.gather(right, right_, &system_.wanted));
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPSolve(ksp, right_, y));
  PetscFunctionReturn(0);
}

const IncrementalPotential::RodEnergy &NewtonSolver::energyAtIterate(int r) {
  if (!energy_known_[r]) energy_[r] = potential_->rodEnergy(potential_->iterate(), r);
  energy_known_[r] = true;
  return energy_[r];
}

/// Moves one rod along its increment; false when no length of the step lowers its energy enough.
bool NewtonSolver::searchRod(int r, double *lambda) {
  constexpr double sufficient = 1e-4;
  constexpr int most_trials = 40;
  const RodRange &rod = potential_->elements().rods[r];
  double slope = -dot(rod, potential_->derivatives().gradient, increment_);
  if (!std::isfinite(slope)) return false;
  for (int a = 0; a < slot_size; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); s += lanes) {
      const Pack d = read<Pack>(increment_[a] + s);
      write(increment_[a] + s, moving_[r] ? Pack(read<Pack>(motion_[a] + s) - d) : Pack(-d));
    }
  const IncrementalPotential::RodEnergy before = energyAtIterate(r);
  IncrementalPotential::RodEnergy after;
  auto attempt = [&](double length) {
    ++report_.trials;
    (void)PetscLogEventBegin(events().configuration, 0, 0, 0, 0);
    const bool possible = potential_->tryMove(increment_, length, r, trial_);
    (void)PetscLogEventEnd(events().configuration, 0, 0, 0, 0);
    (void)PetscLogEventBegin(events().energy, 0, 0, 0, 0);
    const IncrementalPotential::RodEnergy energy = possible ? potential_->rodEnergy(trial_, r) : IncrementalPotential::RodEnergy{};
    (void)PetscLogEventEnd(events().energy, 0, 0, 0, 0);
    return energy;
  };
  *lambda = 1;
  bool accepted = false;
  for (int trial = 0; trial < most_trials && !accepted; ++trial) {
    after = attempt(*lambda);
    // Supports that move do work: the energy may rise with them, and only has to be finite.
    accepted = std::isfinite(after.value) && (moving_[r] || seek_ == Seek::equilibrium || after.value <= before.value + sufficient * *lambda * slope + before.noise);
    if (accepted) break;
    // Minimum of the parabola through both energies and the slope, kept within a fifth and a half.
    const double curvature = after.value - before.value - *lambda * slope;
    const double best = std::isfinite(after.value) && curvature > 0 ? -slope * *lambda * *lambda / (2 * curvature) : 0.5 * *lambda;
    *lambda = std::clamp(best, 0.2 * *lambda, 0.5 * *lambda);
  }
  if (!accepted) return false;
  // A full step that gained clearly more than a quadratic would: the minimum lies beyond, as on the way down from a barrier.
  const double gain = (after.value - before.value) / slope;
  if (*lambda == 1 && gain > 0.6 && gain < 1 && -slope > 1e3 * before.noise) {
    const double longer = std::min(2.0, 0.5 / (1 - gain));
    const IncrementalPotential::RodEnergy beyond = attempt(longer);
    if (beyond.value < after.value) {
      after = beyond;
      *lambda = longer;
    } else
      potential_->tryMove(increment_, 1, r, trial_);
  }
  potential_->accept(trial_, r);
  energy_[r] = after;
  energy_known_[r] = potential_->scene().moments.empty(); // the work of couples is counted from the iterate
  return true;
}

PetscErrorCode NewtonSolver::lineSearch(SNESLineSearch search) {
  Vec x, f, y;
  bool regular;
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchGetVecs(search, &x, &f, &y, nullptr, nullptr));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(moveTo(x));
  PetscCall(readInertia(&regular));
  if (seek_ == Seek::minimum && (report_.negative_pivots > 0 || !regular)) PetscCall(makeDescent(f, y, regular));
  if (std::any_of(moving_.begin(), moving_.end(), [](char m) { return m; })) PetscCall(includeMotion(y));
  PetscCall(potential_->dofs().scatter(y, increment_));

  PetscCall(PetscLogEventBegin(events().line_search, 0, 0, 0, 0));
  double shortest = 1;
  bool accepted = true;
  for (int r = 0; r < potential_->rods() && accepted; ++r) {
    if (!system_.wanted[r]) continue;
    double lambda;
    accepted = searchRod(r, &lambda);
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
  PetscReal xnorm, fnorm, ynorm;
  PetscCall(VecNorm(x, NORM_2, &xnorm));
  PetscCall(VecNorm(f, NORM_2, &fnorm));
  PetscCall(VecNorm(y, NORM_2, &ynorm));
  PetscCall(SNESLineSearchSetNorms(search, xnorm, fnorm, ynorm));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::inertiaAtIterate(int *negative) {
  bool regular;
  PetscFunctionBeginUser;
  std::fill(system_.wanted.begin(), system_.wanted.end(), true);
  PetscCall(assemble(jacobian_));
  PetscCall(refactor());
  PetscCall(readInertia(&regular));
  *negative = regular ? report_.negative_pivots : -1;
  PetscFunctionReturn(0);
}

/// SNES from the potential's iterate. `failure` is null when it converged.
PetscErrorCode NewtonSolver::newton(const char **failure) {
  SNESConvergedReason reason;
  PetscFunctionBeginUser;
  std::fill(system_.wanted.begin(), system_.wanted.end(), true);
  PetscCall(writeIterate(x_));
  const int before = report_.iterations;
  PetscCall(SNESSolve(snes_, nullptr, x_));
  report_.iterations += before;
  PetscCall(SNESGetConvergedReason(snes_, &reason));
  *failure = nullptr;
  if (reason > 0) PetscFunctionReturn(0);
  switch (reason) {
  case SNES_DIVERGED_MAX_IT:
    *failure = "the iteration limit (-snes_max_it) was reached";
    break;
  case SNES_DIVERGED_LINE_SEARCH:
    *failure = "no step along the search direction lowers the energy";
    break;
  case SNES_DIVERGED_FNORM_NAN:
  case SNES_DIVERGED_FUNCTION_DOMAIN:
    *failure = "the forces are not finite";
    break;
  case SNES_DIVERGED_LINEAR_SOLVE:
    *failure = "the linear solve failed";
    break;
  default:
    *failure = SNESConvergedReasons[reason];
  }
  PetscFunctionReturn(0);
}

/// A hint for failures next to an angle of 180 degrees between neighbouring edges, where energies grow without bound.
std::string NewtonSolver::nearBarrier() const {
  const Elements &e = potential_->elements();
  const Configuration &c = potential_->iterate();
  double twist = 0, turning = 0;
  for (int r = 0; r < potential_->rods(); ++r)
    forCells(e, r, [&]<class T>(const LooseCell &cell, int count) {
      for (int l = 0; l < count; ++l) {
        if (e.measure[r] == Measure::tan) twist = std::max(twist, std::abs(c[Configuration::twist][cell.slot + l]));
        turning = std::max(turning, std::acos(std::clamp(c.frameAt(cell.frame0 + l).tangent.dot(c.frameAt(cell.frame1 + l).tangent), -1.0, 1.0)));
      }
    });
  constexpr double near = 150, degrees = 180 / pi;
  std::string hint;
  if (twist * degrees > near)
    hint += "; neighbouring edges are twisted by " + std::to_string(int(twist * degrees)) + " degrees, and measure tan has a barrier at 180: use more edges, or measure: angle";
  if (turning * degrees > near) hint += "; neighbouring edges are folded by " + std::to_string(int(turning * degrees)) + " degrees of at most 180: use more edges";
  return hint;
}

/// Factors once before the first step, so that mistakes in solver options come to light in time.
PetscErrorCode NewtonSolver::rehearse(const State &start, const Step &step) {
  int negative;
  PetscFunctionBeginUser;
  potential_->beginStep(start, step);
  PetscCall(inertiaAtIterate(&negative));
  report_ = {};
  PetscFunctionReturn(0);
}

/// Starts every rod from where its velocities lead when that is lower than the start.
void NewtonSolver::predict(const State &start, const Step &step) {
  const DofMap &dofs = potential_->dofs();
  const double *freedom = potential_->elements().freedom();
  for (const RodRange &rod : dofs.rods()) {
    for (int i = 0; i < rod.vertices; ++i)
      for (int a = 0; a < 3; ++a) increment_[a][rod.slot(i)] = freedom[rod.slot(i)] * step.dt * start.velocity[rod.first_vertex + i][a];
    for (int i = 0; i < rod.edges; ++i) increment_[3][rod.slot(i)] = rod.twist ? step.dt * start.twist_rate[rod.first_edge + i] : 0;
  }
  dofs.copyBehindRings(increment_);
  const RetractionKind kind = potential_->retraction == RetractionKind::length ? RetractionKind::continued : potential_->retraction;
  for (int r = 0; r < potential_->rods(); ++r) {
    if (!potential_->tryMove(increment_, 1, r, kind, trial_)) continue;
    const IncrementalPotential::RodEnergy energy = potential_->rodEnergy(trial_, r);
    if (!(energy.value < energyAtIterate(r).value)) continue;
    potential_->accept(trial_, r);
    energy_[r] = energy;
    energy_known_[r] = potential_->scene().moments.empty();
  }
}

PetscErrorCode NewtonSolver::solve(const State &start, const Step &step, NewtonReport *report, Seek seek, const Planes *guess) {
  const char *failure = nullptr;
  PetscFunctionBeginUser;
  report_ = {};
  seek_ = seek;
  sharpness_ = 1;
  std::fill(last_shift_.begin(), last_shift_.end(), 0.0); // a step depends on its start alone
  potential_->beginStep(start, step);
  forgetEnergies();
  if (guess)
    potential_->moveTo(*guess);
  else if (!step.isStatic())
    predict(start, step);
  if (potential_->beyondBarrier())
    failure = "a support turns past the barrier of measure tan at 180 degrees of twist per vertex; use more edges, or measure: angle";
  else
    PetscCall(newton(&failure));
  // In statics the answer must be a minimum.
  for (int k = 0; step.isStatic() && !failure; ++k) {
    int negative;
    PetscCall(inertiaAtIterate(&negative));
    report_.negative_pivots = negative;
    if (k == 0) report_.first_negative_pivots = negative;
    if (seek == Seek::equilibrium && negative >= 0) break;
    if (negative == 0 || (negative > 0 && !potential_->scene().moments.empty())) break; // couples: no minimum to speak of
    bool left = false;
    if (negative > 0 && k < 10) PetscCall(escapeSaddle(&left));
    if (!left) {
      failure = negative < 0 ? "the Hessian cannot be factored" : "the equilibrium is unstable (negative pivots) and no way down from it was found";
      break;
    }
    sharpness_ *= 1e-2; // close to a branching the forces are small far from the equilibrium
    PetscCall(newton(&failure));
  }
  report_.converged = !failure;
  report_.reason = failure ? failure + nearBarrier() : "converged";
  *report = report_;
  PetscFunctionReturn(0);
}

} // namespace tendril
