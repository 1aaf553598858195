#pragma once
/// \file pair_readings.hpp
/// What rods and bodies do to each other at a state, for results.

#include "tendril/layout/elements.hpp"
#include "tendril/state/state.hpp"

namespace tendril {

/// A sample of a rod or a body that touches another: of the one that has the sample first, then of the other. Where it
/// is near a vertex both edges beside that count it, and the vertex is taken off again: a reading whose force is
/// negative.
struct PairReading {
  std::array<int, 2> rod, edge, body; ///< -1 where it is none: rod and edge of a body, body of a rod
  std::array<double, 2> at;           ///< part of the edge, not a number of a body
  double gap;                         ///< between surfaces [m]
  Vec3 place;                         ///< of the sample: on the axis of its rod, or in its body [m]
  Vec3 normal;                        ///< out of the other
  Vec3 force;                         ///< of the normal law, on the one that has the sample [N]
  Vec3 friction;                      ///< the same of friction and damping, in the step that led to the state [N]
};
/// \param c of the state \param is_static whether statics led to it
std::vector<PairReading> pairReadings(const Scene &scene, const Elements &elements, const State &state,
                                      const Configuration &c, bool is_static);

} // namespace tendril
