#pragma once
/// \file progress.hpp
/// What a user sees while a run goes on: one line that is rewritten on a terminal, now and then a line in a log; and
/// where nothing happens for some seconds, what takes so long.

#include "tendril/dynamics/time_loop.hpp"

#include <cstdio>

namespace tendril {

class Progress {
public:
  /// \param speaks whether it is this rank that tells
  Progress(const LoopSettings &loop, const std::string &log_path, bool speaks = true);
  ~Progress();
  Progress(const Progress &) = delete;
  void step(const Diagnostics &row);
  /// A line on the output and in the log.
  void say(const std::string &line);
  /// In the log only.
  void log(const std::string &line);
  /// Why the run failed: in the log, and on the standard error.
  void fail(const std::string &why);

private:
  double end_;
  const char *time_, *step_; ///< their names
  bool terminal_, open_line_ = false;
  double next_report_ = 0;   ///< fraction of the run at which the next line is due when there is no terminal
  double next_line_ = 0;     ///< wall time of the run at which the line on a terminal is due again [s]
  std::FILE *log_ = nullptr; ///< null on ranks that do not speak
  void endLine();
  void tell(const std::string &line, bool rewrites, bool logs);
};

} // namespace tendril
