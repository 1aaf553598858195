#pragma once
/// \file option_files.hpp
/// Files of options, looked at before PETSc reads them: PETSc names no lines, and takes the last of a key given twice.

#include <map>
#include <string>
#include <vector>

namespace tendril {

/// The files that the command line and PETSC_OPTIONS name by -options_file, and where options stand in them.
class OptionFiles {
public:
  /// \param argc, argv of main
  /// \throws SceneError naming file and line
  void read(int argc, char **argv);
  /// Paths, in the order in which PETSc reads them.
  const std::vector<std::string> &files() const { return files_; }
  /// "file:line" of an option, without its dash; empty where the command line gives it, or nothing does.
  std::string place(const std::string &option) const;
  /// The message with the place of the option that it begins with. PETSc's name no option: they get those whose value
  /// they tell, or the files.
  std::string locate(const std::string &message) const;

private:
  std::vector<std::string> files_;
  std::map<std::string, std::string> places_;
  std::map<std::string, std::string> values_; ///< of all options, wherever they stand
  void readYaml(const std::string &file);
  void readPlain(const std::string &file);
  std::string toldIn(const std::string &message) const;
};

} // namespace tendril
