#include "tendril/dynamics/bifurcation.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Largest distance between vertices of two states, relative to the size of the scene.
double distance(const State &a, const State &b) {
  Vec3 low = a.position[0], high = low;
  double apart = 0;
  for (std::size_t v = 0; v < a.position.size(); ++v) {
    low = low.cwiseMin(a.position[v]);
    high = high.cwiseMax(a.position[v]);
    apart = std::max(apart, (a.position[v] - b.position[v]).norm());
  }
  return apart / (high - low).norm();
}

} // namespace

PetscErrorCode locateCritical(StepSolver &solver, const State &stable, const Step &step, CriticalPoint *point, bool *found) {
  constexpr int most_solves = 40;
  constexpr double interval = 1e-8;
  // Across a bifurcation the branch moves by about the interval, or by its square root when Newton strays to the branch that leaves.
  constexpr double near = 1e-2;
  PetscFunctionBeginUser;
  State low = stable;
  std::optional<State> high;
  double low_factor = stable.time, high_factor = step.time;
  *found = false;
  // A solve that fails counts as beyond: past a limit point there is nothing near to converge to.
  for (int solves = 0; solves < most_solves && high_factor - low_factor > interval * std::abs(high_factor); ++solves) {
    Step middle = step;
    middle.time = 0.5 * (low_factor + high_factor);
    middle.load_factor = middle.time;
    NewtonReport report;
    PetscCall(solver.solve(low, middle, &report, Seek::equilibrium));
    State state = low;
    if (report.converged) solver.potential().commit(state);
    if (report.converged && report.negative_pivots == 0) {
      low = state;
      low_factor = middle.time;
      *found = true;
    } else {
      high_factor = middle.time;
      high.reset();
      if (report.converged) high = state;
    }
  }
  point->load_factor = low_factor;
  point->limit = high_factor < step.time && (!high || distance(low, *high) > near);
  point->state = low;
  point->state->step = stable.step;
  PetscFunctionReturn(0);
}

} // namespace tendril
