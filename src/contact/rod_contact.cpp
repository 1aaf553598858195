/// Contact of rods with each other and with themselves: samples along each edge against the other as a capsule, both
/// ways at half their weight, with friction at their surfaces (docs/theory.md, Contact between rods).
#include "tendril/contact/pair_friction.hpp"
#include "tendril/contact/touching_rods.hpp"
#include "tendril/coupling/couplings.hpp"

#include <algorithm>

namespace tendril {
namespace {

class RodContact final : public Term {
public:
  RodContact(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), rods_(scene, elements), friction_(scene, true) {}

  void findTouching(const State &state, const Configuration &start, const Planes &way, const Step &step, double room,
                    std::vector<TouchingPair> &pairs) override {
    rods_.find(state, start, way, step, room);
    friction_.begin(state, start, step);
    for (int r = 0; r < int(scene_.rods.size()) && friction_.acts(); ++r) friction_.points(r) = slidingPairs(start, r);
    first_number_ = int(pairs.size());
    for (TouchingPair p : rods_.expected()) {
      p.number = int(pairs.size());
      pairs.push_back(p);
    }
  }
  void addRooms(int r, std::vector<Box> &rooms) const override { rods_.addRooms(r, rooms); }
  bool nearlyTouch(const TouchingPair &pair, const Configuration &c) const override {
    return pair.isOfRods() && tendril::nearlyTouch(scene_, pair, TouchingRods::pointsOf(pair, c));
  }
  int timesBounded(RodSet rods) const override {
    int most = 0;
    for (int r = rods.begin; r < rods.end; ++r) most = std::max(most, rods_.timesBounded(r));
    return most;
  }
  bool couplesPositions() const override { return true; }
  bool joinsPositions() const override { return true; }
  bool roundsAsStrains() const override { return false; }

  double energy(const Configuration &c, int r) const override {
    double sum = 0;
    rods_.visit(c, {r, r + 1},
                [&](const TouchingPair &p, const Touching &t) { sum += t.weight * rods_.lawOf(p)(t.gap).value; });
    for (const SlidingPair &p : friction_.points(r)) sum += friction_.forceOn(p, c).value;
    return sum;
  }
  double noise(const Configuration &c, int r, double) const override {
    double sum = 0;
    rods_.visit(c, {r, r + 1}, [&](const TouchingPair &p, const Touching &t) {
      sum += std::abs(t.weight * rods_.lawOf(p)(t.gap).slope) * 4 * epsilon * c.positionAt(p.slot[0]).norm();
    });
    return sum;
  }
  void addEnergies(const State &state, const Configuration &c, double, int r, EnergyBudget &out) const override {
    rods_.cover(c, r);
    const std::vector<double> &of_state = state.rod_contact_stiffness;
    out.contact += energyBy(of_state.empty() ? rods_.stiffness() : of_state, c, r);
  }
  double smallestGap(const Configuration &c, int r) const override {
    rods_.cover(c, r);
    return rods_.smallestGap(c, r);
  }
  double freeFraction(const Configuration &from, const Configuration &to, int r) const override {
    return rods_.freeFraction(from, to, r);
  }

  void addDerivatives(const Configuration &, int, Derivatives &, HessianKind) const override {} // none is of one alone
  void addBetween(const Configuration &c, RodSet island, Derivatives &out, HessianKind kind) const override {
    for (int r = island.begin; r < island.end; ++r) {
      auto sliding = friction_.points(r).begin();
      const auto end = friction_.points(r).end();
      for (const TouchingPair &p : rods_.pairs().of({r, r + 1})) {
        OfPair d;
        bool any = false;
        const NormalLaw &law = rods_.lawOf(p);
        const std::array<Vec3, 4> x = TouchingRods::pointsOf(p, c);
        rods_.visit(p, x, law.reach(), [&](const Touching &t) {
          any = true;
          addNormal(t, law(t.gap), Vec3(x[std::size_t(t.other() + 1)] - x[std::size_t(t.other())]), kind, d);
        });
        for (; sliding != end && sliding->pair.number == p.number; ++sliding) { // both lists are in one order
          any = true;
          addFriction(*sliding, friction_.forceOn(*sliding, c), c, kind, d);
        }
        if (!any) continue;
        const int number = rods_.expectedNumber(p);
        if (number < 0) rods_.note(p);
        addPair(elements_, p, number < 0 ? number : first_number_ + number, d, kind, out);
      }
    }
  }

  std::array<double, 2> pressure(const Configuration &c, const Planes &increment, int r) const override {
    std::array<double, 2> sum{0, 0};
    for (const int k : rods_.pairsOf(r)) {
      const TouchingPair &p = rods_.pairs().items[std::size_t(k)];
      const NormalLaw &law = rods_.lawOf(p);
      rods_.visit(p, TouchingRods::pointsOf(p, c), law.reach(), [&](const Touching &t) {
        const GapLaw g = law(t.gap);
        double closing = 0;
        for (std::size_t v = 0; v < 4; ++v) closing += t.part[v] * t.normal.dot(increment.vector(0, p.slot[v]));
        sum[0] += std::abs(t.weight * g.slope);
        sum[1] += std::abs(t.weight * g.curvature * closing);
      });
    }
    return sum;
  }

  double renew(const Configuration &iterate, int r) override {
    return friction_.renew(iterate, r, [&] { return slidingPairs(iterate, r); });
  }
  void commit(State &state, const Configuration &c, int r) const override {
    friction_.commit(state, c, r);
    state.rod_contact_stiffness.resize(scene_.rods.size(), 0);
    state.rod_contact_stiffness[std::size_t(r)] = rods_.stiffness()[std::size_t(r)];
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  TouchingRods rods_;
  PairFriction friction_;
  int first_number_ = 0;

  double energyBy(const std::vector<double> &stiffness, const Configuration &c, int r) const {
    double sum = 0;
    for (const TouchingPair &p : rods_.pairs().of({r, r + 1})) {
      const NormalLaw law = rods_.lawOf(stiffness, p);
      rods_.visit(p, TouchingRods::pointsOf(p, c), law.reach(),
                  [&](const Touching &t) { sum += t.weight * law(t.gap).value; });
    }
    return sum;
  }

  /// Derivatives of weight W(distance): with n the normal, l the length of the other edge e, and w the parts of the
  /// vertices, those of the distance are w_k n and w_j w_k (1 - n n')/d, less l^2/d times the square of the gradient of
  /// the nearest part where that is between the other's vertices: docs/theory.md (19.2).
  static void addNormal(const Touching &t, const GapLaw &law, const Vec3 &other, HessianKind kind, OfPair &d) {
    for (int k = 0; k < 4; ++k)
      d.gradient.segment<3>(OfPair::vertex(k)) += t.weight * law.slope * t.part[std::size_t(k)] * t.normal;
    if (kind == HessianKind::none) return;
    const Mat3 outer = t.normal * t.normal.transpose();
    Mat3 across = t.weight * law.curvature * outer;
    const bool exact = kind != HessianKind::gauss_newton;
    if (exact) across += t.weight * law.slope / t.distance * (Mat3::Identity() - outer);
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 4; ++k)
        d.hessian.block<3, 3>(OfPair::vertex(j), OfPair::vertex(k)) +=
            t.part[std::size_t(j)] * t.part[std::size_t(k)] * across;
    if (!exact || !t.inside) return;
    Eigen::Matrix<double, OfPair::size, 1> part = Eigen::Matrix<double, OfPair::size, 1>::Zero(); // times l^2
    for (int k = 0; k < 4; ++k) part.segment<3>(OfPair::vertex(k)) = t.part[std::size_t(k)] * other;
    part.segment<3>(OfPair::vertex(t.other())) -= t.distance * t.normal;
    part.segment<3>(OfPair::vertex(t.other() + 1)) += t.distance * t.normal;
    d.hessian -= t.weight * law.slope / (t.distance * other.squaredNorm()) * part * part.transpose();
  }

  /// What touches at a configuration. The point is in the middle between both surfaces.
  std::vector<SlidingPair> slidingPairs(const Configuration &c, int r) const {
    std::vector<SlidingPair> points;
    rods_.visit(c, {r, r + 1}, [&](const TouchingPair &pair, const Touching &t) {
      const double pressing = friction_.pressing(rods_.lawOf(pair), t.weight, t.gap, pair);
      if (t.taken_off) { // from the sample before
        if (!points.empty() && points.back().pair.number == pair.number && points.back().side == t.side &&
            points.back().sample == t.sample)
          points.back().point.pressing = std::max(0.0, points.back().point.pressing + pressing);
        return;
      }
      if (!(pressing > 0)) return;
      SlidingPair p{pair,
                    t.side,
                    t.sample,
                    {t.part[std::size_t(2 * t.side + 1)], Vec3::Zero()},
                    {-t.part[std::size_t(t.other() + 1)], Vec3::Zero()},
                    {}};
      p.point.pressing = pressing;
      p.point.normal = t.normal;
      for (const bool own : {true, false}) {
        const int side = own ? t.side : 1 - t.side;
        const Rod &rod = scene_.rods[std::size_t(pair.rodOf(side))];
        if (!rod.contact.friction_at_surface || rod.material.isCable() || rod.contact.point_cloud) continue;
        const Frame frame = c.frameAt(pair.slot[std::size_t(2 * side)]);
        (own ? p.own : p.other).arm =
            (own ? -1 : 1) * (rod.contact.radius + 0.5 * t.gap) * (matrixOf(frame).transpose() * t.normal);
      }
      friction_.complete(&p);
      points.push_back(p);
    });
    return points;
  }
};

} // namespace

std::unique_ptr<Term> makeRodContact(const Scene &scene, const Elements &elements) {
  return scene.touchesRods() ? std::make_unique<RodContact>(scene, elements) : nullptr;
}

} // namespace tendril
