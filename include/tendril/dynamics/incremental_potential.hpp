#pragma once
/// \file incremental_potential.hpp
/// The function one implicit step minimises, on the configuration manifold: the terms of the scene, the iterate, and the moves between iterates.

#include "tendril/energy/term.hpp"
#include "tendril/solver/retraction.hpp"

namespace tendril {

class IncrementalPotential {
public:
  IncrementalPotential(const Scene &scene, DofMap &dofs, const Elements &elements, bool dynamic);

  Retraction retraction;

  /// Starts a step: the iterate is the start state with supports' frames (not yet their positions) moved to the end of the step.
  void beginStep(const State &start, const Step &step);
  /// Whether a support has turned its edge past 180 degrees of twist in one step, where the measure `tan` has its barrier.
  bool beyondBarrier() const { return beyond_barrier_; }
  /// Changes the load factor (in statics also the time) of the step under way; the iterate stays.
  void setLoadFactor(double factor) {
    step_.load_factor = step_.time = factor;
    for (auto &term : terms_) term->setLoadFactor(factor);
    current_ = false;
  }
  const Configuration &iterate() const { return iterate_; }
  const Step &step() const { return step_; }
  const Scene &scene() const { return scene_; }
  const Elements &elements() const { return elements_; }
  DofMap &dofs() { return dofs_; }

  /// Increments that held vertices still have to make to reach their prescribed positions, in their rows; zero elsewhere. True when there are any.
  bool remainingMotion(std::vector<double> &increment) const;

  /// Energy of each rod [J]; +inf where the configuration is impossible.
  void energies(const Configuration &configuration, std::vector<double> &energy) const;
  double energy(const Configuration &configuration) const;
  /// Gradient, equilibrium residual and Hessian band at the iterate, computed once per iterate.
  const Rows &derivatives();
  /// Hessian band at the iterate without the part that comes from compressed edges.
  const std::vector<double> &bandWithoutCompression();

  /// Trial configuration R(iterate, scale x increment) with its axial forces; false when impossible.
  bool tryMove(const std::vector<double> &increment, double scale, Configuration &trial);
  /// Makes the trial the iterate (swaps the two).
  void accept(Configuration &trial);
  /// Axial forces of the iterate from its strains.
  void resetAxialForces();
  /// Size of the rounding error in the energy: differences below it decide nothing [J].
  double energyNoise(const Configuration &configuration) const;

  /// Moves to where the unknowns are `x` (displacements and spins since the step began) by the additive retraction.
  void moveTo(const std::vector<double> &x);
  /// Unknowns of the iterate, in rows.
  void coordinates(std::vector<double> &x) const;

  /// Residual of each rod relative to its load scale, and the strain error of the axial forces relative to its tolerance.
  struct Residual {
    double force = 0, moment = 0; ///< largest over rods; 1 is the rod's load scale
    double compatibility = 0;     ///< largest |strain - S/k|
    double force_floor = 0, moment_floor = 0, compatibility_floor = 0; ///< what rounding leaves, same units
  };
  Residual residual();

  /// State after the step: velocities by backward Euler, directors made orthonormal.
  void commit(State &state) const;

private:
  const Scene &scene_;
  DofMap &dofs_;
  const Elements &elements_;
  AxialLaw axial_;
  std::vector<std::unique_ptr<Term>> terms_;
  Step step_;
  State start_;
  std::vector<Frame> start_frame_;
  Configuration iterate_;
  Rows rows_;
  bool current_ = false; ///< rows_ belong to the iterate
  Rows uncompressed_;
  std::vector<double> load_, force_scale_, length_; ///< per rod: loads [N], or 0; the present scale of forces [N]
  bool beyond_barrier_ = false;

  double steepnessOf(const Configuration &configuration, int rod) const;
  void turnSupports();
  void setForceScales();
};

} // namespace tendril
