#pragma once
/// \file diagnostics.hpp
/// What is told of every step.

#include "tendril/energy/work.hpp"

#include <string>
#include <vector>

namespace tendril {

/// One row of /diagnostics and of diagnostics.csv.
struct Diagnostics {
  double time = 0, dt = 0;
  EnergyBudget energy;
  Work work;             ///< of loads and supports in the step [J]
  double dissipated = 0; ///< by the step: the fall of the energies, and the work [J]
  double carried = 0;    ///< kinetic energy that obstacles may have given [J]
  int newton_iterations = 0, line_search_trials = 0, negative_pivots = 0, rejected_steps = 0;
  double contact_gap_min = HUGE_VAL; ///< between surfaces of rods and obstacles [m]; infinite where there are none
  double wall_seconds = 0;
  double rounding_error =
      0; ///< what rounding keeps from the answer, over rod lengths; in dynamics summed over the steps (NewtonReport)
  int rejected_iterations = 0; ///< Newton iterations of the rejected steps, which newton_iterations leaves out
  double error_estimate = 0;   ///< errors of all steps so far, each over the rod length, added up; 0 when not computed
};

/// A column of /diagnostics and of diagnostics.csv. To add one is one line of their list.
struct DiagnosticsColumn {
  std::string name, unit;
  double (*value)(const Diagnostics &);
};
const std::vector<DiagnosticsColumn> &diagnosticsColumns();

} // namespace tendril
