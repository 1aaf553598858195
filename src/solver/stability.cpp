/// Whether an answer is a minimum, and the ways out of saddles.
#include "tendril/contact/contact.hpp"
#include "tendril/solver/activity.hpp"
#include "tendril/solver/hints.hpp"
#include "tendril/solver/newton.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {

/// One of two fixed starts without symmetry for the search of a mode, in work_->increment: the same on every machine.
/// Of two modes in different planes that are alike, as those of a round rod, a state may have left along the first
/// start; then it is orthogonal to what is left, and the second is not.
void NewtonSolver::beginMode(int start) {
  constexpr double weight[2][slot_size] = {{1, 1, 1, 1}, {1, -2, 3, -4}};
  const DofMap &dofs = potential_->dofs();
  work_->increment.clear();
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int i = 0; i < rod.vertices; ++i)
      for (int a = 0; a < slot_size; ++a)
        if (dofs.unknown(rod.slot(i), a) >= 0)
          work_->increment[a][rod.slot(i)] = weight[start][a] * (1 + 0.5 * std::sin(1.7 * (slot_size * i + a)));
    for (const JoinedEdge &j : dofs.joinedEdges({r, r + 1}))
      work_->increment.setVector(0, j.frame, Vec3::Constant(weight[start][3]));
    for (const JoinedBody &b : dofs.bodies({r, r + 1}))
      for (const int slot : {b.position, b.rotation})
        work_->increment.setVector(0, slot, Vec3(1, -0.5, 0.25) * weight[start][slot == b.position ? 0 : 3]);
    dofs.copyBehindRing(rod, work_->increment);
  }
  dofs.copyJoined(rods_, work_->increment);
}

/// Product of the metric and a motion of some rods.
void NewtonSolver::weigh(const Planes &motion, Planes &weighed) const {
  const DofMap &dofs = potential_->dofs();
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int a = 0; a < slot_size; ++a)
      for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) weighed[a][s] = work_->metric[a][s] * motion[a][s];
    dofs.forBeside({r, r + 1}, [&](int s) {
      weighed.setVector(0, s, work_->metric.vector(0, s).cwiseProduct(motion.vector(0, s)));
    });
  }
  dofs.foldJoined(rods_, weighed);
}

/// Makes the mode in work_->increment one of unit mass; returns the root of the mass it had.
double NewtonSolver::normaliseMode() {
  Planes weighed = potential_->dofs().makePlanes(rods_);
  weigh(work_->increment, weighed);
  const double mass = potential_->dofs().dot(rods_, weighed, work_->increment);
  for (double &d : work_->increment) d /= std::sqrt(mass);
  return std::sqrt(mass);
}

/// Bisection of the lift on the inertia, then inverse iteration beside the eigenvalue found: motions that cost nothing
/// have another one, if only by little.
PetscErrorCode NewtonSolver::criticalMode(int stable, double *lift, Planes *mode) {
  constexpr int iterations = 12;
  constexpr double close = 1.01,
                   highest = 1e12; // ratio of the ends of the interval: each iteration gains a factor of 100
  PetscFunctionBeginUser;
  int negative;
  double low = *lift, high = low;
  PetscCall(inertiaAtIterate(&negative, low));
  if (negative <= stable) PetscFunctionReturn(0);
  while (negative > stable && high < highest) {
    low = std::exchange(high, 4 * high);
    PetscCall(inertiaAtIterate(&negative, high));
  }
  while (high > close * low) {
    const double middle = std::sqrt(low * high);
    PetscCall(inertiaAtIterate(&negative, middle));
    (negative > stable ? low : high) = middle;
  }
  *lift = high;
  PetscCall(inertiaAtIterate(&negative, high));
  beginMode(0);
  normaliseMode();
  for (int k = 0; k < iterations; ++k) {
    watch().beat();
    Planes right = potential_->dofs().makePlanes(rods_);
    weigh(work_->increment, right);
    PetscCall(solveLinear(right, work_->increment));
    normaliseMode();
  }
  double turning = 0;
  for (int r = rods_.begin; r < rods_.end; ++r) turning = std::max(turning, turningOf(r));
  for (double &d : work_->increment) d /= turning;
  // One of the two signs, always the same: its largest displacement is positive.
  double largest = 0;
  mode->clear();
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = potential_->elements().rods[r];
    for (int a = 0; a < slot_size; ++a)
      for (int s = rod.first_slot; s < rod.vertexEnd() + (rod.closed ? 2 : 0); ++s) {
        const double d = (*mode)[a][s] = work_->increment[a][s];
        if (a < 3 && std::abs(d) > std::abs(largest) * (1 + 1e-6)) largest = d;
      }
    potential_->dofs().forBeside({r, r + 1}, [&](int s) { mode->setVector(0, s, work_->increment.vector(0, s)); });
  }
  if (largest < 0)
    for (double &d : *mode) d = -d;
  PetscFunctionReturn(0);
}

/// Leaves a saddle along directions of negative curvature; side and length come from trials of growing size, with both
/// retractions: edges that are just right must keep their lengths, edges that an unstable state holds compressed must
/// be free to grow.
PetscErrorCode NewtonSolver::escapeSaddle(bool *left, bool *neutral) {
  PetscFunctionBeginUser;
  *left = false;
  const Doing here([](std::ostream &out) { out << "a way down from an unstable equilibrium is looked for"; });
  std::vector<char> found, neutral_rods;
  const std::vector<int> negative = work_->negative;
  PetscCall(findBucklingModes(&found, &neutral_rods));
  *neutral = true;
  for (const RodSet island : islands_) {
    if (negative[island.begin] > 0) *neutral = *neutral && neutral_rods[island.begin];
    if (!found[island.begin]) continue;
    double turning = 0; // one unit: the edge that turns most turns by one radian
    for (int r = island.begin; r < island.end; ++r) turning = std::max(turning, turningOf(r));
    RetractionKind best_kind = RetractionKind::length;
    double best = potential_->energy(potential_->iterate(), island), best_scale = 0;
    auto possible = [&](double s, RetractionKind kind) {
      return potential_->tryMove(work_->increment, s, island, kind, work_->trial);
    };
    for (const RetractionKind kind : {RetractionKind::length, RetractionKind::additive})
      for (double scale = 1e-6; scale < 2;
           scale *= 2) // just past a branching of a stiff rod the other branch is that close
        for (const double s : {scale / turning, -scale / turning}) {
          if (!possible(s, kind)) continue;
          const double energy = potential_->energy(work_->trial, island);
          if (energy >= best) continue;
          best = energy;
          best_scale = s;
          best_kind = kind;
        }
    if (best_scale == 0) continue;
    possible(best_scale, best_kind);
    for (int r = island.begin; r < island.end; ++r) {
      potential_->accept(work_->trial, r);
      potential_->resetAxialForces(r);
    }
    *left = true;
  }
  if (!*left) PetscFunctionReturn(0);
  forgetEnergies();
  ++report_.escapes;
  PetscFunctionReturn(0);
}

/// An equilibrium with motions that cost nothing: what loads move along them has to be found, by Newton's own steps; a
/// shift would drown the soft direction. \param creeps whether a way down was crept along: it is there, if too flat for
/// its curvature to be told from rounding
PetscErrorCode NewtonSolver::settleNeutral(bool first, bool creeps, Seek seek, Outcome *now) {
  int negative;
  PetscFunctionBeginUser;
  PetscCall(inertiaAtIterate(&negative));
  report_.zero_pivots += std::max(0, negative);
  report_.negative_pivots = 0;
  if (first) report_.first_negative_pivots = 0;
  const bool descends = creeps && potential_->scene().edges() <= most_searched_edges;
  Configuration here;
  if (descends) here = potential_->iterate();
  PetscCall(settle(Seek::equilibrium, now));
  if (now->failure.empty() || report_.lost || !descends) PetscFunctionReturn(0);
  for (int r = rods_.begin; r < rods_.end; ++r) potential_->accept(here, r);
  forgetEnergies();
  seek_ = seek;
  descends_ = true;
  PetscCall(newton(&now->failure));
  descends_ = false;
  PetscFunctionReturn(0);
}

/// In statics the answer must be a minimum, and the Hessian there says how far from it the iterate still is.
PetscErrorCode NewtonSolver::settleMinimum(Seek seek, Outcome *now) {
  PetscFunctionBeginUser;
  for (int k = 0; now->failure.empty() && !now->settled; ++k) {
    int negative;
    PetscCall(inertiaAtIterate(&negative));
    report_.negative_pivots = negative;
    if (k == 0) report_.first_negative_pivots = negative;
    // Where nothing holds a scene that is at rest, its Hessian may be too singular to be factored.
    if (seek == Seek::equilibrium && (negative >= 0 || report_.iterations == 0)) break;
    if (negative > 0)
      now->beyond = limitOfLaw(*potential_, rods_, potential_->iterate(), 1, std::sqrt(2.0 / 3),
                               std::sqrt(1.0 / 3)); // where an edge gives way, the load falls
    if (!now->beyond.empty()) {
      now->failure = "the equilibrium is unstable" + now->beyond;
      break;
    }
    // Couples have no minimum to speak of. What friction at the surface holds may roll, and does so from rounding.
    auto rolls = [&](RodSet island) {
      for (int r = island.begin; r < island.end; ++r)
        if (potential_->scene().touches(r) && carriesSurface(potential_->scene().rods[r])) return true;
      return circulatory_ && circulatory_->acts(island);
    };
    for (const RodSet island : islands_)
      if (negative > 0 && rolls(island)) {
        negative -= work_->negative[island.begin];
        fill(work_->negative, island, 0);
      }
    if (negative == 0) {
      PetscCall(settle(seek_, now));
      continue;
    }
    const bool creeps = creeps_;
    bool left = false, neutral = false;
    const std::string unstable = unstableRod();
    if (negative > 0 && k < 10) PetscCall(escapeSaddle(&left, &neutral));
    if (neutral && !left) {
      PetscCall(settleNeutral(k == 0, creeps, seek, now));
      continue;
    }
    seek_ = seek;
    if (!left) {
      now->failure = negative < 0
                         ? "the Hessian cannot be factored" +
                               tellImbalance(*potential_, farthestRod(*potential_, rods_, asked()), asked())
                         : "the equilibrium is unstable (negative pivots) and no way down from it was found" + unstable;
      break;
    }
    sharpness_ *= 1e-2; // close to a branching the forces are small far from the equilibrium
    PetscCall(newton(&now->failure));
  }
  PetscFunctionReturn(0);
}

} // namespace tendril
