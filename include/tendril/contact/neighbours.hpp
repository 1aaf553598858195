#pragma once
/// \file neighbours.hpp
/// Which edges of rods may touch each other.

#include "tendril/contact/law.hpp"
#include "tendril/geometry/box.hpp"
#include "tendril/layout/elements.hpp"

#include <map>

namespace tendril {

/// Where the vertices of the scene may be: those of a rod have all gone the same part of their ways from where they
/// were, and are no farther from there than so much [m]; nor are edges from where that takes them, over their length.
struct Room {
  Planes start, way;                ///< over slots
  std::vector<double> beyond, bend; ///< per rod
  Room() = default;
  Room(int slots, std::size_t rods) : start(3, slots), way(3, slots), beyond(rods, 0), bend(rods, 0) {}
  Vec3 startOf(int slot) const { return start.vector(0, slot); }
  Vec3 wayOf(int slot) const { return way.vector(0, slot); }
  Vec3 endOf(int slot) const { return startOf(slot) + wayOf(slot); }
};

class Neighbours {
public:
  Neighbours(const Scene &scene, const Elements &elements);

  /// Pairs of edges that may come within the reach of their law while vertices keep to their room, in the order of
  /// the rods and edges of the later one. Rods may have gone different parts of their ways. Found by a grid: the cost
  /// goes with the edges and with what is near.
  std::vector<TouchingPair> find(const Room &room) const;
  /// The same by looking at all of them, for tests.
  std::vector<TouchingPair> findByAll(const Room &room) const;
  /// Whether two edges touch at all: neighbours along a rod do not, or rods would push themselves straight. Those are
  /// apart by less than half a turn of the rod around its own surface, along it and through what joins two rods.
  bool mayTouch(int rod, int edge, int to_rod, int to_edge) const;
  /// The box in which an edge may be, with its radius and half of what its law reaches.
  Box boxOf(const Room &room, int rod, int edge) const;
  /// Of the first vertex of an edge, along its rod at rest [m].
  double arc(int rod, int edge) const {
    return arc_[std::size_t(elements_.rods[std::size_t(rod)].first_vertex + edge)];
  }

private:
  /// What joins two rods: where along each, and how far apart that is.
  struct Joint {
    double arc, to_arc, apart;
  };
  /// Neighbouring edges of a rod, and the box in which they may be.
  struct Chunk {
    int rod, begin, end;
    Box box;
  };
  const Scene &scene_;
  const Elements &elements_;
  std::vector<double> arc_;   ///< per vertex
  std::vector<double> width_; ///< per rod, of their barriers, or what a penalty reaches [m]
  std::map<std::pair<int, int>, std::vector<Joint>> joints_; ///< by rods, the smaller number first

  double lengthOf(int rod, int edge) const;
  double alongRod(int rod, int edge, int to_edge) const;
  double toArc(int rod, int edge, double arc) const;
  bool isStraight(const Room &room, int rod, int begin, int end) const;
  bool isApart(const Room &room, int rod, int edge, int to_edge) const;
  bool isNear(const Room &room, int rod, int edge, int to_rod, int to_edge) const;
  TouchingPair pairOf(int rod, int edge, int to_rod, int to_edge) const;
  double reachOf(const Room &room, int rod) const;
  std::vector<char> meeting(const Room &room) const;
  std::vector<Chunk> chunksOf(const Room &room) const;
  void addPairs(const Room &room, const Chunk &a, const Chunk &b, std::vector<TouchingPair> &pairs) const;
  void addJoint(int rod, int vertex, int to_rod, int to_vertex);
};

/// The law of two rods: barriers as wide as both in the mean and as stiff as the stiffer one; penalties of the
/// geometric mean of their stiffnesses.
NormalLaw lawBetween(const ContactSettings &a, double stiffness_a, const ContactSettings &b, double stiffness_b);
/// Whether two edges touch, or might after a motion by the width of their law.
bool nearlyTouch(const Scene &scene, const TouchingPair &pair, const std::array<Vec3, 4> &vertices);
/// Distance between the axes of two rods that no motion passes [m]: that of the barrier, or a fifth of their radii.
double wallBetween(const ContactSettings &a, const ContactSettings &b);

} // namespace tendril
