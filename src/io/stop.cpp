#include "tendril/io/stop.hpp"

#include <ctime>
#include <unistd.h>

namespace tendril {
namespace {

volatile std::sig_atomic_t caught = 0, silent = 0;
timespec first; ///< when the signal that asked to stop came

/// One request may come as two signals: `timeout` sends its own to the process and to its group.
extern "C" void catchSignal(int signal) {
  constexpr double same_request = 0.5; // [s]
  constexpr char text[] = "\ntendril: finishing the step; once more ends the run at once\n";
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (caught == 0) {
    first = now;
    caught = signal;
    if (!silent) (void)!::write(STDERR_FILENO, text, sizeof text - 1);
  } else if (double(now.tv_sec - first.tv_sec) + 1e-9 * double(now.tv_nsec - first.tv_nsec) > same_request) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}

} // namespace

KeptSignals::KeptSignals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGQUIT}) {
    before_.emplace_back(signal, (struct sigaction){});
    sigaction(signal, nullptr, &before_.back().second);
  }
}

void KeptSignals::restore() const {
  for (const auto &[signal, action] : before_) sigaction(signal, &action, nullptr);
}

StopRequest::StopRequest(Clock::time_point begin, std::optional<double> limit, bool speaks)
    : begin_(begin), limit_(limit) {
  caught = 0;
  silent = !speaks;
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction now = {}, before = {};
    sigaction(signal, nullptr, &before);
    if (before.sa_handler == SIG_IGN) continue; // as nohup and shells ask for
    now.sa_handler = catchSignal;
    now.sa_flags = SA_RESTART;
    sigemptyset(&now.sa_mask);
    for (const int other : {SIGINT, SIGTERM}) sigaddset(&now.sa_mask, other); // one at a time
    sigaction(signal, &now, nullptr);
    before_.emplace_back(signal, before);
  }
}

StopRequest::~StopRequest() {
  if (caught != 0) return; // the rest of a request that came as two signals must not end what writes files
  for (const auto &[signal, action] : before_) sigaction(signal, &action, nullptr);
}

bool StopRequest::asked() const {
  return caught != 0 || (limit_ && std::chrono::duration<double>(Clock::now() - begin_).count() >= *limit_);
}

std::string StopRequest::reason(int exit_code) {
  return exit_code == 128 + SIGINT ? "SIGINT" : exit_code == 128 + SIGTERM ? "SIGTERM" : "-time_limit";
}

int StopRequest::exitCode() const { return caught != 0 ? 128 + int(caught) : asked() ? 75 : 0; }

} // namespace tendril
