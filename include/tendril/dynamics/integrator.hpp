#pragma once
/// \file integrator.hpp
/// Time integrators. Every stage of a step minimises one incremental potential, m/2 w |d - d_hat|^2 + U; a method only
/// says how velocities and accelerations follow from the displacements d (StageRule), and what is left at the end of
/// the step. docs/theory.md has the formulas. To add one, write a class in one file of dynamics/integrators/ and one
/// line in the list of integrator.cpp.

#include "tendril/solver/step_solver.hpp"
#include "tendril/state/stage.hpp"

#include <deque>

namespace tendril {

class Integrator {
public:
  using Stages = std::deque<StageRates>; ///< those of a step that are done; they stay where they are
  virtual ~Integrator() = default;
  virtual int order() const { return 2; }
  /// Least number of stages of the step that follows a state.
  virtual int stages(const State & /*start*/) const { return 1; }
  /// Stage number done.size() of a step of length h [s].
  virtual StageRule stage(const State &start, double h, const Stages &done) const = 0;
  /// Whether the step needs another stage after those done, of which the last took some iterations.
  virtual bool goesOn(const State &start, const Stages &done, int /*iterations*/) const {
    return int(done.size()) < stages(start);
  }
  /// Whether the last stage is the end of the step; else `end` has the displacements there, as `guess` and `halfway`.
  virtual bool endsAtStage() const { return true; }
  virtual StageRule end(const State & /*start*/, double /*h*/, const Stages & /*done*/) const { return {}; }
  /// How many sets of State::strains are wanted, where stiffness dissipates.
  virtual int remembersStrains() const { return 0; }
  /// How many sets of State::support_actions are wanted.
  virtual int remembersActions() const { return 0; }
  /// Weights of the forces at the stages, then at the end of the last step and of the one before, in their mean over a
  /// step of length h [s].
  virtual std::vector<double> forceWeights(const State & /*start*/, double /*h*/, std::size_t stages) const {
    std::vector<double> last(stages, 0.0);
    last.back() = 1;
    return last;
  }
  /// Fills the memory of a state that has none; most methods begin without.
  virtual PetscErrorCode begin(StepSolver & /*solver*/, double /*h*/, State & /*state*/) const {
    return PetscErrorCode(0);
  }
  /// Local error of the displacements of a step, to leading order; empty where nothing is known yet.
  virtual Combination error(const State &start, double h, const Stages &done) const = 0;
  /// Velocities at the end of the step.
  virtual Combination velocity(const State & /*start*/, double /*h*/, const Stages &done) const {
    return Combination().add(1, done.back().velocity);
  }
  /// What the state at the end remembers.
  virtual std::vector<Combination> remembers(const State & /*start*/, double /*h*/, const Stages & /*done*/) const {
    return {};
  }
};

/// Accelerations of a state from the forces on it. \param h about the length of a step [s]
Rates startAcceleration(StepSolver &solver, double h, const State &state);

/// Strains s0 for which (s - s0)/damping_dt is the rate that the velocities of a stage give the strains s: found at its
/// guess, where s0 differs from that of the solution by second derivatives of the strains times what the guess is off.
/// Empty where the guess is impossible. In differences of the stages' own strains the squares of motions leave an error
/// of first order in the step, which does not matter to methods of second order whose last stage is the end.
std::vector<double> strainsBehind(StepSolver &solver, const State &start, const Step &stage);

struct IntegratorSettings {
  std::string name = "euler";
  double rho_inf = 0.8; ///< generalized_alpha: spectral radius at infinite frequency
};

/// Names of all methods, and what each is in a few words.
std::vector<std::string> integratorNames();
std::string integratorMeanings();
std::unique_ptr<Integrator> makeIntegrator(const IntegratorSettings &settings);

std::unique_ptr<Integrator> makeEuler(const IntegratorSettings &);
std::unique_ptr<Integrator> makeBdf2(const IntegratorSettings &);
std::unique_ptr<Integrator> makeBdf3(const IntegratorSettings &);
std::unique_ptr<Integrator> makeSdirk2(const IntegratorSettings &);
std::unique_ptr<Integrator> makeSdirk23(const IntegratorSettings &);
std::unique_ptr<Integrator> makeSdirk33(const IntegratorSettings &);
std::unique_ptr<Integrator> makeSymplectic2(const IntegratorSettings &);
std::unique_ptr<Integrator> makeMidpoint(const IntegratorSettings &);
std::unique_ptr<Integrator> makeGeneralizedAlpha(const IntegratorSettings &);
std::unique_ptr<Integrator> makeEnergyMomentum(const IntegratorSettings &);

} // namespace tendril
