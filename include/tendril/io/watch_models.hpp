#pragma once
/// \file watch_models.hpp
/// Models of rods (RodModel) while a scene runs: planar rods that buckle go on as full ones, and what was chosen is
/// proven.

#include "tendril/io/prepare.hpp"
#include "tendril/io/progress.hpp"

namespace tendril {

/// Has a loop give planar rods that chose to be so all their unknowns where a step would leave them unstable out of
/// their planes. In dynamics, where that takes time to show, one step of eight is watched. Rods that begin as their
/// model cannot be, as by a checkpoint, get them at once. \throws SceneError where they did not choose
PetscErrorCode watchModels(Prepared &prepared, const Options &options, Progress &progress, TimeLoop &loop);

/// Runs the scene again with all unknowns of all rods, and tells how far a vertex of the last state is from its place
/// there at most, over the length of its rod. \param exit_code becomes 2 where that is farther than -accuracy, or 1e-6
PetscErrorCode proveModels(const Prepared &prepared, const Options &options, Progress &progress, int *exit_code);

} // namespace tendril
