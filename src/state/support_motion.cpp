#include "tendril/state/support_motion.hpp"

#include "tendril/geometry/rotation.hpp"

#include <limits>

namespace tendril {

using C = Configuration;

SupportMotion::SupportMotion(const Scene &scene, const DofMap &dofs, const Elements &elements)
    : scene_(scene), dofs_(dofs), elements_(elements), moving_(elements.rods.size()), turned_(elements.rods.size()) {
  for (std::size_t s = 0; s < scene.supports.size(); ++s)
    if (scene.supports[s].motion.moves()) moving_[scene.supports[s].rod].push_back(int(s));
  for (std::size_t k = 0; k < scene.constraints.size(); ++k)
    if (scene.constraints[k].motion.moves()) {
      moving_targets_.resize(elements.rods.size());
      moving_targets_[scene.constraints[k].rod].push_back(int(k));
    }
  for (std::size_t k = 0; k < scene.joints.size(); ++k)
    if (scene.joints[k].motion.moves() || scene.joints[k].target_motion.moves()) moving_joints_.push_back(int(k));
  for (std::size_t k = 0; k < scene.tendons.size(); ++k)
    if (scene.tendons[k].isMoved()) moving_tendons_.push_back(int(k));
}

void SupportMotion::turn(const Configuration &from, double from_time, double to_time) {
  beyond_barrier_.clear();
  from_time_ = from_time;
  to_time_ = to_time;
  for (std::size_t r = 0; r < moving_.size(); ++r) {
    turned_[r].clear();
    for (const int s : moving_[r]) {
      const int slot = elements_.support_slot[s];
      const Motion &motion = scene_.supports[s].motion;
      if (slot < 0) continue;
      Turned turned{slot, 0.0, from.frameAt(slot)};
      for (const double time : motion.stopsBetween(from_time, to_time)) {
        const Frame now = supportFrame(scene_.supports[s], time);
        turned.angle += halfAngleBetween(turned.end, now).angle();
        turned.end = now;
      }
      turned_[r].push_back(turned);
    }
  }
}

/// In parts, so that none passes half a turn unseen.
void SupportMotion::followTarget(int k, Configuration &iterate) {
  const Constraint &c = scene_.constraints[k];
  const int slot = elements_.constraint_slot[k];
  const bool jumps = !c.isPin() && c.measure == Constraint::Measure::angle;
  const Frame edge = iterate.frameAt(elements_.rods[c.rod].slot(c.at));
  Vec3 before = jumps ? rotationBetween(iterate.frameAt(slot), edge) : Vec3(Vec3::Zero());
  for (const double time : jumps ? c.motion.stopsBetween(from_time_, to_time_) : std::vector<double>()) {
    const Vec3 now = rotationBetween(c.frameAt(time), edge);
    if (jumpsBetween(before, now))
      beyond_barrier_ = "constraint '" + c.name +
                        "' is turned by more than half a turn from its edge; take shorter steps, or measure: sine";
    before = now;
  }
  setTarget(c, slot, to_time_, iterate);
}

void SupportMotion::follow(int r, Configuration &iterate) {
  if (!moving_targets_.empty())
    for (const int k : moving_targets_[r]) followTarget(k, iterate);
  for (const int k : moving_joints_)
    if (scene_.joints[k].rod == r) setTarget(scene_.joints[k], elements_.pairOf(k), to_time_, iterate);
  for (const int k : moving_tendons_)
    if (scene_.tendons[k].rod == r) setTarget(scene_.tendons[k], elements_.tendon_slot[k], to_time_, iterate);
  if (turned_[r].empty()) return;
  for (const Turned &turned : turned_[r]) iterate.setFrame(turned.slot, turned.end);
  auto turning = [&](int frame) {
    for (const Turned &turned : turned_[r])
      if (turned.slot == frame) return turned.angle;
    return 0.0;
  };
  forCells(elements_, r, [&]<class T>(const LooseCell &cells, int count) {
    for (int l = 0; l < count; ++l) {
      const LooseCell cell{cells.slot + l, cells.frame0 + l, cells.frame1 + l, cells.vertex + l};
      double &twist = iterate[C::twist][cell.slot], &turns = iterate[C::winding][cell.slot];
      const double expected = twist + turning(cell.frame1) - turning(cell.frame0);
      const double principal = halfAngleBetween(iterate.frameAt(cell.frame0), iterate.frameAt(cell.frame1)).angle();
      turns = 2 * pi * std::round((expected - principal) / (2 * pi));
      twist = principal + turns;
      if (elements_.measure[r] == Measure::tan && turns != 0)
        beyond_barrier_ =
            "a support turns past the barrier of measure tan at 180 degrees of twist per vertex; use more "
            "edges, or measure: angle";
    }
  });
}

bool SupportMotion::remaining(const Configuration &iterate, double time, RodSet rods, Planes &increment) const {
  bool any = false;
  for (int r = rods.begin; r < rods.end; ++r)
    for (const int k : moving_[r]) {
      const Support &s = scene_.supports[k];
      if (!s.holdsPosition()) continue;
      const RodRange &rod = elements_.rods[r];
      const int slot = rod.slot(s.vertex);
      const Vec3 target = scene_.rods[r].position[s.vertex] + s.motion.displacementAt(time);
      Vec3 d = (target - iterate.positionAt(slot)) - iterate.values().vector(C::position_low, slot);
      if (d.norm() <= 4 * epsilon * target.norm()) d.setZero();
      any = any || !d.isZero(0);
      increment.setVector(0, slot, d);
      dofs_.copyBehindRing(rod, increment);
    }
  return any;
}

} // namespace tendril
