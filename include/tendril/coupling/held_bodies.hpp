#pragma once
/// \file held_bodies.hpp
/// How stiffly rods, springs and tendons hold bodies.

#include "tendril/layout/elements.hpp"

namespace tendril {

/// Of what holds a body beside its joints, with its loads over its size.
struct Held {
  double stiffness = 0, turning = 0; ///< [N/m], [N m/rad]
};
/// (nb) By the scene as drawn.
std::vector<Held> whatHolds(const Scene &scene, const Elements &elements);

} // namespace tendril
