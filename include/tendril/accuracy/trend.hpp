#pragma once
/// \file trend.hpp
/// How errors fall from a coarse run to finer ones, and what that says of others.

#include "tendril/accuracy/samples.hpp"

#include <optional>

namespace tendril {

inline constexpr double small = 0.25;      ///< part of the tolerance below which an error needs no order
inline constexpr double least_order = 0.7; ///< below, halving tells nothing of the error that is left
inline constexpr double fair_order =
    0.6; ///< of the formal order; below, the order may still rise with shorter steps or edges, unless
inline constexpr double settled_order = 0.9; ///< it is at least this, as of methods that lose one,
inline constexpr double settled = 0.15;      ///< and changes by less than this from one doubling to the next

/// Errors of three runs of a rod, each with half the step or edge of the one before, by the ratio of their differences
/// (Aitken).
struct Trend {
  double error[3] = {0, 0, 0}; ///< of the coarsest to the finest
  double seen = 0;             ///< the order as seen
  double order = 0;            ///< taken for what is finer; not above the formal one
  int formal = 2;
  bool trusted = true;
  Errors errors; ///< of the second, up to a factor

  double finest() const { return error[2]; }
  /// With steps or edges so many times those of the finest run.
  double at(double refinement) const {
    const double level = 2 + std::log2(refinement);
    if (level >= 2) return error[2] * std::pow(refinement, -order);
    if (level <= 0) return error[0] * std::exp2(-formal * level);
    const int k = int(level);
    return error[k] * std::pow(error[k + 1] / std::max(error[k], 1e-300), level - k);
  }
  /// The least refinement at which the error is not above this.
  double reaching(double target) const {
    if (target <= error[2]) return std::pow(error[2] / target, 1 / order);
    if (target >= error[0]) return 0.25 * std::pow(error[0] / target, 1.0 / formal);
    const int k = target >= error[1] ? 0 : 1;
    return 0.25 * std::exp2(k + std::log(error[k] / target) / std::log(error[k] / error[k + 1]));
  }
};

/// \param before the order seen with longer steps or edges, if any
inline Trend trendOf(const Errors &first, Errors second, int formal, double tolerance, std::optional<double> before) {
  Trend t;
  const double one = sizeOf(first), two = sizeOf(second);
  if (one > 0 && two > 0) t.seen = std::log2(one / two);
  t.formal = formal;
  t.order = two > 0 ? std::clamp(t.seen, least_order, double(formal)) : formal;
  t.error[2] = two / (std::pow(2, t.order) - 1);
  t.error[1] = two + t.error[2];
  t.error[0] = std::max(one, two) + t.error[1];
  const bool fair = t.seen >= std::max(least_order, fair_order * formal);
  const bool lasts = before && t.seen >= settled_order && std::abs(t.seen - *before) < settled;
  t.trusted = fair || lasts || t.error[2] <= small * tolerance;
  t.errors = std::move(second);
  return t;
}

/// What the edges may add to an error of the steps so that together they come to the tolerance; negative when nothing.
inline double roomBeside(double step_error, double correlation, double tolerance) {
  const double square = tolerance * tolerance - step_error * step_error * (1 - correlation * correlation);
  return square < 0 ? -1 : std::sqrt(square) - correlation * step_error;
}

inline double together(double a, double b, double correlation) {
  return std::sqrt(a * a + b * b + 2 * correlation * a * b);
}

/// What three runs in steps and three in edges tell of each rod.
struct Found {
  std::vector<Trend> steps, edges;
  std::vector<double> correlation; ///< of the two errors
};

} // namespace tendril
