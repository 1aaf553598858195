#pragma once
/// \file estimate.hpp
/// Richardson's estimate of the error of a static answer: every strain, load and support is of second order in the edge
/// length h, so that of the difference between the answers at h and h/2, 4/3 is the error of the first and 1/3 that of
/// the second.

#include "tendril/dynamics/simulation.hpp"
#include "tendril/model/remesh.hpp"

namespace tendril {

/// As drawn [m].
double lengthOf(const Rod &rod);

/// What an estimate compares.
struct Answer {
  bool found = false;
  std::string failure; ///< why there is none
  double load_factor = 0;
  std::vector<Vec3> position;   ///< (nv) [m]
  EnergyBudget energy;          ///< [J]
  std::vector<double> critical; ///< load factors where stability was lost
  double rounding_error = 0;    ///< over rod lengths (NewtonReport)
};

/// That of a run at its present state.
Answer answerOf(const Simulation &run, double rounding_error, std::vector<double> critical = {});

/// Sets a run up and takes it through its load steps. The settings are those of any run.
PetscErrorCode solveStatics(Simulation &run, Scene scene, const LoopSettings &settings, Answer *answer);

struct RodEstimate {
  double length = 0;       ///< as drawn [m]
  double displacement = 0; ///< largest [m]
  double error = 0;        ///< largest of a vertex, of the answer with edges h [m]
  int vertex = 0;          ///< which has it
  double tip = 0;          ///< error of the last vertex [m]
};

struct Estimate {
  std::vector<Vec3> position; ///< extrapolated, of the vertices at h (nv) [m]
  std::vector<double> error;  ///< of the answer at h (nv) [m]
  std::vector<RodEstimate> rods;
  EnergyBudget energy, energy_error; ///< at h, signed: the energy less its error is the extrapolated energy [J]
  bool tan = false;                  ///< some rod measures strains by tan
  std::string none;                  ///< why the two answers tell nothing; empty when they do
  std::vector<double> critical, critical_error; ///< extrapolated critical load factors, and the errors of those found
  std::string no_critical;                      ///< why there is no estimate of them although some were found

  /// Rod whose error is the largest part of its length.
  int worstRod() const;
  double relativeError() const { return rods[worstRod()].error / rods[worstRod()].length; }
  double elasticEnergy() const { return energy.stretch + energy.bend + energy.twist; }
  double elasticError() const { return std::abs(energy_error.stretch + energy_error.bend + energy_error.twist); }
};

/// No error is estimated below what rounding leaves of the two answers.
/// \param scene that of `coarse`; `fine` has twice the edges of each rod
Estimate richardson(const Scene &scene, const Answer &coarse, const Answer &fine);

/// Solves with twice the edges, starting from the answer at hand so that both are on one branch of equilibria; where
/// Newton does not find it from there, or critical loads were found on the way, by the load steps of the run. \param
/// rounding_error of the run, over rod lengths \param fine the scene of `run` remeshed with twice the edges
PetscErrorCode estimateError(const Simulation &run, double rounding_error, const std::vector<double> &critical,
                             const Scene &fine, const LoopSettings &settings, Estimate *estimate);

/// Energies that have an estimate of their own, by name.
inline constexpr std::pair<const char *, double EnergyBudget::*> estimated_energies[] = {
    {"stretch", &EnergyBudget::stretch},
    {"bend", &EnergyBudget::bend},
    {"twist", &EnergyBudget::twist},
    {"gravity", &EnergyBudget::gravity}};

/// Lines that tell an estimate to a user.
std::vector<std::string> describe(const Estimate &estimate, const Scene &scene);

} // namespace tendril
