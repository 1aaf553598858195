#pragma once
/// \file modes.hpp
/// Small motions about an equilibrium: K phi = omega^2 M phi, K the Hessian of the potential there and M the mass
/// matrix (solver/mass.hpp), without damping. Krylov-Schur (Stewart 2001, in SLEPc) on (K - s M)^-1 M with a shift s
/// below all eigenvalues and the factorisation that Newton has, which keeps the digits of fine rods; the inertia of K -
/// t M with t just above the last eigenvalue counts whether any is missing (Sylvester).
///
/// Where couples or follower forces act, K is the derivative of all forces and not symmetric, and nothing counts:
/// Krylov-Schur finds the eigenvalues nearest to s, pairs of complex ones among them, which flutter: from two
/// frequencies that have met (Bolotin 1963, Nonconservative Problems of the Theory of Elastic Stability).

#include "tendril/solver/step_solver.hpp"

namespace tendril {

/// The lowest modes, from the lowest on; n of them.
struct Modes {
  /// (n) omega^2, of complex ones the real part; negative where the equilibrium is unstable without flutter [1/s^2]
  std::vector<double> eigenvalue;
  /// (n) The imaginary part of omega^2, positive in the first of a pair, whose partner follows: the motion that grows
  /// is exp(growthRate t) (first shape cos(frequency t) + second shape sin(frequency t)). Else 0 [1/s^2]
  std::vector<double> imaginary;
  /// (n) Displacements, twists, and displacements of centres of mass and rotation vectors of bodies, with phi' M phi =
  /// 1 kg m^2, of a pair in sum; of both signs that with a positive largest displacement, or twist where nothing is
  /// displaced. Twist: by which an edge turns about its tangent, parallel transport taken off.
  std::vector<Rates> shape;
  std::vector<double> zero; ///< (n) up to this size they are of motions that cost nothing, to rounding [1/s^2]

  int count() const { return int(eigenvalue.size()); }
  bool flutters(int k) const { return imaginary[std::size_t(k)] != 0; }
  bool isFree(int k) const { return !flutters(k) && std::abs(eigenvalue[std::size_t(k)]) <= zero[std::size_t(k)]; }
  bool isUnstable(int k) const { return flutters(k) || eigenvalue[std::size_t(k)] < -zero[std::size_t(k)]; }
  double frequency(int k) const;  ///< 0 of free ones, and of unstable ones that do not flutter [rad/s]
  double growthRate(int k) const; ///< of unstable ones, or 0 [1/s]
};

/// The lowest eigenvalues of the Hessian at the iterate by a metric, and their motions, with phi' (metric) phi = 1.
/// \param count of modes, at most the rank of the metric \param failure empty, or why not all could be told apart
PetscErrorCode modesAtIterate(StepSolver &solver, Metric metric, int count, Modes *modes, std::string *failure);

/// Finds the lowest modes about an equilibrium, whose forces are balanced once more first as well as rounding allows.
/// \param count of modes, at most massRank \param step settings of a static step; its load and time are those of the
/// state \param failure empty, or why not all could be told apart
PetscErrorCode findModes(StepSolver &solver, const State &state, Step step, int count, Modes *modes,
                         std::string *failure);

} // namespace tendril
