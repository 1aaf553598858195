/// Indefinite Hessians: descent directions from shifted ones, and the ways out of saddles.
#include "tendril/solver/newton.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {

/// Rods whose Hessian gives no way down as it is: with negative pivots, or with zero ones where forces act on the motions that they leave out. `y`:
/// Newton's direction.
PetscErrorCode NewtonSolver::findIndefinite(Vec y, bool regular, bool *any) {
  constexpr double little = 1e-3; // of the forces
  PetscFunctionBeginUser;
  bool scattered = false;
  *any = false;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    char &indefinite = work_->indefinite[r];
    indefinite = work_->wanted[r] && (work_->negative[r] > 0 || !regular);
    if (work_->wanted[r] && !indefinite && work_->zero[r] > 0 && !isAtNoise(work_->residual[r], 0)) {
      if (!scattered) PetscCall(potential_->dofs().scatter(y, rods_, work_->increment));
      scattered = true;
      const RodRange &rod = potential_->elements().rods[r];
      const Planes &gradient = potential_->derivatives({r, r + 1}).gradient;
      Planes &rest = work_->coordinates; // free until the iterate is written
      for (int a = 0; a < slot_size; ++a) std::fill(rest[a] + rod.first_slot, rest[a] + rod.vertexEnd() + 2, 0.0);
      potential_->blocks().multiply(rod, work_->increment, rest);
      potential_->dofs().fold(rod, rest);
      const double *freedom = potential_->elements().freedom();
      double forces = 0, out_of_balance = 0;
      for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
        for (int a = 0; a < slot_size; ++a) {
          const double weight = a < 3 ? freedom[s] : rod.twist ? 1 / std::pow(potential_->length(r), 2) : 0;
          forces += weight * std::pow(gradient[a][s], 2);
          out_of_balance += weight * std::pow(gradient[a][s] - rest[a][s], 2);
        }
      indefinite = out_of_balance > little * little * forces;
    }
    *any = *any || indefinite;
  }
  PetscFunctionReturn(0);
}

/// Direction for an indefinite Hessian. A few negative pivots mean a state near a branching: a shifted diagonal keeps most of Newton's speed there.
/// Many mean compressed edges: then their compression is left out of the Hessian, and the diagonal shifted only if that is not enough.
/// In statics an equilibrium of couples need not be a minimum of anything: there Newton's own direction stands.
PetscErrorCode NewtonSolver::makeDescent(Vec f, Vec y, bool regular) {
  constexpr int few = 4; // the two planes of the first two buckling modes
  PetscFunctionBeginUser;
  if (regular && circulatory_ && potential_->step().isStatic()) PetscFunctionReturn(0);
  const int unshifted = report_.negative_pivots;
  const HessianKind kind = potential_->step().hessian == HessianKind::exact ? HessianKind::uncompressed : potential_->step().hessian;
  bool compressed = false;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    if (!work_->wanted[r] || work_->negative[r] <= (banded_ || inertia_ ? few : few * (rods_.end - rods_.begin))) continue;
    potential_->assembleRod(r, kind);
    compressed = true;
  }
  if (compressed) {
    PetscCall(refactor());
    PetscCall(readInertia(&regular));
    ++report_.shifts;
  }
  PetscCall(shiftUntilPositive(regular));
  PetscCall(KSPSolve(factored(), f, y));
  report_.negative_pivots = unshifted;
  PetscFunctionReturn(0);
}

/// First shift to try [1/s^2]: the slowest bending wave of the rod where it is fastest, EI/(rho L^4), or the edge's own axial one for a cable.
double NewtonSolver::firstShift(int r) const {
  const Rod &rod = potential_->scene().rods[r];
  const double length = potential_->length(r);
  const Material &m = rod.material;
  const auto [k1, k2] = m.flexural_stiffness;
  const double softest = k1 > 0 && k2 > 0 ? std::min(k1, k2) : std::max(k1, k2);
  const double stiffness = m.isCable() ? 1e-6 * m.axial_stiffness : 10 * softest / (length * length);
  return stiffness / (m.linear_density * length * length);
}

/// Adds multiples of the metric to the indefinite Hessians until all pivots are positive, so that the step goes downhill. Starts near
/// the last shift that was needed, so that a run of indefinite iterates costs one extra factorisation each.
PetscErrorCode NewtonSolver::shiftUntilPositive(bool regular) {
  PetscFunctionBeginUser;
  for (int attempt = 0; attempt < 40; ++attempt) {
    bool any = false;
    for (int r = rods_.begin; r < rods_.end; ++r) {
      if (!work_->indefinite[r] || (work_->negative[r] + work_->zero[r] == 0 && regular)) continue;
      double &shift = work_->shift[r];
      shift = shift > 0 ? 8 * shift : work_->last_shift[r] > 0 ? 0.25 * work_->last_shift[r] : firstShift(r);
      work_->last_shift[r] = shift;
      any = true;
    }
    if (!any) break;
    PetscCall(refactor());
    PetscCall(readInertia(&regular));
    ++report_.shifts;
  }
  PetscFunctionReturn(0);
}

/// A direction of negative curvature at an unstable equilibrium, in work_->increment. With the Hessian K = E - G split into the part E without
/// compression and the effect G of compression, iterating v <- E^-1 G v gives the first buckling mode, the smoothest way out. Where compression
/// is not the cause, inverse iteration with the shifted Hessian finds the lowest mode. `neutral`: the mode costs no energy, to rounding, and
/// nothing goes down: a turn of the whole rod about an axis, say.
PetscErrorCode NewtonSolver::findBucklingMode(bool *found, bool *neutral) {
  // Of the energies that balance, stiff edges leave 1e-7 by rounding; and what the forces are out of balance by, a neutral motion is curved by.
  const double rounding = std::clamp(10 * report_.residual.force, 1e-7, 1e-5);
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  const Elements &e = potential_->elements();
  EdgeBlocks softening = potential_->derivatives(rods_).blocks;
  auto sum = [&](const Planes &a, const Planes &b) {
    double sum = 0;
    for (int r = rods_.begin; r < rods_.end; ++r) sum += dot(e.rods[r], a, b);
    return sum;
  };
  // A fixed start without symmetry: the same on every machine, orthogonal to no mode of interest.
  work_->increment.clear();
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = e.rods[r];
    for (int i = 0; i < rod.vertices; ++i)
      for (int a = 0; a < slot_size; ++a)
        if (dofs.unknown(rod.slot(i), a) >= 0) work_->increment[a][rod.slot(i)] = 1 + 0.5 * std::sin(1.7 * (slot_size * i + a));
    dofs.copyBehindRing(rod, work_->increment);
  }
  bool regular;
  for (int r = rods_.begin; r < rods_.end; ++r) potential_->assembleRod(r, HessianKind::uncompressed);
  PetscCall(refactor());
  PetscCall(readInertia(&regular));
  const bool buckles = regular && report_.negative_pivots == 0;
  if (buckles)
    softening.subtractFrom(potential_->blocks());
  else {
    for (int r = rods_.begin; r < rods_.end; ++r) potential_->assembleRod(r, HessianKind::exact);
    fill(work_->indefinite, true);
    PetscCall(shiftUntilPositive(false));
  }
  // With A v = b solved, v'K v = v'b - v'(A - K)v: the stiff part of A never enters, whose rounding would hide a small curvature.
  auto soften = [&] { // (A - K) v
    Planes y = dofs.makePlanes();
    for (int r = rods_.begin; r < rods_.end; ++r) {
      const RodRange &rod = e.rods[r];
      if (buckles) {
        softening.multiply(rod, work_->increment, y);
        dofs.fold(rod, y);
      } else
        for (int a = 0; a < slot_size; ++a)
          for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) y[a][s] = work_->shift[r] * work_->metric[a][s] * work_->increment[a][s];
    }
    return y;
  };
  auto normalise = [&] {
    Planes heavy = work_->increment;
    for (int r = rods_.begin; r < rods_.end; ++r)
      for (int k = 0; k < slot_size; ++k)
        for (int s = e.rods[r].first_slot; s < e.rods[r].vertexEnd(); ++s) heavy[k][s] *= work_->metric[k][s];
    const double norm = std::sqrt(sum(work_->increment, heavy));
    for (double &d : work_->increment) d /= norm;
  };
  *found = false;
  normalise();
  Planes right = soften();
  double stiff = 0, soft = 0;
  for (int k = 0; k < 100 && !*found; ++k) {
    PetscCall(solveLinear(right, work_->increment));
    stiff = sum(work_->increment, right);
    soft = sum(work_->increment, soften());
    double noise = rounding * std::abs(stiff);
    for (int r = rods_.begin; r < rods_.end; ++r) noise += hessianNoise(r, work_->increment);
    *neutral = std::abs(soft - stiff) <= noise;
    *found = k >= 5 && stiff < soft && !*neutral;
    normalise();
    right = soften();
  }
  // Compression that makes up for no mode's stiffness leaves a definite Hessian: its negative pivots are rounding.
  if (buckles && !*found && !(soft > 0.5 * stiff)) *neutral = true;
  for (int r = rods_.begin; r < rods_.end; ++r) potential_->assembleRod(r, potential_->step().hessian);
  PetscFunctionReturn(0);
}

/// Leaves a saddle along a direction of negative curvature; its side and length come from trials of growing size, with both retractions:
/// edges that are just right must keep their lengths, edges that an unstable state holds compressed must be free to grow.
PetscErrorCode NewtonSolver::escapeSaddle(bool *left, bool *neutral) {
  PetscFunctionBeginUser;
  *left = false;
  bool found;
  PetscCall(findBucklingMode(&found, neutral));
  if (!found) PetscFunctionReturn(0);
  // One unit: the edge that turns most turns by one radian.
  double turning = 0;
  const Elements &e = potential_->elements();
  for (int r = rods_.begin; r < rods_.end; ++r)
    for (int s = e.rods[r].first_slot; s < e.rods[r].edgeEnd(); ++s) {
      for (int a = 0; a < 3; ++a) turning = std::max(turning, std::abs(work_->increment[a][s + 1] - work_->increment[a][s]) * e.inverseRestLength()[s]);
      turning = std::max(turning, std::abs(work_->increment[3][s]));
    }
  for (double &d : work_->increment) d /= turning;
  auto move = [&](RetractionKind kind, double scale) {
    for (int r = rods_.begin; r < rods_.end; ++r)
      if (!potential_->tryMove(work_->increment, scale, r, kind, work_->trial)) return false;
    return true;
  };
  RetractionKind best_kind = RetractionKind::length;
  double best = potential_->energy(potential_->iterate(), rods_), best_scale = 0;
  for (const RetractionKind kind : {RetractionKind::length, RetractionKind::additive})
    for (double scale = 1e-6; scale < 2; scale *= 2) // just past a branching of a stiff rod the other branch is that close
      for (const double s : {scale, -scale}) {
        const double energy = move(kind, s) ? potential_->energy(work_->trial, rods_) : HUGE_VAL;
        if (energy >= best) continue;
        best = energy;
        best_scale = s;
        best_kind = kind;
      }
  *left = best_scale != 0 && move(best_kind, best_scale);
  if (!*left) PetscFunctionReturn(0);
  for (int r = rods_.begin; r < rods_.end; ++r) {
    potential_->accept(work_->trial, r);
    potential_->resetAxialForces(r);
  }
  forgetEnergies();
  ++report_.escapes;
  PetscFunctionReturn(0);
}

} // namespace tendril
