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
  NormalLaw(const ContactSettings &settings, double stiffness) : settings_(&settings), stiffness_(stiffness) {}

  double stiffness() const { return stiffness_; }
  /// Where it begins to act [m].
  double reach() const { return settings_->isBarrier() ? 0.5 * settings_->distance : settings_->threshold; }

  GapLaw operator()(double distance) const {
    if (!(distance < reach())) return {};
    return settings_->isBarrier() ? barrier(distance) : penalty(distance);
  }

private:
  const ContactSettings *settings_;
  double stiffness_;

  /// Barrier of Li et al. 2020 (Incremental potential contact, eq. 6) scaled as in Li et al. 2023 (Convergent IPC):
  /// with t the part of `distance` between wall and reach, -stiffness distance (t - 1)^2 ln t.
  GapLaw barrier(double between) const {
    const double width = settings_->distance, t = between / width + 0.5;
    if (!(t > 0)) return {std::numeric_limits<double>::infinity(), 0, 0};
    const double less = t - 1, log = std::log(t);
    return {-stiffness_ * width * less * less * log, -stiffness_ * (2 * less * log + less * less / t),
            -stiffness_ / width * (2 * log + 4 * less / t - less * less / (t * t))};
  }

  /// stiffness/2 h^2 of a ramp h with two continuous derivatives, which is linear from 2 x smoothing behind the
  /// threshold.
  GapLaw penalty(double between) const {
    const double e = settings_->smoothing, depth = settings_->threshold - between, u = depth / e,
                 k = settings_->stiffness;
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
