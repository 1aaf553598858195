#pragma once
/// \file stage.hpp
/// How displacements, velocities and accelerations hang together in one stage of a time step: all that an integrator
/// tells the incremental potential.

#include "tendril/state/state.hpp"

namespace tendril {

/// Sum of rates with weights.
class Combination {
public:
  Combination &add(double weight, const std::vector<Vec3> &vertex, const std::vector<double> &edge) {
    parts_.push_back({weight, &vertex, &edge});
    return *this;
  }
  Combination &add(double weight, const Rates &rates) { return add(weight, rates.vertex, rates.edge); }
  /// The velocities of a state.
  Combination &add(double weight, const State &state) { return add(weight, state.velocity, state.twist_rate); }
  bool empty() const { return parts_.empty(); }
  Vec3 atVertex(int v) const {
    Vec3 sum = Vec3::Zero();
    for (const Part &p : parts_) sum += p.weight * (*p.vertex)[v];
    return sum;
  }
  double atEdge(int e) const {
    double sum = 0;
    for (const Part &p : parts_) sum += p.weight * (*p.edge)[e];
    return sum;
  }

private:
  struct Part {
    double weight;
    const std::vector<Vec3> *vertex;
    const std::vector<double> *edge;
  };
  std::vector<Part> parts_;
};

/// With d the displacements and spins since the start of the step:
///   velocity v = d/dt + `velocity`,   acceleration = (mass v + `acceleration`)/dt,   strain rate = (strain - its value
///   at the start)/damping_dt,
/// where the start's strain s gets weight (s - strains) on top for each of `damping_past`.
struct StageRule {
  double fraction = 1; ///< of the step: forces balance, and supports are, at that time
  double dt = 0;       ///< [s]
  double mass = 1;
  Combination velocity, acceleration; ///< [m/s]
  double damping_dt = 0;              ///< [s]
  struct PastStrains {
    double weight;
    const double *strains; ///< as strainsOf
  };
  std::vector<PastStrains> damping_past;
  bool tangent_rates = false; ///< strain rates are those of the velocities (strainsBehind) instead
  Combination guess;          ///< of d, to start Newton from [m]
  Combination halfway; ///< of d, half-way in time to the guess: frames follow the curve through both (carryFrames);
                       ///< empty: a great circle [m]
  const Rates *half = nullptr; ///< displacements to the middle of the step: axial forces come from the mean of the
                               ///< strains at both its ends (AxialLaw)
};

/// Frames of a rod from which a stage measures twist: those of the start, carried to where the guess leads. Twist
/// inertia then acts on positions by the small turn from there; from the start itself, that would be an error of first
/// order in the step. Between a curve on the sphere of tangents and its chord lies 4/3 of the triangle with the curve's
/// middle, but for terms of fifth order in the step; by that angle frames turn on top where `halfway` is known.
void carryFrames(const StageRule &rule, const Elements &elements, int rod, const Configuration &from,
                 Configuration &reference);

/// What a stage found.
struct StageRates {
  Rates displacement, velocity, acceleration;
  std::vector<double> strains; ///< as in State; only where something dissipates by them
};

} // namespace tendril
