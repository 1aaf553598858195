/// How SNES and its parts are made, and what they call.
#include "tendril/solver/newton.hpp"

#include <petsc/private/linesearchimpl.h>

#include <algorithm>
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

PetscErrorCode directionCallback(SNESLineSearch search, Vec x, Vec y, PetscBool *changed, void *context) {
  Vec f;
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchGetVecs(search, nullptr, &f, nullptr, nullptr, nullptr));
  PetscCall(static_cast<NewtonSolver *>(context)->direct(x, f, y));
  *changed = PETSC_TRUE;
  PetscFunctionReturn(0);
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

PetscErrorCode registerSolvers() {
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchRegister(line_search_name, createLineSearch));
  PetscCall(registerBanded());
  PetscCall(registerCondensed());
  PetscCall(registerWoodbury());
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::setUp(IncrementalPotential &potential, NewtonWork &work, RodSet set) {
  KSP ksp;
  PC pc;
  PetscFunctionBeginUser;
  potential_ = &potential;
  rods_ = set;
  DofMap &dofs = potential.dofs();
  work_ = &work;
  const bool joined = potential.dofs().isCoupled(set);
  islands_.clear();
  for (int r = set.begin; r < set.end; ++r)
    if (joined) { // all of a block that has junctions or contact
      islands_ = {set};
      break;
    } else
      islands_.push_back({r, r + 1});
  if (circulatory_.emplace(potential, islands_, rods_); circulatory_->isNone()) circulatory_.reset();
  system_ = {&dofs,        set,         &potential.blocks(), &work.metric,
             &work.active, &work.shift, &work.workspace,     potential.couplesPositions()};
  PetscCall(createSnes());
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  MatSolverType type = nullptr;
  PetscBool cholesky;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  PetscCall(PCFactorGetMatSolverType(pc, &type));
  const std::string chosen = type ? type : "";
  banded_ = cholesky && (chosen == "banded" || chosen == "condensed" || chosen == "woodbury");
  PetscCheck(
      !banded_ || canFactor(chosen, dofs, set), PETSC_COMM_SELF, PETSC_ERR_SUP,
      "option -pc_factor_mat_solver_type: %s cannot factor these rods: banded is for those that nothing joins, "
      "condensed for junctions of open rods, woodbury for constraints between vertices of rods that suit one of both; "
      "take %s or mumps",
      type, ownSolver(dofs, set) ? ownSolver(dofs, set) : "petsc");
  if (banded_) // factored straight from the band; every other solver gets a matrix of PETSc's own
    PetscCall(createBandedMatrix(&system_, jacobian_.out()));
  else
    PetscCall(makeMatrix());
  PetscCall(SNESSetJacobian(snes_, jacobian_, jacobian_, jacobianCallback, this));
  takeTouching();
  if (!banded_ && (!cholesky || islands_.size() > 1)) {
    PetscCall(createBandedMatrix(&system_, band_.out()));
    PetscCall(KSPCreate(PETSC_COMM_SELF, inertia_.out()));
    PetscCall(KSPSetType(inertia_, KSPPREONLY));
    PetscCall(KSPGetPC(inertia_, &pc));
    PetscCall(PCSetType(pc, PCCHOLESKY));
    const char *own = ownSolver(dofs, set);
    PetscCheck(own, PETSC_COMM_SELF, PETSC_ERR_SUP,
               "option -ksp_type, -pc_type: of rods that are joined like these a factorisation tells a minimum; "
               "take -pc_type cholesky");
    PetscCall(PCFactorSetMatSolverType(pc, own));
    PetscCall(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
  }
  PetscFunctionReturn(0);
}

void NewtonSolver::takeTouching() {
  touches_ = !potential_->dofs().touching(rods_).empty();
  fresh_pairs_ = true;
}

/// Makes a matrix of PETSc's own that has entries for the edges that touch at the iterate. What touches changes from
/// iterate to iterate, and every other matrix has to be analysed: those that nearly touch have some, too, and those
/// that did so earlier in the step keep theirs.
PetscErrorCode NewtonSolver::makeMatrix() {
  KSP ksp;
  PC pc;
  MatSolverType type = nullptr;
  PetscFunctionBeginUser;
  if (banded_) PetscFunctionReturn(0);
  std::vector<int> &has = pattern_.touching;
  const bool first = std::exchange(fresh_pairs_, false), before = !has.empty();
  if (first) has.clear();
  if (touches_ && jacobian_.object()) {
    const EdgeBlocks &blocks = potential_->derivatives(rods_).blocks;
    bool complete = !first;
    std::vector<int> near;
    for (const TouchingPair &p : potential_->dofs().touching(rods_)) {
      const double *const entries = blocks.touching(p.number);
      const int place = int(&p - potential_->dofs().touching().items.data());
      const bool kept = std::binary_search(has.begin(), has.end(), place),
                 touches = std::any_of(entries, entries + EdgeBlocks::touching_size, [](double v) { return v != 0; });
      complete = complete && (kept || !touches);
      if (kept || touches || potential_->nearlyTouch(p)) near.push_back(place);
    }
    if (complete) PetscFunctionReturn(0);
    has = std::move(near);
  }
  if (!before && has.empty() && jacobian_.object()) PetscFunctionReturn(0);
  pattern_.turns = potential_->scene().slidesAmongMoving() || potential_->scene().tendonsTwist();
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(KSPReset(ksp));
  PetscCall(potential_->dofs().createMatrix(rods_, potential_->joinsPositions(), jacobian_.out(), &pattern_));
  PetscCall(SNESSetJacobian(snes_, jacobian_, jacobian_, jacobianCallback, this));
  PetscCall(PCFactorGetMatSolverType(pc, &type));
  if (type && std::string(type) == MATSOLVERMUMPS) PetscCall(askMumpsForInertia(pc, jacobian_));
  PetscFunctionReturn(0);
}

/// SNES with its parts, our choice of each, then what options say.
PetscErrorCode NewtonSolver::createSnes() {
  KSP ksp;
  PC pc;
  SNESLineSearch search;
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  const bool whole = rods_.begin == 0 && rods_.end == dofs.all().end;
  if (whole)
    PetscCall(DMCreateGlobalVector(dofs.dm(), x_.out()));
  else
    PetscCall(VecCreateSeq(PETSC_COMM_SELF, dofs.unknowns(rods_), x_.out()));
  for (OwnedVec *v : {&f_, &right_, &solution_}) PetscCall(VecDuplicate(x_, v->out()));
  PetscCall(SNESCreate(PETSC_COMM_SELF, snes_.out()));
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
  const char *own = ownSolver(dofs, rods_);
  PetscCall(PCFactorSetMatSolverType(pc, own ? own : MATSOLVERMUMPS));
  PetscCall(PCFactorSetMatOrderingType(pc, own ? MATORDERINGNATURAL : MATORDERINGEXTERNAL));
  PetscCall(PCFactorSetZeroPivot(
      pc, 1e-250)); // for PETSc's own: pivots have the units of a stiffness, no absolute bound makes sense
  PetscCall(SNESLineSearchSetPreCheck(search, directionCallback, this));
  PetscCall(SNESSetFromOptions(snes_));
  PetscFunctionReturn(0);
}

} // namespace tendril
