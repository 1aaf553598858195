#pragma once
/// \file run.hpp
/// A run from the command line to the output folder.

#include <petscsys.h>

namespace tendril {

/// The program `tendril`. Exit code 0 after a complete run; 1 for bad input; 2 when a step failed.
int runMain(int argc, char **argv);

} // namespace tendril
