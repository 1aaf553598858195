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
  const bool touch = !potential_->dofs().touching().items.empty();
  return share_.blocks.empty() || touch ? blocksOf(potential_->dofs()) : share_.blocks;
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

/// Of a block among those of all ranks.
double StepSolver::placeOf(std::size_t block) const {
  if (share_.place.empty()) return double(block);
  const int first = blocks_[block].rods().begin;
  const auto next = std::upper_bound(share_.blocks.begin(), share_.blocks.end(), first,
                                     [](int rod, const RodSet &b) { return rod < b.begin; });
  return share_.place[std::size_t(next - share_.blocks.begin() - 1)];
}

/// Ranks tell each other where their rods and bodies may be in the step. \return whether what different ranks have may
/// touch, which makes groups of their blocks
bool StepSolver::meetsOthers() {
  if (share_.owner.empty()) return false;
  struct InBlock {
    Box room;
    int block;
  };
  constexpr std::size_t numbers = 7;
  std::vector<double> mine;
  for (std::size_t b = 0; b < share_.blocks.size(); ++b)
    for (const Box &room : potential_->roomsOf(share_.blocks[b])) {
      mine.insert(mine.end(), room.low.begin(), room.low.end());
      mine.insert(mine.end(), room.high.begin(), room.high.end());
      mine.push_back(share_.place[b]);
    }
  const std::vector<double> all = share_.team.gatherAll(mine);
  std::vector<InBlock> rooms;
  for (std::size_t k = 0; k < all.size(); k += numbers)
    rooms.push_back({{{all[k], all[k + 1], all[k + 2]}, {all[k + 3], all[k + 4], all[k + 5]}}, int(all[k + 6])});
  std::stable_sort(rooms.begin(), rooms.end(),
                   [](const InBlock &a, const InBlock &b) { return a.room.low.x() < b.room.low.x(); });
  std::vector<int> &group = share_.group;
  bool meets = false;
  for (std::size_t i = 0; i < rooms.size(); ++i)
    for (std::size_t j = i + 1; j < rooms.size() && rooms[j].room.low.x() <= rooms[i].room.high.x(); ++j) {
      const auto [a, b] = std::minmax(rooms[i].block, rooms[j].block);
      const auto [first, other] = std::minmax(group[std::size_t(a)], group[std::size_t(b)]);
      if (first == other || !rooms[i].room.overlaps(rooms[j].room)) continue;
      meets = meets || share_.owner[std::size_t(a)] != share_.owner[std::size_t(b)];
      const int from = other, to = first; // of references that change
      std::replace(group.begin(), group.end(), from, to);
    }
  return meets;
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
  *report = {};
  PetscCall(findTouching(start, 1)); // blocks begin with their rods, while these are in the cache
  report->meets = meetsOthers();
  for (double room = 4; !report->meets; room *= 4) {
    PetscCall(solveBlocks(start, step, report, seek, guess));
    if (!report->bounded || room > most_room) break;
    if (on_again) on_again();
    PetscCall(findTouching(start, room));
    report->meets = meetsOthers();
  }
  report->converged = report->converged && !report->meets;
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
      failed = placeOf(b);
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
                      double(report->shifts), double(report->bounded)};
  team.share(numbers, from);
  report->bounded = numbers[4] != 0;
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
    place = placeOf(b);
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
  meets = meets || block.meets;
  if (history.size() < block.history.size()) history.resize(block.history.size(), 0.0);
  for (std::size_t k = 0; k < block.history.size(); ++k) history[k] = std::max(history[k], block.history[k]);
  if (block.converged) return;
  converged = false;
  reason = block.reason;
}

} // namespace tendril
