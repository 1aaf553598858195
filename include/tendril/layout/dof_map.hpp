#pragma once
/// \file dof_map.hpp
/// Where the unknowns are. Three numberings:
///   vertices and edges   of the whole scene, rod after rod, in scene order, as files have them;
///   slots                of the arrays the element loops stream through: vertex i, edge i and the cell at vertex i of
///   a rod share its slot
///                        first_slot + i. Behind a ring come copies of its first two vertices and first edge; around an
///                        open rod there is room for the frames that clamps hold. Element loops know neither ends nor
///                        rings;
///   unknowns             of PETSc's global vector: x, y, z and twist of each slot that neither is a copy nor is held
///   by a support.

#include "tendril/layout/edge_blocks.hpp"
#include "tendril/layout/petsc.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <unordered_map>

namespace tendril {

class DofMap {
public:
  PetscErrorCode setUp(const Scene &scene);
  /// Numbers vertices, edges and slots only, for a scene whose steps are solved elsewhere.
  void layOut(const Scene &scene);

  const std::vector<RodRange> &rods() const { return rods_; }
  int vertices() const { return vertices_; }
  int edges() const { return edges_; }
  int slots() const { return slots_; }
  PetscInt unknowns() const { return unknowns_; }
  /// Unknown of a slot's x, y, z (a = 0, 1, 2) or twist (3), or -1 where it is held or does not exist.
  PetscInt unknown(int slot, int a) const { return unknown_[std::size_t(slot_size) * slot + a]; }
  bool isHeld(int vertex) const { return held_[vertex]; }
  /// Rods that junctions, ties and contact join, with all between them in the order of the scene; a rod that nothing
  /// joins is one by itself.
  RodSet islandOf(int rod) const { return islands_.empty() ? RodSet{rod, rod + 1} : islands_[rod]; }
  /// Whether a junction or a tie meets any of some rods.
  bool isJoined(RodSet rods) const {
    return !joined_.empty() && std::find(joined_.begin() + rods.begin, joined_.begin() + rods.end, char(true)) !=
                                   joined_.begin() + rods.end;
  }
  /// Those of some rods, by rod.
  std::span<const JoinedVertex> joinedVertices(RodSet rods) const { return joined_vertices_.of(rods); }
  std::span<const JoinedEdge> joinedEdges(RodSet rods) const { return joined_edges_.of(rods); }
  std::span<const Tie> ties(RodSet rods) const { return ties_.of(rods); }
  std::span<const JoinedBody> bodies(RodSet rods) const { return bodies_.of(rods); }
  std::span<const BodyPair> pairs(RodSet rods) const { return pairs_.of(rods); }
  /// Edges and bodies that may touch in the step, by the rod that has the pair.
  std::span<const TouchingPair> touching(RodSet rods) const { return touching_.of(rods); }
  const ByRod<TouchingPair> &touching() const { return touching_; }
  /// Sets them, each with a number of its own below their count, and makes islands of the rods that they belong to.
  void setTouching(std::vector<TouchingPair> pairs);
  /// Whether a junction, a tie or contact meets any of some rods.
  bool isCoupled(RodSet rods) const { return isJoined(rods) || !touching(rods).empty(); }
  Joins joins(int rod) const {
    const RodSet one{rod, rod + 1};
    return {joinedEdges(one), ties(one), bodies(one), pairs(one), touching(one)};
  }
  /// Calls visit(slot) for the slots beside rods that have unknowns, copies or sums of their own: frames of junctions,
  /// bodies, ends of ties, parents of joints.
  template <class Visit> void forBeside(RodSet rods, Visit visit) const {
    for (const JoinedEdge &j : joinedEdges(rods)) visit(j.frame);
    for (const JoinedBody &b : bodies(rods)) {
      visit(b.position);
      visit(b.rotation);
    }
    for (const JoinedVertex &j : joinedVertices(rods))
      if (j.isOnBody()) visit(j.frame);
    for (const Tie &t : ties(rods)) visit(t.copy);
    for (const BodyPair &p : pairs(rods))
      for (const int k : {0, 1})
        if (p.variables() > 6) visit(p.parent(k));
  }
  /// From the centre of mass of its body to a vertex, at the iterate [m].
  const Vec3 &arm(const JoinedVertex &j) const { return arms_[std::size_t(j.number)]; }
  void setArm(const JoinedVertex &j, const Vec3 &arm) { arms_[std::size_t(j.number)] = arm; }
  const ByRod<Tie> &ties() const { return ties_; }
  const ByRod<JoinedVertex> &joinedVertices() const { return joined_vertices_; }
  const ByRod<JoinedEdge> &joinedEdges() const { return joined_edges_; }
  const ByRod<JoinedBody> &bodies() const { return bodies_; }
  const ByRod<BodyPair> &pairs() const { return pairs_; }
  int groups() const { return groups_; } ///< rigid ones of all junctions, and bodies
  /// First of those of each tendon (Tendon::slots), in the order of the scene.
  const std::vector<int> &tendonSlots() const { return tendon_slot_; }
  Planes makePlanes() const { return Planes(slot_size, slots_); }
  /// A window of them, over some rods.
  Planes makePlanes(RodSet rods) const {
    Planes window(slot_size, slots(rods));
    window.setOrigin(rods_[rods.begin].first_slot);
    return window;
  }

  DM dm() const { return dm_; }
  /// Entries of the matrix of some rods in its own order: where their values are in the blocks, those to be taken off
  /// as their complement.
  struct Pattern {
    std::vector<PetscInt> row, column;
    std::vector<std::ptrdiff_t> source;
    std::size_t lasting = 0;   ///< of these, all but those of edges that touch
    std::vector<int> touching; ///< pairs that it has entries of, by their rising places in DofMap::touching(), ...
    bool turns = false;        ///< ... with their twists, which friction turns
    std::vector<double> entries;
    /// Components of arms that an entry is multiplied by, three times the number of the arm and the axis, or -1; empty
    /// where there are no bodies.
    std::vector<std::array<int, 2>> factor;
  };
  /// For slots of some rods that are copies in junctions, those that have the unknowns.
  std::unordered_map<int, int> firstSlots(RodSet rods) const;
  /// Matrix of PETSc's own type over the unknowns of some rods, preallocated for their blocks and those of the pairs of
  /// edges that touch which the pattern names. \param pattern empty, or that of the same rods with other pairs
  /// \param joins as EdgeBlocks::joins
  PetscErrorCode createMatrix(RodSet rods, bool joins, Mat *matrix, Pattern *pattern) const;
  /// Puts their blocks into it, both triangles.
  PetscErrorCode fillMatrix(const EdgeBlocks &blocks, Pattern &pattern, Mat matrix) const;

  /// Copies of the first vertices and edge of a closed rod behind its last.
  void copyBehindRing(const RodRange &rod, Planes &increment) const;
  /// Adds what was summed into the copies behind a ring to the slots they stand for.
  void fold(const RodRange &rod, Planes &sums) const;
  /// Positions of first members and of ends of ties, spins of first frames, and the motions of bodies, to what follows
  /// them in whole islands, to first order.
  void copyJoined(RodSet islands, Planes &increment) const;
  /// Adds what was summed into those copies to what they stand for.
  void foldJoined(RodSet islands, Planes &sums) const;
  /// Scalar product over the slots of an island. Of copies one of both must be zero.
  double dot(RodSet island, const Planes &a, const Planes &b) const;

  /// Unknowns of some rods are numbered one after the other.
  PetscInt firstUnknown(RodSet rods) const { return unknown_begin_[rods.begin]; }
  PetscInt unknowns(RodSet rods) const { return unknown_begin_[rods.end] - unknown_begin_[rods.begin]; }
  RodSet all() const { return {0, int(rods_.size())}; }
  /// Slots from the first rod's first to the one behind the last rod's room.
  int slots(RodSet rods) const {
    return rods_[rods.end - 1].first_slot + rods_[rods.end - 1].slots - rods_[rods.begin].first_slot;
  }

  /// out = values of the unknowns of some rods; of these, rods not `active` (by scene order) get zero.
  PetscErrorCode gather(const Planes &values, RodSet rods, Vec out, const std::vector<char> *active = nullptr) const;
  /// Values of the rods' slots from unknowns: zero where held, copies behind rings included.
  PetscErrorCode scatter(Vec in, RodSet rods, Planes &values) const;

private:
  std::vector<RodRange> rods_;
  int vertices_ = 0, edges_ = 0, slots_ = 0;
  PetscInt unknowns_ = 0;
  std::vector<bool> held_;
  std::vector<PetscInt> unknown_, unknown_begin_;
  ByRod<JoinedVertex> joined_vertices_;
  ByRod<JoinedEdge> joined_edges_;
  ByRod<Tie> ties_;
  ByRod<JoinedBody> bodies_;
  ByRod<BodyPair> pairs_;
  std::vector<Vec3> arms_; ///< of joined vertices
  std::vector<int> tendon_slot_;
  int groups_ = 0;
  ByRod<TouchingPair> touching_;
  std::vector<RodSet> islands_;  ///< per rod; empty where nothing joins any
  std::vector<RodSet> lasting_;  ///< the same without contact
  std::vector<char> joined_;     ///< per rod, as islands
  std::vector<int> unknown_end_; ///< slot behind the last with unknowns, per rod
  OwnedDM dm_;

  PetscErrorCode createSection(PetscSection *section) const;
  void join(const Scene &scene, std::vector<int> free_slots);
  void joinBodies(const Scene &scene, std::vector<int> &free_slots);
  void tieToBodies(const Scene &scene, std::vector<int> &free_slots);
  void tieEdges(const Scene &scene, JoinedEdge joined, std::vector<int> &free_slots);
  void makeIsland(RodSet a, RodSet b);
};

} // namespace tendril
