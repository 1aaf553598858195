#pragma once
/// \file recorder.hpp
/// What a run leaves while it goes on and at its end: frames, diagnostics, checkpoints, and what is told of them.

#include "tendril/dynamics/bifurcation.hpp"
#include "tendril/energy/widest_angle.hpp"
#include "tendril/io/checkpoint.hpp"
#include "tendril/io/options.hpp"
#include "tendril/io/prepare.hpp"
#include "tendril/io/progress.hpp"

namespace tendril {

/// The leading rank writes and tells; all ranks call, for what they have goes to it.
class Recorder {
public:
  /// Begins the files of results with the state as it is. \throws WriteError
  Recorder(const Options &options, const Prepared &prepared, const StepControl &control, const RunFacts &facts,
           const Provenance &origin, Progress &progress);

  /// After every step.
  PetscErrorCode observe(const State &state, const Diagnostics &row);
  PetscErrorCode noteCritical(const CriticalPoint &point);
  /// Writes the last frame, the summary and the checkpoint, and tells them.
  PetscErrorCode end(bool stopped);
  /// Where energy rose by more than the work of loads and supports, the method has put it in: a warning, or why a run
  /// that has `finished` is no answer.
  std::string tellGrowth(bool finished);
  /// Angles beyond what the measure `tan` bears, and rounding.
  void tellAccuracy();
  /// No more is written.
  void close() { trajectory_.reset(); }

  long steps() const { return steps_; }
  const Diagnostics &last() const { return last_; }
  const std::vector<double> &criticalFactors() const { return critical_factors_; }

private:
  const Options &options_;
  const Prepared &prepared_;
  const Simulation &run_; ///< of the whole scene on the leading rank
  const StepControl &control_;
  const RunFacts &facts_;
  Progress &progress_;
  std::unique_ptr<TrajectoryWriter> trajectory_;
  std::string checkpoint_;
  bool arclength_;
  Diagnostics last_;
  std::vector<double> critical_factors_;
  double next_output_ = 0; ///< [s]
  double last_frame_ = -1; ///< time of it [s, or load factor]
  long steps_ = 0, iterations_ = 0, rejected_ = 0;
  bool told_unstable_ = false;
  WidestAngle widest_;
  struct {
    double turn = 1; ///< in a step, from which on it is told [rad]
    int body = -1;
    double time = 0, dt = 0; ///< [s]
  } fastest_;
  double dissipated_ = 0, gained_ = 0, work_ = 0, work_of_obstacles_ = 0; ///< [J]
  double most_kinetic_ = 0, first_stored_ = NAN, most_stored_ = 0;        ///< [J]

  bool leads() const { return prepared_.team.leads(); }
  void writeFrame(const State &whole);
  void noteSpins(const State &whole);
  void tellInstability(const Diagnostics &row);
};

} // namespace tendril
