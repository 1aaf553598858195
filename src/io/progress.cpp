#include "tendril/io/progress.hpp"

#include "tendril/io/text.hpp"

#include <unistd.h>

namespace tendril {

Progress::Progress(double end, const std::string &log_path) : end_(end), terminal_(isatty(STDOUT_FILENO)), log_(std::fopen(log_path.c_str(), "w")) {
  if (!log_) throw SceneError(log_path + ": cannot be written; choose another folder with -output_dir");
}

Progress::~Progress() {
  if (open_line_) std::printf("\n");
  std::fclose(log_);
}

void Progress::say(const std::string &line) {
  if (open_line_) std::printf("\n");
  open_line_ = false;
  std::printf("%s\n", printable(line).c_str());
  std::fflush(stdout);
  log(line);
}

void Progress::log(const std::string &line) {
  std::fprintf(log_, "%s\n", printable(line).c_str());
  std::fflush(log_);
}

void Progress::step(const Diagnostics &row) {
  const double done = row.time / end_;
  const bool report = done >= next_report_ || row.rejected_steps > 0;
  const bool rewrite = terminal_ && (report || row.wall_seconds >= next_line_);
  if (!report && !rewrite) return;
  const double left = done > 0 ? row.wall_seconds * (1 - done) / done : 0;
  char line[200];
  std::snprintf(line, sizeof line, "time %.6g of %.6g  dt %.3g  its %d  energy %.6e J  %.0f s left", row.time, end_, row.dt, row.newton_iterations,
                row.energy.total(), left);
  if (rewrite) {
    next_line_ = row.wall_seconds + 0.1;
    std::printf("\r%-90s", line);
    std::fflush(stdout);
    open_line_ = true;
  }
  if (!report) return;
  std::fprintf(log_, "%s\n", line);
  std::fflush(log_);
  if (!terminal_) {
    std::printf("%s\n", line);
    std::fflush(stdout);
  }
  next_report_ = done + 0.1;
}

} // namespace tendril
