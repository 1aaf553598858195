#pragma once
/// \file contact.hpp
/// Obstacles that rods touch, and how they do.

#include "tendril/geometry/mesh_distance.hpp"
#include "tendril/model/motion.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace tendril {

/// How a rod touches obstacles.
struct ContactSettings {
  /// `barrier`: surfaces keep a distance between - distance/2 and distance/2, whatever the load. `penalty`: a spring,
  /// which gives way.
  enum class Law { barrier, penalty };
  bool on = true;
  /// Whether samples are on its skin, and not on its axis with its radius about them.
  bool on_surface = false;
  /// Which rods it touches, of those that say the same of it.
  enum class Rods { none, others, all };
  Rods rods = Rods::none;
  /// Whether it touches bodies, of those that say the same.
  bool bodies = false;
  Law law = Law::barrier;
  /// What other rods feel of it: its edges as capsules, or spheres of its radius about vertices or Gauss points of
  /// edges.
  bool point_cloud = false;
  int cloud = 0; ///< Gauss points of an edge that are spheres; 0: the vertices
  double exclusion_ratio =
      1.5;             ///< points of one rod nearer than so many radii and the threshold, as drawn, do not touch
  double radius = 0;   ///< of the rod [m]
  double distance = 0; ///< width of the barrier [m]
  /// Of a barrier: force per length [N/m], 0: by the loads. Of a penalty: pressure over depth, per length of the rod
  /// [N/m^2].
  double stiffness = 0;
  double threshold = 1e-3;         ///< of a penalty: distance at which it begins [m]
  double smoothing = 5e-3;         ///< of a penalty: half of the depth over which its stiffness rises [m]
  double friction = 0;             ///< coefficient of Coulomb's law
  double fall_off_velocity = 0.01; ///< below which friction falls off to zero [m/s]
  double slip_length = 0;          ///< in statics the same of the way since the last load step [m]
  bool friction_at_surface = true; ///< or at the axis, where it turns nothing
  double tangential_damping = 0, normal_damping = 0; ///< of the normal force by the velocity [s/m]
  /// What friction does with points that stick: `creep`, they slip a little in every step; `anchored`, they are drawn
  /// by a spring from where they began to stick. `by_mode`: anchored in statics.
  enum class Stick { by_mode, creep, anchored };
  Stick stick = Stick::by_mode;
  std::vector<int> passes; ///< obstacles that are not there for it
  /// Rods and bodies that are not there for each other: those of which one has a bit of `apart_from` that the other has
  /// of `apart_to`.
  std::uint64_t apart_from = 0, apart_to = 0;
  /// Gauss points of an edge; 0: vertices, and points between where obstacles curve. On a skin, those of a triangle.
  int quadrature = 0;
  static constexpr int corners = -1; ///< of `quadrature`: the corners of triangles

  static ContactSettings none() {
    ContactSettings settings;
    settings.on = false;
    return settings;
  }
  bool touchesRods() const { return on && rods != Rods::none; }
  bool touchesBodies() const { return on && bodies; }
  /// Whether it touches anything that moves by what it does to it.
  bool touchesMoving() const { return touchesRods() || touchesBodies(); }
  bool isApartFrom(const ContactSettings &other) const {
    return ((apart_from & other.apart_to) | (apart_to & other.apart_from)) != 0;
  }
  bool isBarrier() const { return law == Law::barrier; }
  /// Distance from the surface of a shape that no motion passes [m]: of a penalty, short of where the axis of the rod,
  /// or without a radius the middle of the obstacle, would be passed.
  double wall(const Shape &shape) const {
    return isBarrier() ? -0.5 * distance : padding() > 0 ? -0.8 * padding() : -0.8 * shape.depth();
  }
  /// About a sample [m].
  double padding() const { return on_surface ? 0 : radius; }
  bool slides() const { return friction > 0 || tangential_damping > 0 || normal_damping > 0; }
  bool isAnchored(bool is_static) const { return stick == Stick::anchored || (is_static && stick != Stick::creep); }
  bool operator==(const ContactSettings &) const = default;
};

/// An obstacle: a solid that stands or moves as it is told.
struct Collider {
  std::string name, layer;
  std::string kind;                   ///< of its shape, as scenes have it
  Vec3 size = Vec3::Zero();           ///< of its shape: radius and length; bore, outer radius and length; edges [m]
  std::shared_ptr<const Shape> shape; ///< about its own origin
  std::shared_ptr<const TriangleMesh> mesh = nullptr; ///< of which it was made, or null
  Vec3 position = Vec3::Zero();                       ///< of that origin, without its motion [m]
  Mat3 rotation = Mat3::Identity();                   ///< from its own axes to the world's, without its motion
  Motion motion;
  double friction = -1; ///< coefficient; negative: that of the rod. Of both the geometric mean counts

  /// Place of the origin and axes at a time.
  struct Pose {
    Mat3 rotation;
    Vec3 position;
    Vec3 toLocal(const Vec3 &x) const { return rotation.transpose() * (x - position); }
    Vec3 fromLocal(const Vec3 &x) const { return rotation * x + position; }
  };
  Pose poseAt(double time) const {
    return {motion.rotationAt(time) * rotation, position + motion.displacementAt(time)};
  }
};

} // namespace tendril
