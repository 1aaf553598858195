#pragma once
/// \file support_motion.hpp
/// Prescribed motion of supports and constraints within a step: frames of supports and targets of constraints and
/// joints go to its end at once, the vertices that supports hold with the iterations.

#include "tendril/state/state.hpp"

namespace tendril {

class SupportMotion {
public:
  SupportMotion(const Scene &scene, const DofMap &dofs, const Elements &elements);

  /// Takes up how the frames of all supports turn from where they are in a configuration. Whole turns count.
  void turn(const Configuration &from, double from_time, double to_time);
  /// Turned frames of a rod's supports, and targets of its constraints; whole turns of its twist angles follow.
  void follow(int rod, Configuration &iterate);
  /// What is turned past its barrier in the step, and what to do: a support its edge past 180 degrees of twist, where
  /// the measure `tan` has it, or a frame past half a turn from the edge that it turns. Empty where nothing is.
  const std::string &beyondBarrier() const { return beyond_barrier_; }
  /// Increments that held vertices of some rods still have to make to their places at a time; zero elsewhere. True when
  /// there are any.
  bool remaining(const Configuration &iterate, double time, RodSet rods, Planes &increment) const;

private:
  const Scene &scene_;
  const DofMap &dofs_;
  const Elements &elements_;
  struct Turned {
    int slot;
    double angle; ///< [rad]
    Frame end;
  };
  std::vector<std::vector<int>> moving_;         ///< supports that move, per rod
  std::vector<std::vector<int>> moving_targets_; ///< constraints that move, per rod; empty where the scene has none
  std::vector<int> moving_joints_;               ///< whose parents or drives move
  std::vector<int> moving_tendons_;              ///< whose points or inputs move
  double from_time_ = 0, to_time_ = 0;           ///< of the turn under way
  std::vector<std::vector<Turned>> turned_;      ///< frames that turn in this step, per rod
  std::string beyond_barrier_;
  void followTarget(int constraint, Configuration &iterate);
};

} // namespace tendril
