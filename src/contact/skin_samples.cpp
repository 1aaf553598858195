#include "tendril/contact/skin_samples.hpp"

#include "tendril/embedding/embedding.hpp"

#include <algorithm>

namespace tendril {

SkinSamples::SkinSamples(const Rod &rod, const RodRange &range) : first_(std::size_t(rod.edges() + 1), 0) {
  const Skin skin = skinOf(rod);
  const double around = perimeterOf(rod, skin);
  for (const SkinSample &s : skinSamples(rod, skin, rod.contact.quadrature, std::min(rod.skin->edges, 2))) {
    OnSkin &sample = samples_.emplace_back();
    sample.point.edges = s.point.edges;
    sample.weight = s.area / around;
    double gain = 0;
    for (std::size_t k = 0; k < std::size_t(s.point.edges); ++k) {
      const int edge = s.point.edge[k];
      const Vec3 &local = s.point.local[k];
      const double at = 0.5 + local[0] / rod.edge(edge).norm();
      // Two edges share the vertex between them.
      const double apart = s.point.edges == 1 ? std::min(std::abs(at), std::abs(1 - at))
                           : k == 0           ? std::abs(1 - at)
                                              : std::abs(at);
      sample.point.by[k] = {
          range.slot(edge), range.slot(rod.next(edge)), s.point.weight[k], {at, {0, local[1], local[2]}}};
      arm_ = std::max(arm_, std::hypot(local[1], local[2]));
      apart_ = std::max(apart_, apart);
      gain += s.point.weight[k] * (std::abs(1 - at) + std::abs(at));
    }
    gain_ = std::max(gain_, gain);
    for (std::size_t k = 0; k < 2; ++k) {
      const auto &[slot, next, weight, carried] = sample.point.by[k];
      const double part = k < std::size_t(s.point.edges) ? weight : 0;
      const double of[] = {part, part * carried.at, part * carried.arm[1], part * carried.arm[2]};
      for (std::size_t p = 0; p < 4; ++p) parts_[4 * k + p].push_back(part == 0 ? 0 : of[p]);
    }
    ++first_[std::size_t(s.point.edge[0] + 1)];
  }
  for (std::size_t e = 1; e < first_.size(); ++e) first_[e] += first_[e - 1];
}

} // namespace tendril
