#pragma once
/// \file progress.hpp
/// What a user sees while a run goes on: one line that is rewritten on a terminal, now and then a line in a log.

#include "tendril/io/trajectory.hpp"

#include <cstdio>

namespace tendril {

class Progress {
public:
  Progress(double end, const std::string &log_path);
  ~Progress();
  void step(const Diagnostics &row);
  /// A line on the output and in the log.
  void say(const std::string &line);
  /// In the log only.
  void log(const std::string &line);

private:
  double end_;
  bool terminal_, open_line_ = false;
  double next_report_ = 0; ///< fraction of the run at which the next line is due when there is no terminal
  double next_line_ = 0;   ///< wall time of the run at which the line on a terminal is due again [s]
  std::FILE *log_;
};

} // namespace tendril
