#pragma once
/// \file solids.hpp
/// Distances of points from solids, written once for double, packs and automatic differentiation. Those of boxes and of
/// what turns about an axis are one formula: with q the distances from pairs of faces, negative between them,
/// |max(q, 0)| + min(max q, 0), docs/theory.md (17.10).

#include "tendril/geometry/shape.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {

/// Distance by the distances q and p from two families of faces.
template <class T> T outsideBoth(const T &q, const T &p) {
  using std::max;
  using std::min;
  using std::sqrt;
  const T zero(0.0), a = max(q, zero), b = max(p, zero);
  return sqrt(a * a + b * b) + min(max(q, p), zero);
}

struct HalfSpaceSolid {
  template <class T> T distance(const Vector3<T> &x) const { return x[2]; }
  Distance at(const Vec3 &x) const { return {x[2], Vec3::UnitZ(), Mat3::Zero()}; }
  double curvatureRadius() const { return HUGE_VAL; }
  double depth() const { return HUGE_VAL; }
  bool isConvex() const { return true; }
};

/// A sphere, or with a length a capsule.
struct CapsuleSolid {
  double radius, half; ///< half: of the length [m]
  template <class T> T distance(const Vector3<T> &x) const {
    using std::max;
    using std::min;
    using std::sqrt;
    const T z = x[2] - min(max(x[2], T(-half)), T(half));
    return sqrt(x[0] * x[0] + x[1] * x[1] + z * z) - T(radius);
  }
  Distance at(const Vec3 &x) const;
  double curvatureRadius() const { return radius; }
  double depth() const { return radius; }
  bool isConvex() const { return true; }
};

/// Between two radii and two planes about the axis z.
struct TubeSolid {
  double bore, outer, half; ///< a bore below zero: none [m]
  /// From the walls, by the distance from the axis.
  template <class T> T fromWalls(const T &radial) const {
    using std::abs;
    if (bore < 0) return radial - T(outer);
    if (outer == HUGE_VAL) return T(bore) - radial;
    return abs(radial - T(0.5 * (bore + outer))) - T(0.5 * (outer - bore));
  }
  template <class T> T distance(const Vector3<T> &x) const {
    using std::abs;
    using std::sqrt;
    const T walls = fromWalls(T(sqrt(x[0] * x[0] + x[1] * x[1])));
    return half == HUGE_VAL ? walls : outsideBoth(walls, T(abs(x[2]) - T(half)));
  }
  Distance at(const Vec3 &x) const;
  double curvatureRadius() const { return half < HUGE_VAL ? 0 : bore < 0 ? outer : HUGE_VAL; }
  double depth() const { return std::min(half, bore < 0 ? outer : 0.5 * (outer - bore)); }
  bool isConvex() const { return bore < 0; }
};

struct BoxSolid {
  Vec3 half;
  template <class T> T distance(const Vector3<T> &x) const {
    using std::abs;
    using std::max;
    using std::min;
    using std::sqrt;
    const T zero(0.0);
    T sum(0.0), most(-HUGE_VAL);
    for (int k = 0; k < 3; ++k) {
      const T q = abs(x[k]) - T(half[k]), a = max(q, zero);
      sum += a * a;
      most = max(most, q);
    }
    return sqrt(sum) + min(most, zero);
  }
  Distance at(const Vec3 &x) const;
  double curvatureRadius() const { return 0; }
  double depth() const { return half.minCoeff(); }
  bool isConvex() const { return true; }
};

} // namespace tendril
