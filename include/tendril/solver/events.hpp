#pragma once
/// \file events.hpp
/// Stages and events of -log_view, registered in one place.

#include <petscsys.h>

namespace tendril {

struct Events {
  PetscLogEvent configuration, energy, derivatives, fill, line_search, output;
  PetscLogStage setup, run;
};
const Events &events();
PetscErrorCode registerEvents();

} // namespace tendril
