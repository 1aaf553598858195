#pragma once
/// \file box.hpp

#include "tendril/geometry/scalar.hpp"

#include <cmath>

namespace tendril {

/// What lies between two corners, along the axes; at first nothing.
struct Box {
  Vec3 low = Vec3::Constant(HUGE_VAL), high = Vec3::Constant(-HUGE_VAL); ///< [m]

  void include(const Vec3 &x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  void include(const Box &other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  /// The same with so much more on all sides.
  Box widened(double by) const { return {low.array() - by, high.array() + by}; }
  bool overlaps(const Box &other) const {
    return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
  }
};

} // namespace tendril
