#pragma once
/// \file shape.hpp
/// Solids by their signed distance, each about its own origin.

#include "tendril/geometry/frame.hpp"

#include <memory>

namespace tendril {

/// Signed distance [m], negative inside, with its gradient (of length one) and second derivatives, which contact takes
/// by docs/theory.md (17.4) and solids have by (17.11). Where the nearest
/// place of the surface is not the only one, those of one of them.
struct Distance {
  double value;
  Vec3 gradient;
  Mat3 hessian;
};

class Shape {
public:
  virtual ~Shape() = default;
  /// Of `count` points, given by their coordinates. Two points differ by no more than they are apart.
  virtual void distances(const double *const point[3], int count, double *out) const = 0;
  virtual Distance at(const Vec3 &point) const = 0;
  /// Smallest radius of curvature of the surface [m]; infinite where it is flat, zero where it has edges.
  virtual double curvatureRadius() const = 0;
  /// Largest distance inside [m].
  virtual double depth() const = 0;
  /// Whether the signed distance is a convex function: nowhere less than its tangents.
  virtual bool isConvex() const { return false; }
};

/// Signed distance of one point [m].
inline double distanceAt(const Shape &shape, const Vec3 &x) {
  const double *const point[3] = {&x[0], &x[1], &x[2]};
  double distance;
  shape.distances(point, 1, &distance);
  return distance;
}

/// All below the plane z = 0.
std::shared_ptr<const Shape> makeHalfSpace();
std::shared_ptr<const Shape> makeSphere(double radius);
/// About the axis z, with half spheres as ends. \param length between their centres [m]
std::shared_ptr<const Shape> makeCapsule(double radius, double length);
/// About the axis z, with flat ends. \param length [m], may be infinite
std::shared_ptr<const Shape> makeCylinder(double radius, double length);
/// \param size its edges along x, y, z [m]
std::shared_ptr<const Shape> makeBox(const Vec3 &size);
/// About the axis z, solid between two radii. \param outer [m], may be infinite, as may be \param length [m]
std::shared_ptr<const Shape> makeTube(double bore, double outer, double length);

} // namespace tendril
