#include "tendril/solver/step_solver.hpp"

#include "tendril/solver/coarse.hpp"

#include <algorithm>

namespace tendril {

static std::vector<RodSet> blocksOf(const DofMap &dofs) {
  std::vector<int> edges, island_end;
  for (int r = 0; r < dofs.all().end; ++r) {
    const RodSet island = dofs.islandOf(r);
    edges.push_back(dofs.rods()[r].edges);
    island_end.push_back(dofs.isCoupled(island) ? island.end : 0);
  }
  std::vector<RodSet> blocks;
  for (const Block &block : blocksOf(edges, island_end)) blocks.push_back(block.rods);
  return blocks;
}

PetscErrorCode StepSolver::setUp(IncrementalPotential &potential, Coupling coupling, const Share &share) {
  PetscFunctionBeginUser;
  potential_ = &potential;
  share_ = share;
  coupling_ = coupling;
  PetscCall(setUpBlocks(wantedBlocks()));
  PetscFunctionReturn(0);
}

std::vector<RodSet> StepSolver::wantedBlocks() const {
  if (coupling_ != Coupling::none) return {potential_->all()};
  return share_.blocks.empty() ? blocksOf(potential_->dofs()) : share_.blocks;
}

/// Finds what may touch in the step that has begun, and makes solvers for the islands that it joins.
PetscErrorCode StepSolver::findTouching(const State &start, double room) {
  PetscFunctionBeginUser;
  if (!potential_->touches()) PetscFunctionReturn(0);
  DofMap &dofs = potential_->dofs();
  potential_->findTouching(start, room);
  const std::vector<RodSet> blocks = wantedBlocks();
  const bool same = std::equal(
      blocks.begin(), blocks.end(), blocks_.begin(), blocks_.end(), [&](const RodSet &a, const NewtonSolver &b) {
        return a.begin == b.rods().begin && a.end == b.rods().end && b.touches() == !dofs.touching(a).empty();
      });
  if (!same) PetscCall(setUpBlocks(blocks));
  for (NewtonSolver &block : blocks_) block.takeTouching();
  PetscFunctionReturn(0);
}

/// Where another solver than `banded` was chosen for rods that nothing joins, it needs all of them as one.
PetscErrorCode StepSolver::setUpBlocks(const std::vector<RodSet> &blocks) {
  PetscFunctionBeginUser;
  int slots = 0;
  for (const RodSet &block : blocks) slots = std::max(slots, potential_->dofs().slots(block));
  blocks_.clear();
  work_.emplace(*potential_, slots);
  for (const RodSet &block : blocks) {
    PetscCall(blocks_.emplace_back().setUp(*potential_, *work_, block));
    if (blocks.size() > 1 && !blocks_.back().isBanded() && !potential_->dofs().isCoupled(block)) {
      PetscCall(setUpBlocks({potential_->all()}));
      break;
    }
  }
  PetscFunctionReturn(0);
}

PetscErrorCode StepSolver::begin(const State &start, const Step &step) {
  PetscFunctionBeginUser;
  potential_->beginStep(start, step);
  PetscCall(findTouching(start, 1));
  for (int r = 0; r < potential_->all().end; ++r) potential_->beginRod(start, r);
  PetscFunctionReturn(0);
}

/// Room for contact, over what rods are expected to move: beyond it every edge may touch every other.
constexpr double most_room = 1e4;

PetscErrorCode StepSolver::solve(const State &start, const Step &step, NewtonReport *report, Seek seek,
                                 const Guess *guess) {
  PetscFunctionBeginUser;
  potential_->beginStep(start, step);
  PetscCall(findTouching(start, 1)); // blocks begin with their rods, while these are in the cache
  for (double room = 4;; room *= 4) {
    PetscCall(solveBlocks(start, step, report, seek, guess));
    if (!report->bounded || room > most_room) break;
    PetscCall(findTouching(start, room));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode StepSolver::solveBlocks(const State &start, const Step &step, NewtonReport *report, Seek seek,
                                       const Guess *guess) {
  PetscFunctionBeginUser;
  *report = {};
  report->converged = true;
  report->reason = "converged";
  double failed = HUGE_VAL; // the place of the first block that fails
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    NewtonSolver &block = blocks_[b];
    NewtonReport one;
    if (step.isStatic() && seek == Seek::minimum && !guess)
      PetscCall(solveBlock(block, start, &one));
    else
      PetscCall(block.solve(start, &one, seek, guess));
    if (!one.converged) {
      failed = b < share_.place.size() ? share_.place[b] : double(b);
      *report = one;
      break;
    }
    report->include(one);
    if (on_block) on_block(block.rods());
  }
  agree(failed, report);
  PetscFunctionReturn(0);
}

/// Makes the reports of all ranks one, by one reduction where all have converged.
void StepSolver::agree(double failed, NewtonReport *report) const {
  const Team &team = share_.team;
  if (team.isAlone()) return;
  double first = failed;
  NewtonReport all = *report;
  Tally tally;
  tally.smallest(first);
  all.tally(tally);
  team.combine(tally);
  if (!std::isfinite(first)) {
    *report = all;
    return;
  }
  double owner = failed == first ? team.rank() : team.size();
  Tally lowest;
  team.combine(lowest.smallest(owner));
  const int from = int(owner);
  team.share(report->reason, from);
  report->converged = false;
  double numbers[] = {double(report->iterations), double(report->lost), double(report->first_negative_pivots),
                      double(report->shifts)};
  team.share(numbers, from);
  report->iterations = int(numbers[0]);
  report->lost = numbers[1] != 0;
  report->first_negative_pivots = int(numbers[2]);
  report->shifts = int(numbers[3]);
}

/// Statics. Fine rods that do not converge soon begin again where fewer edges lead; where that leads nowhere, Newton
/// has all the iterations it may take.
PetscErrorCode StepSolver::solveBlock(NewtonSolver &block, const State &start, NewtonReport *report) {
  constexpr int patience = 10;
  PetscFunctionBeginUser;
  const std::vector<RodRange> &rods = potential_->elements().rods;
  const bool fine = !potential_->dofs().isCoupled(block.rods()) &&
                    std::any_of(rods.begin() + block.rods().begin, rods.begin() + block.rods().end,
                                [](const RodRange &rod) { return rod.edges > fine_edges; });
  NewtonReport failed; // what tries took that led nowhere
  bool solved = false;
  auto attempt = [&](const Guess *guess, int most_iterations) {
    PetscFunctionBeginUser;
    PetscCall(block.solve(start, report, Seek::minimum, guess, most_iterations));
    solved = report->converged || report->lost;
    if (!solved) failed.addWork(*report);
    PetscFunctionReturn(0);
  };
  if (fine && !coarse_first) PetscCall(attempt(nullptr, patience));
  if (fine && !solved) {
    for (int r = block.rods().begin; r < block.rods().end; ++r) potential_->beginRod(start, r);
    Guess guess;
    NewtonReport coarse;
    PetscCall(solveCoarse(*potential_, start, block.rods(), &guess, &coarse));
    coarse.iterations = 0; // iterations are those with all edges
    failed.addWork(coarse);
    if (coarse.converged) PetscCall(attempt(&guess, 0));
  }
  if (!solved) PetscCall(block.solve(start, report, Seek::minimum, nullptr));
  report->addWork(failed);
  PetscFunctionReturn(0);
}

PetscErrorCode StepSolver::rehearse(const State &start, const Step &step) {
  PetscFunctionBeginUser;
  PetscCall(begin(start, step));
  for (NewtonSolver &block : blocks_) {
    int negative;
    PetscCall(block.inertiaAtIterate(&negative));
    PetscCall(block.setUpLinear());
  }
  PetscFunctionReturn(0);
}

PetscErrorCode StepSolver::inertiaAtIterate(int *negative, double lift) {
  PetscFunctionBeginUser;
  *negative = 0;
  bool factored = true;
  for (NewtonSolver &block : blocks_) {
    int one;
    PetscCall(block.inertiaAtIterate(&one, lift));
    factored = factored && one >= 0;
    *negative += one;
  }
  bool fails = !factored;
  Tally tally;
  share_.team.combine(tally.any(fails).sum(*negative));
  if (fails) *negative = -1;
  PetscFunctionReturn(0);
}

/// Each block by itself, so that what it finds does not depend on those before it.
PetscErrorCode StepSolver::criticalMode(int stable, double neutral, Planes *mode, bool *found) {
  PetscFunctionBeginUser;
  *mode = potential_->dofs().makePlanes();
  double highest = neutral, place = HUGE_VAL;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    double lift = neutral;
    Planes one = potential_->dofs().makePlanes();
    PetscCall(blocks_[b].criticalMode(stable, &lift, &one));
    if (!(lift > highest)) continue;
    highest = lift;
    place = b < share_.place.size() ? share_.place[b] : double(b);
    *mode = std::move(one);
  }
  double of_all = highest;
  Tally tally;
  share_.team.combine(tally.largest(of_all));
  if (highest < of_all) place = HUGE_VAL;
  double first = place;
  Tally order;
  share_.team.combine(order.smallest(first));
  if (place > first) mode->clear(); // of another rank
  *found = of_all > neutral;
  PetscFunctionReturn(0);
}

void NewtonReport::tally(Tally &t) {
  t.largest(iterations).sum(edge_iterations).sum(trials).sum(shifts).sum(negative_pivots).sum(zero_pivots);
  t.sum(first_negative_pivots).sum(escapes).largest(rounding_error);
  for (double Residual::*part : residual_parts) t.largest(residual.*part);
}

void NewtonReport::addWork(const NewtonReport &before) {
  iterations += before.iterations;
  edge_iterations += before.edge_iterations;
  trials += before.trials;
  shifts += before.shifts;
  escapes += before.escapes;
  first_negative_pivots = std::max(first_negative_pivots, before.first_negative_pivots);
}

void NewtonReport::include(const NewtonReport &block) {
  iterations = std::max(iterations, block.iterations);
  edge_iterations += block.edge_iterations;
  trials += block.trials;
  shifts += block.shifts;
  negative_pivots += block.negative_pivots;
  zero_pivots += block.zero_pivots;
  first_negative_pivots += block.first_negative_pivots;
  escapes += block.escapes;
  residual.include(block.residual);
  rounding_error = std::max(rounding_error, block.rounding_error);
  lost = lost || block.lost;
  if (history.size() < block.history.size()) history.resize(block.history.size(), 0.0);
  for (std::size_t k = 0; k < block.history.size(); ++k) history[k] = std::max(history[k], block.history[k]);
  if (block.converged) return;
  converged = false;
  reason = block.reason;
}

} // namespace tendril
