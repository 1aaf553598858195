#pragma once
/// \file samples.hpp
/// A run in memory, sampled at fixed times: what estimates of errors in dynamics compare.

#include "tendril/accuracy/accuracy.hpp"

namespace tendril {

/// What is kept of a run.
struct RunSamples {
  std::string failure;                     ///< why the run tells nothing; empty when it does
  std::vector<int> edges;                  ///< per rod
  std::vector<std::vector<Vec3>> position; ///< at each time (nv) [m]
  std::vector<double> elastic;             ///< energy of all rods at each time [J]
  double rounding_error = 0;               ///< of the run, over rod lengths
  long steps = 0;
  double seconds = 0; ///< of the time loop
  /// Edges x steps.
  double work() const;
  /// At the first time only.
  RunSamples first() const {
    return {failure, edges, {position.front()}, {elastic.front()}, rounding_error, steps, seconds};
  }
};

/// Runs a scene in dynamics to its end. Steps have to end at the times; where a rejected step put them off, that is a
/// failure. \param times increasing [s]
PetscErrorCode sample(Scene scene, const LoopSettings &settings, const std::vector<double> &times, RunSamples *samples);

/// Errors of a rod at places along it, each at the times of the samples.
using Errors = std::vector<std::vector<Vec3>>;

/// One run less another, per rod, as a Quantity counts: of positions over the rod's length, at the vertices that a rod
/// of `edges` has, or its last one; of the elastic energy of all rods, over its largest value (one place, first
/// component). \param scene with these rods, of any edges \param edges per rod; both runs have as many or multiples
std::vector<Errors> difference(const Scene &scene, const RunSamples &run, const RunSamples &other,
                               const std::vector<int> &edges, Quantity of);

/// The largest root mean square in time of any place.
double sizeOf(const Errors &errors);

/// How much two errors add up where they are large: 1 when they have the same direction at all times, 0 when they have
/// nothing to do with each other or make up for each other.
double correlation(const Errors &a, const Errors &b);

} // namespace tendril
