#pragma once
/// \file friction.hpp
/// Friction and damping of samples in contact. The normal force, the normal and the point of the surface that slides
/// are taken from an earlier iterate, so that what is left has a potential (Li et al. 2020, Incremental potential
/// contact, 5).

#include "tendril/contact/contact.hpp"
#include "tendril/energy/term.hpp"
#include "tendril/geometry/rotation.hpp"

#include <algorithm>

namespace tendril {

/// A sample that slides. Its point of the rod's surface is carried by the frames of edges, which friction turns.
struct SlidingPoint {
  EdgePoint rod;               ///< where it is on the rod
  int point = 0, collider = 0; ///< of samplePoints; of the scene
  double pressing;             ///< normal force [N]
  double coefficient;          ///< of friction
  Vec3 normal = Vec3::Zero();  ///< out of the obstacle, in the axes of the world
  Vec3 touched = Vec3::Zero(); ///< point of the obstacle, in its axes [m]
  Vec3 stick = Vec3::Zero();   ///< drawn from its anchor when the step began, in the axes of the world [m]
  Vec3 held = Vec3::Zero();    ///< friction on the rod when the step began, in the axes of the world [N]
  Vec3 start = Vec3::Zero();   ///< from that point to the rod's when the step began, in the axes of the world [m]
  SlidingPoint &slid() { return *this; }
  bool isSame(const SlidingPoint &b) const {
    return rod.slot() == b.rod.slot() && point == b.point && collider == b.collider;
  }
};

/// What a sample remembers, or null. \param memory of its rod, in the order of keys
const ContactMemory *find(const std::vector<ContactMemory> &memory, int edge, int collider, int point);

/// Over what points slide in a step.
struct Sliding {
  double fall_off;    ///< way below which friction falls off to zero [m]
  double time;        ///< that the step has taken; 0 in statics [s]
  bool holds = false; ///< whether nothing slides
};

/// That a step takes from a state [s]; where a method asks for the forces of its start, no time has gone, and its own
/// length counts. 0 in statics.
inline double slidingTime(const State &state, const Step &step) {
  return step.isStatic() ? 0 : step.time > state.time ? step.time - state.time : step.dt;
}

/// Rounds of a step, in each of which normal forces are taken anew.
struct SlidingRounds {
  bool swings = false; ///< whether they go to and fro, and are led to their middle
  int count = 0;
  double change = 0; ///< of friction in the last of them, of itself
  /// Takes note of another round. \return its change
  double add(double now) {
    constexpr double falls = 0.9;
    swings = swings || (++count > 2 && now > falls * change);
    return change = now;
  }
};

/// Derivatives by the place of the point.
struct SlidingForce {
  double value = 0; ///< [J]
  Vec3 gradient = Vec3::Zero();
  Mat3 hessian = Mat3::Zero();
};
/// Of a way u: normal force times coefficient times rho(|u across the normal, from the anchor|), with rho(u) =
/// u^2/a - u^3/(3 a^2) up to the fall-off a and u - a/3 beyond, docs/theory.md (17.6); and with dampings of the
/// contact, that force times damping/2 u^2 over the time (17.8). Where nothing slides (17.7), what held before and a
/// spring take the place of friction, which reaches `pressing` at the fall-off.
SlidingForce slidingForce(const SlidingPoint &point, const ContactSettings &settings, const Sliding &sliding,
                          const Vec3 &way);

/// What friction and damping two have between them: the geometric means count, docs/theory.md (19.3).
ContactSettings bothSlide(const ContactSettings &a, const ContactSettings &b);

/// Takes points as they touch now in place of those before, both in one order. Where rounds swing, they are led to the
/// middle. \param force_before that on a point of those before, now \return by which part that changes friction
template <class Point, class Force, class ForceBefore>
double renewSliding(std::vector<Point> &points, std::vector<Point> now, SlidingRounds &rounds, Force force_now,
                    ForceBefore force_before) {
  double change = 0, size = 0;
  auto next = points.begin();
  std::vector<double> pressed; // before, at the same points
  for (Point &p : now) {
    const Vec3 force = force_now(p).gradient;
    const auto found = std::find_if(next, points.end(), [&](const Point &old) { return old.isSame(p); });
    Vec3 before = Vec3::Zero();
    pressed.push_back(0);
    if (found != points.end()) {
      before = force_before(*found).gradient;
      pressed.back() = found->slid().pressing;
      next = found + 1;
    }
    size += std::max(p.slid().coefficient * p.slid().pressing, force.norm());
    change += (force - before).norm();
  }
  change = size > 0 ? change / size : 0;
  rounds.add(change);
  for (std::size_t k = 0; k < now.size() && rounds.swings; ++k)
    now[k].slid().pressing = 0.5 * (now[k].slid().pressing + pressed[k]);
  points = std::move(now);
  return change;
}
template <class Point, class Force>
double renewSliding(std::vector<Point> &points, std::vector<Point> now, SlidingRounds &rounds, Force force) {
  return renewSliding(points, std::move(now), rounds, force, force);
}

/// The way of a point since the step began, relative to the obstacle.
Vec3 wayOf(const SlidingPoint &point, const Configuration &c, const Collider::Pose &pose);

} // namespace tendril
