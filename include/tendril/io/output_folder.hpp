#pragma once
/// \file output_folder.hpp
/// The folder of a run's results: held by one run at a time, and empty of the results of others when it begins.

#include <string>
#include <vector>

namespace tendril {

/// Held as long as the object lives; the system lets go of it when a run is killed.
class OutputFolder {
public:
  /// Makes the folder where there is none. \throws SceneError when it cannot be written, or another run holds it
  explicit OutputFolder(const std::string &path);
  /// Removes the folder again if it was made and nothing is in it.
  ~OutputFolder();
  OutputFolder(const OutputFolder &) = delete;

  /// Checkpoints of earlier runs here, the newest first: that of the last one, then those of the parts set aside.
  std::vector<std::string> checkpoints() const;
  /// Whether a run here would remove or replace a file: it has the name and the place of a result.
  bool replaces(const std::string &file) const;
  /// \throws SceneError where it would one of the files that the run reads
  void refuseToReplace(const std::vector<std::string> &inputs) const;
  /// Removes results of earlier runs, with all parts; names of what went.
  std::vector<std::string> clear() const;
  /// Makes room for a run that goes on from one of checkpoints(): moves the results that it is of to part_1, part_2
  /// ..., or removes results of a run that had none. Path of that checkpoint then.
  std::string setAside(const std::string &checkpoint) const;

private:
  std::string path_;
  bool made_;
  int lock_ = -1;

  std::string lockPath() const { return path_ + "/.lock"; }
  std::vector<int> parts() const;
};

} // namespace tendril
