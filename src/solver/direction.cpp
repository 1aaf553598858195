/// Newton's direction: the factored Hessian and its inertia, shifts that make it a way down, supports that move,
/// couples.
#include "tendril/solver/newton.hpp"

namespace tendril {

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
      if (!work_->active[r]) continue;
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

/// First shift to try [1/s^2]: the slowest bending wave of the rod where it is fastest, EI/(rho L^4), or the edge's own
/// axial one for a cable.
double NewtonSolver::firstShift(int r) const {
  const Rod &rod = potential_->scene().rods[r];
  const double length = potential_->length(r);
  const Material &m = rod.material;
  const auto [k1, k2] = m.flexural_stiffness;
  const double softest = k1 > 0 && k2 > 0 ? std::min(k1, k2) : std::max(k1, k2);
  const double stiffness = m.isCable() ? 1e-6 * m.axial_stiffness : 10 * softest / (length * length);
  return stiffness / (m.linear_density * length * length);
}

/// With the masses of bodies that no rod holds by a tie: a mechanism on a rod is as heavy as all of it.
double NewtonSolver::firstShift(RodSet island) const {
  double least = HUGE_VAL, of_rods = 0, of_bodies = 0;
  for (int r = island.begin; r < island.end; ++r) {
    least = std::min(least, firstShift(r));
    of_rods += potential_->scene().rods[r].material.linear_density * potential_->length(r);
  }
  for (const JoinedBody &b : potential_->elements().bodies(island)) of_bodies += work_->metric.vector(0, b.position)[0];
  return least * of_rods / (of_rods + of_bodies);
}

/// Adds multiples of the metric to the indefinite Hessians until all pivots are positive, so that the step goes
/// downhill. Starts near the last shift that was needed, so that a run of indefinite iterates costs one extra
/// factorisation each.
PetscErrorCode NewtonSolver::shiftUntilPositive(bool regular) {
  PetscFunctionBeginUser;
  for (int attempt = 0; attempt < 40; ++attempt) {
    bool any = false;
    for (const RodSet island : islands_) {
      const int r = island.begin;
      if (!work_->indefinite[r] || (work_->negative[r] + work_->zero[r] == 0 && regular)) continue;
      const double shift = work_->shift[r] > 0        ? 8 * work_->shift[r]
                           : work_->last_shift[r] > 0 ? 0.25 * work_->last_shift[r]
                                                      : firstShift(island);
      fill(work_->shift, island, shift);
      fill(work_->last_shift, island, shift);
      any = true;
    }
    if (!any) break;
    PetscCall(refactor());
    PetscCall(readInertia(&regular));
    ++report_.shifts;
  }
  PetscFunctionReturn(0);
}

/// y = K x of an island, by the blocks as they are.
void NewtonSolver::multiplyHessian(RodSet island, const Planes &x, Planes &y) {
  const DofMap &dofs = potential_->dofs();
  for (int r = island.begin; r < island.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int a = 0; a < slot_size; ++a) std::fill(y[a] + rod.first_slot, y[a] + rod.vertexEnd() + 2, 0.0);
    dofs.forBeside({r, r + 1}, [&](int s) { y.setVector(0, s, Vec3::Zero()); });
    potential_->blocks().multiply(rod, dofs.joins(r), x, y);
    dofs.fold(rod, y);
  }
  dofs.foldJoined(island, y);
}

/// Rods whose Hessian gives no way down as it is: with negative pivots, or with zero ones where forces act on the
/// motions that they leave out. `y`: Newton's direction.
PetscErrorCode NewtonSolver::findIndefinite(Vec y, bool regular, bool *any) {
  constexpr double little = 1e-3; // of the forces
  PetscFunctionBeginUser;
  bool scattered = false;
  *any = false;
  const DofMap &dofs = potential_->dofs();
  for (const RodSet island : islands_) {
    const bool active = work_->active[island.begin];
    bool indefinite = active && (work_->negative[island.begin] > 0 || !regular), noise = true;
    for (int r = island.begin; r < island.end; ++r) noise = noise && isAtNoise(work_->residual[r], 0);
    if (active && !indefinite && work_->zero[island.begin] > 0 && !noise) {
      if (!scattered) PetscCall(dofs.scatter(y, rods_, work_->increment));
      scattered = true;
      const Planes &gradient = potential_->derivatives(island).gradient;
      Planes &rest = work_->coordinates; // free until the iterate is written
      multiplyHessian(island, work_->increment, rest);
      const double *freedom = potential_->elements().freedom();
      double forces = 0, out_of_balance = 0;
      for (int r = island.begin; r < island.end; ++r) {
        const RodRange &rod = potential_->elements().rods[r];
        for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
          for (int a = 0; a < slot_size; ++a) {
            const double weight = a < 3 ? freedom[s] : rod.twist ? 1 / std::pow(potential_->length(r), 2) : 0;
            forces += weight * std::pow(gradient[a][s], 2);
            out_of_balance += weight * std::pow(gradient[a][s] - rest[a][s], 2);
          }
        for (const JoinedEdge &j : dofs.joinedEdges({r, r + 1})) {
          const double weight = 1 / std::pow(potential_->length(r), 2);
          forces += weight * gradient.vector(0, j.frame).squaredNorm();
          out_of_balance += weight * (gradient.vector(0, j.frame) - rest.vector(0, j.frame)).squaredNorm();
        }
        for (const JoinedBody &b : dofs.bodies({r, r + 1}))
          for (const int s : {b.position, b.rotation}) {
            const double weight = s == b.position ? 1 : 1 / std::pow(potential_->length(r), 2);
            forces += weight * gradient.vector(0, s).squaredNorm();
            out_of_balance += weight * (gradient.vector(0, s) - rest.vector(0, s)).squaredNorm();
          }
      }
      indefinite = out_of_balance > little * little * forces;
    }
    fill(work_->indefinite, island, indefinite);
    *any = *any || indefinite;
  }
  PetscFunctionReturn(0);
}

/// Direction for an indefinite Hessian. A few negative pivots mean a state near a branching: a shifted diagonal keeps
/// most of Newton's speed there. Many mean compressed edges: then their compression is left out of the Hessian, and the
/// diagonal shifted only if that is not enough. In statics an equilibrium of couples need not be a minimum of anything:
/// near one Newton's own direction stands.
PetscErrorCode NewtonSolver::makeDescent(Vec f, Vec y, bool regular) {
  constexpr int few = 2;          // the first two buckling modes, in each plane
  constexpr double longest = 0.1; // of the rod's length
  PetscFunctionBeginUser;
  if (regular && circulatory_ && potential_->step().isStatic()) {
    bool any = false;
    for (const RodSet island : islands_) {
      if (circulates(island)) fill(work_->indefinite, island, false);
      any = any || work_->indefinite[island.begin];
    }
    if (!any) PetscFunctionReturn(0);
  }
  const int unshifted = report_.negative_pivots;
  const HessianKind kind =
      potential_->step().hessian == HessianKind::exact ? HessianKind::uncompressed : potential_->step().hessian;
  bool compressed = false;
  for (const RodSet island : islands_) {
    const int r = island.begin;
    const int planes = potential_->elements().rods[r].flat < 0 ? 2 : 1;
    if (!work_->active[r] || !work_->indefinite[r] || work_->negative[r] <= few * planes) continue;
    potential_->assemble(island, kind);
    compressed = true;
  }
  if (compressed) {
    PetscCall(refactor());
    PetscCall(readInertia(&regular));
    ++report_.shifts;
  }
  PetscCall(shiftUntilPositive(regular));
  PetscCall(KSPSolve(factored(), f, y));
  // A direction far longer than the rod comes of motions almost without stiffness: a larger shift, instead of a line
  // search that cuts all of it.
  for (bool longer = potential_->step().isStatic(); longer;) {
    longer = false;
    PetscCall(potential_->dofs().scatter(y, rods_, work_->increment));
    for (const RodSet island : islands_) {
      if (!(work_->active[island.begin] && (work_->shift[island.begin] > 0 || work_->indefinite[island.begin])))
        continue;
      double size = 0;
      for (int r = island.begin; r < island.end; ++r)
        if (work_->edge_metric[potential_->elements().rods[r].first_slot] > 0) // what hangs on one place swings
          size = std::max(size, sizeOf(r, work_->increment));
      if (!(size > longest)) continue;
      const double now = work_->shift[island.begin] > 0 ? work_->shift[island.begin] : firstShift(island),
                   shift = now * std::min(size / longest, 1e6);
      fill(work_->shift, island, shift);
      fill(work_->last_shift, island, shift);
      longer = true;
    }
    if (!longer) break;
    PetscCall(refactor());
    ++report_.shifts;
    PetscCall(KSPSolve(factored(), f, y));
  }
  report_.negative_pivots = unshifted;
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
    dofs.forBeside({r, r + 1}, [&](int s) { right.setVector(0, s, gradient.vector(0, s)); });
    potential_->blocks().multiply(rod, dofs.joins(r), work_->motion, right);
    if (potential_->obstaclesGo(r)) potential_->addObstacleMotion(r, right);
    dofs.fold(rod, right);
  }
  dofs.foldJoined(rods_, right);
  PetscCall(dofs.gather(right, rods_, right_, &work_->active));
  PetscCall(SNESGetKSP(snes_, &ksp));
  PetscCall(KSPSolve(ksp, right_, y));
  PetscFunctionReturn(0);
}

/// Whether an island comes to an equilibrium that need not be a minimum of anything, for couples or follower forces
/// act on it. Farther from it than follower forces are large, which have nothing in the matrix, the way down leads
/// nearer.
bool NewtonSolver::circulates(RodSet island) const {
  constexpr double near = 2; // out of balance, over the load
  if (!potential_->step().isStatic() || !circulatory_ || !circulatory_->acts(island)) return false;
  if (potential_->elements().followers(island).empty()) return true;
  return std::all_of(work_->residual.begin() + island.begin, work_->residual.begin() + island.end,
                     [](const Residual &r) { return std::max(r.force, r.moment) <= near; });
}

/// Newton direction of the whole derivative, couples included, from that of its symmetric part, in work_->increment.
PetscErrorCode NewtonSolver::includeCirculation(bool *regular) {
  PetscFunctionBeginUser;
  PetscCall(
      circulatory_->update([this](const Planes &right, Planes &solution) { return solveLinear(right, solution); }));
  *regular = circulatory_->correct(work_->increment);
  PetscFunctionReturn(0);
}

/// The direction y along which a line search goes, of any type: x - length y. It comes as the solution of the matrix
/// factored last with the gradient f, and becomes a way down, with the supports that move and the couples.
PetscErrorCode NewtonSolver::direct(Vec x, Vec f, Vec y) {
  bool regular, possible;
  PetscFunctionBeginUser;
  PetscCall(moveTo(x, &possible));
  PetscCheck(possible, PETSC_COMM_SELF, PETSC_ERR_PLIB, "no configuration is where the line search ended");
  if (fresh_)
    PetscCall(solveAgain(f, y));
  else
    PetscCall(secants_.apply(
        potential_->dofs(), islands_,
        [this](Vec right, Vec solution) -> PetscErrorCode { return KSPSolve(factored(), right, solution); }, f, right_,
        y));
  PetscCall(readInertia(&regular));
  bool indefinite = false;
  fill(work_->indefinite, false);
  if (fresh_ && seek_ == Seek::minimum) PetscCall(findIndefinite(y, regular, &indefinite));
  if (indefinite) PetscCall(makeDescent(f, y, regular));
  if (std::any_of(work_->moving.begin() + rods_.begin, work_->moving.begin() + rods_.end, [](char m) { return m; }))
    PetscCall(includeMotion(y));
  if (circulatory_) {
    PetscCall(potential_->dofs().scatter(y, rods_, work_->increment));
    PetscCall(includeCirculation(&regular)); // where all of it is singular, the symmetric part has to do
    PetscCall(potential_->dofs().gather(work_->increment, rods_, y));
  }
  PetscFunctionReturn(0);
}

} // namespace tendril
