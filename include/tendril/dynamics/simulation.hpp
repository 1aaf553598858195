#pragma once
/// \file simulation.hpp
/// A scene made ready to run: everything from unknowns to solver, in the order it is built.

#include "tendril/dynamics/time_loop.hpp"

namespace tendril {

class Simulation {
public:
  Scene scene;
  DofMap dofs;
  std::unique_ptr<Elements> elements;
  std::unique_ptr<IncrementalPotential> potential;
  StepSolver solver;
  State state;
  bool dynamic = true;

  Simulation() = default;
  Simulation(const Simulation &) = delete; // parts refer to each other
  /// \param settings how the time loop will run; dynamics adds inertia
  PetscErrorCode setUp(Scene scene_to_run, const LoopSettings &settings);
};

} // namespace tendril
