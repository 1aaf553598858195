#pragma once
/// \file take_up.hpp
/// Going on from a checkpoint, and room for the results of a run.

#include "tendril/io/checkpoint.hpp"
#include "tendril/io/options.hpp"
#include "tendril/io/output_folder.hpp"

namespace tendril {

/// Takes up the checkpoint that -restart asks for and makes room for the results. False where the run was complete
/// already.
bool takeUp(const Options &o, const OutputFolder &folder, const RunFacts &facts, Simulation &run, StepControl *control,
            std::vector<std::string> *told);

} // namespace tendril
