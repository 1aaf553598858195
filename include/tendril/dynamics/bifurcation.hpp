#pragma once
/// \file bifurcation.hpp
/// Critical points of a branch of equilibria: where the count of motions that lower its energy changes.

#include "tendril/solver/step_solver.hpp"

#include <functional>
#include <optional>

namespace tendril {

/// An equilibrium on a branch.
struct BranchPoint {
  double parameter = 0; ///< of the branch: load factor, or length along it
  State state;          ///< its time is the load factor
  int unstable = 0;     ///< motions in which it is no minimum; those that cost nothing are left out
  bool found = false;   ///< whether Newton came to one, and near
};

/// Whether two points may be of one branch: before a limit point a rod moves by the root of the interval; beyond it,
/// Newton jumps.
/// \param width of the interval that is searched
bool areNear(const Team &team, const BranchPoint &a, const BranchPoint &b, double width);

struct CriticalPoint {
  double load_factor = 0;
  std::optional<State> state; ///< equilibrium there
  bool limit = false;         ///< the path turns back in the load there, instead of going on unstable
  std::optional<State>
      lost; ///< equilibrium a little away, on the side where more motions are unstable; no value at limit points
  int stable_count = 0; ///< of unstable motions on the other side
  BranchPoint beyond;   ///< a little further along the branch; not found at limit points
};
using CriticalObserver = std::function<PetscErrorCode(const CriticalPoint &)>;

/// Goes along a branch from a point of it to a value of its parameter, by plain Newton without escapes.
using Follow = std::function<PetscErrorCode(const BranchPoint &from, double parameter, BranchPoint *to)>;

/// The motion that becomes unstable at a critical point, at its state `lost`. The solver is left there. `found` is
/// false where no motion is left to follow.
PetscErrorCode criticalMode(StepSolver &solver, const CriticalPoint &point, Step step, Planes *mode, bool *found);

/// Finds the critical point between `low` and the parameter `high` by bisection to 1e-9 of `scale`, and once more from
/// points on either side of it, in other steps. `point` is the end of the interval towards `low`. `found` is false
/// where there is none: nothing changes, Newton had gone over to another branch, no motion loses its stiffness, or the
/// two answers differ by more than 1e-7, as they do where a count is rounding. It may lie a little before `low`, where
/// the count there was rounding. \param step its settings, but the load \param known parameter of the last one that was
/// found before
PetscErrorCode locateCritical(StepSolver &solver, const Step &step, const Follow &follow, BranchPoint low, double high,
                              double scale, double known, CriticalPoint *point, bool *found);

/// Counts the unstable motions at the iterate: eigenvalues of the Hessian below a little less than zero, which leaves
/// motions out that cost nothing.
PetscErrorCode countUnstable(StepSolver &solver, int *unstable);

/// Largest distance between vertices, or centres of bodies, of two states, relative to the size of the scene.
double distanceBetween(const Team &team, const State &a, const State &b);

/// While it lives, Newton's tolerance is one that leaves critical loads eight digits.
class SharpTolerance {
public:
  explicit SharpTolerance(StepSolver &solver);
  ~SharpTolerance();
  SharpTolerance(const SharpTolerance &) = delete;
  /// Whether an answer is one by its forces: beside a limit point, where there is none, Newton's corrections may be
  /// little, too.
  static bool isMet(const Residual &residual);

private:
  StepSolver &solver_;
  PetscReal before_ = 0;
  void set(PetscReal rtol);
};

} // namespace tendril
