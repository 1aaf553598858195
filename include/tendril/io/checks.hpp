#pragma once
/// \file checks.hpp
/// What a scene and the options of its run ask for that cannot be, found before the first step.

#include "tendril/dynamics/simulation.hpp"
#include "tendril/io/options.hpp"

namespace tendril {

/// What the method that the options choose cannot do with the scene. \param notes to be told beside
/// \throws SceneError
void checkScene(const Scene &scene, const Options &options, std::vector<std::string> *notes);
/// \throws SceneError where a body moves away from an exact joint of its own at the start
void refuseTearing(const Simulation &run);
/// \throws SceneError where rods or bodies lie in obstacles, in each other or in themselves at the time of their state
void refuseOverlaps(const Simulation &run);
/// Of rods whose samples lie far apart for obstacles that are not much larger than the rods are thick, and of obstacles
/// whose coefficients of friction count for nothing.
std::vector<std::string> notesOnContact(const Simulation &run);

} // namespace tendril
