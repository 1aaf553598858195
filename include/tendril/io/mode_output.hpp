#pragma once
/// \file mode_output.hpp
/// `-mode modes` and `-mode buckling`: what they cannot do, found before the first step; and modes told and written.

#include "tendril/dynamics/time_loop.hpp"
#include "tendril/io/prepare.hpp"
#include "tendril/io/progress.hpp"

namespace tendril {

/// \throws SceneError where motions about an equilibrium of the scene have no potential, or it turns, or the options do
/// not lead to one; for buckling where nothing is loaded
void checkModes(const Scene &scene, const Options &options);
/// \throws SceneError where the scene has fewer motions, for frequencies with inertia, than are asked for
void refuseTooManyModes(const Simulation &run, const Options &options);
/// Whether nothing holds a scene and nothing pulls on it: then it rests by itself.
bool isAlone(const Scene &scene);
/// Finds where it rests, in one step: motions that cost nothing and rounding make stability of no use there.
/// \param failure empty, or why it was not found
PetscErrorCode settleAlone(Simulation &run, const Options &options, const TimeLoop::Observer &observe, bool *finished,
                           std::string *failure);
/// Follows the path from rest for buckling modes, which stay in `prepared`. \param failure empty, or why there is no
/// path; what ends it later is told with the modes
PetscErrorCode followBuckling(Prepared &prepared, const Options &options, const TimeLoop::Observer &observe,
                              const CriticalObserver &on_critical, const std::function<bool()> &stops, bool *finished,
                              std::string *failure);
/// Finds the modes about the last state, or takes those of buckling, tells them and adds /modes to the trajectory,
/// which is complete. \param exit_code becomes 2 where they could not all be found
PetscErrorCode tellModes(const Prepared &prepared, const Options &options, Progress &progress, int *exit_code);

} // namespace tendril
