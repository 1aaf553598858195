#pragma once
/// \file pair_friction.hpp
/// Friction and damping of rods and bodies that touch each other, docs/theory.md, 19: (17.6) to (17.8) of what both
/// have, (19.3).

#include "tendril/contact/pair_derivatives.hpp"

#include <map>
#include <utility>

namespace tendril {

/// The samples that slide in a step, by the rods that have their pairs, and what they remember from step to step.
class PairFriction {
public:
  /// \param of_rods whether the pairs are those of two edges, or those with a body
  PairFriction(const Scene &scene, bool of_rods)
      : scene_(scene), of_rods_(of_rods), slides_(scene.slidesAmongMoving()), of_(scene.rods.size()) {}

  /// Begins a step without points. `start` stays in place until the next.
  void begin(const State &state, const Configuration &start, const Step &step);
  /// Whether there is any.
  bool acts() const { return slides_; }
  /// Whether points of a rod are held by springs, for it is not known yet what presses on them: at the start of a step
  /// of statics.
  bool holds(int rod) const { return of_[std::size_t(rod)].holds; }
  std::vector<SlidingPair> &points(int rod) { return of_[std::size_t(rod)].points; }
  const std::vector<SlidingPair> &points(int rod) const { return of_[std::size_t(rod)].points; }

  /// Force that presses on a sample, by its law there, or while points are held by the width of that.
  double pressing(const NormalLaw &law, double weight, double gap, const TouchingPair &pair) const {
    if (!holds(pair.rod)) return -weight * law(gap).slope;
    return bothOf(pair).friction * weight * law.stiffness() *
           (settingsOf(scene_, pair, 0).isBarrier() ? 1 : law.reach());
  }
  /// Enters what a point has from its pair and from the steps before.
  void complete(SlidingPair *p) const;
  SlidingForce forceOn(const SlidingPair &p, const Configuration &c) const { return forceOn(p, holds(p.pair.rod), c); }
  /// Takes the points of a rod anew, see Term::renew. \param find the points of the rod as it is now
  template <class Find> double renew(const Configuration &iterate, int rod, Find find) {
    if (!acts()) return 0;
    OfRod &of = of_[std::size_t(rod)];
    const bool held = std::exchange(of.holds, false);
    return renewSliding(
        of.points, find(), of.rounds, [&](const SlidingPair &p) { return forceOn(p, false, iterate); },
        [&](const SlidingPair &p) { return forceOn(p, held, iterate); });
  }
  /// See Term::commit.
  void commit(State &state, const Configuration &c, int rod) const;

private:
  struct OfRod {
    std::vector<SlidingPair> points;
    SlidingRounds rounds;
    bool holds = false;
    std::vector<PairMemory> before; ///< at the start of the step
  };
  const Scene &scene_;
  bool of_rods_, slides_, static_ = false;
  std::vector<OfRod> of_;
  mutable std::map<std::pair<int, int>, ContactSettings> both_; ///< by rods, or bodies as TouchingPair names them
  const Configuration *start_ = nullptr;
  double time_ = 0; ///< that the step takes; 0 in statics [s]

  const ContactSettings &bothOf(const TouchingPair &p) const;
  bool isAnchored(const TouchingPair &p) const {
    return settingsOf(scene_, p, 0).isAnchored(static_) && settingsOf(scene_, p, 1).isAnchored(static_);
  }
  Sliding slidingOf(const SlidingPair &p, bool holds) const {
    const bool by_length = static_ || isAnchored(p.pair);
    return {by_length ? p.both->slip_length : p.both->fall_off_velocity * time_, time_, holds};
  }
  SlidingForce forceOn(const SlidingPair &p, bool holds, const Configuration &c) const;
};

} // namespace tendril
