#pragma once
/// \file trajectory.hpp
/// Trajectories: one HDF5 file that grows frame by frame (layout in docs/reading_results.md) and the XDMF file by which
/// ParaView reads it.

#include "tendril/dynamics/diagnostics.hpp"
#include "tendril/io/contact_writer.hpp"
#include "tendril/io/scene_reader.hpp"
#include "tendril/io/summary.hpp"

#include <chrono>
#include <fstream>
#include <map>
#include <memory>
#include <set>

namespace tendril {

/// Where a run came from; attributes of the trajectory, and its datasets /scene, /scene_files and /options.
struct Provenance {
  std::string command_line, options, git_commit, version, petsc_version, created;
  SceneSource scene;
  std::string effective_options; ///< text of options.yaml
  int ranks = 1;
};

/// What is written waits in memory, or in HDF5, until it is flushed: flushWhenDue() after every step does so half a
/// second after the last time, or when 4 MB wait. A killed run loses what was not flushed and nothing else.
class TrajectoryWriter {
public:
  /// \param fields which of fieldNames() and derivedFieldNames() to write; position always
  /// \param dynamic statics: the time of a state is also the load factor
  TrajectoryWriter(const std::string &folder, const Scene &scene, const Elements &elements,
                   const Provenance &provenance, const std::set<std::string> &fields, bool dynamic);
  ~TrajectoryWriter();
  void writeFrame(const State &state);
  /// Also to diagnostics.csv.
  void writeDiagnostics(const Diagnostics &row);
  /// Adds to /critical/load_factor.
  void writeCritical(double load_factor);
  /// Of the last state.
  void writeSummary(const Summary &summary) { tendril::writeSummary(file_, summary); }
  /// Makes all that was written safe from a kill, and visible to readers. \throws SceneError when it cannot be written
  void flush();
  void flushWhenDue();
  /// Ends the files; nothing may be written afterwards. \throws WriteError when that fails
  void finish();
  int frames() const { return int(times_.size()); }

  /// Fields of a state.
  static const std::vector<std::string> &fieldNames();
  /// Fields computed from it, only when asked for.
  static const std::vector<std::string> &derivedFieldNames();

private:
  using Clock = std::chrono::steady_clock;
  const Scene &scene_;
  const Elements &elements_;
  bool dynamic_;
  int tendon_segments_ = 0;
  std::string folder_;
  std::size_t rods_;
  int vertices_, edges_;
  hsize_t polyline_entries_ = 0;
  std::vector<double> times_;
  std::string csv_rows_; ///< not yet in diagnostics.csv
  std::ofstream csv_;
  Hdf5File file_;
  std::vector<std::unique_ptr<Hdf5Series>> state_; ///< of all fields in their order; null where one is not written
  std::unique_ptr<Hdf5Series> time_, step_, critical_;
  std::vector<std::unique_ptr<Hdf5Series>> diagnostics_;
  std::unique_ptr<ContactWriter> contacts_; ///< or null
  std::unique_ptr<PairWriter> touching_;    ///< or null
  bool broken_ = false, finished_ = false; ///< a flush failed, after which HDF5 must not touch the file; all is written
  Clock::time_point flushed_, described_at_; ///< long ago: the first frame goes to the files at once
  std::size_t described_ = 0;                ///< frames in the XDMF file

  void writeHeader(const Scene &scene, const Elements &elements, const Provenance &provenance);
  void writeOrigin(const Provenance &provenance);
  void writeRods();
  void writeSupports();
  void writeConstraints(); ///< name, type, rod, and the vertex of a pin or edge of a rotation
  void writeSkins();       ///< triangles of each rod, and how its points go with edges (SkinPoint)
  void writeColliders();   ///< name, shape, its parameters, and position and rotation without motion
  void writeJoints();      ///< name, type, bodies, point and axis as drawn
  void writeTendons();     ///< name, actuator, rows of their points, and segments between these
  void writeBodies();      ///< name, shape, its parameters, mass properties as drawn; and what is tied to them
  void writeMaterials();
  void writeXdmf() const;
};

} // namespace tendril
