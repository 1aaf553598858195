#pragma once
/// \file state.hpp
/// What a run must remember between steps, and what is derived from it.

#include "tendril/geometry/rotation.hpp"
#include "tendril/layout/elements.hpp"

#include <cstdint>
#include <tuple>

namespace tendril {

/// Displacement, velocity or acceleration of a body: of its centre of mass; its rotation vector, spin or the rate of
/// that; and its angular momentum or the rate of that (none with a displacement). All in axes fixed in space.
struct BodyRate {
  Vec3 translation = Vec3::Zero(), spin = Vec3::Zero(), momentum = Vec3::Zero();
  BodyRate &add(double weight, const BodyRate &other) {
    translation += weight * other.translation;
    spin += weight * other.spin;
    momentum += weight * other.momentum;
    return *this;
  }
  bool operator==(const BodyRate &) const = default;
};

/// Displacements, velocities or accelerations of all unknowns.
struct Rates {
  std::vector<Vec3> vertex;   ///< (nv)
  std::vector<double> edge;   ///< (ne) of the twist
  std::vector<BodyRate> body; ///< (nb)
  bool operator==(const Rates &) const = default;
};

/// What a sample in contact remembers of its friction.
struct ContactMemory {
  int edge, point, collider; ///< of its rod; of samplePoints; of the scene
  Vec3 stick;                ///< what sticks has been drawn so far from its anchor, in the axes of the obstacle [m]
  Vec3 friction;             ///< on the rod, with the damping of the contact [N]
  bool operator==(const ContactMemory &) const = default;
  auto key() const { return std::tuple(edge, collider, point); }
};

/// What a sample of a rod, or of a body beside it, remembers that touches another at the end of a step. Edges and
/// bodies are named as in TouchingPair.
struct PairMemory {
  int edge, to_rod, to_edge; ///< whose sample it is; what it touches
  int point;                 ///< which sample
  Vec3 stick;                ///< what sticks has been drawn so far from its anchor [m]
  Vec3 friction;             ///< on it, with the damping of the contact [N]
  bool operator==(const PairMemory &) const = default;
  auto key() const { return std::tuple(edge, to_rod, to_edge, point); }
  /// As a row of numbers, and from one.
  static constexpr std::size_t width = 10;
  std::array<double, width> numbers() const {
    return {double(edge), double(to_rod), double(to_edge), double(point), stick[0],
            stick[1],     stick[2],       friction[0],     friction[1],   friction[2]};
  }
  static PairMemory of(const double *x) {
    return {int(x[0]), int(x[1]), int(x[2]), int(x[3]), {x[4], x[5], x[6]}, {x[7], x[8], x[9]}};
  }
};

/// What a joint remembers.
struct JointState {
  std::array<double, BodyPair::forces> force{}; ///< of what it holds exactly, row by row (see coupling/joints.cpp)
  double coordinate = 0;                        ///< with whole turns [m] or [rad]
  bool operator==(const JointState &) const = default;
};

/// All that a checkpoint needs. Copied to be restored when a step fails.
struct State {
  double time = 0;
  std::int64_t step = 0;
  std::vector<Vec3> position; ///< (nv) [m]
  std::vector<Vec3>
      position_low; ///< (nv) what rounding to `position` has left of it; edges are differences of both words [m]
  std::vector<Vec3> director;      ///< (ne) first directors
  std::vector<Vec3> velocity;      ///< (nv) [m/s]
  std::vector<double> twist_rate;  ///< (ne) [rad/s]
  std::vector<double> axial_force; ///< (ne) [N]
  /// Rotation of the frame of each group of junctions, then of each body, since it was drawn: its first two columns.
  std::vector<std::array<Vec3, 2>> junction_axes;
  std::vector<Vec3> body_position, body_position_low; ///< (nb) of the centres of mass, in two words [m]
  std::vector<BodyRate> body_rate;                    ///< (nb) velocities, spins and angular momenta
  std::vector<double>
      winding; ///< (cells) 2 pi x whole turns of the twist angle, carried by continuity (`angle` measure) [rad]
  std::vector<JointState> joints; ///< (nj)
  /// All of a tendon (Tendon::remembered), then of the next.
  std::vector<double> tendon_memory;
  double last_dt = 0;        ///< length of the step that led here; 0 where the integrator remembers nothing [s]
  double dt_before = 0;      ///< of the step before that; 0 where there was none [s]
  std::vector<Rates> memory; ///< what the integrator remembers of steps before
  std::vector<double>
      strains; ///< before the last step, as strainsOf, then before the one before; where the integrator wants them
  /// What supports, constraints and obstacles that move did at the end of the last step, then of the one before
  /// (HolderActions); where the integrator wants them.
  std::vector<Vec3> support_actions;
  /// Stiffness of the barrier between each rod and obstacles in the last step; where there are obstacles [N/m].
  std::vector<double> contact_stiffness;
  /// The same of the barrier between each rod and others; where rods touch each other.
  std::vector<double> rod_contact_stiffness;
  /// What samples of each rod that touched an obstacle at the end of the last step remember, in order; where friction
  /// acts on any rod.
  std::vector<std::vector<ContactMemory>> contacts;
  /// The same of samples that touched rods or bodies.
  std::vector<std::vector<PairMemory>> pairs;

  bool operator==(const State &) const = default;
};

State initialState(const Scene &scene, const Elements &elements);

/// A point of the configuration manifold with its derived frames, over slots: the iterate of a step. Whatever is no
/// edge has a unit frame at rest, so that whole packs can be worked on.
class Configuration {
public:
  /// First planes of what is stored.
  enum Plane : int {
    position = 0, ///< at the slot of a frame of a junction or body: its spin since the step began, summed [rad]
    tangent = 3,
    director = 6,
    length = 9,
    /// Axial strain, computed once: compilers contract the formula differently from place to place, and a stiff rod
    /// turns that last bit into forces.
    strain = 10,
    spin = 11,    ///< turning of each director since the step began, summed over retractions [rad]
    winding = 12, ///< of cells, as in State
    twist = 13,   ///< twist angle of cells with whole turns [rad]
    axial_force = 14,
    /// Second word of the position: edges and displacements are known to rounding of their own size, not to that of the
    /// coordinates.
    position_low = 15,
    planes = 18
  };

  Configuration() = default;
  explicit Configuration(int slots);
  double *operator[](Plane plane) { return values_[plane]; }
  const double *operator[](Plane plane) const { return values_[plane]; }

  const Planes &values() const { return values_; }
  Vec3 positionAt(int slot) const { return values_.vector(position, slot); }
  Frame frameAt(int slot) const { return frames<double>(slot); }
  /// Of a body, since it was drawn.
  Mat3 rotationAt(int slot) const { return matrixOf(frameAt(slot)); }
  void setFrame(int slot, const Frame &f);
  /// Frames of a slot or of a pack of them.
  template <class T> FrameOf<T> frames(int slot) const {
    return {readVector<T>(values_, tangent, slot), readVector<T>(values_, director, slot),
            read<T>((*this)[length] + slot)};
  }
  template <class T> Vector3<T> positions(int slot) const { return readVector<T>(values_, position, slot); }
  /// Edge vectors x_{i+1} - x_i.
  template <class T> Vector3<T> edges(int slot) const { return displacements<T>(slot + 1, *this, slot); }
  /// Displacements from the slot of another configuration.
  template <class T> Vector3<T> displacements(int slot, const Configuration &from, int from_slot) const {
    return (positions<T>(slot) - from.positions<T>(from_slot)) +
           (readVector<T>(values_, position_low, slot) - readVector<T>(from.values_, position_low, from_slot));
  }
  template <class T> Vector3<T> displacements(int slot, const Configuration &from) const {
    return displacements<T>(slot, from, slot);
  }
  Vec3 displacementAt(int slot, const Configuration &from) const { return displacements<double>(slot, from); }
  void setPosition(int slot, const Vec3 &high, const Vec3 &low) {
    values_.setVector(position, slot, high);
    values_.setVector(position_low, slot, low);
  }

  /// Copies all of one rod, the frames of its ends and its loose cells included.
  void copyRod(const Elements &elements, int rod, const Configuration &from);
  /// Copies what a rod has beside its own edges: the frames of supports, the targets of constraints.
  void copyEnds(const Elements &elements, int rod, const Configuration &from);
  /// Moves the window (see Planes).
  void setOrigin(int first_slot) { values_.setOrigin(first_slot); }
  bool empty() const { return values_.size() == 0; }
  /// Time at which obstacles stand for a rod, where any moves [s].
  double obstacleTime(int rod) const { return obstacle_time_.empty() ? 0 : obstacle_time_[rod]; }
  void setObstacleTime(int rod, double time) { obstacle_time_[rod] = time; }
  void setObstacleTimes(int rods, double time) { obstacle_time_.assign(rods, time); }
  /// Frames of the first edge of a ring, and positions of its first two vertices, behind its last.
  void closeRing(const RodRange &rod);

private:
  Planes values_;
  std::vector<double> obstacle_time_; ///< per rod
  void copySlots(const Configuration &from, int begin, int end);
};

/// Configuration of a state; supports' frames at `motion_time` of their prescribed motion.
Configuration configurationOf(const State &state, const Scene &scene, const Elements &elements, double motion_time);
/// Frames of all supports with the targets of all constraints, and all of one rod, into a configuration of that scene.
void setSupports(const Scene &scene, const Elements &elements, double motion_time, Configuration &c);
void setRod(const State &state, const Elements &elements, int rod, Configuration &c);

/// How a group of junctions, or a body, has turned since it was drawn.
Mat3 rotationOf(const State &state, int group);
/// Frame to which a half cell ties an edge, as its junction has turned.
Frame joinedFrame(const State &state, const Elements &elements, const JoinedEdge &edge);

/// Present frame of a support.
Frame supportFrame(const Support &support, double motion_time);
/// Point or frame of a constraint, its target, into the configuration, at its slot.
void setTarget(const Constraint &constraint, int slot, double motion_time, Configuration &c);
/// Of a joint: the target of its drive, and where its parent is one that no step moves.
void setTarget(const Joint &joint, const BodyPair &pair, double motion_time, Configuration &c);
/// Of a tendon: the input of its actuator, and the points that are told. \param slot the first of its own
void setTarget(const Tendon &tendon, int slot, double motion_time, Configuration &c);
void setTargets(const Scene &scene, const Elements &elements, double motion_time, Configuration &c);

/// Visits the cells of a rod: `visit(slot, frame0, frame1, count)`, as Packs of `count` regular cells, then one by one
/// the loose ones (template argument double). The tail of the last pack has no cells: its constants are zero.
template <class Visit> void forCells(const Elements &elements, int rod, Visit visit) {
  const int end = elements.cell_end[rod];
  for (int s = elements.cell_begin[rod]; s < end; s += lanes)
    visit.template operator()<Pack>(LooseCell{s, s - 1, s, s}, std::min(lanes, end - s));
  for (const LooseCell &cell : elements.loose[rod]) visit.template operator()<double>(cell, 1);
}

/// The two frames of a cell. In lanes without a cell the second is the first: they have no strain.
template <class T> std::array<FrameOf<T>, 2> cellFrames(const Configuration &c, const LooseCell &cell, int count) {
  std::array<FrameOf<T>, 2> f{c.frames<T>(cell.frame0), c.frames<T>(cell.frame1)};
  if constexpr (std::is_same_v<T, Pack>)
    if (count < lanes) {
      const Pack::mask_type live = firstLanes(count);
      for (int a = 0; a < 3; ++a) {
        f[1].tangent[a] = select(live, f[1].tangent[a], f[0].tangent[a]);
        f[1].director[a] = select(live, f[1].director[a], f[0].director[a]);
      }
      f[1].length = select(live, f[1].length, f[0].length);
    }
  return f;
}

/// Twist of a pack of edges since the start of a step, whole turns by continuity with the sum of the retractions [rad].
inline Pack spinOver(const Configuration &start, const Configuration &now, int slot) {
  using std::floor;
  const Pack principal = halfAngleBetween(start.frames<Pack>(slot), now.frames<Pack>(slot)).angle();
  const Pack turns =
      Pack(2 * pi) * floor((read<Pack>(now[Configuration::spin] + slot) - principal) * Pack(0.5 / pi) + Pack(0.5));
  return principal + turns;
}

} // namespace tendril
