#include "tendril/solver/newton.hpp"

#include "tendril/solver/activity.hpp"
#include "tendril/solver/banded.hpp"
#include "tendril/solver/events.hpp"

#include <petsc/private/linesearchimpl.h>
#include <petsc/private/snesimpl.h>

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

namespace tendril {
namespace {

constexpr const char *line_search_name = "retraction";

PetscErrorCode functionCallback(SNES, Vec x, Vec f, void *context) {
  return static_cast<NewtonSolver *>(context)->evaluate(x, f);
}

PetscErrorCode jacobianCallback(SNES, Vec, Mat, Mat p, void *context) {
  return static_cast<NewtonSolver *>(context)->assemble(p);
}

PetscErrorCode convergenceCallback(SNES, PetscInt it, PetscReal, PetscReal, PetscReal, SNESConvergedReason *reason,
                                   void *context) {
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

/// Diagonal by which an indefinite Hessian is shifted: the mass of each position, and for twists a moment of the same
/// mass over the edge's length, so that both see curvature on the scale of an edge alike. Independent of units and of
/// the time step.
Planes shiftMetric(const Elements &e, const DofMap &dofs) {
  Planes metric = dofs.makePlanes();
  const double *mass = e.mass(), *length = e.restLength();
  for (const RodRange &rod : e.rods) {
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) metric.setVector(0, s, Vec3::Constant(mass[s]));
    if (rod.twist)
      for (int i = 0; i < rod.edges; ++i)
        metric[3][rod.slot(i)] =
            0.5 * (mass[rod.slot(i)] + mass[rod.slot((i + 1) % rod.vertices)]) * std::pow(length[rod.slot(i)], 2);
  }
  return metric;
}

/// Beside the mass, a tension in all edges, of which the slowest wave of a string as long as the rod has the frequency
/// that the mass alone gives it: a shift of the mass alone moves what is held and what hangs on it by the same, however
/// short the edge between, and lets waves as short as edges buckle first.
std::vector<double> edgeMetric(const IncrementalPotential &potential) {
  const Elements &e = potential.elements();
  std::vector<double> metric(e.slots + lanes, 0.0);
  for (int r = 0; r < int(e.rods.size()); ++r) {
    const RodRange &rod = e.rods[r];
    int held = 0; // a rod that hangs on one place needs none: nothing presses its edges
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) held += e.freedom()[s] == 0;
    for (int i = 0; i < rod.edges && held > 1; ++i) {
      const double mass = 0.5 * (e.mass()[rod.slot(i)] + e.mass()[rod.slot((i + 1) % rod.vertices)]);
      metric[rod.slot(i)] = mass * std::pow(potential.length(r) * e.inverseRestLength()[rod.slot(i)] / pi, 2);
    }
  }
  return metric;
}

/// MUMPS counts pivots only when it looks for null ones, and a large pivot leaves their variables out. Options of the
/// same names (options/mumps_inertia.yaml) go before these values: PETSc reads them later.
PetscErrorCode askMumpsForInertia([[maybe_unused]] PC pc, [[maybe_unused]] Mat matrix) {
  PetscFunctionBeginUser;
#if defined(PETSC_HAVE_MUMPS)
  Mat factor;
  PetscCall(PCSetOperators(pc, matrix, matrix));
  PetscCall(PCFactorSetUpMatSolverType(pc));
  PetscCall(PCFactorGetMatrix(pc, &factor));
  PetscCall(MatMumpsSetIcntl(factor, 24, 1));
  PetscCall(MatMumpsSetCntl(factor, 5, 1e20));
#endif
  PetscFunctionReturn(0);
}

} // namespace

NewtonWork::NewtonWork(const IncrementalPotential &potential, int slots)
    : wanted(potential.all().end, true), shift(wanted.size(), 0), last_shift(shift), negative(wanted.size(), 0),
      zero(negative), indefinite(wanted.size(), false), energy(wanted.size()), energy_known(wanted.size(), false),
      residual(wanted.size()), moving(wanted.size(), false), standstill(wanted.size()), left(wanted.size(), 0),
      load_reach(wanted.size(), 0), load_energy(wanted.size(), 0), increment(slot_size, slots), coordinates(increment),
      trial(slots), motion(potential.dofs().makePlanes()), metric(shiftMetric(potential.elements(), potential.dofs())),
      edge_metric(edgeMetric(potential)) {}

void NewtonWork::setOrigin(int first_slot) {
  increment.setOrigin(first_slot);
  coordinates.setOrigin(first_slot);
  trial.setOrigin(first_slot);
  if (!kept.empty()) kept.setOrigin(first_slot);
}

PetscErrorCode registerSolvers() {
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchRegister(line_search_name, createLineSearch));
  PetscCall(registerBanded());
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::setUp(IncrementalPotential &potential, NewtonWork &work, RodSet set) {
  KSP ksp;
  PC pc;
  SNESLineSearch search;
  PetscFunctionBeginUser;
  potential_ = &potential;
  rods_ = set;
  DofMap &dofs = potential.dofs();
  work_ = &work;
  if (circulatory_.emplace(potential, set); circulatory_->isNone()) circulatory_.reset();
  system_ = {&dofs,        set,         &potential.blocks(), &work.metric,
             &work.wanted, &work.shift, &work.workspace,     !potential.scene().rotation.angular_velocity.isZero(0)};
  const bool whole = set.begin == 0 && set.end == dofs.all().end;
  if (whole)
    PetscCall(DMCreateGlobalVector(dofs.dm(), x_.out()));
  else
    PetscCall(VecCreateSeq(PETSC_COMM_SELF, dofs.unknowns(set), x_.out()));
  for (OwnedVec *v : {&f_, &right_, &solution_}) PetscCall(VecDuplicate(x_, v->out()));
  PetscCall(SNESCreate(whole ? PETSC_COMM_WORLD : PETSC_COMM_SELF, snes_.out()));
  if (whole) PetscCall(SNESSetDM(snes_, dofs.dm()));
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
  PetscCall(PCFactorSetZeroPivot(
      pc, 1e-250)); // for PETSc's own: pivots have the units of a stiffness, no absolute bound makes sense
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
  if (type && std::string(type) == MATSOLVERMUMPS) PetscCall(askMumpsForInertia(pc, jacobian_));
  if (!cholesky) {
    PetscCall(createBandedMatrix(&system_, band_.out()));
    PetscCall(KSPCreate(PETSC_COMM_SELF, inertia_.out()));
    PetscCall(KSPSetType(inertia_, KSPPREONLY));
    PetscCall(KSPGetPC(inertia_, &pc));
    PetscCall(PCSetType(pc, PCCHOLESKY));
    PetscCall(PCFactorSetMatSolverType(pc, "banded"));
    PetscCall(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
  }
  PetscFunctionReturn(0);
}

/// The solver whose factorisation has an inertia.
KSP NewtonSolver::factored() const {
  KSP ksp = inertia_;
  if (!ksp) (void)SNESGetKSP(snes_, &ksp);
  return ksp;
}

PetscErrorCode NewtonSolver::setUpLinear() {
  KSP ksp;
  PetscFunctionBeginUser;
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPSetOperators(ksp, jacobian_, jacobian_));
  PetscCall(KSPSetUp(ksp));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::moveTo(Vec x) {
  PetscObjectState state;
  PetscFunctionBeginUser;
  PetscCall(PetscObjectStateGet((PetscObject)x, &state));
  if (x == iterate_vec_ && state == iterate_state_) PetscFunctionReturn(0);
  Planes wanted = potential_->dofs().makePlanes();
  PetscCall(potential_->dofs().scatter(x, rods_, wanted));
  potential_->moveTo(wanted, rods_);
  forgetEnergies();
  iterate_vec_ = x;
  iterate_state_ = state;
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::writeIterate(Vec x) {
  PetscFunctionBeginUser;
  potential_->coordinates(work_->coordinates, rods_);
  PetscCall(potential_->dofs().gather(work_->coordinates, rods_, x));
  iterate_vec_ = x;
  PetscCall(PetscObjectStateGet((PetscObject)x, &iterate_state_));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::evaluate(Vec x, Vec f) {
  PetscFunctionBeginUser;
  PetscCall(moveTo(x));
  PetscCall(PetscLogEventBegin(events().derivatives, 0, 0, 0, 0));
  // Newton squares a small residual: from below the root of the tolerance the next iterate is taken for an answer,
  // which needs no Hessian.
  const Derivatives *d = nullptr;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    if (!work_->wanted[r]) continue;
    const IncrementalPotential::Residual &last = work_->residual[r];
    d = std::max(last.force, last.moment) < likely_ || sharesFactor() ? &potential_->gradient(r)
                                                                      : &potential_->derivatives({r, r + 1});
  }
  PetscCall(PetscLogEventEnd(events().derivatives, 0, 0, 0, 0));
  if (d) PetscCall(potential_->dofs().gather(d->gradient, rods_, f, &work_->wanted));
  PetscFunctionReturn(0);
}

/// Whether the next iteration may do with the factorisation that there is.
bool NewtonSolver::sharesFactor() const {
  return age_ > 0 && age_ < potential_->settings.quasi_newton && !renew_ && !circulatory_ &&
         std::none_of(work_->moving.begin() + rods_.begin, work_->moving.begin() + rods_.end,
                      [](char moving) { return moving; });
}

PetscErrorCode NewtonSolver::assemble(Mat) {
  PetscFunctionBeginUser;
  fresh_ = !sharesFactor();
  if (!fresh_) { // the matrix stays as it is, and with it its factorisation
    ++age_;
    PetscFunctionReturn(0);
  }
  age_ = 1;
  renew_ = false;
  secants_.clear();
  for (int r = rods_.begin; r < rods_.end; ++r)
    if (work_->wanted[r]) potential_->derivatives({r, r + 1});
  for (int r = rods_.begin; r < rods_.end; ++r) work_->shift[r] = follows_ ? regular_lift * firstShift(r) : 0;
  PetscCall(refill());
  PetscFunctionReturn(0);
}

/// The matrix to the present blocks and shifts.
PetscErrorCode NewtonSolver::refill() {
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(events().fill, 0, 0, 0, 0));
  if (inertia_) PetscCall(PetscObjectStateIncrease((PetscObject)band_.object()));
  if (banded_)
    PetscCall(PetscObjectStateIncrease((PetscObject)jacobian_.object()));
  else {
    EdgeBlocks blocks = potential_->blocks();
    for (int r = rods_.begin; r < rods_.end; ++r) {
      const RodRange &rod = potential_->elements().rods[r];
      for (int a = 0; a < slot_size && work_->shift[r] != 0; ++a) {
        double *own = blocks.entry(rod, EdgeBlocks::own(a, a)),
               *vertex = a < 3 ? blocks.entry(rod, EdgeBlocks::vertex(a, a)) : nullptr;
        for (int i = 0; i < rod.edges; ++i)
          own[i] += work_->shift[r] * (a == 3                ? work_->metric[3][rod.slot(i)]
                                       : system_.edge_metric ? system_.edge_metric[rod.slot(i)]
                                                             : 0);
        for (int i = 0; i < rod.vertices && vertex; ++i) vertex[i] += work_->shift[r] * work_->metric[a][rod.slot(i)];
      }
    }
    PetscCall(potential_->dofs().fillMatrix(blocks, jacobian_));
  }
  PetscCall(PetscLogEventEnd(events().fill, 0, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::refactor() {
  PetscFunctionBeginUser;
  PetscCall(refill());
  Mat matrix =
      inertia_.object() ? band_.object() : jacobian_.object(); // set anew, or KSP takes it for the one it knows
  PetscCall(KSPSetOperators(factored(), matrix, matrix));
  PetscCall(KSPSetUp(factored()));
  PetscFunctionReturn(0);
}

/// With the matrix factored last; rods that are not wanted have the solution zero.
PetscErrorCode NewtonSolver::solveLinear(const Planes &right, Planes &solution) {
  PetscFunctionBeginUser;
  PetscCall(potential_->dofs().gather(right, rods_, right_));
  PetscCall(KSPSolve(factored(), right_, solution_));
  PetscCall(potential_->dofs().scatter(solution_, rods_, solution));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::testConvergence(PetscInt iteration, SNESConvergedReason *reason) {
  PetscReal rtol;
  PetscInt limit;
  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(snes_, nullptr, &rtol, nullptr, &limit, nullptr));
  likely_ = std::sqrt(rtol);
  rtol_ = rtol *= sharpness_;
  report_.iterations = int(iteration);
  const bool moving = potential_->remainingMotion(rods_, work_->motion);
  bool done = true, finite = true, lost = false;
  creeps_ = false;
  IncrementalPotential::Residual &worst = report_.residual = {};
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = potential_->elements().rods[r];
    IncrementalPotential::Residual &residual = work_->residual[r];
    if (work_->wanted[r]) { // a rod that has converged takes no part any more
      residual = potential_->residual(r, energyAtIterate(r));
      work_->moving[r] = moving && dot(rod, work_->motion, work_->motion) > 0;
      finite = finite && residual.isFinite();
      const Verdict verdict = residual.isFinite() && !work_->moving[r] ? judge(r, rtol) : Verdict::going;
      lost = lost || verdict == Verdict::lost;
      creeps_ = creeps_ || verdict == Verdict::saddle;
      work_->wanted[r] = verdict != Verdict::answer;
      done = done && !work_->wanted[r];
    }
    worst.include(residual);
  }
  report_.history.push_back(worst.force);
  watch().beat();
  *reason = SNES_CONVERGED_ITERATING;
  if (!finite)
    *reason = SNES_DIVERGED_FNORM_NAN;
  else if (lost || creeps_)
    *reason = SNES_DIVERGED_LOCAL_MIN; // its meaning here: what is left is rounding
  else if (done)
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
  else if (iteration >= limit || (patience_ > 0 && spent_ + iteration >= patience_))
    *reason = SNES_DIVERGED_MAX_IT;
  PetscFunctionReturn(0);
}

/// Negative pivots of the factored matrix, per rod where the factorisation tells; `regular` is false when it broke
/// down.
PetscErrorCode NewtonSolver::readInertia(bool *regular) {
  PC pc;
  Mat factor;
  PCFailedReason failed;
  PetscFunctionBeginUser;
  PetscCall(KSPGetPC(factored(), &pc));
  PetscCall(PCGetFailedReason(pc, &failed));
  *regular = failed == PC_NOERROR;
  fill(work_->negative, 0);
  fill(work_->zero, 0);
  report_.zero_pivots = report_.negative_pivots = 0;
  if (!*regular) PetscFunctionReturn(0);
  PetscCall(PCFactorGetMatrix(pc, &factor));
  if (const BandedFactor *banded = bandedFactorOf(factor)) {
    for (int r = rods_.begin; r < rods_.end; ++r) {
      if (!work_->wanted[r]) continue;
      report_.negative_pivots += work_->negative[r] = banded->negativePivots(r);
      report_.zero_pivots += work_->zero[r] = banded->zeroPivots(r);
    }
  } else {
    PetscInt minus, zero, plus;
    PetscCall(MatGetInertia(factor, &minus, &zero, &plus));
    fill(work_->negative, report_.negative_pivots = int(minus));
    fill(work_->zero, report_.zero_pivots = int(zero));
  }
  PetscFunctionReturn(0);
}

/// Newton direction for supports that still have to move: solves again with their increments on the right-hand side.
PetscErrorCode NewtonSolver::includeMotion(Vec y) {
  KSP ksp;
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  Planes &right = work_->coordinates; // free until the iterate is written
  const Planes &gradient = potential_->derivatives(rods_).gradient;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int a = 0; a < slot_size; ++a)
      std::copy(gradient[a] + rod.first_slot, gradient[a] + rod.vertexEnd() + 2, right[a] + rod.first_slot);
    potential_->blocks().multiply(rod, work_->motion, right);
    dofs.fold(rod, right);
  }
  PetscCall(dofs.gather(right, rods_, right_, &work_->wanted));
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPSolve(ksp, right_, y));
  PetscFunctionReturn(0);
}

/// Newton direction of the whole derivative, couples included, from that of its symmetric part, in work_->increment.
PetscErrorCode NewtonSolver::includeCirculation(bool *regular) {
  PetscFunctionBeginUser;
  PetscCall(
      circulatory_->update([this](const Planes &right, Planes &solution) { return solveLinear(right, solution); }));
  *regular = circulatory_->correct(work_->increment);
  PetscFunctionReturn(0);
}

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
  const IncrementalPotential::Residual now = potential_->residual(r, trial), before = work_->residual[r];
  potential_->accept(kept, r);
  auto size = [](const IncrementalPotential::Residual &residual) {
    return std::hypot(residual.force, residual.moment);
  };
  return now.isFinite() &&
         (size(now) <= (1 - sufficient * length) * size(before) || excess(now, rtol_) <= 1 || isAtNoise(now, rtol_));
}

/// The direction of the Hessian factored last, corrected by the secants since (two-loop recursion, Nocedal and Wright
/// 2006, algorithm 7.4), rod by rod.
PetscErrorCode NewtonSolver::secantDirection(Vec f, Vec y) {
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  const int rods = rods_.end - rods_.begin;
  auto forRods = [&](auto visit) {
    for (int r = rods_.begin; r < rods_.end; ++r) {
      const PetscInt begin = dofs.firstUnknown({r, r + 1}) - dofs.firstUnknown(rods_);
      visit(r - rods_.begin, begin, begin + dofs.unknowns({r, r + 1}));
    }
  };
  std::vector<std::vector<double>> share(secants_.size(), std::vector<double>(rods));
  double *q;
  PetscCall(VecCopy(f, right_));
  PetscCall(VecGetArray(right_, &q));
  for (std::size_t k = secants_.size(); k-- > 0;)
    forRods([&](int r, PetscInt begin, PetscInt end) {
      const Secant &secant = secants_[k];
      double product = 0;
      for (PetscInt i = begin; i < end; ++i) product += secant.step[i] * q[i];
      share[k][r] = secant.inverse[r] * product;
      for (PetscInt i = begin; i < end; ++i) q[i] -= share[k][r] * secant.change[i];
    });
  PetscCall(VecRestoreArray(right_, &q));
  PetscCall(KSPSolve(factored(), right_, y));
  PetscCall(VecGetArray(y, &q));
  for (std::size_t k = 0; k < secants_.size(); ++k)
    forRods([&](int r, PetscInt begin, PetscInt end) {
      const Secant &secant = secants_[k];
      double product = 0;
      for (PetscInt i = begin; i < end; ++i) product += secant.change[i] * q[i];
      const double factor = share[k][r] - secant.inverse[r] * product;
      for (PetscInt i = begin; i < end; ++i) q[i] += factor * secant.step[i];
    });
  PetscCall(VecRestoreArray(y, &q));
  PetscFunctionReturn(0);
}

/// The last step, in work_->increment and lengths_, and what it changed of the gradient.
PetscErrorCode NewtonSolver::addSecant(const std::vector<double> &before, Vec f) {
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  Secant secant;
  const double *values;
  PetscCall(dofs.gather(work_->increment, rods_, right_));
  PetscCall(VecGetArrayRead(right_, &values));
  secant.step.assign(values, values + before.size());
  PetscCall(VecRestoreArrayRead(right_, &values));
  PetscCall(VecGetArrayRead(f, &values));
  secant.change.assign(values, values + before.size());
  PetscCall(VecRestoreArrayRead(f, &values));
  for (std::size_t i = 0; i < before.size(); ++i) secant.change[i] -= before[i];
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const PetscInt begin = dofs.firstUnknown({r, r + 1}) - dofs.firstUnknown(rods_),
                   end = begin + dofs.unknowns({r, r + 1});
    const double length = lengths_[r - rods_.begin];
    double product = 0, steps = 0, changes = 0;
    for (PetscInt i = begin; i < end; ++i) {
      secant.step[i] *= length;
      product += secant.step[i] * secant.change[i];
      steps += secant.step[i] * secant.step[i];
      changes += secant.change[i] * secant.change[i];
    }
    secant.inverse.push_back(product > 1e-10 * std::sqrt(steps * changes) ? 1 / product : 0);
  }
  secants_.push_back(std::move(secant));
  PetscFunctionReturn(0);
}

/// Moves one rod along its increment; false when no length of the step lowers its energy enough.
bool NewtonSolver::searchRod(int r, double *lambda) {
  constexpr double sufficient = 1e-4;
  constexpr int most_trials = 40;
  const RodRange &rod = potential_->elements().rods[r];
  double slope = -dot(rod, potential_->gradient(r).gradient, work_->increment);
  if (!std::isfinite(slope)) return false;
  for (int a = 0; a < slot_size; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); s += lanes) {
      const Pack d = read<Pack>(work_->increment[a] + s);
      write(work_->increment[a] + s, work_->moving[r] ? Pack(read<Pack>(work_->motion[a] + s) - d) : Pack(-d));
    }
  const IncrementalPotential::RodEnergy before = energyAtIterate(r);
  IncrementalPotential::RodEnergy after;
  Standstill &standstill = work_->standstill[r];
  standstill.known = fresh_ && !work_->indefinite[r] && !work_->moving[r];
  standstill.partial = work_->zero[r] > 0;
  standstill.energy = slope;
  auto attempt = [&](double length) {
    ++report_.trials;
    (void)PetscLogEventBegin(events().configuration, 0, 0, 0, 0);
    const bool possible = potential_->tryMove(work_->increment, length, r, work_->trial);
    (void)PetscLogEventEnd(events().configuration, 0, 0, 0, 0);
    (void)PetscLogEventBegin(events().energy, 0, 0, 0, 0);
    const IncrementalPotential::RodEnergy energy =
        possible ? potential_->rodEnergy(work_->trial, r) : IncrementalPotential::RodEnergy{};
    (void)PetscLogEventEnd(events().energy, 0, 0, 0, 0);
    return energy;
  };
  // Where the symmetric part is indefinite, couples have nothing that an equilibrium would minimise.
  const bool free = seek_ == Seek::equilibrium ||
                    (potential_->step().isStatic() && circulatory_ && circulatory_->acts(r) && work_->negative[r] > 0);
  const LineSearchKind kind = potential_->settings.line_search;
  enum class Length { good, too_long, too_short };
  auto judge = [&](double length) {
    if (!std::isfinite(after.value)) return Length::too_long;
    // Supports that move do work: the energy may rise with them, and only has to be finite.
    if (work_->moving[r] || free) return Length::good;
    if (kind == LineSearchKind::residual) return residualFalls(r, length, after) ? Length::good : Length::too_long;
    if (!(after.value <= before.value + sufficient * length * slope + before.noise)) return Length::too_long;
    constexpr double apart = 1e-3, flat = 0.9;
    if (kind != LineSearchKind::wolfe || -slope * length * apart < 10 * before.noise) return Length::good;
    const double beyond = attempt(length * (1 + apart)).value, ahead = attempt(length * (1 - apart)).value;
    attempt(length); // is the trial again
    const double there = (beyond - ahead) / (2 * apart * length);
    return there < flat * slope ? Length::too_short : there > -flat * slope ? Length::too_long : Length::good;
  };
  *lambda = 1;
  bool accepted = false;
  double low = 0, high = HUGE_VAL;
  for (int trial = 0; trial < most_trials && !accepted; ++trial) {
    after = attempt(*lambda);
    const Length length = judge(*lambda);
    accepted = length == Length::good;
    if (accepted) break;
    (length == Length::too_short ? low : high) = *lambda;
    if (kind == LineSearchKind::wolfe && std::isfinite(after.value)) {
      *lambda = std::isfinite(high) ? 0.5 * (low + high) : 2 * *lambda;
      continue;
    }
    // Minimum of the parabola through both energies and the slope, kept within a fifth and a half.
    const double curvature = after.value - before.value - *lambda * slope;
    const double best =
        std::isfinite(after.value) && curvature > 0 ? -slope * *lambda * *lambda / (2 * curvature) : 0.5 * *lambda;
    *lambda = std::clamp(best, 0.2 * *lambda, 0.5 * *lambda);
  }
  if (!accepted) {
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
  standstill.tiny = work_->indefinite[r] && *lambda >= 1 && sizeOf(r, work_->increment) < 1e-3;
  if (*lambda < 0.1) work_->last_shift[r] *= 16; // a shift that leaves too long a step is too small
  // A full step that gained clearly more than a quadratic would: the minimum lies beyond, as on the way down from a
  // barrier.
  const double gain = (after.value - before.value) / slope;
  if (kind == LineSearchKind::energy && !free && *lambda == 1 && gain > 0.6 && gain < 1 &&
      -slope > 1e3 * before.noise) {
    const double longer = std::min(2.0, 0.5 / (1 - gain));
    const IncrementalPotential::RodEnergy beyond = attempt(longer);
    if (beyond.value < after.value) {
      after = beyond;
      *lambda = longer;
    } else
      potential_->tryMove(work_->increment, 1, r, work_->trial);
  }
  potential_->accept(work_->trial, r);
  work_->energy[r] = after;
  work_->energy_known[r] = potential_->scene().moments.empty(); // the work of couples is counted from the iterate
  return true;
}

/// The factorisation with an inertia; where the solver that was chosen broke down, the direction comes from it.
PetscErrorCode NewtonSolver::solveAgain(Vec f, Vec y) {
  KSP ksp;
  KSPConvergedReason reason;
  PetscFunctionBeginUser;
  if (!inertia_) PetscFunctionReturn(0);
  PetscCall(KSPSetOperators(inertia_, band_, band_));
  PetscCall(KSPSetUp(inertia_));
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  if (reason < 0) PetscCall(KSPSolve(inertia_, f, y));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::lineSearch(SNESLineSearch search) {
  Vec x, f, y;
  bool regular;
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchGetVecs(search, &x, &f, &y, nullptr, nullptr));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(moveTo(x));
  if (fresh_)
    PetscCall(solveAgain(f, y));
  else
    PetscCall(secantDirection(f, y));
  PetscCall(readInertia(&regular));
  bool indefinite = false;
  fill(work_->indefinite, false);
  if (fresh_ && seek_ == Seek::minimum) PetscCall(findIndefinite(y, regular, &indefinite));
  if (indefinite) PetscCall(makeDescent(f, y, regular));
  if (std::any_of(work_->moving.begin() + rods_.begin, work_->moving.begin() + rods_.end, [](char m) { return m; }))
    PetscCall(includeMotion(y));
  PetscCall(potential_->dofs().scatter(y, rods_, work_->increment));
  if (circulatory_) PetscCall(includeCirculation(&regular));

  PetscCall(PetscLogEventBegin(events().line_search, 0, 0, 0, 0));
  double shortest = 1;
  bool accepted = true;
  std::vector<double> before; // the gradient, where secants are wanted
  if (potential_->settings.quasi_newton > 1) {
    const double *values;
    PetscCall(VecGetArrayRead(f, &values));
    before.assign(values, values + potential_->dofs().unknowns(rods_));
    PetscCall(VecRestoreArrayRead(f, &values));
    lengths_.assign(rods_.end - rods_.begin, 0.0);
  }
  for (int r = rods_.begin; r < rods_.end && accepted; ++r) {
    if (!work_->wanted[r]) continue;
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
  if (!before.empty()) PetscCall(addSecant(before, f));
  PetscReal norm = 0; // only monitors look at it; those of x and y serve tests that are not used here
  if (snes_.object()->numbermonitors > 0) PetscCall(VecNorm(f, NORM_2, &norm));
  PetscCall(SNESLineSearchSetNorms(search, 0, norm, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::inertiaAtIterate(int *negative, double lift) {
  bool regular;
  PetscFunctionBeginUser;
  watch().beat();
  focus();
  fill(work_->wanted, true);
  age_ = 0;
  PetscCall(assemble(jacobian_));
  for (int r = rods_.begin; r < rods_.end && potential_->step().hessian != HessianKind::exact; ++r)
    potential_->assembleRod(r, HessianKind::exact);
  for (int r = rods_.begin; r < rods_.end; ++r) work_->shift[r] = lift * firstShift(r);
  PetscCall(refactor());
  PetscCall(readInertia(&regular));
  *negative = regular ? report_.negative_pivots : -1;
  PetscFunctionReturn(0);
}

void NewtonSolver::focus() {
  potential_->focus(rods_);
  work_->setOrigin(potential_->elements().rods[rods_.begin].first_slot);
}

/// The rod that is farthest from its equilibrium, in words.
std::string NewtonSolver::farthest() {
  const int rod = farthestRod(*potential_, rods_, asked(), &work_->wanted);
  if (rod >= 0 && isAtNoise(potential_->residual(rod, energyAtIterate(rod)), 0))
    return "; " + roundingMessage(rod, sizeOf(rod, work_->increment));
  return tellImbalance(*potential_, rod, asked());
}

/// The first rod that is unstable in the Hessian factored last, in words, where that tells them apart.
std::string NewtonSolver::unstableRod() const {
  if (!banded_ && !inertia_ && rods_.end - rods_.begin > 1) return "";
  for (int r = rods_.begin; r < rods_.end; ++r)
    if (const int count = work_->negative[r]; count > 0)
      return "; " + labelOf(potential_->scene().rods[r]) + ": forces and moments are in balance, and " +
             std::to_string(count) + (count == 1 ? " motion lowers" : " motions lower") + " its energy";
  return "";
}

/// SNES from the potential's iterate. `failure` is empty when it converged.
PetscErrorCode NewtonSolver::newton(std::string *failure) {
  constexpr int limits_from_saddle = 10;
  SNESConvergedReason reason;
  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(snes_, nullptr, &rtol_, nullptr, nullptr, nullptr));
  rtol_ *= sharpness_;
  fill(work_->wanted, true);
  fill(work_->standstill, Standstill());
  fill(work_->load_reach, std::nan(""));
  age_ = 0;
  lost_.clear();
  PetscCall(writeIterate(x_));
  // From a saddle the way down may be long, and shorter load steps begin at the same one; of fine rods they are still
  // the cheaper way.
  int limits = report_.escapes > 0 && patience_ == 0 && potential_->elements().edges() <= most_searched_edges
                   ? limits_from_saddle
                   : 1;
  do {
    spent_ = report_.iterations;
    PetscCall(SNESSolve(snes_, nullptr, x_));
    report_.iterations += std::exchange(spent_, 0);
    PetscCall(SNESGetConvergedReason(snes_, &reason));
  } while (reason == SNES_DIVERGED_MAX_IT && --limits > 0);
  failure->clear();
  if (reason > 0 || creeps_) PetscFunctionReturn(0); // a saddle nearby is left as one that was reached
  report_.lost = !lost_.empty() && (reason == SNES_DIVERGED_LOCAL_MIN || reason == SNES_DIVERGED_LINE_SEARCH);
  if (report_.lost)
    *failure = lost_;
  else
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
  if (!report_.lost) *failure += farthest();
  PetscFunctionReturn(0);
}

/// A hint for failures next to an angle of 180 degrees between neighbouring edges, where energies grow without bound.
std::string NewtonSolver::nearBarrier() const {
  const Elements &e = potential_->elements();
  const Configuration &c = potential_->iterate();
  struct Worst {
    double angle = 0;
    int rod = 0;
    void include(double other, int r) {
      if (other > angle) angle = other, rod = r;
    }
  } twist, turning;
  for (int r = rods_.begin; r < rods_.end; ++r)
    forCells(e, r, [&]<class T>(const LooseCell &cell, int count) {
      for (int l = 0; l < count; ++l) {
        if (e.measure[r] == Measure::tan) twist.include(std::abs(c[Configuration::twist][cell.slot + l]), r);
        turning.include(std::acos(std::clamp(c.frameAt(cell.frame0 + l).tangent.dot(c.frameAt(cell.frame1 + l).tangent),
                                             -1.0, 1.0)),
                        r);
      }
    });
  constexpr double near = 150, degrees = 180 / pi;
  std::string hint;
  auto told = [&](const Worst &worst) {
    return "; neighbouring edges of " + labelOf(potential_->scene().rods[worst.rod]) + " are ";
  };
  if (twist.angle * degrees > near)
    hint += told(twist) + "twisted by " + std::to_string(int(twist.angle * degrees)) +
            " degrees, and measure tan has a barrier at 180: use more edges, or measure: angle";
  if (turning.angle * degrees > near)
    hint += told(turning) + "folded by " + std::to_string(int(turning.angle * degrees)) +
            " degrees of at most 180: use more edges";
  return hint;
}

/// Words on the rod of the energy `seed` that bends most sharply, more than `sharpest`, with its edges shorter than
/// `longest`: without axial force its stretch r obeys r^2 = 1 - 2 B kappa^2/EA, with kappa the turning per reference
/// length, and the moment B r^2 kappa is largest where B kappa^2 = EA/6, the unit of the sharpness, and r^2 = 2/3.
/// Empty where none does.
std::string NewtonSolver::sharpestBend(const Configuration &c, double sharpest, double longest) const {
  const Elements &e = potential_->elements();
  constexpr double near = 0.88; // of the limit; where it is passed the moment falls again
  std::ostringstream hint;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const Rod &rod = potential_->scene().rods[r];
    if (rod.energy != Energy::seed) continue;
    forCells(e, r, [&]<class T>(const LooseCell &cells, int count) {
      for (int l = 0; l < count; ++l) {
        const LooseCell cell{cells.slot + l, cells.frame0 + l, cells.frame1 + l, cells.vertex + l};
        const CellOf<double> k = cellOf<double>(e.cells(), c, cell.slot);
        const double stretch = cellGeometry(c.frameAt(cell.frame0), c.frameAt(cell.frame1), k).stretch;
        const std::array<double, 3> s = presentStrain<double>(e, c, r, cell);
        const Eigen::Vector2d strain(s[0] - k.rest[0], s[1] - k.rest[1]),
            force(k.stiffness[0] * strain[0], k.stiffness[1] * strain[1]);
        const double bending =
            force.squaredNorm() / force.dot(strain) * e.cellLength()[cell.slot]; // B about the axis of bending
        const double sharpness = 6 * force.squaredNorm() / (bending * stretch * stretch * rod.material.axial_stiffness);
        if (!(sharpness > sharpest && stretch < longest)) continue;
        sharpest = sharpness;
        const double moment = stretch * force.norm(),
                     limit = 2.0 / 3 * std::sqrt(rod.material.axial_stiffness * bending / 6);
        hint.str("");
        hint << std::setprecision(4) << "; rod '" << rod.name
             << (moment > near * limit ? "' bends under a moment of "
                                       : "' has given way to bending, its moment is down to ")
             << moment
             << " N m, and its 'energy: seed', which couples bending with stretch, bears at most (2/3) sqrt(EA EI/6) = "
             << limit << " N m without tension; 'energy: classical' has no limit";
      }
    });
  }
  return hint.str();
}

/// Words on a rod of the energy `seed` that is near a limit of its law, or beyond: of bending, as sharpestBend, or of
/// compression with an edge shorter than `shortest`; the force is largest, EA r (1 - r^2)/2 = 0.192 EA, where the
/// stretch r obeys r^2 = 1/3.
std::string NewtonSolver::limitOfLaw(const Configuration &c, double sharpest, double longest, double shortest) const {
  std::string bent = sharpestBend(c, sharpest, longest);
  if (!bent.empty()) return bent;
  const Elements &e = potential_->elements();
  std::ostringstream words;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const Rod &rod = potential_->scene().rods[r];
    double stretch = shortest;
    for (int s = e.rods[r].first_slot; s < e.rods[r].edgeEnd(); ++s)
      stretch = std::min(stretch, c[Configuration::length][s] * e.inverseRestLength()[s]);
    if (rod.energy != Energy::seed || stretch == shortest) continue;
    words << std::setprecision(4) << "; an edge of rod '" << rod.name << "' is down to " << stretch
          << " of its length, and its 'energy: seed' bears at most 0.192 EA = "
          << rod.material.axial_stiffness / (3 * std::sqrt(3.0))
          << " N of compression; 'energy: classical' has no limit";
    break;
  }
  return words.str();
}

/// Starts every rod from where its velocities lead when that is lower than the start.
void NewtonSolver::predict(const State &start) {
  const DofMap &dofs = potential_->dofs();
  const double *freedom = potential_->elements().freedom();
  const StageRule *rule = potential_->step().rule;
  const Combination guess = rule ? rule->guess : Combination().add(potential_->step().dt, start);
  // Backward Euler's velocities are the last step's chords; others are tangents of the motion, and say nothing of
  // lengths at that accuracy.
  const RetractionKind along = rule && rule->half ? RetractionKind::additive
                               : rule             ? RetractionKind::kept
                                                  : RetractionKind::continued;
  const RetractionKind kind =
      potential_->settings.retraction == RetractionKind::length ? along : potential_->settings.retraction;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int i = 0; i < rod.vertices; ++i)
      work_->increment.setVector(0, rod.slot(i), freedom[rod.slot(i)] * guess.atVertex(rod.first_vertex + i));
    for (int i = 0; i < rod.edges; ++i)
      work_->increment[3][rod.slot(i)] = rod.twist ? guess.atEdge(rod.first_edge + i) : 0;
    dofs.copyBehindRing(rod, work_->increment);
    if (!potential_->tryMove(work_->increment, 1, r, kind, work_->trial)) continue;
    const IncrementalPotential::RodEnergy energy = potential_->rodEnergy(work_->trial, r);
    if (!(energy.value < energyAtIterate(r).value)) continue;
    potential_->accept(work_->trial, r);
    if (along == RetractionKind::additive) potential_->resetAxialForces(r);
    work_->energy[r] = energy;
    work_->energy_known[r] = potential_->scene().moments.empty();
  }
}

PetscErrorCode NewtonSolver::solve(const State &start, NewtonReport *report, Seek seek, const Guess *guess,
                                   int patience) {
  constexpr int most_rounds = 4; // of a tolerance made sharper
  std::string failure;
  const bool is_static = potential_->step().isStatic();
  PetscFunctionBeginUser;
  focus();
  system_.edge_metric =
      is_static ? work_->edge_metric.data() : nullptr; // in dynamics, inertia is what holds short waves
  report_ = {};
  seek_ = seek;
  follows_ = seek == Seek::equilibrium;
  patience_ = patience;
  sharpness_ = 1;
  likely_ = spent_ = 0;
  const Doing here([this](std::ostream &out) {
    out << "Newton iteration " << spent_ + report_.iterations;
    if (rtol_ > 0) out << ", out of balance by " << excess(report_.residual, rtol_) << " times what is asked for";
  });
  fill(work_->last_shift, 0.0); // a step depends on its start alone
  for (int r = rods_.begin; r < rods_.end; ++r) potential_->beginRod(start, r);
  forgetEnergies();
  if (guess) {
    const bool complete = guess->axial_force.size() > 0;
    potential_->moveTo(guess->unknowns, rods_, complete);
    for (int r = rods_.begin; r < rods_.end && complete; ++r) potential_->setAxialForces(r, guess->axial_force[0]);
  } else if (!is_static)
    predict(start);
  if (potential_->beyondBarrier())
    failure = "a support turns past the barrier of measure tan at 180 degrees of twist per vertex; use more edges, or "
              "measure: angle";
  else
    PetscCall(newton(&failure));
  // In statics the answer must be a minimum, and the Hessian there says how far from it the iterate still is.
  int rounds = 0;
  bool settled = false;
  std::string beyond; // the limit of a law
  // Whether what is left is little; else Newton goes on to a sharper tolerance, `along` as it seeks.
  auto settle = [&](Seek along) {
    PetscFunctionBeginUser;
    PetscCall(verify(&settled));
    if (settled) PetscFunctionReturn(0);
    if (++rounds == most_rounds) {
      failure = lost_;
      report_.lost = true;
      PetscFunctionReturn(0);
    }
    sharpness_ *= 1e-2;
    seek_ = along;
    PetscCall(newton(&failure));
    PetscFunctionReturn(0);
  };
  for (int k = 0; is_static && failure.empty() && !settled; ++k) {
    int negative;
    PetscCall(inertiaAtIterate(&negative));
    report_.negative_pivots = negative;
    if (k == 0) report_.first_negative_pivots = negative;
    if (seek == Seek::equilibrium && negative >= 0) break;
    if (negative > 0)
      beyond = limitOfLaw(potential_->iterate(), 1, std::sqrt(2.0 / 3),
                          std::sqrt(1.0 / 3)); // where an edge gives way, the load falls
    if (!beyond.empty()) {
      failure = "the equilibrium is unstable" + beyond;
      break;
    }
    if (negative == 0 || (negative > 0 && !potential_->scene().moments.empty())) { // couples: no minimum to speak of
      PetscCall(settle(seek_));
      continue;
    }
    bool left = false, neutral = false;
    const std::string unstable = unstableRod();
    if (negative > 0 && k < 10) PetscCall(escapeSaddle(&left, &neutral));
    if (neutral && !left) { // no way down, but what loads move along it has to be found
      PetscCall(inertiaAtIterate(&negative));
      report_.zero_pivots += std::max(0, negative);
      report_.negative_pivots = 0;
      if (k == 0) report_.first_negative_pivots = 0;
      PetscCall(settle(Seek::equilibrium)); // Newton's own steps: a shift would drown the soft direction
      continue;
    }
    seek_ = seek;
    if (!left) {
      failure = negative < 0
                    ? "the Hessian cannot be factored" +
                          tellImbalance(*potential_, farthestRod(*potential_, rods_, asked()), asked())
                    : "the equilibrium is unstable (negative pivots) and no way down from it was found" + unstable;
      break;
    }
    sharpness_ *= 1e-2; // close to a branching the forces are small far from the equilibrium
    PetscCall(newton(&failure));
  }
  report_.converged = failure.empty();
  for (int r = rods_.begin; r < rods_.end; ++r)
    report_.rounding_error = std::max(report_.rounding_error, work_->left[r]);
  report_.reason = report_.converged ? "converged"
                                     : failure + nearBarrier() +
                                           (beyond.empty() ? limitOfLaw(potential_->start(), 0.5, HUGE_VAL, 0.65)
                                                           : ""); // 0.88 of the moment, 0.98 of the force
  *report = report_;
  PetscFunctionReturn(0);
}

} // namespace tendril
