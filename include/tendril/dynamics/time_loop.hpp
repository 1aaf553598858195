#pragma once
/// \file time_loop.hpp
/// Steps through time (dynamics) or load (statics), rejecting what does not converge.

#include "tendril/io/trajectory.hpp"
#include "tendril/solver/newton.hpp"

#include <functional>

namespace tendril {

struct LoopSettings {
  bool dynamic = true;
  double dt = 1e-2, dt_min = 0, t_end = 1; ///< in statics time is the load factor and ends at 1
  bool mixed = true;
  HessianKind hessian = HessianKind::exact;
  RetractionKind retraction = RetractionKind::length;
};

/// Takes steps and tells the observer of each one accepted.
class TimeLoop {
public:
  using Observer = std::function<PetscErrorCode(const State &, const Diagnostics &)>;
  TimeLoop(NewtonSolver &solver, const LoopSettings &settings) : solver_(solver), settings_(settings) {}

  /// Advances `state` to the end. `finished` is false when dt_min was reached; `state` is then the last one accepted, bit for bit.
  PetscErrorCode run(State &state, const Observer &observe, bool *finished);
  /// The step of length `dt` [s, or load factor] that follows a state.
  static Step stepOf(const LoopSettings &settings, const State &state, double dt);
  const std::string &failure() const { return failure_; }

private:
  NewtonSolver &solver_;
  LoopSettings settings_;
  std::string failure_;

  PetscErrorCode step(State &state, double dt, NewtonReport *report);
};

} // namespace tendril
