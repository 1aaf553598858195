#pragma once
/// \file elements.hpp
/// The scene cut into elements: edges (stretch, twist inertia), vertices (mass) and cells (bending and twist), as
/// arrays over slots (see DofMap) that the element loops stream through. Built once; constant afterwards.

#include "tendril/layout/dof_map.hpp"

#include <span>

namespace tendril {

/// A cell that is not the one between the two edges at its slot: half cells of supports along a rod, and of junctions.
/// Its constants have a slot of their own.
struct LooseCell {
  int slot;
  int frame0, frame1; ///< slots of the frames it joins
  int vertex;         ///< slot of the vertex in the middle of its unknowns
  int turning = -1;   ///< which of the two frames, 0 or 1, is that of a junction; -1: none
};

/// Half of the end edge of an end that is free to turn, beyond all cells, where couples on that edge act at the end:
/// their moment is the whole moment of the rod there.
struct EndCouple {
  bool last;                        ///< at the last vertex of its rod, or the first
  int edge;                         ///< slot
  bool stretches;                   ///< whether bending is multiplied by the stretch of the edge (`seed`)
  std::array<double, 3> compliance; ///< half the edge's length over (kb1, kb2, kt), 0 for a stiffness of zero [1/(N m)]
  std::array<double, 2> rest;       ///< turns about both directors at rest, as the cell before, by the moment [rad]
  Vec3 moment;                      ///< at load factor 1, fixed in space ... [N m]
  double torque;                    ///< ... and about the tangent [N m]
};

/// A force on a vertex that turns with an edge which ends there.
struct PlacedFollower {
  int rod, vertex, edge; ///< the vertex and the edge by their slots
  Vec3 force;            ///< along the directors and the tangent of the edge, at load factor 1 [N]
  Vec3 along(const Frame &f) const {
    return force[0] * f.director + force[1] * f.secondDirector() + force[2] * f.tangent;
  }
};

class Elements {
public:
  std::vector<RodRange> rods;
  std::vector<Measure> measure; ///< per rod
  std::vector<Energy> energy;   ///< per rod
  int slots = 0;                ///< those of DofMap

  /// Regular cells of a rod, [begin, end): the cell at slot s joins the frames at s - 1 and s.
  std::vector<int> cell_begin, cell_end;
  std::vector<std::vector<LooseCell>> loose;       ///< per rod
  std::vector<std::vector<EndCouple>> end_couples; ///< per rod
  std::vector<int> support_slot;                   ///< of each support's frame, or -1 where nothing meets it
  std::vector<int> constraint_slot; ///< first of each constraint's slots: that of its target (Constraint::slots)
  std::vector<int> tendon_slot;     ///< first of those of each tendon (Tendon::slots)
  /// Pins of a rod by their vertices' slots, a vertex once: how stiff they hold it [N/m].
  using Pins = std::vector<std::pair<int, double>>;

  // In scene order.
  std::vector<int> vertex0, vertex1; ///< ends of each edge
  std::vector<int> vertex_slot, edge_slot, cell_slot;
  std::vector<int> rod_cells; ///< offsets of the rods' cells (nr + 1)
  int groups;                 ///< of junctions, then bodies, each with a frame

  // Over slots; zero where there is no such element, except rest lengths, which are one there.
  const double *mass() const { return constants_[0]; }              ///< of vertices; on bodies it is theirs [kg]
  const double *restLength() const { return constants_[1]; }        ///< of edges [m]
  const double *inverseRestLength() const { return constants_[2]; } ///< [1/m]
  const double *axialStiffness() const { return constants_[3]; }    ///< [N]
  const double *twistMass() const { return constants_[4]; }         ///< r_L L of edges [kg m^2]
  const double *freedom() const { return constants_[5]; }           ///< 1 for vertices that are not held
  const double *cellLength() const { return constants_[6]; }        ///< Lbar [m]
  /// stiffness, 3 planes; rest, 3; weight, 2; free, 2; base, 1 (CellOf)
  const Planes &cells() const { return cells_; }
  /// Constraints on a rod, by number, and its pins to the world; empty where the scene has none.
  std::span<const int> constraintsOf(int rod) const {
    return constraints_.empty() ? std::span<const int>() : std::span<const int>(constraints_[rod]);
  }
  /// What else the scene has of a rod, by number.
  std::span<const int> supportsOf(int rod) const { return supports_.of(rod); }
  std::span<const int> forcesOf(int rod) const { return forces_.of(rod); }
  std::span<const int> momentsOf(int rod) const { return moments_.of(rod); }
  std::span<const PlacedFollower> followers(RodSet set) const { return followers_.of(set); }
  std::span<const int> tendonsOf(int rod) const { return tendons_.of(rod); }
  /// Of a tendon, [begin, end).
  std::pair<int, int> tendonSlots(int k) const { return {tendon_slot[k], tendon_slot[k] + tendon_slots_[k]}; }
  const Pins &pinsOf(int rod) const { return pins_.empty() ? no_pins_ : pins_[rod]; }
  double length(int rod) const { return length_[rod]; } ///< at rest [m]
  std::span<const JoinedEdge> joinedEdges(RodSet set) const { return joined_edges_.of(set); }
  std::span<const JoinedVertex> joinedVertices(RodSet set) const { return joined_vertices_.of(set); }
  std::span<const Tie> ties(RodSet set) const { return ties_.of(set); }
  const Frame &frameAsDrawn(const JoinedEdge &j) const { return joined_frame_[&j - joined_edges_.items.data()]; }
  std::span<const JoinedBody> bodies(RodSet set) const { return bodies_.of(set); }
  /// By the body's number in the scene.
  const JoinedBody &body(int b) const { return bodies_.items[place_of_body_[b]]; }
  int bodyCount() const { return int(body_mass_.size()); }
  std::span<const BodyPair> pairs(RodSet set) const { return pairs_.of(set); }
  /// By the joint's number in the scene.
  const BodyPair &pairOf(int joint) const { return pairs_.items[place_of_joint_[joint]]; }
  /// Of a body and what presses on it (Scene::isPressed).
  const BodyPair &pairOfBody(int body) const { return pairs_.items[place_of_contact_[body]]; }
  /// Of a body with what rods tied to it add, as drawn.
  const MassProperties &bodyMass(int body) const { return body_mass_[body]; }
  /// Spin that belongs to an angular momentum, both in the axes as drawn [rad/s].
  Vec3 spinOf(int body, const Vec3 &momentum) const { return inverse_inertia_[body] * momentum; }
  /// Its radius of gyration, or its longest arm to what is tied to it [m].
  double bodySize(int body) const { return body_size_[body]; }
  /// From the centre of mass of its body to a vertex, as drawn [m].
  const Vec3 &armAsDrawn(const JoinedVertex &j) const { return arm_[j.number]; }
  int vertices() const { return int(vertex_slot.size()); }
  int edges() const { return int(edge_slot.size()); }

  Elements(const Scene &scene, const DofMap &dofs);

private:
  NumbersByRod supports_, forces_, moments_, tendons_;
  Planes constants_, cells_;
  std::vector<double> length_;    ///< per rod
  std::vector<int> tendon_slots_; ///< how many each has
  ByRod<PlacedFollower> followers_;
  ByRod<JoinedEdge> joined_edges_;
  ByRod<JoinedVertex> joined_vertices_;
  ByRod<Tie> ties_;
  ByRod<JoinedBody> bodies_;
  ByRod<BodyPair> pairs_;
  std::vector<int> place_of_joint_, place_of_contact_; ///< of each joint, and of each body that touches, in pairs_
  std::vector<MassProperties> body_mass_;
  std::vector<Mat3> inverse_inertia_;
  std::vector<double> body_size_;
  std::vector<int> place_of_body_; ///< of each body in bodies_
  std::vector<Vec3> arm_;          ///< per joined vertex
  void weighBodies(const Scene &scene);
  void placeFollowers(const Scene &scene);
  std::vector<Frame> joined_frame_;           ///< as drawn, of unit length
  std::vector<std::vector<int>> constraints_; ///< per rod
  std::vector<Pins> pins_;                    ///< per rod
  Pins no_pins_;
  void placeConstraints(const Scene &scene, std::vector<int> free_slots);
  friend class CellBuilder;
};

/// Cells of a rod one by one in scene order, those of half edges too.
std::vector<LooseCell> cellsOf(const Elements &elements, int rod);
/// Half cells between the frame of a support, at its slot, and the edges beside it.
std::vector<LooseCell> heldCells(const Elements &elements, int rod, int frame);
/// Edge of a rod at the slot of a frame, or -1 where a support's is.
int edgeAt(const RodRange &rod, int slot);

/// Planes of Elements::cells().
enum CellPlane : int {
  cell_stiffness = 0,
  cell_rest = 3,
  cell_weight = 6,
  cell_free = 8,
  cell_base = 10,
  cell_planes = 11
};

} // namespace tendril
