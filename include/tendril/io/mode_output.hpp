#pragma once
/// \file mode_output.hpp
/// `-mode modes`: what it cannot do, found before the first step; and natural frequencies told and written.

#include "tendril/io/options.hpp"
#include "tendril/io/progress.hpp"

namespace tendril {

class Simulation;

/// \throws SceneError where motions about an equilibrium of the scene have no potential, or it turns, or the options do
/// not lead to one
void checkModes(const Scene &scene, const Options &options);
/// \throws SceneError where the scene has fewer motions with inertia than are asked for
void refuseTooManyModes(const Simulation &run, int count);
/// Whether nothing pulls on a scene, so that it rests as drawn even where nothing holds it.
bool isUnloaded(const Scene &scene);
/// Finds the modes about the last state, tells them and adds /modes to the trajectory, which is complete.
/// \param exit_code becomes 2 where they could not all be found
PetscErrorCode tellModes(Simulation &run, const Options &options, Progress &progress, int *exit_code);

} // namespace tendril
