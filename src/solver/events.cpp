#include "tendril/solver/events.hpp"

namespace tendril {
namespace {
Events registered{};
}

const Events &events() { return registered; }

PetscErrorCode registerEvents() {
  PetscClassId id;
  PetscFunctionBeginUser;
  PetscCall(PetscClassIdRegister("tendril", &id));
  PetscCall(PetscLogEventRegister("RodConfiguration", id, &registered.configuration));
  PetscCall(PetscLogEventRegister("RodEnergy", id, &registered.energy));
  PetscCall(PetscLogEventRegister("RodDerivatives", id, &registered.derivatives));
  PetscCall(PetscLogEventRegister("RodFill", id, &registered.fill));
  PetscCall(PetscLogEventRegister("RodLineSearch", id, &registered.line_search));
  PetscCall(PetscLogEventRegister("RodOutput", id, &registered.output));
  PetscCall(PetscLogStageRegister("Rod set-up", &registered.setup));
  PetscCall(PetscLogStageRegister("Rod steps", &registered.run));
  PetscFunctionReturn(0);
}

} // namespace tendril
