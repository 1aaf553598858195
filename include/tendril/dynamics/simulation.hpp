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
  /// The same in two parts, for a part of a scene that ranks share: all but the solver, on all of them together; and
  /// the solver, which one of them may fail to set up. Both again take the place of what was there.
  PetscErrorCode prepare(Scene part, const LoopSettings &settings, const Team &team);
  PetscErrorCode setUpSolver(const LoopSettings &settings, const Share &share);
  /// Numbering, elements and first state only, for a scene whose steps are solved elsewhere.
  void describe(Scene scene_to_describe, bool in_time);
};

} // namespace tendril
