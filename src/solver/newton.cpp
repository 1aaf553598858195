#include "tendril/solver/newton.hpp"

#include "tendril/solver/activity.hpp"
#include "tendril/solver/events.hpp"
#include "tendril/solver/hints.hpp"

#include <petsc/private/petscimpl.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tendril {
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

/// Makes x the iterate where it is not: another line search than ours has tried it, in which supports reach their
/// places at once. `possible` is false where no configuration is there; the iterate stays then.
PetscErrorCode NewtonSolver::moveTo(Vec x, bool *possible) {
  PetscObjectState state;
  PetscFunctionBeginUser;
  *possible = true;
  PetscCall(PetscObjectStateGet((PetscObject)x, &state));
  if (x == iterate_vec_ && state == iterate_state_) PetscFunctionReturn(0);
  Planes wanted = potential_->dofs().makePlanes(rods_);
  PetscCall(potential_->dofs().scatter(x, rods_, wanted));
  *possible = potential_->moveTo(wanted, rods_, work_->trial, true);
  forgetEnergies();
  if (!*possible) iterate_vec_ = nullptr;
  if (!*possible) PetscFunctionReturn(0);
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
  bool possible;
  PetscFunctionBeginUser;
  PetscCall(moveTo(x, &possible));
  if (!possible) {
    PetscCall(SNESSetFunctionDomainError(snes_));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscLogEventBegin(events().derivatives, 0, 0, 0, 0));
  // Newton squares a small residual: from below the root of the tolerance the next iterate is taken for an answer,
  // which needs no Hessian.
  const Derivatives *d = nullptr;
  for (int r = rods_.begin; r < rods_.end; ++r) {
    if (!work_->active[r]) continue;
    const Residual &last = work_->residual[r];
    d = std::max(last.force, last.moment) < likely_ || sharesFactor() ? &potential_->gradient(r)
                                                                      : &potential_->derivatives({r, r + 1});
  }
  PetscCall(PetscLogEventEnd(events().derivatives, 0, 0, 0, 0));
  if (d) PetscCall(potential_->dofs().gather(d->gradient, rods_, f, &work_->active));
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
    if (work_->active[r]) potential_->derivatives({r, r + 1});
  for (const RodSet island : islands_) fill(work_->shift, island, follows_ ? regular_lift * firstShift(island) : 0.0);
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
    EdgeBlocks blocks = *system_.blocks;
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
        for (const JoinedEdge &j : potential_->elements().joinedEdges({r, r + 1}))
          if (vertex) vertex[j.frame - rod.first_slot] += work_->shift[r] * work_->metric[a][j.frame];
        for (const JoinedBody &b : potential_->elements().bodies({r, r + 1}))
          for (const int s : {b.position, b.rotation})
            if (vertex) vertex[s - rod.first_slot] += work_->shift[r] * work_->metric[a][s];
      }
    }
    PetscCall(potential_->dofs().fillMatrix(blocks, pattern_, jacobian_));
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

/// With the matrix factored last; rods that are not active have the solution zero.
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
  constexpr double rtol_obstacles = 0.1;
  constexpr int most_bounded = 8, surprised = 1 << 16; // trials; more where edges touch that the matrix does not know
  const bool moving = potential_->remainingMotion(rods_, work_->motion);
  bool done = true, finite = true, lost = false;
  creeps_ = false;
  Residual &worst = report_.residual = {};
  for (const RodSet island : islands_) {
    if (work_->active[island.begin]) { // what has converged takes no part any more
      bool waits = false, moves = false, sound = true;
      for (int r = island.begin; r < island.end; ++r) {
        Residual &residual = work_->residual[r];
        residual = potential_->residual(r, energyAtIterate(r));
        // Obstacles go on with its moves; in statics from where forces nearly balance, for no inertia holds the rest.
        const bool remain = potential_->obstaclesRemain(r),
                   go = remain && (!potential_->step().isStatic() || excess(residual, rtol_obstacles) <= 1 ||
                                   isAtNoise(residual, rtol_obstacles));
        potential_->holdObstacles(r, remain && !go);
        const RodRange &rod = potential_->elements().rods[r];
        moves = moves || (moving && dot(rod, work_->motion, work_->motion) > 0) || go;
        waits = waits || remain;
        sound = sound && residual.isFinite();
      }
      fill(work_->moving, island, moves);
      finite = finite && sound;
      const Verdict verdict = sound && !moves && !waits ? judge(island, rtol) : Verdict::going;
      lost = lost || verdict == Verdict::lost;
      creeps_ = creeps_ || verdict == Verdict::saddle;
      fill(work_->active, island, verdict != Verdict::answer);
      done = done && verdict == Verdict::answer;
    }
    for (int r = island.begin; r < island.end; ++r) worst.include(work_->residual[r]);
  }
  report_.history.push_back(worst.force);
  watch().beat();
  *reason = SNES_CONVERGED_ITERATING;
  const int bounded = potential_->timesBounded(rods_);
  if (!finite)
    *reason = SNES_DIVERGED_FNORM_NAN;
  else if (bounded >= surprised)
    *reason = SNES_DIVERGED_FUNCTION_COUNT;
  else if (lost || creeps_)
    *reason = SNES_DIVERGED_LOCAL_MIN; // its meaning here: what is left is rounding
  else if (done)
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
  else if (bounded > most_bounded)
    *reason = SNES_DIVERGED_FUNCTION_COUNT; // its meaning here: rods leave the room in which contact is known
  else if (iteration >= limit || (patience_ > 0 && spent_ + iteration >= patience_))
    *reason = SNES_DIVERGED_MAX_IT;
  else if (touches_ && !sharesFactor()) // for the next direction; SNES takes a matrix of other entries here
    PetscCall(makeMatrix());
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::inertiaAtIterate(int *negative, double lift) {
  bool regular;
  PetscFunctionBeginUser;
  watch().beat();
  focus();
  fill(work_->active, true);
  age_ = 0;
  PetscCall(makeMatrix());
  PetscCall(assemble(jacobian_));
  for (const RodSet island : islands_) {
    if (potential_->step().hessian != HessianKind::exact) potential_->assemble(island, HessianKind::exact);
    fill(work_->shift, island, lift * firstShift(island));
  }
  PetscCall(refactor());
  PetscCall(readInertia(&regular));
  *negative = regular ? report_.negative_pivots : -1;
  PetscFunctionReturn(0);
}

void NewtonSolver::focus() {
  potential_->focus(rods_);
  work_->setOrigin(potential_->elements().rods[rods_.begin].first_slot);
}

/// SNES from the potential's iterate. `failure` is empty when it converged.
PetscErrorCode NewtonSolver::newton(std::string *failure) {
  constexpr int limits_from_saddle = 10;
  SNESConvergedReason reason;
  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(snes_, nullptr, &rtol_, nullptr, nullptr, nullptr));
  rtol_ *= sharpness_;
  fill(work_->active, true);
  fill(work_->standstill, Standstill());
  fill(work_->load_reach, std::nan(""));
  age_ = 0;
  lost_.clear();
  for (const RodSet island : islands_) potential_->carryTrees(island);
  PetscCall(writeIterate(x_));
  // From a saddle the way down may be long, and shorter load steps begin at the same one; of fine rods they are still
  // the cheaper way.
  int limits = report_.escapes > 0 && seek_ == Seek::minimum && patience_ == 0 &&
                       potential_->scene().edges() <= most_searched_edges
                   ? limits_from_saddle
                   : 1;
  do {
    spent_ = report_.iterations;
    PetscCall(SNESSolve(snes_, nullptr, x_));
    report_.iterations += std::exchange(spent_, 0);
    PetscCall(SNESGetConvergedReason(snes_, &reason));
  } while (reason == SNES_DIVERGED_MAX_IT && --limits > 0);
  failure->clear();
  limit_reached_ = reason == SNES_DIVERGED_MAX_IT;
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
    case SNES_DIVERGED_FUNCTION_COUNT:
      report_.bounded = true;
      *failure = "rods move farther than contact between them was looked for";
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

/// Makes all ready for a solve, and moves the iterate to where it begins.
void NewtonSolver::begin(const State &start, Seek seek, const Guess *guess, int patience) {
  const bool is_static = potential_->step().isStatic();
  focus();
  system_.edge_metric =
      is_static ? work_->edge_metric.data() : nullptr; // in dynamics, inertia is what holds short waves
  report_ = {};
  seek_ = seek;
  follows_ = seek == Seek::equilibrium;
  descends_ = false;
  patience_ = patience;
  sharpness_ = 1;
  likely_ = spent_ = 0;
  fill(work_->last_shift, 0.0); // a step depends on its start alone
  for (int r = rods_.begin; r < rods_.end; ++r) potential_->beginRod(start, r);
  forgetEnergies();
  if (!guess) {
    if (!is_static) predict();
    return;
  }
  const bool complete = guess->axial_force.size() > 0;
  const bool possible = potential_->moveTo(guess->unknowns, rods_, work_->trial, complete);
  for (int r = rods_.begin; r < rods_.end; ++r)
    if (!possible)
      potential_->beginRod(start, r); // from the start, then
    else if (complete)
      potential_->setAxialForces(r, guess->axial_force[0]);
}

/// Whether what is left is little; else Newton goes on to a sharper tolerance, `along` as it seeks.
PetscErrorCode NewtonSolver::settle(Seek along, Outcome *now) {
  constexpr int most_rounds = 4; // of a tolerance made sharper
  PetscFunctionBeginUser;
  PetscCall(verify(&now->settled));
  if (now->settled) PetscFunctionReturn(0);
  if (++now->rounds == most_rounds) {
    now->failure = lost_;
    report_.lost = true;
    PetscFunctionReturn(0);
  }
  sharpness_ *= 1e-2;
  seek_ = along;
  PetscCall(newton(&now->failure));
  PetscFunctionReturn(0);
}

/// Newton; what terms take for constant, as friction does its normal forces, is taken anew from its answer until that
/// changes nothing. In statics friction may be all that holds a rod: it is taken anew from where Newton's patience
/// ends, too.
PetscErrorCode NewtonSolver::newtonAndRenew(std::string *failure) {
  constexpr double little = 1e-3;
  constexpr int most = 20;
  PetscFunctionBeginUser;
  const bool is_static = potential_->step().isStatic();
  double change = 0;
  for (int round = 0;; ++round) {
    PetscCall(newton(failure));
    const bool settled = failure->empty(), was_little = round > 0 && change < little;
    if (settled ? was_little : !(is_static && limit_reached_)) PetscFunctionReturn(0);
    if (round > most) break;
    change = 0;
    for (int r = rods_.begin; r < rods_.end; ++r) change = std::max(change, potential_->renew(r));
    if (change == 0) PetscFunctionReturn(0);
    forgetEnergies();
  }
  if (failure->empty())
    *failure = "friction does not settle: its forces still change by " + shortText(change) + " of themselves";
  PetscFunctionReturn(0);
}

PetscErrorCode NewtonSolver::solve(const State &start, NewtonReport *report, Seek seek, const Guess *guess,
                                   int patience) {
  PetscFunctionBeginUser;
  begin(start, seek, guess, patience);
  const Doing here([this](std::ostream &out) {
    out << "Newton iteration " << spent_ + report_.iterations;
    if (rtol_ > 0) out << ", out of balance by " << excess(report_.residual, rtol_) << " times what is asked for";
  });
  Outcome now;
  now.failure = potential_->beyondBarrier();
  if (now.failure.empty()) PetscCall(newtonAndRenew(&now.failure));
  if (potential_->step().isStatic()) PetscCall(settleMinimum(seek, &now));
  report_.converged = now.failure.empty();
  for (int r = rods_.begin; r < rods_.end; ++r)
    report_.rounding_error = std::max(report_.rounding_error, work_->left[r]);
  report_.reason = "converged";
  if (!report_.converged) {
    report_.reason = now.failure + nearBarrier(*potential_, rods_) + nearObstacle(*potential_, rods_) +
                     nearRod(*potential_, rods_) + fastBody(*potential_, rods_) + tightTendon(*potential_, rods_);
    if (now.beyond.empty()) // 0.88 of the moment, 0.98 of the force
      report_.reason += limitOfLaw(*potential_, rods_, potential_->start(), 0.5, HUGE_VAL, 0.65);
  }
  *report = report_;
  PetscFunctionReturn(0);
}

} // namespace tendril
