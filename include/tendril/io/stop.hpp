#pragma once
/// \file stop.hpp
/// Requests to end a run early: SIGINT, SIGTERM, and a limit of wall time.

#include <chrono>
#include <csignal>
#include <optional>
#include <string>
#include <vector>

namespace tendril {

/// Keeps what the signals that end programs did before, for libraries put handlers of their own in their place;
/// restored by the call.
class KeptSignals {
public:
  KeptSignals();
  void restore() const;

private:
  std::vector<std::pair<int, struct sigaction>> before_;
};

/// While it lives, the first SIGINT or SIGTERM only asks the run to stop; another, half a second later or
/// more, ends it. Signals that were ignored
/// stay so.
class StopRequest {
public:
  using Clock = std::chrono::steady_clock;
  /// \param limit wall time from `begin` [s] \param speaks whether it is this rank that tells
  StopRequest(Clock::time_point begin, std::optional<double> limit, bool speaks = true);
  ~StopRequest();
  StopRequest(const StopRequest &) = delete;
  bool asked() const;
  /// The exit code of what asked: 130, 143, or 75 for the limit of time; 0 where nothing has.
  int exitCode() const;
  /// What asked, by its exit code.
  static std::string reason(int exit_code);

private:
  Clock::time_point begin_;
  std::optional<double> limit_;
  std::vector<std::pair<int, struct sigaction>> before_;
};

} // namespace tendril
