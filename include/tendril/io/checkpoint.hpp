#pragma once
/// \file checkpoint.hpp
/// What a run needs to go on to the same bits: the state, how the time loop is stepping, and of what run they are.

#include "tendril/dynamics/simulation.hpp"
#include "tendril/io/hdf5.hpp"
#include "tendril/io/run_facts.hpp"

namespace tendril {

/// A checkpoint of which not all is there, or not as it was written.
struct DamagedCheckpoint : SceneError {
  using SceneError::SceneError;
};

/// Writes beside `path` and renames: the file is always whole. \throws WriteError when it cannot be written
void writeCheckpoint(const std::string &path, const Simulation &run, const StepControl &control, const RunFacts &facts);

/// Takes up a checkpoint as the state of a run. Where nothing but options and loads is other, to the bit, with what the
/// integrator remembers if it is the same; else the integrator begins anew. Between statics and dynamics the positions
/// are taken, at rest and at time 0. \param run made ready for the scene; its sizes are what the file must fit \param
/// told lines for the user: what has changed, and what follows from it \return whether anything but options is other
/// \throws DamagedCheckpoint when the file is missing, or not as it was written; SceneError when it is of another
/// topology. Nothing has changed then
bool readCheckpoint(const std::string &path, Simulation *run, StepControl *control, const RunFacts &facts,
                    std::vector<std::string> *told);

} // namespace tendril
