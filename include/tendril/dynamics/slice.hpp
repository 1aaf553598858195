#pragma once
/// \file slice.hpp
/// The part of a scene that a rank has, and the way of its state to the whole and back.

#include "tendril/layout/partition.hpp"
#include "tendril/layout/team.hpp"
#include "tendril/state/state.hpp"

namespace tendril {

/// All of the scene where a rank is alone and solves its rods in the order of the scene: then nothing is copied.
class Slice {
public:
  Slice() = default;
  /// \param whole the scene \param team of as many ranks as the partition has
  /// \param apart whether what this rank has is a copy even where it is all of the scene
  Slice(const Scene &whole, const Partition &partition, const Team &team, bool apart = false);

  bool isAll() const { return parts_.empty(); }
  /// The part of this rank, with what is asked of the whole.
  Scene sceneOf(const Scene &whole) const;
  /// The state of the whole scene, on the leading rank, from the parts of all.
  /// \param own elements of this rank \param whole of the scene; null on other ranks
  void collect(const Elements &own, const State &part, const Elements *whole, State *state) const;
  /// The part of this rank of a state that the leading rank has.
  void spread(const Elements &own, State *part, const Elements *whole, const State *state) const;

private:
  /// What one rank has of the scene, by the numbers there.
  struct Part {
    std::vector<int> rods, groups; ///< groups of junctions, then bodies
    std::vector<int> bodies;
    std::vector<int> joints;  ///< between bodies
    std::vector<int> sticks;  ///< that tendons remember
    std::vector<int> holders; ///< that move: those of movingHolders, and behind them movingObstacles
  };
  Team team_;
  std::vector<Part> parts_; ///< by rank
  int groups_ = 0, bodies_ = 0, joints_ = 0, sticks_ = 0, holders_ = 0;
  class Transfer;
};

} // namespace tendril
