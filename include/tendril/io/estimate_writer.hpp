#pragma once
/// \file estimate_writer.hpp
/// Estimated errors in a trajectory that is complete: the group /estimate (docs/user.md has its layout).

#include "tendril/accuracy/estimate.hpp"

namespace tendril {

/// Of a static answer. \throws SceneError
void writeEstimate(const std::string &path, const Estimate &estimate);
/// Of the steps of a dynamic run, over rod lengths, added up: the attribute `time_error`. \throws SceneError
void writeTimeError(const std::string &path, double error);

} // namespace tendril
