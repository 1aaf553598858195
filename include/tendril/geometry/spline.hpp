#pragma once
/// \file spline.hpp
/// Cubic splines through points.

#include "tendril/geometry/frame.hpp"

#include <vector>

namespace tendril {

/// Slopes at points of the cubic spline through them over the length along their polyline [1]: its second derivative is
/// continuous, and so is the third behind the first edge and before the last (`not a knot`: de Boor, *A Practical Guide
/// to Splines*, 1978, chapter IV). It is off a smooth curve by the fourth power of the edge length. Three points have a
/// parabola, two a straight line. \param points two or more, no two neighbours at one place
std::vector<Vec3> splineSlopes(const std::vector<Vec3> &points);

/// The cubic between two points `length` apart with slopes m0 and m1, at a part t of the way.
inline Vec3 hermite(const Vec3 &x0, const Vec3 &x1, const Vec3 &m0, const Vec3 &m1, double length, double t) {
  const double u = 1 - t;
  return (1 + 2 * t) * u * u * x0 + t * t * (3 - 2 * t) * x1 + length * t * u * (u * m0 - t * m1);
}

} // namespace tendril
