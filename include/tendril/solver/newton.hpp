#pragma once
/// \file newton.hpp
/// One implicit step by SNES: Newton with the exact Hessian, its inertia read at every factorisation, and the line search `retraction`.

#include "tendril/dynamics/incremental_potential.hpp"
#include "tendril/solver/banded.hpp"

#include <string>

namespace tendril {

/// What a solve did.
struct NewtonReport {
  bool converged = false;
  int iterations = 0;        ///< linear solves with a new Hessian
  std::int64_t edge_iterations = 0; ///< edges of the rods that took part, summed over the iterations
  int trials = 0;            ///< energies of rods evaluated by the line search
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

/// Which equilibria are answers in statics: minima, or any, reached by Newton's own full steps, for following a branch.
enum class Seek { minimum, equilibrium };

class NewtonSolver {
public:
  /// Creates SNES and its parts and reads -snes_*, -ksp_*, -pc_*, -mat_* options.
  PetscErrorCode setUp(IncrementalPotential &potential);
  /// Minimises the potential of the step. The potential's iterate is the answer when `report` says converged.
  /// \param guess displacements and spins to start from instead of the start state
  PetscErrorCode solve(const State &start, const Step &step, NewtonReport *report, Seek seek = Seek::minimum, const Planes *guess = nullptr);
  /// Sets the linear solver up as a step would, so that its options have been asked for before the first step.
  PetscErrorCode rehearse(const State &start, const Step &step);
  /// Factors the Hessian at the iterate and counts negative pivots; -1 when it cannot be factored.
  PetscErrorCode inertiaAtIterate(int *negative);
  /// Solves with the matrix factored last.
  PetscErrorCode solveLinear(const Planes &right, Planes &solution);

  SNES snes() const { return snes_; }
  IncrementalPotential &potential() { return *potential_; }

  // What SNES calls.
  PetscErrorCode evaluate(Vec x, Vec f);
  PetscErrorCode assemble(Mat jacobian);
  PetscErrorCode lineSearch(SNESLineSearch search);
  PetscErrorCode testConvergence(PetscInt iteration, SNESConvergedReason *reason);

private:
  IncrementalPotential *potential_ = nullptr;
  OwnedSNES snes_;
  BandedSystem system_; ///< its wanted rods are those that have not converged yet
  OwnedMat jacobian_;
  bool banded_ = true;
  OwnedVec x_, f_, right_, solution_;
  Vec iterate_vec_ = nullptr; ///< vector that holds the coordinates of the potential's iterate, ...
  PetscObjectState iterate_state_ = 0; ///< ... and its state when they were written
  NewtonReport report_;
  Configuration trial_;
  Planes increment_, coordinates_, motion_, metric_;
  std::vector<IncrementalPotential::RodEnergy> energy_; ///< per rod, at the iterate
  std::vector<char> energy_known_;
  std::vector<int> negative_;   ///< pivots per rod; of all together where the solver does not tell rods apart
  std::vector<double> last_shift_;
  Seek seek_ = Seek::minimum;
  double sharpness_ = 1;
  std::vector<IncrementalPotential::Residual> residual_; ///< per rod
  std::vector<char> moving_; ///< per rod: its supports have not reached their places

  PetscErrorCode newton(const char **failure);
  PetscErrorCode moveTo(Vec x);
  PetscErrorCode writeIterate(Vec x);
  PetscErrorCode readInertia(bool *regular);
  PetscErrorCode refill();
  PetscErrorCode refactor();
  PetscErrorCode makeDescent(Vec f, Vec y, bool regular);
  PetscErrorCode shiftUntilPositive(bool regular);
  double firstShift(int rod) const;
  PetscErrorCode includeMotion(Vec y);
  bool searchRod(int rod, double *lambda);
  PetscErrorCode findBucklingMode(bool *found);
  PetscErrorCode escapeSaddle(bool *left);
  void predict(const State &start, const Step &step);
  const IncrementalPotential::RodEnergy &energyAtIterate(int rod);
  void forgetEnergies() { std::fill(energy_known_.begin(), energy_known_.end(), false); }
  std::string nearBarrier() const;
};

/// Registers the line search type `retraction` and the factorisation `banded`; call after PetscInitialize.
PetscErrorCode registerSolvers();

} // namespace tendril
