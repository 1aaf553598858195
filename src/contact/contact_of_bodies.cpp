/// Contact of rigid bodies with rods and with each other: samples of the ones against the others as solids, with
/// friction at their surfaces (docs/theory.md, 20).
#include "tendril/contact/pair_friction.hpp"
#include "tendril/contact/touching_bodies.hpp"
#include "tendril/coupling/couplings.hpp"
#include "tendril/state/spin_stage.hpp"

#include <algorithm>

namespace tendril {
namespace {

class ContactOfBodies final : public Term {
public:
  ContactOfBodies(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), bodies_(scene, elements), friction_(scene, false) {}

  void findTouching(const State &state, const Configuration &start, const Planes &way, const Step &step, double room,
                    std::vector<TouchingPair> &pairs) override {
    bodies_.find(start, way, step, room);
    first_number_ = int(pairs.size());
    for (TouchingPair p : bodies_.pairs().items) {
      p.number += first_number_;
      pairs.push_back(p);
    }
    friction_.begin(state, start, step);
    for (int r = 0; r < int(scene_.rods.size()) && friction_.acts(); ++r) friction_.points(r) = slidingPairs(start, r);
  }
  void addRooms(int r, std::vector<Box> &rooms) const override { bodies_.addRooms(r, rooms); }
  bool nearlyTouch(const TouchingPair &pair, const Configuration &c) const override {
    if (pair.isOfRods()) return false;
    TouchingPair own = pair;
    own.number -= first_number_;
    bool near = false;
    const double reach = 3 * bodies_.lawOf(own).reach();
    bodies_.visit(own, c, reach, [&](const TouchingSolid &) { near = true; });
    if (const int before = bodies_.before(own); before >= 0 && !near) // samples on its skin that this edge carries, too
      bodies_.visit(bodies_.pairs().items[std::size_t(before)], c, reach,
                    [&](const TouchingSolid &t) { near = near || t.skin->point.edges == 2; });
    return near;
  }
  int timesBounded(RodSet rods) const override {
    int most = 0;
    for (int r = rods.begin; r < rods.end; ++r) most = std::max(most, bodies_.timesBounded(r));
    return most;
  }
  bool couplesPositions() const override { return true; }
  bool joinsPositions() const override { return true; }
  bool roundsAsStrains() const override { return false; }

  double energy(const Configuration &c, int r) const override {
    double sum = normalEnergy(c, r);
    for (const SlidingPair &p : friction_.points(r)) sum += friction_.forceOn(p, c).value;
    return sum;
  }
  double noise(const Configuration &c, int r, double) const override {
    double sum = 0;
    bodies_.visit(c, {r, r + 1}, [&](const TouchingPair &p, const TouchingSolid &t) {
      sum += std::abs(t.weight * bodies_.lawOf(p)(t.gap).slope) * 4 * epsilon * c.positionAt(p.slot[0]).norm();
    });
    return sum;
  }
  void addEnergies(const State &, const Configuration &c, double, int r, EnergyBudget &out) const override {
    bodies_.cover(c, r);
    out.contact += normalEnergy(c, r);
  }
  double smallestGap(const Configuration &c, int r) const override {
    bodies_.cover(c, r);
    return bodies_.smallestGap(c, r);
  }
  double freeFraction(const Configuration &from, const Configuration &to, int r) const override {
    return bodies_.freeFraction(from, to, r);
  }

  void addDerivatives(const Configuration &, int, Derivatives &, HessianKind) const override {} // none is of one alone
  void addBetween(const Configuration &c, RodSet island, Derivatives &out, HessianKind kind) const override {
    for (int r = island.begin; r < island.end; ++r) {
      auto sliding = friction_.points(r).begin();
      const auto end = friction_.points(r).end();
      for (const TouchingPair &p : bodies_.pairs().of({r, r + 1})) {
        OfPair d;
        bool any = false;
        bodies_.visit(p, c, bodies_.lawOf(p).reach(), [&](const TouchingSolid &t) {
          any = true;
          if (t.skin)
            addNormalOnSkin(p, t, c, kind, d, out);
          else
            addNormal(p, t, c, kind, d);
        });
        for (; sliding != end && sliding->pair.number == p.number; ++sliding) { // both lists are in one order
          any = true;
          if (sliding->skin)
            addFrictionOnSkin(*sliding, c, kind, d, out);
          else
            addFriction(*sliding, friction_.forceOn(*sliding, c), c, kind, d);
        }
        if (any) addPair(elements_, p, first_number_ + p.number, d, kind, out);
      }
    }
  }

  std::array<double, 2> pressure(const Configuration &c, const Planes &increment, int r) const override {
    std::array<double, 2> sum{0, 0};
    for (const int k : bodies_.pairsOf(r)) {
      const TouchingPair &p = bodies_.pairs().items[std::size_t(k)];
      bodies_.visit(p, c, bodies_.lawOf(p).reach(), [&](const TouchingSolid &t) {
        const GapLaw law = bodies_.lawOf(p)(t.gap);
        const Collider::Pose pose = bodies_.poseOf(p.body(t.solid()), c);
        const Vec3 normal = pose.rotation * bodies_.solidOf(p.body(t.solid())).at(t.local).gradient;
        const Vec3 arm = armTo(p, t, c);
        double closing = 0;
        for (const int side : {0, 1}) {
          if (side == t.side && t.skin) {
            closing += normal.dot(motionOf(t.skin->point, c, increment));
            continue;
          }
          const OfPair::BySide by = bySide(p, t, side, arm, c);
          for (int v = 0; v < (p.isBody(side) ? 6 : OfPair::half); ++v) {
            const auto [slot, a] = p.place(side, v);
            closing += normal.dot(by.col(v)) * increment[a][slot];
          }
        }
        sum[0] += std::abs(t.weight * law.slope);
        sum[1] += std::abs(t.weight * law.curvature * closing);
      });
    }
    return sum;
  }

  double renew(const Configuration &iterate, int r) override {
    return friction_.renew(iterate, r, [&] { return slidingPairs(iterate, r); });
  }
  void commit(State &state, const Configuration &c, int r) const override { friction_.commit(state, c, r); }

private:
  const Scene &scene_;
  const Elements &elements_;
  TouchingBodies bodies_;
  PairFriction friction_;
  int first_number_ = 0;

  double normalEnergy(const Configuration &c, int r) const {
    double sum = 0;
    bodies_.visit(c, {r, r + 1}, [&](const TouchingPair &p, const TouchingSolid &t) {
      sum += t.weight * bodies_.lawOf(p)(t.gap).value;
    });
    return sum;
  }

  /// From the centre of mass of the solid to a sample [m].
  Vec3 armTo(const TouchingPair &p, const TouchingSolid &t, const Configuration &c) const {
    const Collider::Pose pose = bodies_.poseOf(p.body(t.solid()), c);
    return pose.fromLocal(t.local) - c.positionAt(p.slot[std::size_t(2 * t.solid())]);
  }
  /// What the sample's place as the solid sees it, exp(-d)(x - p), changes by the variables of one of both.
  /// \param arm from the centre of mass of the solid to the sample [m]
  OfPair::BySide bySide(const TouchingPair &p, const TouchingSolid &t, int side, const Vec3 &arm,
                        const Configuration &c) const {
    if (side == t.side) return byPoint(p, side, bodies_.pointOf(p, t), c);
    OfPair::BySide by;
    by << -Mat3::Identity(), crossMatrix<double>(arm), Vec3::Zero();
    return by;
  }

  /// Of weight W(distance) by the place of a sample as the solid sees it, and from its centre of mass to there [m].
  struct Push {
    Vec3 gradient, arm;
    Mat3 hessian;
  };
  Push pushOn(const TouchingPair &p, const TouchingSolid &t, const Configuration &c, bool exact) const {
    const int solid = p.body(t.solid());
    const Mat3 q = bodies_.poseOf(solid, c).rotation;
    const Distance distance = bodies_.solidOf(solid).at(t.local);
    const GapLaw law = bodies_.lawOf(p)(t.gap);
    const Vec3 normal = q * distance.gradient;
    Push push{t.weight * law.slope * normal, armTo(p, t, c), t.weight * law.curvature * normal * normal.transpose()};
    if (exact) push.hessian += t.weight * law.slope * (q * distance.hessian * q.transpose());
    return push;
  }

  /// Derivatives of weight W(distance) of u = exp(-d)(x - p), the place of the sample as the solid sees it, which turns
  /// by d about p: of second order g.u has what x does, that of the arm x - p, and -d x (dx - dp), docs/theory.md
  /// (20.2).
  void addNormal(const TouchingPair &p, const TouchingSolid &t, const Configuration &c, HessianKind kind,
                 OfPair &d) const {
    const int own = OfPair::half * t.side, other = OfPair::half * t.solid();
    const bool exact = kind != HessianKind::gauss_newton;
    const auto [g, arm, h] = pushOn(p, t, c, exact);
    Eigen::Matrix<double, 3, OfPair::size> by;
    by << bySide(p, t, 0, arm, c), bySide(p, t, 1, arm, c);
    d.gradient += by.transpose() * g;
    if (kind == HessianKind::none) return;
    d.hessian += by.transpose() * h * by;
    if (!exact) return;
    addCurvature(p, t.side, bodies_.pointOf(p, t), g, c, d);
    d.hessian.block<3, 3>(other + 3, other + 3) += curvatureOfArm(g, arm);
    Eigen::Matrix<double, 3, OfPair::size> moved = Eigen::Matrix<double, 3, OfPair::size>::Zero(); // dx - dp
    moved.middleCols<OfPair::half>(own) = by.middleCols<OfPair::half>(own);
    moved.middleCols<3>(other) = -Mat3::Identity();
    const Eigen::Matrix<double, OfPair::size, 3> turned = -moved.transpose() * crossMatrix<double>(g);
    d.hessian.middleCols<3>(other + 3) += turned;
    d.hessian.middleRows<3>(other + 3) += turned.transpose();
  }

  std::array<int, 2> numbersOf(const TouchingPair &p) const {
    const int next = bodies_.next(p);
    return {first_number_ + p.number, next < 0 ? -1 : first_number_ + next};
  }
  /// The same of a sample on the skin of a rod.
  void addNormalOnSkin(const TouchingPair &p, const TouchingSolid &t, const Configuration &c, HessianKind kind,
                       OfPair &d, Derivatives &out) const {
    const int other = OfPair::half * t.solid();
    const bool exact = kind != HessianKind::gauss_newton;
    const auto [g, arm, h] = pushOn(p, t, c, exact);
    OnSkinOfPair on{t.skin->point, g, h, bySide(p, t, t.solid(), arm, c)};
    if (exact) on.turned.middleCols<3>(3) = -crossMatrix<double>(g);
    on.number = numbersOf(p);
    addOnSkin(elements_, p, t.side, on, c, kind, out);
    d.gradient.segment<OfPair::half>(other) += on.by_body.transpose() * g;
    if (kind == HessianKind::none) return;
    Eigen::Matrix<double, OfPair::half, OfPair::half> own = on.by_body.transpose() * h * on.by_body;
    if (exact) {
      own.block<3, 3>(3, 3) += curvatureOfArm(g, arm);
      own.block<3, 3>(0, 3) += crossMatrix<double>(g); // of its centre of mass and its spin
      own.block<3, 3>(3, 0) += crossMatrix<double>(g).transpose();
    }
    d.hessian.block<OfPair::half, OfPair::half>(other, other) += own;
  }
  void addFrictionOnSkin(const SlidingPair &p, const Configuration &c, HessianKind kind, OfPair &d,
                         Derivatives &out) const {
    const int solid = 1 - p.side, other = OfPair::half * solid;
    const SlidingForce force = friction_.forceOn(p, c);
    OnSkinOfPair on{*p.skin, force.gradient, force.hessian, -byPoint(p.pair, solid, p.other, c)};
    on.number = {first_number_ + p.pair.number, p.next};
    addOnSkin(elements_, p.pair, p.side, on, c, kind, out);
    d.gradient.segment<OfPair::half>(other) += on.by_body.transpose() * force.gradient;
    if (kind == HessianKind::none) return;
    addCurvature(p.pair, solid, p.other, -force.gradient, c, d);
    d.hessian.block<OfPair::half, OfPair::half>(other, other) += on.by_body.transpose() * force.hessian * on.by_body;
  }

  /// What touches at a configuration. The point is in the middle between both surfaces, or on the axis of a rod whose
  /// friction acts there.
  std::vector<SlidingPair> slidingPairs(const Configuration &c, int r) const {
    std::vector<SlidingPair> points;
    bodies_.visit(c, {r, r + 1}, [&](const TouchingPair &pair, const TouchingSolid &t) {
      const double pressing = friction_.pressing(bodies_.lawOf(pair), t.weight, t.gap, pair);
      if (!(pressing > 0)) return;
      const int solid = pair.body(t.solid());
      const Collider::Pose pose = bodies_.poseOf(solid, c);
      const Vec3 steep = pose.rotation * bodies_.solidOf(solid).at(t.local).gradient, normal = steep.normalized();
      SlidingPair p{pair, t.side, t.sample, bodies_.pointOf(pair, t), {}, {}};
      const bool on_axis = !pair.isBody(t.side) && (!bodies_.settingsOf(pair, t.side).friction_at_surface ||
                                                    scene_.rods[std::size_t(pair.rodOf(t.side))].material.isCable());
      const double out = on_axis || t.skin ? 0 : t.radius + 0.5 * t.gap;
      const std::size_t first = std::size_t(2 * t.side), to = std::size_t(2 * t.solid());
      const int frame = pair.isBody(t.side) ? pair.slot[first + 1] : pair.slot[first];
      p.own.arm -= out * (matrixOf(c.frameAt(frame)).transpose() * normal);
      p.other.arm = matrixOf(c.frameAt(pair.slot[to + 1])).transpose() * (armTo(pair, t, c) - out * normal);
      if (t.skin) {
        p.skin = t.skin->point;
        p.next = numbersOf(pair)[1];
      }
      p.point.pressing = pressing * steep.norm();
      p.point.normal = normal;
      friction_.complete(&p);
      points.push_back(p);
    });
    return points;
  }
};

} // namespace

std::unique_ptr<Term> makeContactOfBodies(const Scene &scene, const Elements &elements) {
  return scene.touchesBodies() ? std::make_unique<ContactOfBodies>(scene, elements) : nullptr;
}

} // namespace tendril
