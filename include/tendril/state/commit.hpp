#pragma once
/// \file commit.hpp
/// From the iterate at the end of a step to the state, rod by rod.

#include "tendril/state/stage.hpp"

namespace tendril {

/// Positions, directors made orthonormal, whole turns, axial forces.
void commitConfiguration(const Elements &elements, const Configuration &iterate, RodSet rods, State &state);
/// What follows from places, rotations and momenta of the bodies of whole islands: their spins, and the places and
/// velocities of the vertices that are points of them.
void settleBodies(const Elements &elements, RodSet islands, State &state);
/// Displacements of some rods since the step began, and the rates that follow from them by a rule.
/// \param twist_reference frames from which twist is measured
void stageRates(const Elements &elements, const Configuration &start, const Configuration &twist_reference,
                const Configuration &iterate, const StageRule &rule, RodSet rods, StageRates &out);

} // namespace tendril
