/// Indefinite Hessians: descent directions from shifted ones, and the ways out of saddles.
#include "tendril/contact/contact.hpp"
#include "tendril/solver/activity.hpp"
#include "tendril/solver/hints.hpp"
#include "tendril/solver/newton.hpp"

#include <Eigen/Eigenvalues>

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
  Planes weighed = potential_->dofs().makePlanes();
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
    Planes right = potential_->dofs().makePlanes();
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

namespace {

/// A motion v, A v and (A - K) v, with the Hessian K and a definite matrix A beside it.
struct Probe {
  Planes motion, stiff, soft;
};

/// The combination of up to three probes with the largest quotient of v'(A - K)v and v'Av, island by island: a step of
/// locally optimal conjugate gradients (Knyazev 2001) from `x` along `w`, and what the last step moved by, `p`. `x` has
/// v'Av = 1 then.
void improve(const DofMap &dofs, RodSet island, const Probe &w, Probe &x, Probe &p, int count) {
  const std::array<const Probe *, 3> basis{&w, &x, &p};
  Eigen::MatrixXd stiff(3, 3), soft(3, 3);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j <= i; ++j) {
      stiff(i, j) = stiff(j, i) = dofs.dot(island, basis[i]->motion, basis[j]->stiff);
      soft(i, j) = soft(j, i) = dofs.dot(island, basis[i]->motion, basis[j]->soft);
    }
  Eigen::Vector3d share = Eigen::Vector3d::Zero();
  for (bool independent = false; count > 0 && !independent;
       --count) { // what is almost a combination of the others is left out
    const Eigen::VectorXd scale = stiff.diagonal().head(count).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd a = scale.asDiagonal() * stiff.topLeftCorner(count, count) * scale.asDiagonal();
    independent = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues()[0] > 1e-10;
    if (!independent) continue;
    const Eigen::MatrixXd b = scale.asDiagonal() * soft.topLeftCorner(count, count) * scale.asDiagonal();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(b, a);
    share.head(count) = scale.cwiseProduct(ritz.eigenvectors().col(count - 1));
  }
  auto combine = [&](Planes Probe::*part) {
    for (int r = island.begin; r < island.end; ++r) {
      const RodRange &rod = dofs.rods()[r];
      for (int a = 0; a < slot_size; ++a) {
        const double *along = (w.*part)[a];
        double *here = (x.*part)[a], *last = (p.*part)[a];
        auto combined = [&](int s) {
          last[s] = share[0] * along[s] + share[2] * last[s];
          here[s] = share[1] * here[s] + last[s];
        };
        for (int s = rod.first_slot; s < rod.vertexEnd() + 2; ++s) combined(s);
        if (a < 3) dofs.forBeside({r, r + 1}, combined);
      }
    }
  };
  for (Planes Probe::*part : {&Probe::motion, &Probe::stiff, &Probe::soft}) combine(part);
}

} // namespace

/// Directions of negative curvature of the rods with negative pivots, in work_->increment. With the Hessian K = E - G
/// split into the part E without compression and the effect G of compression, the largest eigenvalue of E^-1 G belongs
/// to the first buckling mode, the smoothest way out. Where compression is not the cause, or leaves motions without
/// stiffness, the shifted Hessian in place of E gives the lowest mode, beginning from the last shift. `neutral`: rods
/// whose mode costs no energy, to rounding, and that nothing goes down from: a turn of the whole rod about an axis,
/// say.
PetscErrorCode NewtonSolver::findBucklingModes(std::vector<char> *found, std::vector<char> *neutral) {
  // Of the energies that balance, stiff edges leave 1e-7 by rounding; and what the forces are out of balance by, a
  // neutral motion is curved by.
  const double rounding = std::clamp(10 * report_.residual.force, 1e-7, 1e-5);
  constexpr int enough = 5; // iterations for a mode that is not close to another
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  const Elements &e = potential_->elements();
  const std::vector<int> negative = work_->negative;
  const EdgeBlocks exact = potential_->derivatives(rods_).blocks;
  found->assign(work_->active.size(), false);
  neutral->assign(work_->active.size(), false);
  bool regular, done = false;
  enum class Try { buckling, shifted, shifted_anew };
  for (const Try way : {Try::buckling, Try::shifted, Try::shifted_anew}) {
    if (done) break;
    const bool buckling = way == Try::buckling;
    potential_->assemble(rods_, buckling ? HessianKind::uncompressed : HessianKind::exact);
    EdgeBlocks softening = exact;
    if (buckling) {
      PetscCall(refactor());
      PetscCall(readInertia(&regular));
      if (!regular || report_.negative_pivots > 0) continue;
      softening.subtractFrom(potential_->blocks());
    } else {
      fill(work_->indefinite, true);
      if (way == Try::shifted_anew) // the last shift, of an iterate far away, drowned the mode
        for (std::vector<double> *shift : {&work_->shift, &work_->last_shift}) fill(*shift, 0.0);
      PetscCall(shiftUntilPositive(false));
    }
    const bool definite = buckling && report_.zero_pivots == 0;
    // With A v = b solved, v'K v = v'b - v'(A - K)v: the stiff part of A never enters, whose rounding would hide a
    // small curvature.
    auto soften = [&](const Planes &v, Planes &y) { // (A - K) v
      y.clear();
      for (int r = rods_.begin; r < rods_.end; ++r) {
        const RodRange &rod = e.rods[r];
        if (buckling)
          softening.multiply(rod, dofs.joins(r), v, y);
        else
          addMetric(work_->metric, system_.edge_metric, rod, dofs.joins(r), work_->shift[r], v, y);
        dofs.fold(rod, y);
      }
      dofs.foldJoined(rods_, y);
    };
    bool settled = false; // what more iterations would not change
    for (int start = 0; start < 2 && !done && (start == 0 || settled || definite); ++start) {
      Planes workspace(slot_size, dofs.slots(rods_));
      workspace.setOrigin(dofs.rods()[rods_.begin].first_slot);
      Probe w{workspace, workspace, workspace}, x = w, p = w;
      beginMode(start);
      soften(work_->increment, x.soft);
      std::vector<double> before(neutral->size(), HUGE_VAL);
      settled = false;
      for (int k = 0; k < 100 && !settled; ++k) {
        for (std::size_t n = 0; n < islands_.size() && k > 0; ++n)
          if (negative[islands_[n].begin] > 0)
            improve(dofs, islands_[n], w, x, p,
                    start == 0 ? 1 : std::min(k, 3)); // first by inverse iteration, whose modes are smooth
        watch().beat();
        w.stiff = x.soft;
        PetscCall(solveLinear(w.stiff, w.motion));
        soften(w.motion, w.soft);
        done = settled = true;
        bool told = true; // of every rod, whether there is a way down
        for (const RodSet island : islands_) {
          const int r = island.begin;
          if (negative[r] == 0) continue;
          const double stiffness = dofs.dot(island, w.motion, w.stiff), softness = dofs.dot(island, w.motion, w.soft);
          double noise = rounding * std::abs(stiffness);
          for (int each = r; each < island.end; ++each) noise += hessianNoise(each, w.motion);
          const double change = softness - stiffness - before[r];
          before[r] = softness - stiffness;
          fill(*found, island, k >= enough && softness - stiffness > noise);
          // Compression that makes up for no mode's stiffness leaves a definite Hessian: its negative pivots are
          // rounding.
          fill(*neutral, island,
               std::abs(softness - stiffness) <= noise || (definite && !(softness > 0.5 * stiffness)));
          settled = settled && ((*found)[r] || (k >= enough && std::abs(change) < 1e-3 * noise));
          done = done && (*found)[r];
          told = told && ((*found)[r] || (*neutral)[r]);
        }
        done = done || (settled && told);
      }
      for (int r = rods_.begin; r < rods_.end; ++r) {
        for (int a = 0; a < slot_size; ++a)
          std::copy(w.motion[a] + e.rods[r].first_slot, w.motion[a] + e.rods[r].vertexEnd() + 2,
                    work_->increment[a] + e.rods[r].first_slot);
        dofs.forBeside({r, r + 1}, [&](int s) { work_->increment.setVector(0, s, w.motion.vector(0, s)); });
      }
    }
    done = done || definite || (settled && !buckling);
  }
  potential_->assemble(rods_, potential_->step().hessian);
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
