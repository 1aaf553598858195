#pragma once
/// \file run.hpp
/// A run from the command line to the output folder.

#include <petscsys.h>

namespace tendril {

/// The program `tendril`. Exit code 0 after a complete run; 1 for bad input; 2 when a step failed; 3 when files cannot
/// be written; 75, 130 and 143 when stopped on request (docs/exit_codes.md).
int runMain(int argc, char **argv);

} // namespace tendril
