#pragma once
/// \file state.hpp
/// What a run must remember between steps, and what is derived from it.

#include "tendril/model/elements.hpp"

#include <cstdint>

namespace tendril {

/// All that a checkpoint needs. Copied to be restored when a step fails.
struct State {
  double time = 0;
  std::int64_t step = 0;
  std::vector<Vec3> position;      ///< (nv) [m]
  std::vector<Vec3> director;      ///< (ne) first directors
  std::vector<Vec3> velocity;      ///< (nv) [m/s]
  std::vector<double> twist_rate;  ///< (ne) [rad/s]
  std::vector<double> axial_force; ///< (ne) [N]
  std::vector<double> turns;       ///< (cells) 2 pi x whole turns of the twist angle, carried by continuity (`angle` measure) [rad]

  bool operator==(const State &) const = default;
};

State initialState(const Scene &scene, const Elements &elements);

/// A point of the configuration manifold with its derived frames: the iterate of a step.
struct Configuration {
  std::vector<Vec3> position;
  std::vector<Frame> frame;        ///< of edges, then of supports
  /// (ne) axial strain, computed once: compilers contract the formula differently from place to place, and a stiff rod turns that last bit
  /// into forces.
  std::vector<double> strain;
  std::vector<double> spin;        ///< (ne) turning of each director since the step began, summed over retractions [rad]
  std::vector<double> turns;       ///< as in State
  std::vector<double> twist;       ///< (cells) twist angle with whole turns [rad]
  std::vector<double> axial_force; ///< (ne) [N]
};

/// Configuration of a state; supports' frames at `motion_time` of their prescribed motion.
Configuration configurationOf(const State &state, const Scene &scene, const Elements &elements, double motion_time);

/// Present frame of a support.
Frame supportFrame(const Support &support, double motion_time);

} // namespace tendril
