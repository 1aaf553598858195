#pragma once
/// \file samples.hpp
/// A run in memory, sampled at fixed times: what estimates of errors in dynamics compare.

#include "tendril/io/accuracy.hpp"

namespace tendril {

struct Samples {
  std::string failure;                     ///< why the run tells nothing; empty when it does
  std::vector<int> edges;                  ///< per rod
  std::vector<std::vector<Vec3>> position; ///< at each time (nv) [m]
  std::vector<double> elastic;             ///< energy of all rods at each time [J]
  long steps = 0;
  double seconds = 0;
  double work() const; ///< edges x steps
};

/// Runs a scene in dynamics to its end. Steps have to end at the times; where a rejected step put them off, that is a failure.
/// \param times increasing [s]
PetscErrorCode sample(Scene scene, const LoopSettings &settings, const std::vector<double> &times, Samples *samples);

/// How far two runs are apart, per rod, as a Quantity counts: the largest over its vertices of the distance, root mean square over the times, over its length;
/// the same of its last vertex; or the elastic energy of all rods.
/// \param scene with these rods, of any edges
/// \param fine each rod with as many edges as in `coarse`, or a multiple
std::vector<double> distances(const Scene &scene, const Samples &coarse, const Samples &fine, Quantity of);

} // namespace tendril
