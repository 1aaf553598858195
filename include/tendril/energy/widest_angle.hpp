#pragma once
/// \file widest_angle.hpp
/// How far neighbouring edges were from each other during a run.

#include "tendril/state/state.hpp"

namespace tendril {

/// The largest turning or twist between neighbouring edges. Cables and corners in junctions do not
/// count; rods of measure `angle`, for which it is no error, only when asked for.
struct WidestAngle {
  double angle;             ///< [rad]
  int rod = -1, vertex = 0; ///< rod -1: nothing was wider than the angle that it began with
  double time = 0;
  bool every_measure = false;
  void include(const Scene &scene, const Elements &elements, const State &state);
};

} // namespace tendril
