#pragma once
/// \file skin_samples.hpp
/// Where the skin of a rod touches.

#include "tendril/energy/edge_point.hpp"

#include <span>

namespace tendril {

/// A sample on the skin.
struct OnSkin {
  EdgePoint point;
  double weight; ///< its part of the rod at rest, as of all of the skin [m]
};

/// The samples of a rod that touches by its skin; none of another.
class SkinSamples {
public:
  SkinSamples() = default;
  SkinSamples(const Rod &rod, const RodRange &range);
  bool empty() const { return samples_.empty(); }
  /// Those that an edge carries, alone or with the one behind it.
  std::span<const OnSkin> of(int edge) const {
    return {samples_.data() + first_[edge], samples_.data() + first_[edge + 1]};
  }
  /// How many are before those of an edge.
  int first(int edge) const { return first_[edge]; }
  const OnSkin &operator[](int k) const { return samples_[k]; }
  /// Parts that samples from one on have of what carries them, as place() takes them: of the first edge its first
  /// vertex, its vector and both directors, then of the second.
  static constexpr int parts = 8;
  std::array<const double *, parts> partsFrom(int k) const {
    std::array<const double *, parts> from;
    for (int p = 0; p < parts; ++p) from[p] = parts_[p].data() + k;
    return from;
  }

  // How far samples are at most from the nearest vertex of the edges that carry them: so much [m], and so many of the
  // longest edge; and how much faster they go than vertices, but for their arms.
  double arm() const { return arm_; }
  double apart() const { return apart_; }
  double gain() const { return gain_; }

private:
  std::vector<OnSkin> samples_; ///< in the order of their first edges
  std::vector<int> first_;      ///< per edge, and the end
  std::array<std::vector<double>, parts> parts_;
  double arm_ = 0, apart_ = 0.5, gain_ = 1;
};

} // namespace tendril
