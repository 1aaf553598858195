#pragma once
/// \file step_solver.hpp
/// One implicit step of the whole scene. Rods that nothing joins are independent of each other: they are solved in
/// blocks small enough to stay in the cache, a SNES each. Other linear solvers than `banded` get the whole scene as one
/// system.

#include "tendril/layout/partition.hpp"
#include "tendril/layout/team.hpp"
#include "tendril/solver/newton.hpp"

#include <deque>
#include <functional>
#include <optional>

namespace tendril {

/// Whether independent rods may be solved one block after the other, or must form one system (paths of equilibria share
/// a load factor).
enum class Coupling { none, load };

/// What a rank has of a scene that it shares with others.
struct Share {
  Team team;
  std::vector<RodSet> blocks; ///< of rods that are solved together; none: as blocksOf
  std::vector<double> place;  ///< of each block among those of all ranks
  std::vector<int> owner; ///< rank of each block of all, where those of different ranks may come to touch; else none
  std::vector<int> group; ///< as Partition, with owners
};

class StepSolver {
public:
  /// \param share what this rank has of a larger scene
  PetscErrorCode setUp(IncrementalPotential &potential, Coupling coupling = Coupling::none, const Share &share = {});
  /// Minimises the potential of the step, on all ranks. The potential's iterate is the answer when `report` says
  /// converged; iterations are the most of any block. After a failure the report is that of the first block that
  /// failed; where rods or bodies of different ranks may touch, nothing is solved. In statics, where fine rods take
  /// many iterations, they begin again from the answer with fewer edges (solveCoarse). \param guess where to begin
  /// instead of at the start state
  PetscErrorCode solve(const State &start, const Step &step, NewtonReport *report, Seek seek = Seek::minimum,
                       const Guess *guess = nullptr);
  /// After a report that says `meets`: groups of blocks that have to be on one rank each, as Partition.
  const std::vector<int> &groups() const { return share_.group; }
  bool coarse_first = false; ///< whether fine rods begin from fewer edges without a try of their own
  /// Called with each block that has converged, while it is in the cache.
  std::function<void(RodSet)> on_block;
  /// Called where rods have left the room in which contact is known and the step is solved anew: what on_block has been
  /// told is void.
  std::function<void()> on_again;
  /// Starts a step without solving it.
  PetscErrorCode begin(const State &start, const Step &step);
  /// Sets the linear solvers up as a step would, so that their options have been asked for before the first step.
  PetscErrorCode rehearse(const State &start, const Step &step);
  /// Factors the Hessian at the iterate and counts negative pivots; -1 when it cannot be factored.
  /// \param lift of its eigenvalues, in units of the softest bending of each rod
  PetscErrorCode inertiaAtIterate(int *negative, double lift = 0);
  /// The motion at the iterate without which no more than `stable` motions would be unstable with their eigenvalues
  /// lifted by `neutral`; `found` is false where there is none. The edge that turns most turns by one radian.
  PetscErrorCode criticalMode(int stable, double neutral, Planes *mode, bool *found);

  const Team &team() const { return share_.team; }
  IncrementalPotential &potential() const { return *potential_; }
  const std::deque<NewtonSolver> &blocks() const { return blocks_; }
  std::deque<NewtonSolver> &blocks() { return blocks_; }
  /// The solver of the first block.
  NewtonSolver &front() { return blocks_.front(); }
  SNES snes() const { return blocks_.front().snes(); }

private:
  IncrementalPotential *potential_ = nullptr;
  Share share_;
  Coupling coupling_ = Coupling::none;
  std::optional<NewtonWork> work_;
  std::deque<NewtonSolver> blocks_;

  PetscErrorCode solveBlocks(const State &start, const Step &step, NewtonReport *report, Seek seek, const Guess *guess);
  void agree(double failed, NewtonReport *report) const;
  double placeOf(std::size_t block) const;
  bool meetsOthers();
  PetscErrorCode solveBlock(NewtonSolver &block, const State &start, NewtonReport *report);
  PetscErrorCode setUpBlocks(const std::vector<RodSet> &blocks);
  std::vector<RodSet> wantedBlocks() const;
  PetscErrorCode findTouching(const State &start, double room);
};

} // namespace tendril
