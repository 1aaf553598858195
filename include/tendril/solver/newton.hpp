#pragma once
/// \file newton.hpp
/// One implicit step by SNES: Newton with the exact Hessian, its inertia read at every factorisation, and the line search `retraction`.

#include "tendril/dynamics/incremental_potential.hpp"

#include <string>

namespace tendril {

/// What a solve did.
struct NewtonReport {
  bool converged = false;
  int iterations = 0;        ///< linear solves with a new Hessian
  int trials = 0;            ///< energies evaluated by the line search
  int shifts = 0;            ///< factorisations repeated with a shifted diagonal
  int negative_pivots = 0;   ///< of the last Hessian, unshifted
  int neutral_pivots = 0;    ///< motions that cost no energy (solver type banded)
  int first_negative_pivots = 0; ///< at the equilibrium found first, before any escape (statics)
  int escapes = 0;           ///< saddles left along a direction of negative curvature (statics)
  IncrementalPotential::Residual residual;
  std::vector<double> history; ///< force residual, relative to the load scale, at every iterate
  std::string reason;        ///< in words
};

/// Whether an iterate is an answer: each residual below `rtol` of its scale, or below what rounding leaves.
bool isSmall(const IncrementalPotential::Residual &residual, double rtol);

class NewtonSolver {
public:
  /// Off: Newton's own full steps, to an equilibrium of any stability, for following a branch. On: only minima are answers in statics.
  bool seek_minimum = true;

  /// Creates SNES and its parts and reads -snes_*, -ksp_*, -pc_*, -mat_* options.
  PetscErrorCode setUp(IncrementalPotential &potential);
  /// Minimises the potential of the step. The potential's iterate is the answer when `report` says converged.
  /// \param guess rows of displacements and spins to start from instead of the start state
  PetscErrorCode solve(const State &start, const Step &step, NewtonReport *report, const std::vector<double> *guess = nullptr);
  /// Sets the linear solver up as a step would, so that its options have been asked for before the first step.
  PetscErrorCode rehearse(const State &start, const Step &step);
  /// Factors the Hessian at the iterate and counts negative pivots.
  PetscErrorCode inertiaAtIterate(int *negative);

  SNES snes() const { return snes_; }

  // What the callbacks work with.
  IncrementalPotential &potential() { return *potential_; }
  PetscErrorCode evaluate(Vec x, Vec f);
  PetscErrorCode assemble(Mat jacobian);
  PetscErrorCode lineSearch(SNESLineSearch search);
  PetscErrorCode testConvergence(PetscInt iteration, SNESConvergedReason *reason);

private:
  IncrementalPotential *potential_ = nullptr;
  OwnedSNES snes_;
  OwnedMat jacobian_;
  OwnedVec x_, f_;
  Vec iterate_vec_ = nullptr; ///< vector that holds the coordinates of the potential's iterate, ...
  PetscObjectState iterate_state_ = 0; ///< ... and its state when they were written
  NewtonReport report_;
  Configuration trial_, shorter_;
  std::vector<double> increment_, rows_, motion_, metric_;
  double energy_ = 0, shift_ = 0, sharpness_ = 1;
  bool energy_known_ = false, moving_ = false;

  PetscErrorCode newton(const char **failure);
  PetscErrorCode moveTo(Vec x);
  PetscErrorCode writeIterate(Vec x);
  PetscErrorCode readInertia(int *negative, bool *regular);
  PetscErrorCode makeDescent(KSP ksp, Vec f, Vec y, int negative, bool regular);
  PetscErrorCode findBucklingMode(bool *found);
  PetscErrorCode shiftUntilPositive(KSP ksp, Vec f, Vec y, int negative, bool regular);
  PetscErrorCode includeMotion(KSP ksp, Vec f, Vec y);
  PetscErrorCode escapeSaddle(bool *left);
  void predict(const State &start, const Step &step);
  std::string nearBarrier() const;
};

/// Registers the line search type `retraction`; call after PetscInitialize.
PetscErrorCode registerSolvers();

} // namespace tendril
