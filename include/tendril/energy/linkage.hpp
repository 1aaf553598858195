#pragma once
/// \file linkage.hpp
/// Trees of bodies that exact joints join: where they go together.

#include "tendril/energy/joint.hpp"

namespace tendril {

/// Exact joints of a scene that close no loop, each with a body that it places by the other, or by the world. Moves of
/// bodies are taken to those that the joints leave free: a hinge or a slider by its coordinate, to first order as far
/// as both bodies say, a ball by the turn of its body. So joints of trees hold exactly along every path of Newton's
/// method, as in reduced coordinates (R. Featherstone, *Rigid Body Dynamics Algorithms*, 2008, 3.5 and 4.1); joints
/// that close loops hold at its end.
class Linkage {
public:
  /// `placed` is the child, or the parent, by which goes the other and the joint.
  struct TreeJoint {
    int joint;
    bool places_parent;
  };
  Linkage(const Scene &scene, const Elements &elements);
  /// Whether a body beside a rod, or one that it is tied to, is in a tree.
  bool moves(int rod) const { return !hosts_.empty() && !hosts_[std::size_t(rod)].empty(); }
  /// Those of trees on a rod, from roots to leaves.
  std::span<const TreeJoint> trees(int rod) const { return links_[std::size_t(rod)]; }
  bool isOfTree(int joint) const { return of_tree_[std::size_t(joint)]; }
  /// The increments of a rod, as they are scaled, with those of bodies in trees and of what is tied to these.
  /// \param from where targets are at the end of the step \return by how much a body in these trees turns at most [rad]
  double correct(const Configuration &from, const Planes &increment, double scale, int rod, Planes &out) const;

private:
  /// Of a body: displacement of its centre of mass and rotation vector [m], [rad].
  struct Move {
    Vec3 translation, turn;
  };
  const Scene &scene_;
  const Elements &elements_;
  std::vector<std::vector<TreeJoint>> links_; ///< per rod that has their bodies, from roots to leaves
  std::vector<std::vector<int>> hosts_; ///< per rod: those that have bodies which it goes with; empty: there are none
  std::vector<char> in_tree_;           ///< per body
  std::vector<char> of_tree_;           ///< per joint
  mutable std::vector<Move> moves_;     ///< per body

  void follow(const TreeJoint &link, const Configuration &from, const Planes &increment, double scale) const;
};

} // namespace tendril
