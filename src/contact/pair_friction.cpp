#include "tendril/contact/pair_friction.hpp"

#include <algorithm>

namespace tendril {

/// What a sample remembers, or null; where it was at the edge beside, for it slides along.
static const PairMemory *find(const std::vector<PairMemory> &memory, const SlidingPair &p) {
  const TouchingPair &pair = p.pair;
  const PairMemory *beside = nullptr;
  auto m = std::lower_bound(memory.begin(), memory.end(), pair.edge,
                            [](const PairMemory &one, int edge) { return one.edge < edge; });
  for (; m != memory.end() && m->edge == pair.edge; ++m) {
    if (m->to_rod != pair.to_rod || m->point != p.point.point) continue;
    if (m->to_edge == pair.to_edge) return &*m;
    if (pair.to_edge >= 0 && std::abs(m->to_edge - pair.to_edge) == 1) beside = &*m;
  }
  return beside;
}

void PairFriction::begin(const State &state, const Configuration &start, const Step &step) {
  start_ = &start;
  static_ = step.isStatic();
  time_ = slidingTime(state, step);
  for (std::size_t r = 0; r < of_.size() && slides_; ++r) {
    of_[r] = {};
    of_[r].holds = static_;
    if (!state.pairs.empty()) of_[r].before = state.pairs[r];
  }
}

void PairFriction::complete(SlidingPair *p) const {
  SlidingPoint &point = p->point;
  point.point = 2 * p->sample + p->side;
  point.coefficient = bothSlide(settingsOf(p->pair, 0), settingsOf(p->pair, 1)).friction;
  point.start = wayBetween(p->pair, p->side, p->own, p->other, *start_);
  const bool anchored = isAnchored(p->pair);
  if (!anchored && !holds(p->pair.rod)) return;
  const PairMemory *const found = find(of_[std::size_t(p->pair.rod)].before, *p);
  if (!found) return;
  point.held = found->friction;
  if (anchored) point.stick = found->stick - point.normal.dot(found->stick) * point.normal;
}

SlidingForce PairFriction::forceOn(const SlidingPair &p, bool holds, const Configuration &c) const {
  const ContactSettings both = bothSlide(settingsOf(p.pair, 0), settingsOf(p.pair, 1));
  return slidingForce(p.point, both, slidingOf(p, both, holds),
                      wayBetween(p.pair, p.side, p.own, p.other, c) - p.point.start);
}

/// Where a point slides, its anchor follows within the fall-off.
void PairFriction::commit(State &state, const Configuration &c, int r) const {
  if (!slides_) return;
  state.pairs.resize(scene_.rods.size());
  std::vector<PairMemory> &memory = state.pairs[std::size_t(r)];
  std::erase_if(memory, [&](const PairMemory &m) { return (m.edge >= 0 && m.to_edge >= 0) == of_rods_; });
  for (const SlidingPair &p : points(r)) {
    PairMemory m{p.pair.edge, p.pair.to_rod, p.pair.to_edge, p.point.point, Vec3::Zero(), -forceOn(p, c).gradient};
    if (isAnchored(p.pair)) {
      const ContactSettings both = bothSlide(settingsOf(p.pair, 0), settingsOf(p.pair, 1));
      const Vec3 way = wayBetween(p.pair, p.side, p.own, p.other, c) - p.point.start,
                 drawn = way - p.point.normal.dot(way) * p.point.normal + p.point.stick;
      m.stick = drawn * std::min(1.0, slidingOf(p, both, false).fall_off / std::max(drawn.norm(), 1e-300));
    }
    memory.push_back(m);
  }
  std::sort(memory.begin(), memory.end(), [](const PairMemory &a, const PairMemory &b) { return a.key() < b.key(); });
}

} // namespace tendril
