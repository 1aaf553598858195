#pragma once
/// \file wrap.hpp
/// Shortest ways between two points round a cylinder or a sphere. Numbers in brackets are of docs/theory.md, 10.

#include "tendril/geometry/frame.hpp"

namespace tendril {

/// Length of a way and its derivatives by both of its ends, those of the first in front.
struct WayLength {
  double value = 0;
  Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();
  double angle = 0;   ///< that it winds by [rad]; 0 of a straight one
  double turning = 0; ///< of its direction over that arc [rad]: less round a cylinder that it climbs along
};

/// Of the straight way, (10.1); infinite where both ends are one.
WayLength straightWay(const Vec3 &way);

/// Round a cylinder about the z axis, whose surface can be developed: h in the plane of its circle, sqrt(h^2 + dz^2)
/// (10.2). The derivative of h by an end is the unit vector from where it meets the circle, and of second order the end
/// moves as on a straight way to there (10.3). \param side 0: the nearer one, where the straight way meets it; 1
/// anticlockwise, -1 clockwise from the first to the second, up to three quarters of a turn. \return infinite where an
/// end is within
WayLength wayRoundCylinder(const Vec3 &from, const Vec3 &to, double radius, int side);
/// Round a sphere at the origin (10.4), in the plane through both ends, on the nearer side where the straight way meets
/// it.
WayLength wayRoundSphere(const Vec3 &from, const Vec3 &to, double radius);

/// So many points on it, for pictures, from where it meets the obstacle to where it leaves it; none of a straight way.
std::vector<Vec3> drawnRoundCylinder(const Vec3 &from, const Vec3 &to, double radius, int side, int points);
std::vector<Vec3> drawnRoundSphere(const Vec3 &from, const Vec3 &to, double radius, int points);

} // namespace tendril
