#pragma once
/// \file polyline.hpp
/// Points in order, from which rods are made.

#include "tendril/model/skin.hpp"

#include <functional>
#include <vector>

namespace tendril {

/// A curve over [0, 1]: vertex i of a polyline of n edges along it stands at i/n.
using Curve = std::function<Vec3(double)>;

struct Polyline {
  std::vector<Vec3> points; ///< [m]; the first is not repeated at the end of a closed one
  bool closed = false;
  Curve curve;                      ///< that the points were taken from; empty where there are only points
  std::vector<Vec3> directors;      ///< of its edges; empty where the file has none
  std::shared_ptr<const Skin> skin; ///< that the file has, or null
};

} // namespace tendril
