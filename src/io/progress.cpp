#include "tendril/io/progress.hpp"

#include "tendril/io/text.hpp"
#include "tendril/layout/launch.hpp"
#include "tendril/solver/activity.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

namespace tendril {
namespace {

/// What of a line fits into one of the terminal.
std::string fitted(const std::string &line) {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || line.size() < size.ws_col) return line;
  std::size_t end = size.ws_col - 1;
  while (end > 0 && (line[end] & 0xC0) == 0x80) --end; // no part of a character
  return line.substr(0, end);
}

} // namespace

Progress::Progress(const LoopSettings &loop, const std::string &log_path, bool speaks)
    : end_(loop.t_end), time_(loop.dynamic ? "time" : "load factor"),
      step_(loop.dynamic                                   ? "dt"
            : loop.continuation == Continuation::arclength ? "length"
                                                           : "increment"),
      terminal_(isatty(STDOUT_FILENO) && !isLaunched()) { // Open MPI pretends to be one
  if (!speaks) return;
  log_ = std::fopen(log_path.c_str(), "w");
  if (!log_) throw SceneError(log_path + ": cannot be written; choose another folder with -output_dir");
  watch().restart();
  watch().tell = [this](const std::string &line) { tell(printable(line), terminal_, true); };
}

Progress::~Progress() {
  if (!log_) return;
  watch().tell = nullptr;
  endLine();
  std::fclose(log_);
}

/// Ends a line that would be rewritten.
void Progress::endLine() {
  if (open_line_) std::printf("\n");
  open_line_ = false;
}

void Progress::tell(const std::string &line, bool rewrites, bool logs) {
  if (rewrites) {
    std::printf("\r%s\033[K", fitted(line).c_str());
    open_line_ = true;
  } else if (logs && !terminal_)
    std::printf("%s\n", line.c_str());
  std::fflush(stdout);
  if (!logs) return;
  std::fprintf(log_, "%s\n", line.c_str());
  std::fflush(log_);
}

void Progress::say(const std::string &line) {
  if (!log_) return;
  endLine();
  std::printf("%s\n", printable(line).c_str());
  std::fflush(stdout);
  log(line);
  watch().restart();
}

void Progress::log(const std::string &line) {
  if (!log_) return;
  std::fprintf(log_, "%s\n", printable(line).c_str());
  std::fflush(log_);
}

void Progress::fail(const std::string &why) {
  if (!log_) return;
  endLine();
  std::fflush(stdout);
  log("failed: " + why);
  std::fprintf(stderr, "tendril: %s\n", printable(why).c_str());
}

void Progress::step(const Diagnostics &row) {
  if (!log_) return;
  watch().restart();
  const double done = row.time / end_;
  const bool report = done >= next_report_ || row.rejected_steps > 0;
  const bool rewrite = terminal_ && (report || row.wall_seconds >= next_line_);
  if (!report && !rewrite) return;
  const double left = done > 0 ? row.wall_seconds * (1 - done) / done : 0;
  char line[200];
  std::snprintf(line, sizeof line, "%s %.6g of %.6g  %s %.3g  its %d  energy %.6e J  %.0f s left", time_, row.time,
                end_, step_, row.dt, row.newton_iterations, row.energy.total(), left);
  tell(line, rewrite, report);
  if (rewrite) next_line_ = row.wall_seconds + 0.1;
  if (report) next_report_ = done + 0.1;
}

} // namespace tendril
