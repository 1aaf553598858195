#include "tendril/dynamics/simulation.hpp"

namespace tendril {

PetscErrorCode Simulation::setUp(Scene scene_to_run, const LoopSettings &settings) {
  PetscFunctionBeginUser;
  scene = std::move(scene_to_run);
  dynamic = settings.dynamic;
  PetscCall(dofs.setUp(scene));
  elements = std::make_unique<Elements>(scene, dofs);
  potential = std::make_unique<IncrementalPotential>(scene, dofs, *elements, settings.dynamic);
  potential->settings = settings.solve;
  PetscCall(solver.setUp(*potential, !settings.dynamic && settings.continuation == Continuation::arclength
                                         ? Coupling::load
                                         : Coupling::none));
  state = initialState(scene, *elements);
  PetscFunctionReturn(0);
}

} // namespace tendril
