#pragma once
/// \file joint.hpp
/// What joins two rigid bodies, or one to the world.

#include "tendril/model/motion.hpp"

#include <cmath>
#include <string>
#include <string_view>

namespace tendril {

/// A joint stands at a point of both bodies, with axes in both that are one as drawn; the third is its axis. It holds
/// the point, the direction of the axis and the turn about it, all or some. What it leaves free along or about the axis
/// is its coordinate, 0 as drawn.
struct Joint {
  enum class Type { ball, hinge, prismatic, cylindrical, planar, fixed };
  /// What a type holds: the point across the axis and along it, the tilt of the axis, the turn about it.
  struct Held {
    bool across, along, tilt, turn;
    bool turnsFreely() const { return tilt && !turn; }
    bool slidesFreely() const { return across && !along; }
  };
  std::string name;
  Type type;
  int child;       ///< of the scene's bodies
  int parent = -1; ///< of these, or -1: the world, or a body that goes as it is told, ...
  Motion motion;   ///< ... by this motion of the point
  int rod = 0;     ///< that of the child (Body::rod)
  Vec3 point;      ///< as drawn [m]
  Mat3 axes;       ///< as drawn
  /// Of springs in place of what is held; exact where negative.
  double stiffness = -1, rotational_stiffness = -1; ///< [N/m], [N m/rad]
  double damping = 0, rotational_damping = 0;       ///< [N s/m], [N m s/rad]
  double saturation = -1;                           ///< of the point's spring, as Constraint::saturation [m]
  /// Where the coordinate may be, of a ball the angle of its rotation; by a spring where `range_stiffness` is not
  /// negative, or exactly.
  double lower = -HUGE_VAL, upper = HUGE_VAL, range_stiffness = -1;
  /// What draws the coordinate to a target, which is the displacement along x of a motion: by a spring, or exactly
  /// where `drive_stiffness` is negative.
  bool driven = false;
  double drive_stiffness = -1, drive_damping = 0;
  double target = 0; ///< where it has no motion
  Motion target_motion;

  Held held() const;
  bool isExact() const { return stiffness < 0; }
  bool hasRange() const { return std::isfinite(lower) || std::isfinite(upper); }
  bool dissipates() const { return damping > 0 || rotational_damping > 0 || drive_damping > 0; }
  double targetAt(double time) const {
    return target_motion.table.empty() ? target : target_motion.displacementAt(time)[0];
  }
};

/// By their names in scenes.
inline constexpr std::string_view joint_types[] = {"ball", "hinge", "prismatic", "cylindrical", "planar", "fixed"};
inline std::string_view nameOf(Joint::Type type) { return joint_types[int(type)]; }

inline Joint::Held Joint::held() const {
  switch (type) {
  case Type::ball:
    return {true, true, false, false};
  case Type::hinge:
    return {true, true, true, false};
  case Type::prismatic:
    return {true, false, true, true};
  case Type::cylindrical:
    return {true, false, true, false};
  case Type::planar:
    return {false, true, true, false};
  case Type::fixed:
    break;
  }
  return {true, true, true, true};
}

} // namespace tendril
