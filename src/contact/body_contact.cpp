/// Contact of rigid bodies with obstacles, at samples of their surfaces.
#include "tendril/contact/body_samples.hpp"
#include "tendril/contact/friction.hpp"
#include "tendril/coupling/couplings.hpp"
#include "tendril/state/spin_stage.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// A sample that may touch an obstacle. \see Samples
struct Near {
  int sample, collider;
  double distance; ///< between surfaces [m]
  Vec3 local;      ///< in the axes of the obstacle
};

/// What one body may touch.
class BodyContacts {
public:
  BodyContacts(const Scene &scene, const Elements &elements, int b)
      : scene_(scene), body_(elements.body(b)),
        samples_(surfaceSamples(scene.bodies[std::size_t(b)], elements.bodyMass(b).centre)),
        law_(scene.bodies[std::size_t(b)].contact, pressOn(scene, elements, b)) {
    for (const BodySample &s : samples_) reach_ = std::max(reach_, s.arm.norm() + s.radius);
    const std::vector<int> &passes = settings().passes;
    for (int k = 0; k < int(scene.colliders.size()); ++k)
      if (std::find(passes.begin(), passes.end(), k) == passes.end()) met_.push_back(k);
    if (settings().stiffness == 0) bearAsDrawn(elements.bodyMass(b).centre, loadOn(scene, elements, b));
  }
  const ContactSettings &settings() const { return scene_.bodies[std::size_t(body_.body)].contact; }
  /// Energy of a sample, a force [N] in place of a force per length.
  const NormalLaw &law() const { return law_; }
  const BodySample &sample(int i) const { return samples_[std::size_t(i)]; }
  Collider::Pose pose(int collider, const Configuration &c) const {
    return scene_.colliders[std::size_t(collider)].poseAt(c.obstacleTime(body_.rod));
  }
  Vec3 arm(int i, const Configuration &c) const { return c.rotationAt(body_.rotation) * sample(i).arm; }

  /// Calls visit for those that may be nearer than so much to an obstacle.
  template <class Visit> void visitNear(const Configuration &c, double within, Visit visit) const {
    visitNear(c.positionAt(body_.position), c.rotationAt(body_.rotation), c.obstacleTime(body_.rod), within, visit);
  }
  template <class Visit> void visitTouching(const Configuration &c, Visit visit) const {
    visitNear(c, law_.reach(), visit);
  }

  /// \see RodContacts::freeFraction; the ways of samples are taken for straight.
  double freeFraction(const Configuration &from, const Configuration &to) const {
    const Vec3 start = from.positionAt(body_.position), way = to.displacementAt(body_.position, from);
    const Mat3 before = from.rotationAt(body_.rotation), after = to.rotationAt(body_.rotation);
    double longest = way.norm() + (after - before).norm() * reach_;
    for (const int k : met_) { // obstacles go their part of the way
      const Collider::Pose here = pose(k, from), there = pose(k, to);
      longest += (there.position - here.position).norm() +
                 (there.rotation - here.rotation).norm() * (start - here.position).norm();
    }
    const double wall = -0.5 * settings().distance, stop_at = 0.2 * settings().distance;
    double free = 1;
    visitNear(from, longest + stop_at, [&](const Near &n) {
      const Shape &shape = *scene_.colliders[std::size_t(n.collider)].shape;
      const BodySample &s = sample(n.sample);
      const Vec3 end = pose(n.collider, to).toLocal(start + way + after * s.arm);
      free = std::min(free, freeWay(shape, n.local, end - n.local, s.radius, n.distance, wall, settings().distance));
    });
    return free;
  }

private:
  const Scene &scene_;
  const JoinedBody body_;
  std::vector<BodySample> samples_;
  NormalLaw law_;
  double reach_ = 0; ///< of the farthest from the centre of mass [m]
  std::vector<int> met_;

  template <class Visit>
  void visitNear(const Vec3 &centre, const Mat3 &turned, double time, double within, Visit visit) const {
    std::array<std::vector<double>, 3> local;
    std::vector<double> distance(samples_.size());
    for (const int k : met_) {
      const Shape &shape = *scene_.colliders[std::size_t(k)].shape;
      const Collider::Pose pose = scene_.colliders[std::size_t(k)].poseAt(time);
      if (shape.at(pose.toLocal(centre)).value > reach_ + within) continue;
      for (std::vector<double> &x : local) x.resize(samples_.size());
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        const Vec3 x = pose.toLocal(centre + turned * samples_[i].arm);
        for (int a = 0; a < 3; ++a) local[std::size_t(a)][i] = x[a];
      }
      const double *const points[3] = {local[0].data(), local[1].data(), local[2].data()};
      shape.distances(points, int(samples_.size()), distance.data());
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        const double gap = distance[i] - samples_[i].radius;
        if (gap < within) visit(Near{int(i), k, gap, {local[0][i], local[1][i], local[2][i]}});
      }
    }
  }

  /// What is drawn touching is not thrown off: all samples there bear the load together.
  void bearAsDrawn(const Vec3 &centre, double load) {
    constexpr double least = 1e-3;
    double pressed = 0;
    visitNear(centre, Mat3::Identity(), 0, law_.reach(), [&](const Near &n) { pressed -= law_(n.distance).slope; });
    if (pressed > load && std::isfinite(pressed))
      law_ = {settings(), law_.stiffness() * std::max(load / pressed, least)};
  }
};

class BodyContact final : public Term {
public:
  BodyContact(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements) {
    for (int b = 0; b < int(scene.bodies.size()); ++b)
      of_.push_back(scene.bodies[std::size_t(b)].contact.on ? std::make_unique<BodyContacts>(scene, elements, b)
                                                            : nullptr);
    sliding_.resize(of_.size());
  }
  bool roundsAsStrains() const override { return false; }

  void beginStep(const State &state, const Configuration &start, const Step &step, int rod) override {
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      OfSliding &s = sliding_[std::size_t(b.body)];
      s.points.clear();
      s.rounds = {};
      s.start = &start;
      const double time = slidingTime(state, step);
      s.slides = contacts.settings().slides() && time > 0;
      s.sliding = {contacts.settings().fall_off_velocity * time, time};
      if (s.slides) s.points = slidingPoints(contacts, b, start);
    });
  }

  double energy(const Configuration &c, int rod) const override {
    double sum = 0;
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      contacts.visitTouching(c, [&](const Near &n) { sum += contacts.law()(n.distance).value; });
      for (const Slid &p : sliding_[std::size_t(b.body)].points) sum += forceOn(p, contacts, b, c).value;
    });
    return sum;
  }
  double noise(const Configuration &c, int rod, double) const override {
    double sum = 0;
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      const double blur = 4 * epsilon * c.positionAt(b.position).norm();
      contacts.visitTouching(c, [&](const Near &n) { sum += std::abs(contacts.law()(n.distance).slope) * blur; });
    });
    return sum;
  }
  double freeFraction(const Configuration &from, const Configuration &to, int rod) const override {
    double free = 1;
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &) {
      free = std::min(free, contacts.freeFraction(from, to));
    });
    return free;
  }
  double smallestGap(const Configuration &c, int rod) const override {
    double least = HUGE_VAL;
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &) {
      contacts.visitNear(c, least, [&](const Near &n) { least = std::min(least, n.distance); });
    });
    return least;
  }
  void addEnergies(const State &, const Configuration &c, double, int rod, EnergyBudget &out) const override {
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &) {
      contacts.visitTouching(c, [&](const Near &n) { out.contact += contacts.law()(n.distance).value; });
    });
  }

  void addDerivatives(const Configuration &c, int rod, Derivatives &out, HessianKind kind) const override {
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      Six gradient = Six::Zero();
      SixBySix hessian = SixBySix::Zero();
      contacts.visitTouching(c, [&](const Near &n) {
        const auto [slope, curvature] = pushOn(n, contacts, c, kind);
        addAt(contacts.arm(n.sample, c), slope, curvature, gradient, hessian);
      });
      for (const Slid &p : sliding_[std::size_t(b.body)].points) {
        const SlidingForce force = forceOn(p, contacts, b, c);
        addAt(c.rotationAt(b.rotation) * p.arm, force.gradient, force.hessian, gradient, hessian);
      }
      for (int a = 0; a < 3; ++a) {
        out.equilibrium[a][b.position] += gradient[a];
        out.equilibrium[a][b.rotation] += gradient[3 + a];
      }
      if (kind == HessianKind::none) return;
      const BodyPair &pair = elements_.pairOfBody(b.body);
      const RodRange &range = elements_.rods[std::size_t(rod)];
      for (int i = 0; i < 6; ++i)
        for (int j = i; j < 6; ++j) {
          const auto [plane, slot] = EdgeBlocks::pair(i, j);
          out.blocks.entry(range, plane)[pair.first + slot - range.first_slot] += hessian(i, j);
        }
    });
  }
  void addObstacleMotion(const Configuration &c, double time, int rod, Planes &out) const override {
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      contacts.visitTouching(c, [&](const Near &n) {
        const Collider &collider = scene_.colliders[std::size_t(n.collider)];
        if (!collider.motion.moves()) return;
        const Vec3 moved = collider.poseAt(time).fromLocal(n.local) - contacts.pose(n.collider, c).fromLocal(n.local),
                   force = -pushOn(n, contacts, c, HessianKind::exact).second * moved;
        out.setVector(0, b.position, out.vector(0, b.position) + force);
        out.setVector(0, b.rotation, out.vector(0, b.rotation) + contacts.arm(n.sample, c).cross(force));
      });
    });
  }
  std::array<Vec3, 2> actionOfObstacle(int collider, const Configuration &c, int rod) const override {
    std::array<Vec3, 2> action{Vec3::Zero(), Vec3::Zero()};
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      auto add = [&](const Vec3 &force, const Vec3 &local) {
        action[0] += force;
        action[1] += (contacts.pose(collider, c).rotation * local).cross(force);
      };
      contacts.visitTouching(c, [&](const Near &n) {
        if (n.collider == collider) add(-pushOn(n, contacts, c, HessianKind::none).first, n.local);
      });
      for (const Slid &p : sliding_[std::size_t(b.body)].points)
        if (p.point.collider == collider) add(-forceOn(p, contacts, b, c).gradient, p.point.touched);
    });
    return action;
  }

  double renew(const Configuration &iterate, int rod) override {
    double most = 0;
    each(rod, [&](const BodyContacts &contacts, const JoinedBody &b) {
      OfSliding &s = sliding_[std::size_t(b.body)];
      if (!s.slides) return;
      most = std::max(most, renewSliding(s.points, slidingPoints(contacts, b, iterate), s.rounds,
                                         [&](const Slid &p) { return forceOn(p, contacts, b, iterate); }));
    });
    return most;
  }

private:
  using Six = Eigen::Matrix<double, 6, 1>;
  using SixBySix = Eigen::Matrix<double, 6, 6>;
  /// A sample that slides; its arm is from the centre of mass, as drawn.
  struct Slid {
    int sample;
    SlidingPoint point;
    Vec3 arm = Vec3::Zero();
    SlidingPoint &slid() { return point; }
    bool isSame(const Slid &b) const { return sample == b.sample && point.collider == b.point.collider; }
  };
  struct OfSliding {
    bool slides = false;
    std::vector<Slid> points;
    Sliding sliding;
    const Configuration *start = nullptr;
    SlidingRounds rounds;
  };
  const Scene &scene_;
  const Elements &elements_;
  std::vector<std::unique_ptr<BodyContacts>> of_; ///< per body
  std::vector<OfSliding> sliding_;                ///< per body

  template <class Visit> void each(int rod, Visit visit) const {
    for (const JoinedBody &b : elements_.bodies({rod, rod + 1}))
      if (of_[std::size_t(b.body)]) visit(*of_[std::size_t(b.body)], b);
  }

  /// Derivatives of the energy of a sample by its place.
  std::pair<Vec3, Mat3> pushOn(const Near &n, const BodyContacts &contacts, const Configuration &c,
                               HessianKind kind) const {
    const Distance d = scene_.colliders[std::size_t(n.collider)].shape->at(n.local);
    const GapLaw law = contacts.law()(n.distance);
    const Mat3 q = contacts.pose(n.collider, c).rotation;
    const Vec3 normal = q * d.gradient;
    Mat3 h = law.curvature * normal * normal.transpose();
    if (kind != HessianKind::gauss_newton) h += law.slope * (q * d.hessian * q.transpose());
    return {law.slope * normal, h};
  }

  /// Adds derivatives by the place of a point of the body, x = p + exp(d) arm.
  static void addAt(const Vec3 &arm, const Vec3 &g, const Mat3 &h, Six &gradient, SixBySix &hessian) {
    Eigen::Matrix<double, 3, 6> by;
    by << Mat3::Identity(), -crossMatrix<double>(arm);
    gradient += by.transpose() * g;
    hessian += by.transpose() * h * by;
    hessian.bottomRightCorner<3, 3>() += curvatureOfArm(g, arm);
  }

  SlidingForce forceOn(const Slid &p, const BodyContacts &contacts, const JoinedBody &b, const Configuration &c) const {
    return slidingForce(p.point, contacts.settings(), sliding_[std::size_t(b.body)].sliding, wayOf(p, contacts, b, c));
  }
  static Vec3 wayOf(const Slid &p, const BodyContacts &contacts, const JoinedBody &b, const Configuration &c) {
    return c.positionAt(b.position) + c.rotationAt(b.rotation) * p.arm -
           contacts.pose(p.point.collider, c).fromLocal(p.point.touched) - p.point.start;
  }
  std::vector<Slid> slidingPoints(const BodyContacts &contacts, const JoinedBody &b, const Configuration &c) const {
    const Configuration &start = *sliding_[std::size_t(b.body)].start;
    std::vector<Slid> points;
    contacts.visitTouching(c, [&](const Near &n) {
      const auto push = pushOn(n, contacts, c, HessianKind::none).first;
      const double pressing = push.norm();
      if (!(pressing > 0)) return;
      const Collider &collider = scene_.colliders[std::size_t(n.collider)];
      const double own = contacts.settings().friction;
      const Collider::Pose pose = contacts.pose(n.collider, c);
      Slid p{n.sample, {}};
      p.point.collider = n.collider;
      p.point.pressing = pressing;
      p.point.coefficient = collider.friction < 0 ? own : std::sqrt(own * collider.friction);
      p.point.normal = -push / pressing;
      const double radius = contacts.sample(n.sample).radius;
      p.arm = contacts.sample(n.sample).arm - radius * (c.rotationAt(b.rotation).transpose() * p.point.normal);
      p.point.touched = n.local - radius * (pose.rotation.transpose() * p.point.normal);
      p.point.start = Vec3::Zero();
      p.point.start = wayOf(p, contacts, b, start);
      points.push_back(p);
    });
    return points;
  }
};

} // namespace

std::vector<Touch> tightestOfBodies(const Scene &scene, const Elements &elements, const Configuration &c) {
  std::vector<Touch> found;
  for (int b = 0; b < int(scene.bodies.size()); ++b) {
    if (!scene.touchesBody(b)) continue;
    std::vector<Touch> of_body(scene.colliders.size());
    const BodyContacts contacts(scene, elements, b);
    contacts.visitNear(c, contacts.law().reach(), [&](const Near &n) {
      if (Touch &worst = of_body[std::size_t(n.collider)]; n.distance < worst.gap) worst = {b, n.collider, n.distance};
    });
    std::copy_if(of_body.begin(), of_body.end(), std::back_inserter(found), [](const Touch &t) { return t.rod >= 0; });
  }
  return found;
}

std::unique_ptr<Term> makeBodyContact(const Scene &scene, const Elements &elements) {
  const bool any = !scene.colliders.empty() &&
                   std::any_of(scene.bodies.begin(), scene.bodies.end(), [](const Body &b) { return b.contact.on; });
  return any ? std::make_unique<BodyContact>(scene, elements) : nullptr;
}

} // namespace tendril
