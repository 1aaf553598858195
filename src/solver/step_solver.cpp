#include "tendril/solver/step_solver.hpp"

#include "tendril/solver/coarse.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Cuts the scene into blocks of at least so many edges (about 2 kB each), and at least a pack of rods to factor
/// together. An island of several rods is a block by itself.
std::vector<RodSet> blocksOf(const DofMap &dofs) {
  constexpr int block_edges = 800;
  const std::vector<RodRange> &rods = dofs.rods();
  const int count = int(rods.size());
  std::vector<RodSet> blocks;
  int begin = 0, edges = 0;
  auto close = [&](int end) {
    if (end > begin) blocks.push_back({begin, end});
    begin = end;
    edges = 0;
  };
  for (int r = 0; r < count; ++r) {
    const RodSet island = dofs.islandOf(r);
    if (dofs.isJoined(island)) {
      close(r);
      close(island.end);
      r = island.end - 1;
      continue;
    }
    edges += rods[r].edges;
    if ((edges < block_edges || (r + 1 - begin) % lanes != 0) && edges < 4 * block_edges && r + 1 < count) continue;
    close(r + 1);
  }
  return blocks;
}

} // namespace

PetscErrorCode StepSolver::setUp(IncrementalPotential &potential, Coupling coupling) {
  PetscFunctionBeginUser;
  potential_ = &potential;
  std::vector<RodSet> blocks;
  if (coupling == Coupling::none) blocks = blocksOf(potential.dofs());
  if (blocks.size() > 1) {
    PetscCall(setUpBlocks(blocks));
    if (blocks_.size() == blocks.size()) PetscFunctionReturn(0);
  }
  PetscCall(setUpBlocks({potential.all()}));
  PetscFunctionReturn(0);
}

/// Stops where another solver than `banded` was chosen for rods that nothing joins, which needs all of them as one.
PetscErrorCode StepSolver::setUpBlocks(const std::vector<RodSet> &blocks) {
  PetscFunctionBeginUser;
  int slots = 0;
  for (const RodSet &block : blocks) slots = std::max(slots, potential_->dofs().slots(block));
  blocks_.clear();
  work_.emplace(*potential_, slots);
  for (const RodSet &block : blocks) {
    PetscCall(blocks_.emplace_back().setUp(*potential_, *work_, block));
    if (!blocks_.back().isBanded() && !potential_->dofs().isJoined(block)) break;
  }
  PetscFunctionReturn(0);
}

void StepSolver::begin(const State &start, const Step &step) {
  potential_->beginStep(start, step);
  for (int r = 0; r < potential_->all().end; ++r) potential_->beginRod(start, r);
}

PetscErrorCode StepSolver::solve(const State &start, const Step &step, NewtonReport *report, Seek seek,
                                 const Guess *guess) {
  PetscFunctionBeginUser;
  potential_->beginStep(start, step);
  *report = {};
  report->converged = true;
  report->reason = "converged";
  for (NewtonSolver &block : blocks_) {
    NewtonReport one;
    if (step.isStatic() && seek == Seek::minimum && !guess)
      PetscCall(solveBlock(block, start, &one));
    else
      PetscCall(block.solve(start, &one, seek, guess));
    report->include(one);
    if (!one.converged) break;
    if (on_block) on_block(block.rods());
  }
  PetscFunctionReturn(0);
}

/// Statics. Fine rods that do not converge soon begin again where fewer edges lead; where that leads nowhere, Newton
/// has all the iterations it may take.
PetscErrorCode StepSolver::solveBlock(NewtonSolver &block, const State &start, NewtonReport *report) {
  constexpr int patience = 10;
  PetscFunctionBeginUser;
  const std::vector<RodRange> &rods = potential_->elements().rods;
  const bool fine = !potential_->dofs().isJoined(block.rods()) &&
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
  int negative;
  PetscFunctionBeginUser;
  begin(start, step);
  PetscCall(inertiaAtIterate(&negative));
  for (NewtonSolver &block : blocks_) PetscCall(block.setUpLinear());
  PetscFunctionReturn(0);
}

PetscErrorCode StepSolver::inertiaAtIterate(int *negative, double lift) {
  PetscFunctionBeginUser;
  *negative = 0;
  for (NewtonSolver &block : blocks_) {
    int one;
    PetscCall(block.inertiaAtIterate(&one, lift));
    *negative = one < 0 || *negative < 0 ? -1 : *negative + one;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode StepSolver::criticalMode(int stable, double neutral, Planes *mode, bool *found) {
  double lift = neutral;
  PetscFunctionBeginUser;
  *mode = potential_->dofs().makePlanes();
  for (NewtonSolver &block : blocks_) PetscCall(block.criticalMode(stable, &lift, mode));
  *found = lift > neutral;
  PetscFunctionReturn(0);
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
