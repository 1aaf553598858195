#include "tendril/contact/pair_friction.hpp"

#include <algorithm>

namespace tendril {

/// What a sample remembers, or null; where it was at the edge beside, for it slides along.
static const PairMemory *find(const std::vector<PairMemory> &memory, const SlidingPair &p) {
  const int edge = p.pair.edgeOf(p.side), to_rod = p.pair.rodOf(1 - p.side), to_edge = p.pair.edgeOf(1 - p.side);
  const PairMemory *beside = nullptr;
  auto m =
      std::lower_bound(memory.begin(), memory.end(), edge, [](const PairMemory &one, int of) { return one.edge < of; });
  for (; m != memory.end() && m->edge == edge; ++m) {
    if (m->to_rod != to_rod || m->point != p.sample) continue;
    if (m->to_edge == to_edge) return &*m;
    if (to_edge >= 0 && std::abs(m->to_edge - to_edge) == 1) beside = &*m;
  }
  return beside;
}

/// From the point of the other to that of the sample.
static Vec3 wayOf(const SlidingPair &p, const Configuration &c) {
  if (!p.skin) return wayBetween(p.pair, p.side, p.own, p.other, c);
  const std::size_t to = std::size_t(2 - 2 * p.side); // of the body's position
  return placeOf(*p.skin, c) - c.positionAt(p.pair.slot[to]) - armOf(p.pair, 1 - p.side, p.other, c);
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

const ContactSettings &PairFriction::bothOf(const TouchingPair &p) const {
  const std::pair<int, int> key = p.things();
  auto found = both_.find(key);
  if (found == both_.end())
    found = both_.emplace(key, bothSlide(settingsOf(scene_, p, 0), settingsOf(scene_, p, 1))).first;
  return found->second;
}

void PairFriction::complete(SlidingPair *p) const {
  SlidingPoint &point = p->point;
  p->both = &bothOf(p->pair);
  point.coefficient = p->both->friction;
  point.start = wayOf(*p, *start_);
  const bool anchored = isAnchored(p->pair);
  if (!anchored && !holds(p->pair.rod)) return;
  const PairMemory *const found = find(of_[std::size_t(p->pair.rodOf(p->side))].before, *p);
  if (!found) return;
  point.held = found->friction;
  if (anchored) point.stick = found->stick - point.normal.dot(found->stick) * point.normal;
}

SlidingForce PairFriction::forceOn(const SlidingPair &p, bool holds, const Configuration &c) const {
  return slidingForce(p.point, *p.both, slidingOf(p, holds), wayOf(p, c) - p.point.start);
}

/// Where a point slides, its anchor follows within the fall-off. A rod has pairs with those before it, which have
/// forgotten what was before them already.
void PairFriction::commit(State &state, const Configuration &c, int r) const {
  if (!slides_) return;
  state.pairs.resize(scene_.rods.size());
  std::erase_if(state.pairs[std::size_t(r)],
                [&](const PairMemory &m) { return (m.edge >= 0 && m.to_edge >= 0) == of_rods_; });
  for (const SlidingPair &p : points(r)) {
    PairMemory m{p.pair.edgeOf(p.side), p.pair.rodOf(1 - p.side), p.pair.edgeOf(1 - p.side), p.sample,
                 Vec3::Zero(),          -forceOn(p, c).gradient};
    if (isAnchored(p.pair)) {
      const Vec3 way = wayOf(p, c) - p.point.start,
                 drawn = way - p.point.normal.dot(way) * p.point.normal + p.point.stick;
      m.stick = drawn * std::min(1.0, slidingOf(p, false).fall_off / std::max(drawn.norm(), 1e-300));
    }
    std::vector<PairMemory> &memory = state.pairs[std::size_t(p.pair.rodOf(p.side))];
    memory.insert(std::upper_bound(memory.begin(), memory.end(), m,
                                   [](const PairMemory &a, const PairMemory &b) { return a.key() < b.key(); }),
                  m);
  }
}

} // namespace tendril
