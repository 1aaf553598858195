#pragma once
/// \file trajectory.hpp
/// Trajectories: one HDF5 file that grows frame by frame (layout in docs/user.md) and the XDMF file by which ParaView reads it.

#include "tendril/energy/term.hpp"
#include "tendril/io/hdf5.hpp"

#include <map>
#include <memory>
#include <set>

namespace tendril {

/// One row of /diagnostics and of diagnostics.csv.
struct Diagnostics {
  double time = 0, dt = 0;
  EnergyBudget energy;
  double dissipated = 0; ///< by the step, of kinetic and potential energy: what the loads and supports put in is counted too [J]
  int newton_iterations = 0, line_search_trials = 0, negative_pivots = 0, rejected_steps = 0;
  double wall_seconds = 0;

  static const std::vector<std::string> &names();
  std::vector<double> values() const;
};

/// Where a run came from; attributes of the trajectory.
struct Provenance {
  std::string command_line, options, git_commit, version, petsc_version, created;
  int ranks = 1;
};

class TrajectoryWriter {
public:
  /// \param fields which of position, director, velocity, twist_rate, axial_force to write; position always
  TrajectoryWriter(const std::string &folder, const Scene &scene, const Elements &elements, const Provenance &provenance, const std::set<std::string> &fields);
  ~TrajectoryWriter();
  void writeFrame(const State &state);
  void writeDiagnostics(const Diagnostics &row);
  /// Adds to /critical/load_factor.
  void writeCritical(double load_factor);
  int frames() const { return int(times_.size()); }

  static const std::vector<std::string> &fieldNames();

private:
  std::string folder_;
  std::size_t rods_;
  int vertices_, edges_;
  hsize_t polyline_entries_ = 0;
  std::vector<double> times_;
  Hdf5File file_;
  std::vector<std::pair<std::string, std::unique_ptr<Hdf5Series>>> state_;
  std::unique_ptr<Hdf5Series> time_, step_, critical_;
  std::vector<std::unique_ptr<Hdf5Series>> diagnostics_;

  void writeHeader(const Scene &scene, const Elements &elements, const Provenance &provenance);
  void writeXdmf() const;
};

} // namespace tendril
