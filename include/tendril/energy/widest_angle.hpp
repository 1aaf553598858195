#pragma once
/// \file widest_angle.hpp
/// How far neighbouring edges were from each other during a run.

#include "tendril/dynamics/state.hpp"

namespace tendril {

/// Where measure `tan` went furthest from the angle itself, turning or twist at a vertex. Cables and rods of measure `angle` do not count.
struct WidestAngle {
  double angle;             ///< [rad]
  int rod = -1, vertex = 0; ///< rod -1: nothing was wider than the angle that it began with
  double time = 0;
  void include(const Scene &scene, const Elements &elements, const State &state);
};

} // namespace tendril
