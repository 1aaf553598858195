#pragma once
/// \file mode_output.hpp
/// `-mode modes`: what it cannot do, found before the first step; and natural frequencies told and written.

#include "tendril/dynamics/time_loop.hpp"
#include "tendril/io/options.hpp"
#include "tendril/io/progress.hpp"

namespace tendril {

class Simulation;

/// \throws SceneError where motions about an equilibrium of the scene have no potential, or it turns, or the options do
/// not lead to one
void checkModes(const Scene &scene, const Options &options);
/// \throws SceneError where the scene has fewer motions with inertia than are asked for
void refuseTooManyModes(const Simulation &run, int count);
/// Whether nothing holds a scene and nothing pulls on it: then it rests by itself.
bool isAlone(const Scene &scene);
/// Finds where it rests, in one step: motions that cost nothing and rounding make stability of no use there.
/// \param failure empty, or why it was not found
PetscErrorCode settleAlone(Simulation &run, const Options &options, const TimeLoop::Observer &observe, bool *finished,
                           std::string *failure);
/// Finds the modes about the last state, tells them and adds /modes to the trajectory, which is complete.
/// \param exit_code becomes 2 where they could not all be found
PetscErrorCode tellModes(Simulation &run, const Options &options, Progress &progress, int *exit_code);

} // namespace tendril
