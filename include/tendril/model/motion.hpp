#pragma once
/// \file motion.hpp
/// Prescribed motions.

#include "tendril/geometry/frame.hpp"

#include <vector>

namespace tendril {

/// How a held thing moves: displacement and rotation vector, both from the reference, by constant velocities and a
/// swing, or by a table, linear between its rows and at rest before the first and after the last.
struct Motion {
  struct Key {
    double time;       ///< [s]
    Vec3 displacement; ///< [m]
    Vec3 rotation;     ///< rotation vector about the vertex [rad]
    bool operator==(const Key &) const = default;
  };
  Vec3 velocity = Vec3::Zero();         ///< [m/s]
  Vec3 angular_velocity = Vec3::Zero(); ///< about the vertex [rad/s]
  /// Out and back in a period: displacement amplitude (1 - cos(2 pi t/period))/2 [m], [s].
  Vec3 amplitude = Vec3::Zero();
  double period = 1;
  std::vector<Key> table; ///< in order of time; used instead of the velocities when not empty
  Vec3 arm =
      Vec3::Zero(); ///< from the point that is moved so and turned about, to the thing: it goes round with it [m]

  bool operator==(const Motion &) const = default;
  bool moves() const {
    return !table.empty() || !velocity.isZero(0) || !angular_velocity.isZero(0) || !amplitude.isZero(0);
  }
  Vec3 displacementAt(double time) const; ///< of the thing
  /// Of the same motion a point elsewhere.
  Motion at(const Vec3 &arm_there) const {
    Motion there = *this;
    there.arm = arm_there;
    return there;
  }
  Vec3 velocityAt(double time) const;       ///< where it jumps, that before [m/s]
  Vec3 rotationVectorAt(double time) const; ///< [rad]
  Mat3 rotationAt(double time) const;
  Vec3 angularVelocityAt(double time) const; ///< where it jumps, that before [rad/s]
  /// Times from one, left out, to another, before or after it: between two it turns by less than half a radian, so that
  /// whole turns can be counted.
  std::vector<double> stopsBetween(double from, double to) const;
  /// Sum of the rotation vectors of its parts between two times: whole turns are counted [rad].
  Vec3 turnBetween(double from, double to) const;
  /// The latest time up to another, later one until which it goes straight and turns by less than half a radian.
  double evenUntil(double from, double to) const;
};

} // namespace tendril
