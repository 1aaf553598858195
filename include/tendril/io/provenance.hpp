#pragma once
/// \file provenance.hpp
/// What a run is of: the program, its command line, its rods in numbers.

#include "tendril/io/trajectory.hpp"

namespace tendril {

/// Program, commit and PETSc, in a line.
std::string versionText();
/// Of this process; without the scene and the effective options.
Provenance provenance(int argc, char **argv);
/// Lines on the rods in dimensionless groups, and warnings about edges that are too few.
std::string groupsText(const Scene &scene);

} // namespace tendril
