#include "tendril/solver/activity.hpp"

namespace tendril {

std::string Activity::all() {
  std::string text;
  for (const Activity *a = innermost_; a; a = a->outer_) {
    std::ostringstream out;
    a->describe(out);
    text = text.empty() ? out.str() : out.str() + "; " + text;
  }
  return text;
}

void Watch::look() {
  const Clock::time_point now = Clock::now();
  if (!since_) since_ = told_ = now;
  if (std::chrono::duration<double>(now - *told_).count() < wait) return;
  told_ = now;
  std::ostringstream line;
  line << "working for " << std::chrono::duration_cast<std::chrono::seconds>(now - *since_).count()
       << " s: " << Activity::all();
  tell(line.str());
}

Watch &watch() {
  static Watch one;
  return one;
}

} // namespace tendril
