#pragma once
/// \file activity.hpp
/// What a run is doing, told where it takes long: nothing for what is fast, a line every few seconds for what is not.

#include <chrono>
#include <functional>
#include <optional>
#include <sstream>
#include <string>

namespace tendril {

/// What is going on while it lives, within what goes on around it. Its words are made only when they are told.
class Activity {
public:
  Activity() : outer_(innermost_) { innermost_ = this; }
  Activity(const Activity &) = delete;
  virtual void describe(std::ostream &out) const = 0;
  /// Of all, the outermost first, divided by "; ".
  static std::string all();

protected:
  ~Activity() { innermost_ = outer_; }

private:
  static inline const Activity *innermost_ = nullptr;
  const Activity *outer_;
};

/// `const Doing here([&](std::ostream &out) { out << "step at time " << time; });`
template <class Describe> class Doing final : public Activity {
public:
  explicit Doing(Describe describe) : describe_(std::move(describe)) {}
  void describe(std::ostream &out) const override { describe_(out); }

private:
  Describe describe_;
};

/// Tells what goes on where that takes long. One for all, as a program has one who waits.
class Watch {
public:
  using Clock = std::chrono::steady_clock;
  std::function<void(const std::string &)> tell; ///< without one, nothing is watched
  double wait = 5;                               ///< before the first line, and between lines [s]

  /// Where work goes on, once an iteration: tells what goes on when nothing has been told for so long. One look at the
  /// clock.
  void beat() {
    if (tell) look();
  }
  /// Something has been told, or is done: waiting begins anew at the next beat.
  void restart() { since_.reset(); }

private:
  std::optional<Clock::time_point> since_, told_;
  void look();
};
Watch &watch();

} // namespace tendril
