#pragma once
/// \file builders.hpp
/// Shapes a scene may name instead of listing points.

#include "tendril/model/polyline.hpp"
#include "tendril/model/scene.hpp"

namespace tendril {

Polyline lineShape(const Vec3 &from, const Vec3 &to, int edges);
/// Regular polygon inscribed in the circle; starts on the axis-most normal of `normal` and runs counter-clockwise about
/// it.
Polyline ringShape(const Vec3 &center, const Vec3 &normal, double radius, int edges);

/// Helix about `axis` from `origin`, beginning at the side of `start`; over the first and last fraction `taper` of its
/// parameter the radius grows from and shrinks to zero as a smooth step q^2 (3 - 2 q).
struct HelixShape {
  Vec3 origin, axis, start;
  double length, radius, turns, taper; ///< length along the axis [m]
  int edges;
  /// With fewer edges, vertices would stand on another curve of fewer turns.
  double leastEdges() const { return std::floor(2 * std::abs(turns)) + 1; }
};
Polyline helixShape(const HelixShape &helix);

} // namespace tendril
