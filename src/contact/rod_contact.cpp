/// Contact of rods with each other and with themselves: samples along each edge against the other as a capsule, both
/// ways at half their weight, with friction at their surfaces (docs/theory.md, Contact between rods).
#include "tendril/contact/friction.hpp"
#include "tendril/contact/touching_rods.hpp"
#include "tendril/coupling/couplings.hpp"
#include "tendril/energy/constraint.hpp"
#include "tendril/state/spin_stage.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Derivatives over the variables of a pair of edges (EdgePair::place), those of the one first.
struct OfPair {
  static constexpr int half = EdgePair::variables, size = 2 * half;
  Eigen::Matrix<double, size, 1> gradient = Eigen::Matrix<double, size, 1>::Zero();
  Eigen::Matrix<double, size, size> hessian = Eigen::Matrix<double, size, size>::Zero();
  /// Where the position of one of the four vertices begins.
  static int vertex(int k) { return half * (k / 2) + 3 * (k % 2); }
};

/// A sample of one edge that slides along the other. The point where surfaces touch is carried by the frames of both,
/// so that friction turns them and makes no couple of its own.
struct SlidingPair {
  EdgePair pair;
  int side, sample;
  SlidingPoint own; ///< on the sample's edge
  double other_at;
  Vec3 other_arm; ///< as own.arm, of the other edge
  int slot(bool other) const { return pair.slot[std::size_t(2 * (other ? 1 - side : side))]; }
  int next(bool other) const { return pair.slot[std::size_t(2 * (other ? 1 - side : side) + 1)]; }
  bool isSame(const SlidingPair &b) const {
    return pair.number == b.pair.number && side == b.side && sample == b.sample;
  }
};

class RodContact final : public Term {
public:
  RodContact(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), rods_(scene, elements), sliding_(scene.rods.size()),
        slides_(scene.slidesAmongRods()) {}

  std::vector<EdgePair> findTouching(const State &state, const Configuration &start, const Planes &way,
                                     const Step &step, double room) override {
    rods_.find(state, start, way, step, room);
    start_ = &start;
    time_ = step.isStatic() ? 0 : step.time > state.time ? step.time - state.time : step.dt;
    for (int r = 0; r < int(sliding_.size()) && slides_; ++r) {
      OfSliding &s = sliding_[std::size_t(r)];
      s = {};
      if (time_ > 0) s.points = slidingPairs(start, r);
    }
    return rods_.expected();
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
    double sum = energyBy(rods_.stiffness(), c, r);
    for (const SlidingPair &p : sliding_[std::size_t(r)].points) sum += forceOn(p, c).value;
    return sum;
  }
  double noise(const Configuration &c, int r, double) const override {
    double sum = 0;
    rods_.visit(c, {r, r + 1}, [&](const EdgePair &p, const Touching &t) {
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
      auto sliding = sliding_[std::size_t(r)].points.begin();
      const auto end = sliding_[std::size_t(r)].points.end();
      for (const EdgePair &p : rods_.pairs().of({r, r + 1})) {
        OfPair d;
        bool any = false;
        const NormalLaw law = rods_.lawOf(p);
        const std::array<Vec3, 4> x = TouchingRods::pointsOf(p, c);
        rods_.visit(p, x, law.reach(), [&](const Touching &t) {
          any = true;
          addNormal(t, law(t.gap), Vec3(x[std::size_t(t.other() + 1)] - x[std::size_t(t.other())]), kind, d);
        });
        for (; sliding != end && sliding->pair.number == p.number; ++sliding) { // both lists are in one order
          any = true;
          addFriction(*sliding, forceOn(*sliding, c), c, kind, d);
        }
        if (any) enter(p, d, kind, out);
      }
    }
  }

  std::array<double, 2> pressure(const Configuration &c, const Planes &increment, int r) const override {
    std::array<double, 2> sum{0, 0};
    for (const int k : rods_.pairsOf(r)) {
      const EdgePair &p = rods_.pairs().items[std::size_t(k)];
      const NormalLaw law = rods_.lawOf(p);
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
    OfSliding &s = sliding_[std::size_t(r)];
    if (!slides_ || time_ == 0) return 0;
    std::vector<SlidingPair> now = slidingPairs(iterate, r);
    double change = 0, size = 0;
    auto next = s.points.begin(); // both lists are in one order
    for (SlidingPair &p : now) {
      const auto found = std::find_if(next, s.points.end(), [&](const SlidingPair &old) { return old.isSame(p); });
      const Vec3 force = forceOn(p, iterate).gradient;
      Vec3 before = Vec3::Zero();
      double pressed = 0;
      if (found != s.points.end()) {
        before = forceOn(*found, iterate).gradient;
        pressed = found->own.pressing;
        next = found + 1;
      }
      size += std::max(p.own.coefficient * p.own.pressing, force.norm());
      change += (force - before).norm();
      if (s.rounds.swings) p.own.pressing = 0.5 * (p.own.pressing + pressed);
    }
    change = size > 0 ? change / size : 0;
    s.points = std::move(now);
    return s.rounds.add(change);
  }
  void commit(State &state, const Configuration &, int r) const override {
    state.rod_contact_stiffness.resize(scene_.rods.size(), 0);
    state.rod_contact_stiffness[std::size_t(r)] = rods_.stiffness()[std::size_t(r)];
  }

private:
  struct OfSliding {
    std::vector<SlidingPair> points;
    SlidingRounds rounds;
  };
  const Scene &scene_;
  const Elements &elements_;
  TouchingRods rods_;
  std::vector<OfSliding> sliding_; ///< by the rods that have the pairs
  const bool slides_;
  const Configuration *start_ = nullptr;
  double time_ = 0; ///< that the step takes; 0 in statics [s]

  double energyBy(const std::vector<double> &stiffness, const Configuration &c, int r) const {
    double sum = 0;
    for (const EdgePair &p : rods_.pairs().of({r, r + 1})) {
      const NormalLaw law = rods_.lawOf(stiffness, p);
      rods_.visit(p, TouchingRods::pointsOf(p, c), law.reach(),
                  [&](const Touching &t) { sum += t.weight * law(t.gap).value; });
    }
    return sum;
  }

  /// Derivatives of weight W(distance): with n the normal, l the length of the other edge e, and w the parts of the
  /// vertices, those of the distance are w_k n and w_j w_k (1 - n n')/d, less l^2/d times the square of the gradient of
  /// the nearest part where that is between the other's vertices.
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

  /// Of the way between two points y = x + s e + o, with the arms o turned by the spins of their edges (addSliding).
  void addFriction(const SlidingPair &p, const SlidingForce &force, const Configuration &c, HessianKind kind,
                   OfPair &d) const {
    using BySide = Eigen::Matrix<double, 3, OfPair::half>;
    BySide by[2]; // of the pair's edge and of its other, with their signs
    for (const bool other : {false, true}) {
      const int side = other ? 1 - p.side : p.side, first = OfPair::half * side;
      const double sign = other ? -1 : 1, at = other ? p.other_at : p.own.at;
      const Frame frame = c.frameAt(p.slot(other));
      const Vec3 arm = matrixOf(frame) * (other ? p.other_arm : p.own.arm);
      Eigen::Matrix<double, 3, 4> spin; // of the edge, by its vector and twist
      spin << crossMatrix(frame.tangent) / frame.length, frame.tangent;
      const Eigen::Matrix<double, 3, 4> turned = -crossMatrix(arm) * spin;
      const Mat3 by_edge = at * Mat3::Identity() + turned.leftCols<3>();
      by[side] << Mat3::Identity() - by_edge, by_edge, turned.col(3);
      by[side] *= sign;
      d.gradient.segment<OfPair::half>(first) += by[side].transpose() * force.gradient;
      if (kind == HessianKind::none || arm.isZero(0)) continue;
      const Vec3 g = sign * force.gradient;
      const EdgeDerivatives bent = overEdge(frame, {arm.cross(g), curvatureOfArm(g, arm)}, true);
      Eigen::Matrix<double, 4, OfPair::half> edge; // its variables by those of its vertices
      edge << -Mat3::Identity(), Mat3::Identity(), Vec3::Zero(), Eigen::Matrix<double, 1, 6>::Zero(), 1;
      d.hessian.block<OfPair::half, OfPair::half>(first, first) += edge.transpose() * bent.hessian * edge;
    }
    if (kind == HessianKind::none) return;
    Eigen::Matrix<double, 3, OfPair::size> both;
    both << by[0], by[1];
    d.hessian += both.transpose() * force.hessian * both;
  }

  /// What each edge has with itself goes to its own rod, by its first vertex, its vector and its twist.
  void enter(const EdgePair &p, const OfPair &d, HessianKind kind, Derivatives &out) const {
    for (const int side : {0, 1})
      for (int k = 0; k < OfPair::half; ++k) {
        const auto [slot, a] = p.place(side, k);
        out.gradient[a][slot] += d.gradient[OfPair::half * side + k];
        out.equilibrium[a][slot] += d.gradient[OfPair::half * side + k];
      }
    const int number = rods_.expectedNumber(p);
    if (number < 0) rods_.note(p);
    if (kind == HessianKind::none) return;
    EdgeBlocks &blocks = out.blocks;
    for (const int side : {0, 1}) {
      const RodRange &rod = elements_.rods[std::size_t(side == 0 ? p.rod : p.to_rod)];
      const int i = side == 0 ? p.edge : p.to_edge, at = OfPair::half * side;
      const Mat3 second = d.hessian.block<3, 3>(at + 3, at + 3), between = d.hessian.block<3, 3>(at, at + 3),
                 whole = d.hessian.block<3, 3>(at, at) + between + between.transpose() + second;
      Eigen::Matrix<double, 3, 4> joined;
      joined << between + second, d.hessian.block<3, 1>(at, at + 6) + d.hessian.block<3, 1>(at + 3, at + 6);
      for (int a = 0; a < 3; ++a) {
        for (int b = a; b < 3; ++b) blocks.entry(rod, EdgeBlocks::vertex(a, b))[i] += whole(a, b);
        for (int b = 0; b < edge_size; ++b) blocks.entry(rod, EdgeBlocks::joined(a, b))[i] += joined(a, b);
      }
      for (int a = 0; a < edge_size; ++a)
        for (int b = a; b < edge_size; ++b)
          blocks.entry(rod, EdgeBlocks::own(a, b))[i] += d.hessian(at + 3 + a, at + 3 + b);
    }
    if (number < 0) return;
    double *to = blocks.touching(number);
    for (int a = 0; a < OfPair::half; ++a)
      for (int b = 0; b < OfPair::half; ++b) to[OfPair::half * a + b] += d.hessian(a, OfPair::half + b);
  }

  /// Of two rods the geometric means count.
  ContactSettings between(const EdgePair &p) const {
    ContactSettings both = rods_.settings(p.rod);
    const ContactSettings &other = rods_.settings(p.to_rod);
    for (double ContactSettings::*value : {&ContactSettings::friction, &ContactSettings::fall_off_velocity,
                                           &ContactSettings::tangential_damping, &ContactSettings::normal_damping})
      both.*value = std::sqrt(both.*value * other.*value);
    return both;
  }
  SlidingForce forceOn(const SlidingPair &p, const Configuration &c) const {
    const ContactSettings both = between(p.pair);
    return slidingForce(p.own, both, {both.fall_off_velocity * time_, time_}, wayOf(p, c));
  }
  static Vec3 wayOf(const SlidingPair &p, const Configuration &c) {
    auto along = [&](bool other) { return c.displacements<double>(p.next(other), c, p.slot(other)); };
    return c.displacements<double>(p.slot(false), c, p.slot(true)) + p.own.at * along(false) +
           matrixOf(c.frameAt(p.slot(false))) * p.own.arm - p.other_at * along(true) -
           matrixOf(c.frameAt(p.slot(true))) * p.other_arm - p.own.start;
  }

  /// What touches at a configuration. The point is in the middle between both surfaces.
  std::vector<SlidingPair> slidingPairs(const Configuration &c, int r) const {
    std::vector<SlidingPair> points;
    rods_.visit(c, {r, r + 1}, [&](const EdgePair &pair, const Touching &t) {
      const double pressing = -t.weight * rods_.lawOf(pair)(t.gap).slope;
      if (t.taken_off) { // from the sample before
        if (!points.empty() && points.back().pair.number == pair.number && points.back().side == t.side &&
            points.back().sample == t.sample)
          points.back().own.pressing = std::max(0.0, points.back().own.pressing + pressing);
        return;
      }
      if (!(pressing > 0)) return;
      SlidingPair p{pair, t.side, t.sample, {}, -t.part[std::size_t(t.other() + 1)], Vec3::Zero()};
      p.own.at = t.part[std::size_t(2 * t.side + 1)];
      p.own.pressing = pressing;
      p.own.coefficient = between(pair).friction;
      p.own.normal = t.normal;
      const Rod &own = scene_.rods[std::size_t(t.side == 0 ? pair.rod : pair.to_rod)],
                &other = scene_.rods[std::size_t(t.side == 0 ? pair.to_rod : pair.rod)];
      if (own.contact.friction_at_surface && !own.material.isCable())
        p.own.arm = -(own.contact.radius + 0.5 * t.gap) * (matrixOf(c.frameAt(p.slot(false))).transpose() * t.normal);
      if (other.contact.friction_at_surface && !other.material.isCable())
        p.other_arm = (other.contact.radius + 0.5 * t.gap) * (matrixOf(c.frameAt(p.slot(true))).transpose() * t.normal);
      p.own.start = wayOf(p, *start_);
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
