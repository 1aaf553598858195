/// Contact of rods with obstacles: the energy of their samples by the normal law.
#include "tendril/contact/friction.hpp"

#include "tendril/coupling/couplings.hpp"
#include "tendril/coupling/stencil_term.hpp"
#include "tendril/energy/load.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Sum of the momenta of the vertices of a rod towards the obstacles that they may meet in the step [kg m/s].
double momentumTowards(const Scene &scene, const Elements &elements, const RodContacts &contacts, const State &state,
                       double dt, int r) {
  const RodRange &rod = elements.rods[r];
  std::vector<std::array<Collider::Pose, 2>> poses;
  for (const Collider &collider : scene.colliders)
    poses.push_back({collider.poseAt(state.time), collider.poseAt(state.time + dt)});
  double sum = 0;
  for (int i = 0; i < rod.vertices; ++i) {
    const Vec3 &x = state.position[rod.first_vertex + i];
    double towards = 0;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const auto &[from, to] = poses[k];
      const Vec3 local = from.toLocal(x), way = state.velocity[rod.first_vertex + i] * dt - (to.fromLocal(local) - x);
      if (contacts.mayMeet(i, int(k), way.norm()))
        towards = std::max(towards, -way.dot(from.rotation * scene.colliders[k].shape->at(local).gradient));
    }
    sum += elements.mass()[rod.slot(i)] * towards / dt;
  }
  return sum;
}

/// Sum of the loads on a rod [N].
Vec3 resultantLoad(const Scene &scene, const Elements &elements, int r, double length) {
  const Rod &rod = scene.rods[r];
  Vec3 sum = rod.gravity ? Vec3(rod.material.linear_density * length * scene.gravity) : Vec3(Vec3::Zero());
  for (const int k : elements.forcesOf(r)) sum += scene.forces[k].force;
  return sum;
}

class Contact final : public Term {
public:
  Contact(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements) {
    for (int r = 0; r < int(scene.rods.size()); ++r)
      of_.push_back(scene.touches(r) ? std::make_unique<RodContacts>(scene, elements, r) : nullptr);
    sliding_.resize(of_.size());
    slides_ = scene.slides();
  }

  void beginStep(const State &state, const Configuration &start, const Step &step, int r) override {
    if (!of_[r]) return;
    RodContacts &rod = *of_[r];
    rod.look(start, true);
    const ContactSettings &settings = scene_.rods[r].contact;
    if (settings.isBarrier()) setStiffness(state, start, step, r);
    if (settings.slides()) beginSliding(state, start, step, r);
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
      addAt(point.rod, -point.force, h, kind != HessianKind::gauss_newton, c, wanted, out);
    });
    for (const SlidingPoint &point : sliding_[r].points) {
      const SlidingForce force = forceOn(point, c, r);
      addAt(point.rod, force.gradient, force.hessian, true, c, wanted, out);
    }
  }
  std::array<double, 2> pressure(const Configuration &c, const Planes &increment, int r) const override {
    std::array<double, 2> sum{0, 0};
    if (!of_[r]) return sum;
    const RodContacts &rod = *of_[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const ContactPoint point = contactPoint(scene_, rod, samples, k);
      sum[0] += point.force.norm();
      sum[1] += (point.stiffness * motionOf(point.rod, c, increment)).norm();
    });
    return sum;
  }
  void addObstacleMotion(const Configuration &c, double time, int r, Planes &out) const override {
    if (!of_[r]) return;
    const RodContacts &rod = *of_[r];
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const Collider &collider = scene_.colliders[samples.collider];
      if (!collider.motion.moves()) return;
      const ContactPoint point = contactPoint(scene_, rod, samples, k);
      const Vec3 moved = collider.poseAt(time).fromLocal(samples.at(k)) - samples.pose.fromLocal(samples.at(k));
      spread(point.rod, -(point.stiffness + point.curvature) * moved, c, out);
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
    const Sliding before = sliding.sliding;
    sliding.sliding.holds = false;
    return renewSliding(
        sliding.points, slidingPoints(iterate, of_[r]->law(), r), sliding.rounds,
        [&](const SlidingPoint &point) { return forceOn(point, iterate, r); },
        [&](const SlidingPoint &point) { return forceOn(point, before, iterate, r); });
  }
  void addEnergies(const State &state, const Configuration &c, double, int r, EnergyBudget &out) const override {
    if (!of_[r]) return;
    const RodContacts &rod = *of_[r];
    const NormalLaw law = lawOf(state, r);
    rod.visitTouching(c, law, [&](const Samples &samples, int k) {
      out.contact += rod.weight(samples, k) * law(samples.distance[k]).value;
    });
  }
  double smallestGap(const Configuration &c, int r) const override {
    return of_[r] ? of_[r]->smallestGap(c) : HUGE_VAL;
  }
  void commit(State &state, const Configuration &c, int r) const override {
    if (state.contact_stiffness.empty()) state.contact_stiffness.assign(scene_.rods.size(), 0);
    if (of_[r] && scene_.rods[r].contact.isBarrier()) state.contact_stiffness[r] = of_[r]->law().stiffness();
    if (!slides_) return;
    state.contacts.resize(scene_.rods.size());
    state.contacts[r].clear();
    for (const SlidingPoint &point : sliding_[r].points) state.contacts[r].push_back(memoryOf(point, c, r));
    std::sort(state.contacts[r].begin(), state.contacts[r].end(),
              [](const ContactMemory &a, const ContactMemory &b) { return a.key() < b.key(); });
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  std::vector<std::unique_ptr<RodContacts>> of_; ///< per rod
  struct OfSliding {
    std::vector<SlidingPoint> points;
    Sliding sliding;
    const Configuration *start = nullptr;
    bool anchored = false;
    SlidingRounds rounds;
    std::vector<ContactMemory> before; ///< at the start of the step
  };
  bool slides_ = false;
  std::vector<OfSliding> sliding_; ///< per rod

  /// That of the step that led to a state; of the first step where none has.
  NormalLaw lawOf(const State &state, int r) const {
    if (state.contact_stiffness.empty()) return of_[r]->law();
    return {scene_.rods[r].contact, state.contact_stiffness[r]};
  }

  void setStiffness(const State &state, const Configuration &start, const Step &step, int r) {
    RodContacts &rod = *of_[r];
    double stiffness = scene_.rods[r].contact.stiffness;
    if (stiffness == 0) {
      const double before = state.contact_stiffness.empty() ? 0 : state.contact_stiffness[r];
      rod.setStiffness(before);
      const double pressure = before > 0 ? largestPressure(rod, start) : 0;
      // A barrier that grew while it is pressed would throw the rod off.
      constexpr double bearable = 1e4;
      if (!step.isStatic() && pressure > 0 && pressure <= bearable * before)
        stiffness = before;
      else {
        const double length = elements_.length(r);
        double force = loadScale(scene_, elements_, r, length);
        const double stopping =
            step.isStatic() ? 0 : momentumTowards(scene_, elements_, rod, state, step.dt, r) / step.dt;
        force += stopping;
        stiffness =
            barrierStiffness(scene_, elements_, force, pressure, step.isStatic(), r, scene_.rods[r].contact.on_surface);
        if (!step.isStatic() && before == 0) { // what is drawn touching is not thrown off
          rod.setStiffness(stiffness);
          stiffness *= partBorne(rod, start, resultantLoad(scene_, elements_, r, length), stopping);
        }
      }
    }
    rod.setStiffness(stiffness);
  }

  /// Force per length of the sample that is pressed most, by the law that is set [N/m].
  static double largestPressure(const RodContacts &rod, const Configuration &c) {
    double most = 0;
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      most = std::max(most, -rod.law()(samples.distance[k]).slope);
    });
    return most;
  }

  /// Part of the forces of the law that is set which the loads of a rod, and what stops it, press against; at least a
  /// thousandth, at most all.
  double partBorne(const RodContacts &rod, const Configuration &c, const Vec3 &load, double stopping) const {
    constexpr double least = 1e-3;
    Vec3 resultant = Vec3::Zero();
    double pressed = 0;
    rod.visitTouching(c, rod.law(), [&](const Samples &samples, int k) {
      const Vec3 force = contactPoint(scene_, rod, samples, k).force;
      resultant += force;
      pressed += force.norm();
    });
    if (pressed == 0) return 1;
    // Where it is wound round an obstacle, its forces cancel and loads press against them from all sides.
    const double size = resultant.norm(), against = size > 0 ? -load.dot(resultant) / size : 0,
                 around = load.norm() * (1 - size / pressed);
    return std::clamp((std::max(around, against) + stopping) / pressed, least, 1.0);
  }

  SlidingForce forceOn(const SlidingPoint &point, const Configuration &c, int r) const {
    return forceOn(point, sliding_[r].sliding, c, r);
  }
  SlidingForce forceOn(const SlidingPoint &point, const Sliding &sliding, const Configuration &c, int r) const {
    const Collider::Pose pose = scene_.colliders[point.collider].poseAt(c.obstacleTime(r));
    return slidingForce(point, scene_.rods[r].contact, sliding, wayOf(point, c, pose));
  }

  void beginSliding(const State &state, const Configuration &start, const Step &step, int r) {
    const ContactSettings &settings = scene_.rods[r].contact;
    const double time = slidingTime(state, step);
    OfSliding &sliding = sliding_[r];
    sliding.anchored = settings.isAnchored(step.isStatic());
    sliding.rounds = {};
    sliding.sliding = {sliding.anchored || step.isStatic() ? settings.slip_length : settings.fall_off_velocity * time,
                       time};
    sliding.start = &start;
    if (state.contacts.empty())
      sliding.before.clear();
    else
      sliding.before = state.contacts[r];
    sliding.sliding.holds = step.isStatic(); // until it is known what presses, or loads of later would find no friction
    sliding.points = slidingPoints(start, lawOf(state, r), r);
  }

  /// What a point remembers. Where it slides, its anchor follows within the fall-off.
  ContactMemory memoryOf(const SlidingPoint &point, const Configuration &c, int r) const {
    const OfSliding &sliding = sliding_[r];
    const Collider::Pose pose = scene_.colliders[point.collider].poseAt(c.obstacleTime(r));
    const Vec3 way = wayOf(point, c, pose);
    ContactMemory memory{point.rod.slot() - elements_.rods[r].first_slot, point.point, point.collider, Vec3::Zero(),
                         -slidingForce(point, scene_.rods[r].contact, sliding.sliding, way).gradient};
    if (!sliding.anchored) return memory;
    const Vec3 drawn = way - point.normal.dot(way) * point.normal + point.stick;
    memory.stick =
        pose.rotation.transpose() * drawn * std::min(1.0, sliding.sliding.fall_off / std::max(drawn.norm(), 1e-300));
    return memory;
  }
  /// Adds what a point remembers from before the step.
  void recall(SlidingPoint *point, const Mat3 &rotation, int r) const {
    const OfSliding &sliding = sliding_[r];
    const ContactMemory *found =
        find(sliding.before, point->rod.slot() - elements_.rods[r].first_slot, point->collider, point->point);
    if (!found) return;
    point->held = found->friction;
    if (!sliding.anchored) return;
    const Vec3 drawn = rotation * found->stick;
    point->stick = drawn - point->normal.dot(drawn) * point->normal;
  }

  /// What touches at a configuration, by a law.
  std::vector<SlidingPoint> slidingPoints(const Configuration &c, const NormalLaw &law, int r) const {
    const Rod &rod = scene_.rods[r];
    const RodContacts &contacts = *of_[r];
    const Configuration &start = *sliding_[r].start;
    std::vector<SlidingPoint> points;
    contacts.visitTouching(c, law, [&](const Samples &samples, int k) {
      const double slope = law(samples.distance[k]).slope;
      const bool holds = sliding_[r].sliding.holds;
      if (!(slope < 0 || holds)) return;
      const ContactPoint contact = contactPoint(scene_, contacts, samples, k);
      const double steep = contact.normal.norm(); // not 1 where distances are interpolated
      const Vec3 normal = contact.normal / steep;
      const Collider &collider = scene_.colliders[samples.collider];
      SlidingPoint point{};
      point.rod = contact.rod;
      point.point = samples.point[k];
      point.collider = samples.collider;
      point.pressing = -contacts.weight(samples, k) * slope * steep;
      point.coefficient =
          collider.friction < 0 ? rod.contact.friction : std::sqrt(rod.contact.friction * collider.friction);
      point.normal = normal;
      point.touched = samples.at(k);
      if (carriesSurface(rod) && !rod.contact.on_surface) {
        point.touched -= rod.contact.radius * (samples.pose.rotation.transpose() * normal);
        point.rod.by[0].point.arm = -rod.contact.radius * (matrixOf(c.frameAt(samples.slot[k])).transpose() * normal);
      }
      recall(&point, samples.pose.rotation, r);
      if (holds) // as if it were pressed by the width of its law
        point.pressing = point.coefficient * contacts.weight(samples, k) * law.stiffness() *
                         (rod.contact.isBarrier() ? 1 : law.reach());
      point.start = wayOf(point, start, collider.poseAt(start.obstacleTime(r)));
      points.push_back(point);
    });
    return points;
  }
};

} // namespace

std::unique_ptr<Term> makeContact(const Scene &scene, const Elements &elements) {
  if (scene.colliders.empty()) return nullptr;
  return std::make_unique<Contact>(scene, elements);
}

} // namespace tendril
