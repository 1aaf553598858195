#pragma once
/// \file checkpoint.hpp
/// What a run needs to go on to the same bits: the state and how the time loop is stepping.

#include "tendril/dynamics/time_loop.hpp"

namespace tendril {

/// Writes beside `path` and renames: the file is always whole. \throws SceneError when it cannot be written
void writeCheckpoint(const std::string &path, const State &state, const StepControl &control, const std::string &integrator);

/// \param state initial state of the scene, replaced; its sizes are what the file must fit
/// What another integrator remembered is left out.
/// \throws SceneError when the file is missing, incomplete or of another scene
void readCheckpoint(const std::string &path, State *state, StepControl *control, const std::string &integrator);

} // namespace tendril
