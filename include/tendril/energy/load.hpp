#pragma once
/// \file load.hpp
/// What loads amount to.

#include "tendril/model/scene.hpp"

namespace tendril {

/// Loads on a rod [N]: its weight, and the forces and couples on what is free to move.
/// \param length of the rod at rest [m]
double loadScale(const Scene &scene, int rod, double length);

} // namespace tendril
