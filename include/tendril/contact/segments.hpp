#pragma once
/// \file segments.hpp
/// Distances of points and segments, for contact between rods.

#include "tendril/geometry/frame.hpp"

namespace tendril {

/// Where a point is nearest to the segment a + part (b - a), 0 <= part <= 1.
struct Projection {
  double part, distance;
  Vec3 from; ///< the nearest place to the point [m]
  bool inside() const { return part > 0 && part < 1; }
};
Projection project(const Vec3 &point, const Vec3 &a, const Vec3 &b);

/// Where two segments are nearest to each other: their parts there, and the way from the second to the first [m].
struct Closest {
  double part, other_part, distance;
  Vec3 from;
};
/// That of the lines where both segments have it, or of an end of one with the other (Eberly 2018, Robust computation
/// of distance between line segments): parallel segments need no threshold.
Closest closest(const Vec3 &a0, const Vec3 &a1, const Vec3 &b0, const Vec3 &b1);

/// Part of the straight ways of the four ends of two segments on which their distance stays above a wall: 1 where all
/// of it does. It stops short of the wall by `stop`. Conservative advancement (Li et al. 2021, Codimensional
/// incremental potential contact, 4.2).
double freePart(const std::array<Vec3, 4> &from, const std::array<Vec3, 4> &way, double wall, double stop);

} // namespace tendril
