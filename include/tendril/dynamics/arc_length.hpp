#pragma once
/// \file arc_length.hpp
/// Bordered arc-length continuation (Keller 1977; Riks 1979): follows a path of equilibria, stable or not, through
/// limit points of the load.

#include "tendril/dynamics/time_loop.hpp"
#include "tendril/solver/circulatory.hpp"

namespace tendril {

/// \throws SceneError when the path has another parameter than the load factor (prescribed motions), or no load at all
void requireDeadLoads(const Scene &scene);

/// Unknowns are those of the rods, q, and the load factor. Length along the path, without units:
///   ds^2 = mean over vertices of |dx|^2/L^2 + mean over edges of d(theta)^2 + d(factor)^2.
class ArcLength {
public:
  /// The first step is as long as a load step of `settings.dt` is there; steps then adapt to four iterations.
  ArcLength(StepSolver &solver, const LoopSettings &settings);

  CriticalObserver on_critical; ///< told of critical points, before the step that passes them
  std::function<bool()> stops;  ///< as that of TimeLoop
  /// Follows the path from `state` until the load factor is 1 or the steps are used up. `finished` is false when a step
  /// of the smallest length failed; `state` is then the last one accepted. Diagnostics' dt is the step along the path.
  PetscErrorCode run(State &state, const TimeLoop::Observer &observe, bool *finished);
  const std::string &failure() const { return failure_; }

private:
  /// A point relative to the start of the step, or a direction.
  struct Point {
    Planes unknowns;
    double factor = 0;
  };
  StepSolver &solver_;
  LoopSettings settings_;
  std::vector<std::unique_ptr<Term>>
      loads_;               ///< at load factor 1: their gradient is the derivative of the gradient by the load factor
  Circulatory circulation_; ///< of couples and follower forces
  Planes metric_;
  Derivatives load_derivatives_;
  Point last_; ///< the last step taken
  Configuration trial_;
  std::string failure_, obstacle_;
  int iterations_ = 0, negative_ = 0;
  bool astray_ = false;   ///< the last step turned from its tangent, or from a stable branch to an unstable one
  double sharpness_ = 1;  ///< of -snes_rtol
  double left_ = 0;       ///< what Newton would still move the end of the last step by, in the positions and twists
  double load_reach_ = 0; ///< what the whole load would move them by at first, ...
  double rounding_ = 0;   ///< ... and what rounding of coordinates does

  /// How far a run has come.
  struct Walk {
    Point direction;                            ///< tangent of the path at the state
    double length = 0, first = 0, shortest = 0; ///< of the next step, the first one, and the least
    int taken = 0, rejected = 0, in_vain = 0;   ///< steps; rejected since the last one taken, and their iterations
    double energy = 0;                          ///< of the state [J]
  };
  /// A step that is tried.
  struct Tried {
    State start;
    Point before; ///< the step before
    Point end;    ///< tangent of the path at its end
    bool converged = false;
    bool crossed = false; ///< the count of negative pivots has changed
    /// Whether the load factor rises at one end and falls at the other.
    bool turns(const Walk &walk) const { return walk.direction.factor * end.factor < 0; }
  };

  PetscErrorCode beginWalk(const State &state, Walk *walk);
  PetscErrorCode tryStep(const State &state, const Walk &walk, Tried *now);
  PetscErrorCode shorten(State &state, const Tried &failed, Walk *walk);
  PetscErrorCode passCritical(const Tried &now, const Walk &walk, State &state, bool *ends, bool *switched);
  Diagnostics rowOf(const State &state, const EnergyBudget &energy, const Work &work, Walk *walk) const;
  EnergyBudget energyOf(const State &at) const;
  double product(const Point &a, const Point &b) const;
  double size(const Point &p) const;
  double allowance(const Point &moved) const;
  PetscErrorCode verify(const Point &direction, bool *little);
  std::string imbalance();
  PetscErrorCode findStart(State &state);
  PetscErrorCode tangent(Point *direction);
  PetscErrorCode factor(int *negative);
  PetscErrorCode solve(const Planes &gradient, Planes *step);
  PetscErrorCode solveLoad(Planes *response);
  bool move(const Planes &increment, double factor);
  PetscErrorCode correct(double start, const Point &direction, double length, bool *converged);
  PetscErrorCode correctAt(double factor, bool *converged);
  PetscErrorCode
  iterate(const std::function<double(const Point &moved, const Point &residual, const Point &load)> &constraint,
          double start, bool *converged);
  PetscErrorCode begin(const State &state, Point *direction);
  PetscErrorCode countNeutral(double little, int *count);
  PetscErrorCode refuseFreeStart(const State &state);
  PetscErrorCode refine(State &state, Point *direction, bool *refined);
  PetscErrorCode step(const State &state, double length, bool *converged, const Point *along = nullptr);
  PetscErrorCode locateLimit(const State &start, const Point &before, const std::array<double, 2> &slopes,
                             double length, std::vector<CriticalPoint> *located);
  PetscErrorCode locateBifurcation(const State &start, const State &end, const Point &before, double length,
                                   std::vector<CriticalPoint> *located);
  PetscErrorCode switchBranch(const CriticalPoint &critical, double length, double shortest, State *state,
                              bool *switched);
};

} // namespace tendril
