/// Contact of rods with obstacles: the energy of their samples by the normal law.
#include "tendril/contact/friction.hpp"

#include "tendril/coupling/couplings.hpp"
#include "tendril/coupling/stencil_term.hpp"
#include "tendril/energy/load.hpp"

#include <algorithm>

namespace tendril {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// That of the step that led to a state.
NormalLaw lawOf(const Scene &scene, const State &state, int r) {
  return {scene.rods[r].contact, state.contact_stiffness.empty() ? 0 : state.contact_stiffness[r]};
}

/// Sum of the momenta of the vertices of a rod, each relative to the obstacle nearest to it [kg m/s].
double momentumTowards(const Scene &scene, const Elements &elements, const RodContacts &contacts, const State &state,
                       double dt, int r) {
  const RodRange &rod = elements.rods[r];
  std::vector<std::array<Collider::Pose, 2>> poses;
  for (const Collider &collider : scene.colliders)
    poses.push_back({collider.poseAt(state.time), collider.poseAt(state.time + dt)});
  double sum = 0;
  for (int i = 0; i < rod.vertices; ++i) {
    const auto &[from, to] = poses[contacts.nearestTo(i)];
    const Vec3 &x = state.position[rod.first_vertex + i];
    const Vec3 moved = to.fromLocal(from.toLocal(x)) - x;
    sum += elements.mass()[rod.slot(i)] * (state.velocity[rod.first_vertex + i] - moved / dt).norm();
  }
  return sum;
}

/// Stiffness of the barrier of a rod [N/m]: ten times its weight per length, or where it has more to bear as much as
/// keeps surfaces within the barrier; a power of four.
double barrierStiffness(const Scene &scene, const Elements &elements, double force, double pressure, int r) {
  const Rod &rod = scene.rods[r];
  const double length = elements.length(r);
  double wanted = std::max(force / (20 * rod.contact.radius), 0.1 * pressure);
  if (rod.gravity) wanted = std::max(wanted, 10 * rod.material.linear_density * scene.gravity.norm());
  // Nothing pulls: what bends it by its own length.
  if (wanted == 0) {
    const auto [k1, k2] = rod.material.flexural_stiffness;
    const double stiffness = std::max({k1, k2, 1e-4 * rod.material.axial_stiffness * length * length});
    wanted = stiffness / (length * length * length);
  }
  return std::pow(4.0, std::ceil(std::log2(wanted) / 2));
}

class Contact final : public Term {
public:
  Contact(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements) {
    for (int r = 0; r < int(scene.rods.size()); ++r)
      of_.push_back(scene.touches(r) ? std::make_unique<RodContacts>(scene, elements, r) : nullptr);
    sliding_.resize(of_.size());
  }

  void beginStep(const State &state, const Configuration &start, const Step &step, int r) override {
    if (!of_[r]) return;
    RodContacts &rod = *of_[r];
    rod.look(start, true);
    const ContactSettings &settings = scene_.rods[r].contact;
    if (settings.slides()) beginSliding(state, start, step, r);
    if (!settings.isBarrier()) return;
    double stiffness = settings.stiffness;
    if (stiffness == 0) {
      const double before = state.contact_stiffness.empty() ? 0 : state.contact_stiffness[r];
      rod.setStiffness(before);
      const double pressure = before > 0 ? largestPressure(rod, start) : 0;
      // A barrier that grew while it is pressed would throw the rod off.
      constexpr double bearable = 100;
      if (!step.isStatic() && pressure > 0 && pressure <= bearable * before)
        stiffness = before;
      else {
        double force = loadScale(scene_, r, elements_.length(r));
        if (!step.isStatic()) force += momentumTowards(scene_, elements_, rod, state, step.dt, r) / step.dt;
        stiffness = barrierStiffness(scene_, elements_, force, pressure, r);
      }
    }
    rod.setStiffness(stiffness);
  }
  void moveIterate(const Configuration &iterate, int r) override {
    if (of_[r]) of_[r]->look(iterate, false);
  }
  bool couplesPositions() const override { return true; }
  bool joinsPositions() const override {
    return std::any_of(scene_.rods.begin(), scene_.rods.end(), [](const Rod &rod) { return carriesSurface(rod); });
  }
  bool roundsAsStrains() const override { return false; }

  double freeFraction(const Configuration &from, const Configuration &to, int r) const override {
    return of_[r] ? of_[r]->freeFraction(from, to) : 1;
  }
  double energy(const Configuration &c, int r) const override {
    double sum = 0;
    if (!of_[r]) return sum;
    const RodContacts &rod = *of_[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      sum += rod.weight(samples, k) * rod.law()(samples.distance[k]).value;
    });
    for (const SlidingPoint &point : sliding_[r].points) sum += forceOn(point, c, r).value;
    return sum;
  }
  double noise(const Configuration &c, int r, double) const override {
    double sum = 0;
    if (!of_[r]) return sum;
    const RodContacts &rod = *of_[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const Vec3 x = c.positionAt(samples.slot[k]);
      sum += rod.weight(samples, k) * std::abs(rod.law()(samples.distance[k]).slope) * 4 * epsilon * x.norm();
    });
    return sum;
  }
  void addDerivatives(const Configuration &c, int r, Derivatives &out, HessianKind kind) const override {
    if (!of_[r]) return;
    const RodContacts &rod = *of_[r];
    const BlockPlanes blocks(out.blocks, elements_.rods[r]);
    const BlockPlanes *wanted = kind == HessianKind::none ? nullptr : &blocks;
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const ContactPoint point = contactPoint(scene_, rod, samples, k);
      const Mat3 h = kind == HessianKind::gauss_newton ? point.stiffness : Mat3(point.stiffness + point.curvature);
      addOnAxis(point.at, samples.slot[k], -point.force, h, wanted, out);
    });
    for (const SlidingPoint &point : sliding_[r].points) addSliding(point, forceOn(point, c, r), c, wanted, out);
  }
  void addObstacleMotion(const Configuration &c, double time, int r, Planes &out) const override {
    if (!of_[r]) return;
    const RodContacts &rod = *of_[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const Collider &collider = scene_.colliders[samples.collider];
      if (!collider.motion.moves()) return;
      const ContactPoint point = contactPoint(scene_, rod, samples, k);
      const Vec3 moved = collider.poseAt(time).fromLocal(samples.at(k)) - samples.pose.fromLocal(samples.at(k));
      spread(point.at, samples.slot[k], -(point.stiffness + point.curvature) * moved, out);
    });
  }
  std::array<Vec3, 2> actionOfObstacle(int collider, const Configuration &c, int r) const override {
    std::array<Vec3, 2> action{Vec3::Zero(), Vec3::Zero()};
    if (!of_[r]) return action;
    const RodContacts &rod = *of_[r];
    const Mat3 rotation = scene_.colliders[collider].poseAt(c.obstacleTime(r)).rotation;
    auto add = [&](const Vec3 &force, const Vec3 &local) {
      action[0] += force;
      action[1] += (rotation * local).cross(force);
    };
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      if (samples.collider == collider) add(contactPoint(scene_, rod, samples, k).force, samples.at(k));
    });
    for (const SlidingPoint &point : sliding_[r].points)
      if (point.collider == collider) add(-forceOn(point, c, r).gradient, point.touched);
    return action;
  }
  double renew(const Configuration &iterate, int r) override {
    if (!of_[r] || !scene_.rods[r].contact.slides()) return 0;
    OfSliding &sliding = sliding_[r];
    std::vector<SlidingPoint> now = slidingPoints(iterate, of_[r]->law(), r);
    double change = 0, size = 0;
    auto same = [](const SlidingPoint &a, const SlidingPoint &b) {
      return a.slot == b.slot && a.point == b.point && a.collider == b.collider;
    };
    std::size_t next = 0; // both lists are in one order
    for (const SlidingPoint &point : now) {
      const SlidingForce force = forceOn(point, iterate, r);
      size += std::max(point.coefficient * point.pressing, force.gradient.norm());
      const auto found = std::find_if(sliding.points.begin() + next, sliding.points.end(),
                                      [&](const SlidingPoint &old) { return same(old, point); });
      Vec3 before = Vec3::Zero();
      if (found != sliding.points.end()) {
        before = forceOn(*found, iterate, r).gradient;
        next = std::size_t(found - sliding.points.begin()) + 1;
      }
      change += (force.gradient - before).norm();
    }
    sliding.points = std::move(now);
    return size > 0 ? change / size : 0;
  }
  void addEnergies(const State &state, const Configuration &c, double, int r, EnergyBudget &out) const override {
    if (!of_[r]) return;
    const RodContacts &rod = *of_[r];
    const NormalLaw law = lawOf(scene_, state, r);
    rod.visitTouching(c, law, [&](const Samples &samples, int k) {
      out.contact += rod.weight(samples, k) * law(samples.distance[k]).value;
    });
  }
  double smallestGap(const Configuration &c, int r) const override {
    return of_[r] ? of_[r]->smallestGap(c) : HUGE_VAL;
  }
  void commit(State &state, int r) const override {
    if (state.contact_stiffness.empty()) state.contact_stiffness.assign(scene_.rods.size(), 0);
    if (of_[r]) state.contact_stiffness[r] = of_[r]->law().stiffness();
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  std::vector<std::unique_ptr<RodContacts>> of_; ///< per rod
  struct OfSliding {
    std::vector<SlidingPoint> points;
    Sliding sliding;
    const Configuration *start = nullptr;
  };
  std::vector<OfSliding> sliding_; ///< per rod

  /// Whether friction acts at the surface of a rod, whose frames it turns; cables have none.
  static bool carriesSurface(const Rod &rod) {
    return rod.contact.on && rod.contact.slides() && rod.contact.friction_at_surface && !rod.material.isCable();
  }

  /// Force per length of the sample that is pressed most, by the law that is set [N/m].
  static double largestPressure(const RodContacts &rod, const Configuration &c) {
    double most = 0;
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      most = std::max(most, -rod.law()(samples.distance[k]).slope);
    });
    return most;
  }

  SlidingForce forceOn(const SlidingPoint &point, const Configuration &c, int r) const {
    const Collider::Pose pose = scene_.colliders[point.collider].poseAt(c.obstacleTime(r));
    return slidingForce(point, scene_.rods[r].contact, sliding_[r].sliding, wayOf(point, c, pose));
  }

  void beginSliding(const State &state, const Configuration &start, const Step &step, int r) {
    const ContactSettings &settings = scene_.rods[r].contact;
    // Where a method asks for the forces of its start, no time has gone.
    const double time = step.isStatic() ? 0 : step.time > state.time ? step.time - state.time : step.dt;
    OfSliding &sliding = sliding_[r];
    sliding.sliding = {step.isStatic() ? settings.slip_length : settings.fall_off_velocity * time, time};
    sliding.start = &start;
    sliding.points = slidingPoints(start, lawOf(scene_, state, r), r);
  }

  /// What touches at a configuration, by a law.
  std::vector<SlidingPoint> slidingPoints(const Configuration &c, const NormalLaw &law, int r) const {
    const Rod &rod = scene_.rods[r];
    const RodContacts &contacts = *of_[r];
    const Configuration &start = *sliding_[r].start;
    std::vector<SlidingPoint> points;
    contacts.visitTouching(c, law, [&](const Samples &samples, int k) {
      const double force = -contacts.weight(samples, k) * law(samples.distance[k]).slope;
      if (!(force > 0)) return;
      const ContactPoint contact = contactPoint(scene_, contacts, samples, k);
      const Collider &collider = scene_.colliders[samples.collider];
      SlidingPoint point{};
      point.slot = samples.slot[k];
      point.point = samples.point[k];
      point.collider = samples.collider;
      point.at = contact.at;
      point.pressing = force;
      point.coefficient =
          collider.friction < 0 ? rod.contact.friction : std::sqrt(rod.contact.friction * collider.friction);
      point.normal = contact.normal;
      point.touched = samples.at(k);
      if (carriesSurface(rod)) {
        point.touched -= rod.contact.radius * (samples.pose.rotation.transpose() * contact.normal);
        point.arm = -rod.contact.radius * (matrixOf(c.frameAt(point.slot)).transpose() * contact.normal);
      }
      point.start = wayOf(point, start, collider.poseAt(start.obstacleTime(r)));
      points.push_back(point);
    });
    return points;
  }
};

} // namespace

ContactPoint contactPoint(const Scene &scene, const RodContacts &rod, const Samples &samples, int k) {
  const Distance d = scene.colliders[samples.collider].shape->at(samples.at(k));
  const GapLaw law = rod.law()(samples.distance[k]);
  const double weight = rod.weight(samples, k);
  const Mat3 &q = samples.pose.rotation;
  ContactPoint point;
  point.at = rod.points(samples.collider)[samples.point[k]].at;
  point.normal = q * d.gradient;
  point.force = -weight * law.slope * point.normal;
  point.stiffness = weight * law.curvature * point.normal * point.normal.transpose();
  point.curvature = weight * law.slope * (q * d.hessian * q.transpose());
  return point;
}

std::vector<Vec3> contactForces(const Scene &scene, const Elements &elements, const State &state,
                                const Configuration &c) {
  std::vector<Vec3> force(elements.vertices(), Vec3::Zero());
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    if (!scene.touches(r)) continue;
    RodContacts rod(scene, elements, r);
    if (!state.contact_stiffness.empty()) rod.setStiffness(state.contact_stiffness[r]);
    rod.look(c, true);
    const RodRange &range = elements.rods[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const ContactPoint point = contactPoint(scene, rod, samples, k);
      const int i = samples.slot[k] - range.first_slot;
      force[range.first_vertex + i] += (1 - point.at) * point.force;
      force[range.first_vertex + (i + 1) % range.vertices] += point.at * point.force;
    });
  }
  return force;
}

std::vector<Touch> tightest(const Scene &scene, const Elements &elements, const Configuration &c) {
  std::vector<Touch> found;
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    if (!scene.touches(r)) continue;
    RodContacts rod(scene, elements, r);
    rod.look(c, true);
    std::vector<Touch> of_rod(scene.colliders.size());
    rod.visitNear(c, nullptr, [&](const Samples &samples) {
      for (int k = 0; k < samples.count; ++k) {
        Touch &worst = of_rod[samples.collider];
        if (samples.distance[k] >= worst.gap) continue;
        const double at = rod.points(samples.collider)[samples.point[k]].at;
        double arc = 0;
        for (int s = elements.rods[r].first_slot; s < samples.slot[k]; ++s) arc += elements.restLength()[s];
        worst = {r, samples.collider, samples.distance[k], arc + at * elements.restLength()[samples.slot[k]]};
      }
    });
    std::copy_if(of_rod.begin(), of_rod.end(), std::back_inserter(found), [](const Touch &t) { return t.rod >= 0; });
  }
  std::stable_sort(found.begin(), found.end(), [](const Touch &a, const Touch &b) { return a.gap < b.gap; });
  return found;
}

std::unique_ptr<Term> makeContact(const Scene &scene, const Elements &elements) {
  if (scene.colliders.empty()) return nullptr;
  return std::make_unique<Contact>(scene, elements);
}

} // namespace tendril
