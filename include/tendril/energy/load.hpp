#pragma once
/// \file load.hpp
/// What loads amount to.

#include "tendril/layout/elements.hpp"

namespace tendril {

/// Loads on a rod [N]: its weight, and the forces and couples on what is free to move.
/// \param length of the rod at rest [m]
double loadScale(const Scene &scene, const Elements &elements, int rod, double length);

} // namespace tendril
