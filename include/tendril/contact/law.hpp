#pragma once
/// \file law.hpp
/// Normal laws of contact: energy of a sample by its distance from an obstacle, per length of the rod.

#include "tendril/model/contact.hpp"

#include <cmath>
#include <limits>

namespace tendril {

/// Energy per length [J/m] of a distance [m] between surfaces, its derivative (less the line force) and the second one.
struct GapLaw {
  double value = 0, slope = 0, curvature = 0;
};

/// The law of one rod with its numbers put in. `distance` is between surfaces: that of the centreline less the radius.
class NormalLaw {
public:
  /// \param stiffness of a barrier, force per length [N/m]
  NormalLaw(const ContactSettings &settings, double stiffness)
      : is_barrier_(settings.isBarrier()), width_(settings.distance), threshold_(settings.threshold),
        smoothing_(settings.smoothing), stiffness_(is_barrier_ ? stiffness : settings.stiffness) {}

  double stiffness() const { return stiffness_; }
  /// Where it begins to act [m].
  double reach() const { return is_barrier_ ? 0.5 * width_ : threshold_; }

  GapLaw operator()(double distance) const {
    if (!(distance < reach())) return {};
    return is_barrier_ ? barrier(distance) : penalty(distance);
  }

private:
  bool is_barrier_;
  double width_, threshold_, smoothing_, stiffness_;

  /// Barrier of Li et al. 2020 (Incremental potential contact, eq. 6) scaled as in Li et al. 2023 (Convergent IPC):
  /// with t the part of the width between wall and reach, -stiffness width (t - 1)^2 ln t, docs/theory.md (17.2).
  GapLaw barrier(double between) const {
    const double t = between / width_ + 0.5;
    if (!(t > 0)) return {std::numeric_limits<double>::infinity(), 0, 0};
    const double less = t - 1, log = std::log(t);
    return {-stiffness_ * width_ * less * less * log, -stiffness_ * (2 * less * log + less * less / t),
            -stiffness_ / width_ * (2 * log + 4 * less / t - less * less / (t * t))};
  }

  /// stiffness/2 h^2 of a ramp h with two continuous derivatives, which is linear from 2 x smoothing behind the
  /// threshold: docs/theory.md (17.3).
  GapLaw penalty(double between) const {
    const double e = smoothing_, depth = threshold_ - between, u = depth / e, k = stiffness_;
    double h = depth - e, slope = 1, bend = 0;
    if (u < 2) { // 3/16 + s/2 + 3/8 s^2 - s^4/16 with s = u - 1
      h = e * u * u * u * (4 - u) / 16;
      slope = u * u * (3 - u) / 4;
      bend = 0.75 * u * (2 - u) / e;
    }
    return {0.5 * k * h * h, -k * h * slope, k * (slope * slope + h * bend)};
  }
};

} // namespace tendril
