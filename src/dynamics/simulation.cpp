#include "tendril/dynamics/simulation.hpp"

namespace tendril {

void Simulation::describe(Scene scene_to_describe, bool in_time) {
  scene = std::move(scene_to_describe);
  dynamic = in_time;
  dofs.layOut(scene);
  elements = std::make_unique<Elements>(scene, dofs);
  state = initialState(scene, *elements);
}

PetscErrorCode Simulation::prepare(Scene part, const LoopSettings &settings, const Team &team) {
  PetscFunctionBeginUser;
  potential.reset();
  dofs = DofMap();
  scene = std::move(part);
  dynamic = settings.dynamic;
  PetscCall(dofs.setUp(scene));
  elements = std::make_unique<Elements>(scene, dofs);
  potential = std::make_unique<IncrementalPotential>(scene, dofs, *elements, settings.dynamic);
  potential->settings = settings.solve;
  potential->agree(team);
  state = initialState(scene, *elements);
  PetscFunctionReturn(0);
}

PetscErrorCode Simulation::setUpSolver(const LoopSettings &settings, const Share &share) {
  PetscFunctionBeginUser;
  PetscCall(solver.setUp(
      *potential,
      !settings.dynamic && settings.continuation == Continuation::arclength ? Coupling::load : Coupling::none, share));
  PetscFunctionReturn(0);
}

PetscErrorCode Simulation::setUp(Scene scene_to_run, const LoopSettings &settings) {
  PetscFunctionBeginUser;
  PetscCall(prepare(std::move(scene_to_run), settings, {}));
  PetscCall(setUpSolver(settings, {}));
  PetscFunctionReturn(0);
}

} // namespace tendril
