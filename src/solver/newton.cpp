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

double dot(const std::vector<double> &a, const std::vector<double> &b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

/// Product of a symmetric band (see DofMap::fillMatrix) with rows.
std::vector<double> bandTimes(const std::vector<double> &band, const std::vector<double> &x) {
  std::vector<double> y(x.size(), 0.0);
  for (std::size_t r = 0; r + DofMap::band <= x.size(); ++r)
    for (int k = 0; k < DofMap::band; ++k) {
      const double h = band[r * DofMap::band + k];
      y[r] += h * x[r + k];
      if (k > 0) y[r + k] += h * x[r];
    }
  return y;
}

/// Diagonal by which an indefinite Hessian is shifted: the mass of each position, and for twists a moment of the same mass over the
/// edge's length, so that both see curvature on the scale of an edge alike. Independent of units and of the time step.
std::vector<double> shiftMetric(const Elements &e, int rows) {
  std::vector<double> metric(rows, 0.0);
  for (std::size_t v = 0; v < e.vertex_row.size(); ++v)
    for (int a = 0; a < 3; ++a) metric[e.vertex_row[v] + a] = e.mass[v];
  for (const RodRange &rod : e.rods)
    if (rod.stride == 4)
      for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i)
        metric[e.edge_row[i] + 3] = 0.5 * (e.mass[e.vertex0[i]] + e.mass[e.vertex1[i]]) * e.rest_length[i] * e.rest_length[i];
  return metric;
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
  metric_ = shiftMetric(potential.elements(), dofs.rows());
  PetscCall(dofs.createMatrix(jacobian_.out()));
  PetscCall(DMCreateGlobalVector(dofs.dm(), x_.out()));
  PetscCall(VecDuplicate(x_, f_.out()));
  PetscCall(SNESCreate(PETSC_COMM_WORLD, snes_.out()));
  PetscCall(SNESSetDM(snes_, dofs.dm()));
  PetscCall(SNESSetApplicationContext(snes_, this));
  PetscCall(SNESSetType(snes_, SNESNEWTONLS));
  PetscCall(SNESSetFunction(snes_, f_, functionCallback, this));
  PetscCall(SNESSetJacobian(snes_, jacobian_, jacobian_, jacobianCallback, this));
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
  MatSolverType type;
  PetscCall(PCFactorGetMatSolverType(pc, &type));
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
  rows_.assign(potential_->dofs().rows(), 0.0);
  PetscCall(potential_->dofs().scatter(x, rows_));
  potential_->moveTo(rows_);
  energy_known_ = false;
  iterate_vec_ = x;
  iterate_state_ = state;
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::writeIterate(Vec x) {
  PetscScalar *values;
  PetscFunctionBeginUser;
  potential_->coordinates(rows_);
  const auto &unknown = potential_->dofs().unknownOfRow();
  PetscCall(VecGetArrayWrite(x, &values));
  for (const RodRange &rod : potential_->elements().rods) // not the copies behind a ring: they would write twice
    for (int r = rod.first_row; r < rod.first_row + rod.rows; ++r)
      if (unknown[r] >= 0) values[unknown[r]] = rows_[r];
  PetscCall(VecRestoreArrayWrite(x, &values));
  iterate_vec_ = x;
  PetscCall(PetscObjectStateGet((PetscObject)x, &iterate_state_));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::evaluate(Vec x, Vec f) {
  PetscFunctionBeginUser;
  PetscCall(moveTo(x));
  PetscCall(PetscLogEventBegin(events().derivatives, 0, 0, 0, 0));
  const Rows &rows = potential_->derivatives();
  PetscCall(PetscLogEventEnd(events().derivatives, 0, 0, 0, 0));
  PetscCall(potential_->dofs().gather(rows.gradient, f));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::assemble(Mat jacobian) {
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(events().fill, 0, 0, 0, 0));
  PetscCall(potential_->dofs().fillMatrix(potential_->derivatives().band, jacobian));
  PetscCall(PetscLogEventEnd(events().fill, 0, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::testConvergence(PetscInt iteration, SNESConvergedReason *reason) {
  PetscReal rtol;
  PetscInt limit;
  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(snes_, nullptr, &rtol, nullptr, &limit, nullptr));
  rtol *= sharpness_;
  report_.iterations = int(iteration);
  const IncrementalPotential::Residual r = report_.residual = potential_->residual();
  report_.history.push_back(r.force);
  moving_ = potential_->remainingMotion(motion_);
  *reason = SNES_CONVERGED_ITERATING;
  if (!std::isfinite(r.force) || !std::isfinite(r.moment))
    *reason = SNES_DIVERGED_FNORM_NAN;
  else if (!moving_ && isSmall(r, rtol))
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
  else if (iteration >= limit)
    *reason = SNES_DIVERGED_MAX_IT;
  PetscFunctionReturn(0);
}

/// Negative pivots of the factored matrix; `regular` is false when the factorisation broke down. Factorisations without inertia (LU,
/// iterative solvers) report none.
PetscErrorCode NewtonSolver::readInertia(int *negative, bool *regular) {
  KSP ksp;
  PC pc;
  Mat factor;
  PetscBool cholesky;
  PCFailedReason failed;
  PetscFunctionBeginUser;
  *negative = 0;
  *regular = true;
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCGetFailedReason(pc, &failed));
  *regular = failed == PC_NOERROR;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  if (!cholesky || !*regular) PetscFunctionReturn(0);
  PetscInt minus, zero, plus;
  PetscCall(PCFactorGetMatrix(pc, &factor));
  PetscCall(MatGetInertia(factor, &minus, &zero, &plus));
  *negative = int(minus);
  report_.neutral_pivots = int(zero);
  PetscFunctionReturn(0);
}

/// Direction for an indefinite Hessian. A few negative pivots mean a state near a branching: a shifted diagonal keeps most of Newton's speed there.
/// Many mean compressed edges: then their compression is left out of the Hessian, and the diagonal shifted only if that is not enough.
/// Couples have no potential and no definite Hessian: for them Newton's own direction stands as long as it goes downhill.
PetscErrorCode NewtonSolver::makeDescent(KSP ksp, Vec f, Vec y, int negative, bool regular) {
  PetscFunctionBeginUser;
  if (regular && !potential_->scene().moments.empty()) {
    PetscScalar slope;
    PetscCall(VecDot(f, y, &slope));
    if (slope > 0) PetscFunctionReturn(0);
  }
  constexpr int few = 4; // per rod: the two planes of the first two buckling modes
  if (negative > few * int(potential_->scene().rods.size())) {
    PetscCall(potential_->dofs().fillMatrix(potential_->bandWithoutCompression(), jacobian_));
    PetscCall(KSPSetOperators(ksp, jacobian_, jacobian_));
    PetscCall(KSPSolve(ksp, f, y));
    PetscCall(readInertia(&negative, &regular));
    ++report_.shifts;
  }
  if (negative > 0 || !regular) PetscCall(shiftUntilPositive(ksp, f, y, negative, regular));
  PetscFunctionReturn(0);
}

/// Adds multiples of the metric to the Hessian until all pivots are positive, so that the step goes downhill. Starts near the last shift
/// that was needed, so that a run of indefinite iterates costs one extra factorisation each.
PetscErrorCode NewtonSolver::shiftUntilPositive(KSP ksp, Vec f, Vec y, int negative, bool regular) {
  PetscFunctionBeginUser;
  const auto &unknown = potential_->dofs().unknownOfRow();
  OwnedVec diagonal;
  PetscScalar *values;
  PetscCall(VecDuplicate(f, diagonal.out()));
  if (shift_ == 0) { // the slowest bending wave of the rod where it is fastest, EI/(rho L^4), or the edge's own axial one for a cable
    const Scene &scene = potential_->scene();
    for (const Rod &rod : scene.rods) {
      double length = 0;
      for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
      const Material &m = rod.material;
      const auto [k1, k2] = m.flexural_stiffness;
      const double softest = k1 > 0 && k2 > 0 ? std::min(k1, k2) : std::max(k1, k2);
      const double stiffness = m.isCable() ? 1e-6 * m.axial_stiffness : 10 * softest / (length * length);
      shift_ = std::max(shift_, stiffness / (m.linear_density * length * length));
    }
  } else
    shift_ *= 0.25;
  double previous = 0;
  for (int attempt = 0; attempt < 40 && (negative > 0 || !regular); ++attempt) {
    PetscCall(VecSet(diagonal, 0));
    PetscCall(VecGetArrayWrite(diagonal, &values));
    for (std::size_t r = 0; r < metric_.size(); ++r)
      if (metric_[r] > 0 && unknown[r] >= 0) values[unknown[r]] = (shift_ - previous) * metric_[r];
    PetscCall(VecRestoreArrayWrite(diagonal, &values));
    PetscCall(MatDiagonalSet(jacobian_, diagonal, ADD_VALUES));
    previous = shift_;
    PetscCall(KSPSetOperators(ksp, jacobian_, jacobian_));
    PetscCall(KSPSolve(ksp, f, y));
    PetscCall(readInertia(&negative, &regular));
    ++report_.shifts;
    if (negative > 0 || !regular) shift_ *= 8;
  }
  PetscFunctionReturn(0);
}

/// Newton direction for supports that still have to move: solves again with their increments on the right-hand side.
PetscErrorCode NewtonSolver::includeMotion(KSP ksp, Vec f, Vec y) {
  PetscFunctionBeginUser;
  const Rows &rows = potential_->derivatives();
  std::vector<double> right = bandTimes(rows.band, motion_);
  for (std::size_t r = 0; r < right.size(); ++r) right[r] += rows.gradient[r];
  OwnedVec full;
  PetscCall(VecDuplicate(f, full.out()));
  PetscCall(potential_->dofs().gather(right, full));
  PetscCall(KSPSolve(ksp, full, y));
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::lineSearch(SNESLineSearch search) {
  constexpr double sufficient = 1e-4;
  constexpr int most_trials = 40;
  Vec x, f, y;
  KSP ksp;
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchGetVecs(search, &x, &f, &y, nullptr, nullptr));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(moveTo(x));
  bool regular;
  PetscCall(readInertia(&report_.negative_pivots, &regular));
  if (seek_minimum && (report_.negative_pivots > 0 || !regular)) PetscCall(makeDescent(ksp, f, y, report_.negative_pivots, regular));
  if (moving_) PetscCall(includeMotion(ksp, f, y));

  increment_.assign(potential_->dofs().rows(), 0.0);
  PetscCall(potential_->dofs().scatter(y, increment_));
  for (double &d : increment_) d = -d;
  const double slope = dot(potential_->derivatives().gradient, increment_);
  if (moving_)
    for (std::size_t k = 0; k < increment_.size(); ++k) increment_[k] += motion_[k];

  PetscCall(PetscLogEventBegin(events().line_search, 0, 0, 0, 0));
  if (!energy_known_) energy_ = potential_->energy(potential_->iterate());
  const double noise = potential_->energyNoise(potential_->iterate());
  const double energy_before = energy_;
  double lambda = 1;
  bool accepted = false;
  for (int trial = 0; trial < most_trials && !accepted; ++trial) {
    ++report_.trials;
    PetscCall(PetscLogEventBegin(events().configuration, 0, 0, 0, 0));
    const bool possible = potential_->tryMove(increment_, lambda, trial_);
    PetscCall(PetscLogEventEnd(events().configuration, 0, 0, 0, 0));
    PetscCall(PetscLogEventBegin(events().energy, 0, 0, 0, 0));
    const double energy = possible ? potential_->energy(trial_) : HUGE_VAL;
    PetscCall(PetscLogEventEnd(events().energy, 0, 0, 0, 0));
    // Supports that move do work: the energy may rise with them, and only has to be finite.
    accepted = std::isfinite(energy) && (moving_ || !seek_minimum || energy <= energy_ + sufficient * lambda * slope + noise);
    if (accepted) {
      energy_ = energy;
      break;
    }
    // Minimum of the parabola through both energies and the slope, kept within a fifth and a half.
    const double curvature = energy - energy_ - lambda * slope;
    const double best = std::isfinite(energy) && curvature > 0 ? -slope * lambda * lambda / (2 * curvature) : 0.5 * lambda;
    lambda = std::clamp(best, 0.2 * lambda, 0.5 * lambda);
  }
  // A full step that gained clearly more than a quadratic would: the minimum lies beyond, as on the way down from a barrier.
  const double gain = (energy_ - energy_before) / slope;
  if (accepted && lambda == 1 && gain > 0.6 && gain < 1 && -slope > 1e3 * noise) {
    std::swap(trial_, shorter_);
    const double longer = std::min(2.0, 0.5 / (1 - gain));
    const double energy = potential_->tryMove(increment_, longer, trial_) ? potential_->energy(trial_) : HUGE_VAL;
    ++report_.trials;
    if (energy < energy_) {
      energy_ = energy;
      lambda = longer;
    } else
      std::swap(trial_, shorter_);
  }
  PetscCall(PetscLogEventEnd(events().line_search, 0, 0, 0, 0));
  PetscCall(SNESLineSearchSetLambda(search, lambda));
  if (!accepted || !std::isfinite(slope)) {
    PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_FAILED_REDUCT));
    PetscFunctionReturn(0);
  }
  potential_->accept(trial_);
  energy_known_ = potential_->scene().moments.empty(); // the work of couples is counted from the iterate
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
  KSP ksp;
  bool regular;
  PetscFunctionBeginUser;
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(assemble(jacobian_));
  PetscCall(KSPSetOperators(ksp, jacobian_, jacobian_));
  PetscCall(KSPSetUp(ksp));
  PetscCall(readInertia(negative, &regular));
  if (!regular) *negative = -1;
  PetscFunctionReturn(0);
}

/// A direction of negative curvature at an unstable equilibrium, in increment_. With the Hessian K = E - G split into the part E without
/// compression and the effect G of compression, iterating v <- E^-1 G v gives the first buckling mode, the smoothest way out. Where compression
/// is not the cause, inverse iteration with the shifted Hessian finds the lowest mode.
PetscErrorCode NewtonSolver::findBucklingMode(bool *found) {
  KSP ksp;
  PetscFunctionBeginUser;
  PetscCall(SNESGetKSP(snes_, &ksp));
  const DofMap &dofs = potential_->dofs();
  const std::vector<double> full = potential_->derivatives().band, elastic = potential_->bandWithoutCompression();
  std::vector<double> compression(full.size()), right(dofs.rows());
  for (std::size_t k = 0; k < full.size(); ++k) compression[k] = elastic[k] - full[k];
  OwnedVec f, y;
  PetscCall(VecDuplicate(f_, f.out()));
  PetscCall(VecDuplicate(f_, y.out()));
  // A fixed start without symmetry: the same on every machine, orthogonal to no mode of interest.
  increment_.assign(dofs.rows(), 0.0);
  for (std::size_t r = 0; r < increment_.size(); ++r)
    if (dofs.unknownOfRow()[r] >= 0) increment_[r] = 1 + 0.5 * std::sin(1.7 * double(r));
  auto normalise = [&] {
    double norm = 0;
    for (std::size_t r = 0; r < metric_.size(); ++r) norm += metric_[r] * increment_[r] * increment_[r];
    for (double &d : increment_) d /= std::sqrt(norm);
  };
  *found = false;
  int negative;
  bool regular;
  PetscCall(potential_->dofs().fillMatrix(elastic, jacobian_));
  PetscCall(KSPSetOperators(ksp, jacobian_, jacobian_));
  PetscCall(KSPSetUp(ksp));
  PetscCall(readInertia(&negative, &regular));
  const bool buckles = regular && negative == 0;
  if (!buckles) {
    PetscCall(potential_->dofs().fillMatrix(full, jacobian_));
    PetscCall(potential_->dofs().gather(increment_, f));
    PetscCall(shiftUntilPositive(ksp, f, y, 1, true));
  }
  // With A v = b solved, v'K v = v'b - v'(A - K)v: the stiff part of A never enters, whose rounding would hide a small curvature.
  auto softening = [&] {
    if (buckles) return bandTimes(compression, increment_);
    std::vector<double> y(increment_.size(), 0.0);
    for (std::size_t r = 0; r < y.size(); ++r) y[r] = metric_[r] * increment_[r];
    return y;
  };
  normalise();
  right = softening();
  for (int k = 0; k < 100 && !*found; ++k) {
    PetscCall(potential_->dofs().gather(right, f));
    PetscCall(KSPSolve(ksp, f, y));
    increment_.assign(dofs.rows(), 0.0);
    PetscCall(dofs.scatter(y, increment_));
    const double work = dot(increment_, right);
    const std::vector<double> soft = softening();
    *found = k >= 5 && work < (buckles ? 1 : shift_) * dot(increment_, soft);
    normalise();
    right = softening();
  }
  PetscFunctionReturn(0);
}

/// Leaves a saddle along a direction of negative curvature; its side and length come from trials of growing size, with both retractions:
/// edges that are just right must keep their lengths, edges that an unstable state holds compressed must be free to grow.
PetscErrorCode NewtonSolver::escapeSaddle(bool *left) {
  PetscFunctionBeginUser;
  *left = false;
  bool found;
  PetscCall(findBucklingMode(&found));
  if (!found) PetscFunctionReturn(0);
  // One unit: the edge that turns most turns by one radian.
  double turning = 0;
  const Elements &e = potential_->elements();
  for (const RodRange &rod : e.rods)
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const int row = e.edge_row[i];
      for (int a = 0; a < 3; ++a) turning = std::max(turning, std::abs(increment_[row + rod.stride + a] - increment_[row + a]) * e.inverse_rest_length[i]);
      if (rod.stride == 4) turning = std::max(turning, std::abs(increment_[row + 3]));
    }
  for (double &d : increment_) d /= turning;
  RetractionKind &kind = potential_->retraction.kind;
  const RetractionKind usual = kind;
  RetractionKind best_kind = usual;
  double best = potential_->energy(potential_->iterate()), best_scale = 0;
  for (const RetractionKind k : {RetractionKind::length, RetractionKind::additive}) {
    kind = k;
    for (double scale = 1e-6; scale < 2; scale *= 2) // just past a branching of a stiff rod the other branch is that close
      for (const double s : {scale, -scale}) {
        const double energy = potential_->tryMove(increment_, s, trial_) ? potential_->energy(trial_) : HUGE_VAL;
        if (energy < best) {
          best = energy;
          best_scale = s;
          best_kind = k;
        }
      }
  }
  kind = best_kind;
  *left = best_scale != 0 && potential_->tryMove(increment_, best_scale, trial_);
  kind = usual;
  if (!*left) PetscFunctionReturn(0);
  potential_->accept(trial_);
  potential_->resetAxialForces();
  energy_known_ = false;
  ++report_.escapes;
  PetscFunctionReturn(0);
}

/// SNES from the potential's iterate. `failure` is null when it converged.
PetscErrorCode NewtonSolver::newton(const char **failure) {
  SNESConvergedReason reason;
  PetscFunctionBeginUser;
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
  for (std::size_t r = 0; r < e.rods.size(); ++r)
    for (int n = e.rod_cells[r]; n < e.rod_cells[r + 1]; ++n) {
      if (e.measure[r] == Measure::tan) twist = std::max(twist, std::abs(c.twist[n]));
      turning = std::max(turning, std::acos(std::clamp(c.frame[e.cells.frame0[n]].tangent.dot(c.frame[e.cells.frame1[n]].tangent), -1.0, 1.0)));
    }
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

/// Starts from where the velocities lead when that is lower than the start.
void NewtonSolver::predict(const State &start, const Step &step) {
  const Elements &e = potential_->elements();
  const auto &unknown = potential_->dofs().unknownOfRow();
  increment_.assign(potential_->dofs().rows(), 0.0);
  for (std::size_t v = 0; v < start.velocity.size(); ++v)
    for (int a = 0; a < 3; ++a)
      if (unknown[e.vertex_row[v] + a] >= 0) increment_[e.vertex_row[v] + a] = step.dt * start.velocity[v][a];
  for (const RodRange &rod : e.rods) {
    if (rod.stride == 4)
      for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) increment_[e.edge_row[i] + 3] = step.dt * start.twist_rate[i];
    if (rod.closed) std::copy_n(&increment_[rod.first_row], rod.stride + 3, &increment_[rod.first_row + rod.rows]);
  }
  potential_->retraction.continues = true;
  const bool possible = potential_->tryMove(increment_, 1, trial_);
  potential_->retraction.continues = false;
  if (!possible) return;
  if (potential_->energy(trial_) < potential_->energy(potential_->iterate())) potential_->accept(trial_);
}

PetscErrorCode NewtonSolver::solve(const State &start, const Step &step, NewtonReport *report, const std::vector<double> *guess) {
  const char *failure = nullptr;
  PetscFunctionBeginUser;
  report_ = {};
  sharpness_ = 1;
  shift_ = 0; // a step depends on its start alone
  potential_->beginStep(start, step);
  if (guess)
    potential_->moveTo(*guess);
  else if (!step.isStatic())
    predict(start, step);
  energy_known_ = false;
  if (potential_->beyondBarrier())
    failure = "a support turns past the barrier of measure tan at 180 degrees of twist per vertex; use more edges, or measure: angle";
  else
    PetscCall(newton(&failure));
  // In statics the answer must be a minimum.
  for (int k = 0; step.isStatic() && !failure; ++k) {
    PetscCall(inertiaAtIterate(&report_.negative_pivots));
    if (k == 0) report_.first_negative_pivots = report_.negative_pivots;
    if (!seek_minimum && report_.negative_pivots >= 0) break;
    if (report_.negative_pivots == 0 || (report_.negative_pivots > 0 && !potential_->scene().moments.empty())) break; // couples: no minimum to speak of
    bool left = false;
    if (report_.negative_pivots > 0 && k < 10) PetscCall(escapeSaddle(&left));
    if (!left) {
      failure = report_.negative_pivots < 0 ? "the Hessian cannot be factored"
                                            : "the equilibrium is unstable (negative pivots) and no way down from it was found";
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
