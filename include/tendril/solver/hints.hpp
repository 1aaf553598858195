#pragma once
/// \file hints.hpp
/// Why a step may have failed, in words that follow its reason. Empty where nothing of the kind is near.

#include "tendril/solver/incremental_potential.hpp"

#include <string>

namespace tendril {

/// A hint for failures next to an angle of 180 degrees between neighbouring edges, where energies grow without bound.
std::string nearBarrier(const IncrementalPotential &potential, RodSet rods);

/// On the first rod that is pressed hard against an obstacle.
std::string nearObstacle(const IncrementalPotential &potential, RodSet rods);

/// On the two rods that are pressed hardest against each other, or a rod against itself.
std::string nearRod(const IncrementalPotential &potential, RodSet rods);

/// On the first body that turns by more than a radian in the step.
std::string fastBody(const IncrementalPotential &potential, RodSet rods);
/// A tendon whose point has come to the surface that the tendon winds round.
std::string tightTendon(const IncrementalPotential &potential, RodSet rods);

/// Words on a rod of the energy `seed` that is near a limit of its law, or beyond: of bending, more sharply than
/// `sharpest` (in units of the limit) with edges shorter than `longest`, or of compression with an edge shorter than
/// `shortest`; the force is largest, EA r (1 - r^2)/2 = 0.192 EA, where the stretch r obeys r^2 = 1/3.
std::string limitOfLaw(const IncrementalPotential &potential, RodSet rods, const Configuration &c, double sharpest,
                       double longest, double shortest);

} // namespace tendril
