#pragma once
/// \file prepare.hpp
/// From a scene file and options to a scene that is ready to run.

#include "tendril/accuracy/accuracy.hpp"
#include "tendril/io/options.hpp"

namespace tendril {

/// A scene ready to run; and as written, when it may have to be drawn again.
struct Prepared {
  std::unique_ptr<Simulation> run;
  SceneSource source;
  std::vector<std::string> notes;
  Scene written;
  std::vector<Drawing> drawings;
};

/// Reads the scene and sets everything up. \throws SceneError
PetscErrorCode prepare(Prepared &prepared, Options &options);
/// \throws SceneError where rods lie in obstacles at the time of their state
void refuseOverlaps(const Simulation &run);
/// Chooses the edges, and in dynamics the steps, and makes the scene ready to run with them.
PetscErrorCode meetAccuracy(Prepared &prepared, Options &options, Choice *choice);

} // namespace tendril
