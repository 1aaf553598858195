#pragma once
/// \file buckling.hpp
/// Buckling modes: K(lambda) phi = 0, K the Hessian of the potential on the path of equilibria from rest, lambda the
/// load factor. At a point of the path the lowest eigenvalues w of K phi = w B phi by a definite metric B come from
/// modesAtIterate, whose inertia counts that none is missing. The k-th of them is zero at the k-th critical load, which
/// lies between two points with different counts. Inverse interpolation, lambda as a polynomial of w, narrows them: it
/// is smooth at bifurcations and at limit points alike, where lambda - lambda_c goes as w and as w^2. Between points
/// right beside a root the Hessian is linear in lambda, in the space of the soft motions: its roots are the factors,
/// however close, with their modes. Products with K, whose entries cancel, are never taken.

#include "tendril/dynamics/modes.hpp"
#include "tendril/dynamics/time_loop.hpp"

namespace tendril {

/// Modes in order of their load factors; n of them.
struct BucklingModes {
  std::vector<double> load_factor; ///< (n) at which the equilibrium has a motion without stiffness
  std::vector<Rates> shape;        ///< (n) largest displacement 1 m, or twist 1 rad where nothing is displaced (Modes)
  std::vector<char> limit;         ///< (n) whether the path turns back in the load there
  int count() const { return int(load_factor.size()); }
};

class BucklingPath {
public:
  CriticalObserver on_critical; ///< told of each critical load once, with an equilibrium less than 1e-4 of it below
  /// Told of the points of the path, with the number of unstable motions.
  std::function<PetscErrorCode(const State &, const NewtonReport &, int unstable)> on_step;
  std::function<bool()> stops; ///< asked before each step whether to end

  /// \param settings of statics: `dt` is the first step of the load factor, `t_end` where the path ends at the latest
  /// \param count of modes to find
  BucklingPath(StepSolver &solver, const LoopSettings &settings, int count)
      : solver_(solver), settings_(settings), count_(count) {}

  /// Follows the path from a state at rest, in steps that grow, until all modes are found. `finished` is false where it
  /// was stopped, or where there is no equilibrium to begin with; `state` is the last point.
  PetscErrorCode run(State &state, bool *finished);
  const BucklingModes &modes() const { return modes_; }
  const std::string &failure() const { return failure_; } ///< why the path could not be followed on; else empty
  const std::string &ending() const { return ending_; }   ///< why there are fewer modes than asked for; else empty

private:
  /// An equilibrium on the path.
  struct Point {
    double factor = 0;
    State state;
    std::vector<double> stiffness; ///< eigenvalues from the lowest on, but for motions that cost nothing [1/s^2]
    int unstable = 0;              ///< how many of them are negative
    int free = 0;                  ///< motions that cost nothing
    bool found = false;
    NewtonReport report;
  };
  struct Root {
    double factor = 0;
    bool limit = false;
    State below; ///< equilibrium just below
    Rates shape;
  };
  /// The last point of the path, and the one before it.
  struct Stretch {
    Point at, before;
  };
  StepSolver &solver_;
  LoopSettings settings_;
  int count_, asked_ = 0;
  int free_ = -1; ///< motions that cost nothing, with and without load; -1: not known yet
  BucklingModes modes_;
  std::vector<Point> near_; ///< points of the interval that is looked into
  std::string failure_, ending_;

  PetscErrorCode balance(const State &start, double factor, State *state, NewtonReport *report, bool *found);
  PetscErrorCode reach(const Point &from, double factor, Point *to, Modes *modes = nullptr);
  PetscErrorCode advance(const Point &from, double factor, Point *to);
  PetscErrorCode begin(State &state, Point *at);
  PetscErrorCode isLimit(const Point &low, double factor, bool *limit);
  std::vector<std::size_t> numbersOf(const Modes &modes) const;
  const Point &nearest(double factor) const;
  double estimate(int k, double low, double high) const;
  PetscErrorCode locate(int k, Point low, Point high, bool ahead, bool rising, std::vector<Root> *roots);
  PetscErrorCode resolve(const Point &a, const Point &b, double apart, std::vector<Root> *roots);
  PetscErrorCode takeLimit(const Point &low, double factor, int k, std::vector<Root> *roots);
  double lengthOfAll() const;
  PetscErrorCode locateAll(const Point &at, const Point &next, bool *snapped);
  PetscErrorCode note(std::vector<Root> &roots);
  PetscErrorCode take(Point &point, Stretch &along, State &state);
  PetscErrorCode look(const Point &at, Point &next);
  PetscErrorCode goAround(const Stretch &along, double target, Point *next, State &state);
  PetscErrorCode follow(Stretch &along, State &state, bool *stopped);
};

} // namespace tendril
