#pragma once
/// \file rod_range.hpp
/// Numbering of one rod, and sets of rods.

#include "tendril/geometry/planes.hpp"
#include "tendril/model/numbers_by_rod.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

namespace tendril {

/// Numbering of one rod.
struct RodRange {
  int first_vertex, vertices;
  int first_edge, edges;
  int first_slot; ///< of vertex 0; a multiple of the lanes
  int slots;      ///< from this rod's first slot to the next rod's
  bool twist;     ///< whether the twists of its edges are unknowns
  bool closed;
  bool bends;    ///< false for a cable
  int flat = -1; ///< coordinate that is no unknown, of a planar rod; -1: none

  /// Whether a vertex has this coordinate, or an edge the twist (3), as an unknown where nothing holds it.
  bool has(int a) const { return a == 3 ? twist : a != flat; }
  /// Bends, and has fewer unknowns than a rod that bends and twists.
  bool isReduced() const { return bends && !twist; }
  int slot(int i) const { return first_slot + i; }
  int vertexEnd() const { return first_slot + vertices; }
  int edgeEnd() const { return first_slot + edges; }
  /// Slots behind the last vertex that loops over it may touch: copies of a ring's first two, and a pack.
  static constexpr int behind = 2 + lanes;
  /// Where the frames and cells of supports along the rod begin.
  int looseSlot() const { return vertexEnd() + behind; }
};

/// Rods that follow each other in the scene, [begin, end).
struct RodSet {
  int begin, end;
};

/// A list by rod; empty where no rod has any.
template <class Item> struct ByRod {
  std::vector<Item> items;
  std::vector<int> begin; ///< per rod, and the end
  std::span<const Item> of(RodSet rods) const {
    if (items.empty()) return {};
    return std::span(items).subspan(begin[rods.begin], begin[rods.end] - begin[rods.begin]);
  }
  void sort(std::size_t rods) {
    std::stable_sort(items.begin(), items.end(), [](const Item &a, const Item &b) { return a.rod < b.rod; });
    begin.assign(rods + 1, 0);
    for (const Item &item : items) ++begin[item.rod + 1];
    for (std::size_t r = 0; r < rods; ++r) begin[r + 1] += begin[r];
  }
};

/// A vertex of a rod in a junction. The position of the first member is an unknown, those of the others are its copies.
struct JoinedVertex {
  int rod, vertex;      ///< -1: a point of a body that is no vertex, but what a constraint draws one to
  int slot, first_slot; ///< its own, and that of the first member
  int junction;         ///< of the scene; -1 of a body
  int attachment = -1;  ///< to a body, of the scene; of what is no vertex, the number of the constraint
  int body = -1;        ///< of the scene
  /// Of a point of a body: a slot of its own for the body's frame, and that of the body's spin. `first_slot` is that of
  /// its centre of mass, and the vertex moves by d + spin x arm, with the arm from there to it.
  int frame = -1, first_frame = -1;
  int number = -1; ///< over all joined vertices
  bool isCopy() const { return slot != first_slot; }
  bool isOnBody() const { return frame >= 0; }
  bool isVertex() const { return vertex >= 0; }
};

/// A rigid body beside a rod: the displacement of its centre of mass stands at one slot as a position, its spin at
/// another.
struct JoinedBody {
  int rod, position, rotation;
  int body, group; ///< of the scene; the number of its frame behind those of junctions
};

/// Two bodies, or one and the world, that a joint or obstacles hold, with slots beside the rod of the first for what is
/// between them: from `first` on the forces that hold them (Configuration::axial_force), and their Hessian
/// (EdgeBlocks::pair).
struct BodyPair {
  static constexpr int forces = 8, slots = forces + 2;
  int rod, first;
  int joint;             ///< of the scene; -1: obstacles, which have no forces of their own
  int body;              ///< the first
  std::array<int, 4> of; ///< slots of positions and rotations: of the child, then of the parent, or -1
  int variables() const { return of[2] < 0 ? 6 : 12; }
  /// Where what acts on the parent is summed, a force and a couple, before it goes to the parent's own slots; of a
  /// parent that is the world, the first has its point and axes.
  int parent(int k) const { return first + forces + k; }
  /// Has the target of a drive for a position along x, and the coordinate at the start of a step as the winding.
  int target() const { return parent(1); }
  /// Where a variable stands: its slot and the component there. \param sums whether that of sums is meant
  std::pair<int, int> place(int variable, bool sums = false) const {
    const int k = variable / 3;
    return {sums && k > 1 ? parent(k - 2) : of[k], variable % 3};
  }
};

/// An edge beside a vertex in a group of a junction, tied to the frame of the group by a half cell. The frame that the
/// half cell sees is that of the edge as drawn, turned as the group has turned, at a slot of its own. Its spin stands
/// there as a position does elsewhere: an unknown at the first edge of the group, of which the others have copies.
struct JoinedEdge {
  int rod, edge, vertex;        ///< vertex -1: a constraint turns the edge to the frame, and there is no half cell
  int cell, frame, first_frame; ///< slots
  int group;                    ///< over all junctions, then bodies
  bool of_body;
  bool ends; ///< at that vertex, or else begins there
  bool isFirst() const { return frame == first_frame; }
};

/// A pin between two vertices. Beside the rod of the one stands a copy of the other's position, so that the pin is a
/// matter of that rod alone. Its Hessian by the difference is where that of the copy would be.
struct Tie {
  int rod, slot, copy;
  int to_rod, vertex, of; ///< the other one's rod, number over all rods, and slot; of a body -1, -1 and the copy's slot
  int constraint;
  bool isToBody() const { return vertex < 0; }
};

/// Two edges that may touch each other in a step, of two rods or of one, an edge and a body, or two bodies; `rod` is
/// the later of the rods that have them.
struct TouchingPair {
  int rod, edge, to_rod, to_edge; ///< in place of its edge a body has its number, by ofBody
  std::array<int, 4> slot; ///< of the vertices of an edge, or of a body's position and rotation; then of the other
  int number = -1;         ///< over all pairs: of the block that they have between them (EdgeBlocks::touching)
  static constexpr int ofBody(int body) { return -1 - body; }
  /// \param side 0 the one, 1 the other
  bool isBody(int side) const { return (side == 0 ? edge : to_edge) < 0; }
  int body(int side) const { return -1 - (side == 0 ? edge : to_edge); }
  int rodOf(int side) const { return side == 0 ? rod : to_rod; }
  int edgeOf(int side) const { return side == 0 ? edge : to_edge; }
  /// Both that touch: rods by their numbers, bodies by ofBody.
  std::pair<int, int> things() const { return {edge < 0 ? edge : rod, to_edge < 0 ? to_edge : to_rod}; }
  bool isOfRods() const { return edge >= 0 && to_edge >= 0; }
  bool isOfBodies() const { return edge < 0 && to_edge < 0; }
  /// Of an edge x, y, z of its first vertex, those of its second, and its twist; of a body its displacement and spin.
  static constexpr int variables = 7;
  /// Where a variable stands: its slot and the component there. \param side 0 the one, 1 the other
  std::pair<int, int> place(int side, int variable) const {
    if (variable == 6) return {slot[std::size_t(2 * side)], 3};
    return {slot[std::size_t(2 * side + variable / 3)], variable % 3};
  }
};

/// What junctions, ties and contact add to the matrix of some rods.
struct Joins {
  std::span<const JoinedEdge> edges;
  std::span<const Tie> ties;
  std::span<const JoinedBody> bodies;
  std::span<const BodyPair> pairs;
  std::span<const TouchingPair> touching;
};

/// Unknowns of a slot: x, y, z, twist.
inline constexpr int slot_size = 4;

/// Scalar product over the slots of a rod. Of copies behind a ring one of both must be zero.
inline double dot(const RodRange &rod, const Planes &a, const Planes &b) {
  Pack sum(0.0);
  for (int k = 0; k < slot_size; ++k)
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) sum += read<Pack>(a[k] + s) * read<Pack>(b[k] + s);
  return reduce(sum);
}

} // namespace tendril
