#pragma once
/// \file bifurcation.hpp
/// Where a path of stable equilibria loses its stability: the load factor at which the first pivot of the Hessian changes sign.

#include "tendril/solver/step_solver.hpp"

#include <functional>
#include <optional>

namespace tendril {

struct CriticalPoint {
  double load_factor = 0;
  std::optional<State> state; ///< equilibrium there
  bool limit = false;         ///< the path turns back in the load there, instead of going on unstable
};
using CriticalObserver = std::function<PetscErrorCode(const CriticalPoint &)>;

/// Bisects the load factor between `stable` and the end of `step`, where the equilibrium is unstable, to a relative interval of 1e-8, following
/// the branch by Newton without escapes. `point` is the stable end of the interval. `found` is false when no stable equilibrium was met: then
/// `stable` was not on the branch.
PetscErrorCode locateCritical(StepSolver &solver, const State &stable, const Step &step, CriticalPoint *point, bool *found);

} // namespace tendril
