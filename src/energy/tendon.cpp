#include "tendril/energy/tendon.hpp"

#include "tendril/energy/joint.hpp"
#include "tendril/geometry/wrap.hpp"
#include "tendril/state/spin_stage.hpp"

#include <algorithm>

namespace tendril {
namespace {

constexpr int width = Carrier::variables;

} // namespace

Vec3 asDrawn(const Scene &scene, const Waypoint &p) {
  if (p.rod < 0) return p.point;
  const Rod &rod = scene.rods[std::size_t(p.rod)];
  const Frame frame = referenceFrame(rod, p.edge);
  return rod.position[std::size_t(p.edge)] + p.at * rod.edge(p.edge) + matrixOf(frame) * p.point;
}

/// Its length by both ends, in the axes of the world. \param p, q the ends in the axes of the cylinder or sphere
static WayLength wayRound(const Wrap &wrap, const Mat3 &axes, const Vec3 &p, const Vec3 &q) {
  WayLength way = wrap.sphere ? wayRoundSphere(p, q, wrap.radius) : wayRoundCylinder(p, q, wrap.radius, wrap.side);
  for (const int a : {0, 3}) {
    way.gradient.segment<3>(a) = axes * way.gradient.segment<3>(a);
    for (const int b : {0, 3}) way.hessian.block<3, 3>(a, b) = axes * way.hessian.block<3, 3>(a, b) * axes.transpose();
  }
  return way;
}

/// Of a cylinder, as columns.
static Mat3 axesAsDrawn(const Wrap &wrap) {
  const Vec3 across = wrap.axis.unitOrthogonal();
  Mat3 axes;
  axes << across, wrap.axis.cross(across), wrap.axis;
  return axes;
}

double segmentAsDrawn(const Scene &scene, const Tendon &tendon, const Tendon::Segment &s) {
  const Vec3 from = asDrawn(scene, tendon.points[std::size_t(s.from)]),
             to = asDrawn(scene, tendon.points[std::size_t(s.to)]);
  if (s.wrap < 0) return (to - from).norm();
  const Wrap &wrap = tendon.wraps[std::size_t(s.wrap)];
  const Mat3 axes = axesAsDrawn(wrap);
  return wayRound(wrap, axes, axes.transpose() * (from - wrap.centre), axes.transpose() * (to - wrap.centre)).value;
}

TendonPath::TendonPath(const Scene &scene, const Elements &elements, int index)
    : scene_(&scene), elements_(&elements), index_(index), slot_(elements.tendon_slot[std::size_t(index)]) {
  const Tendon &tendon = scene.tendons[std::size_t(index)];
  auto onBody = [&](int body, const Vec3 &drawn) {
    return Carried{numberOf(Carrier::ofBody(elements.body(body))), -1, {0, drawn - elements.bodyMass(body).centre}};
  };
  int told = slot_;
  for (const Waypoint &p : tendon.points)
    points_.push_back(p.body >= 0  ? onBody(p.body, p.point)
                      : p.rod >= 0 ? Carried{numberOf(Carrier::ofEdge(elements, p.rod, p.edge)), -1, {p.at, p.point}}
                                   : Carried{-1, ++told, {0, p.point}});
  for (const Wrap &w : tendon.wraps)
    rounds_.push_back({w.body >= 0 ? onBody(w.body, w.centre) : Carried{-1, -1, {0, w.centre}}, axesAsDrawn(w)});
  for (const Tendon::Pull &pull : tendon.joints) {
    const Joint &joint = scene.joints[std::size_t(pull.joint)];
    numberOf(Carrier::ofBody(elements.body(joint.child)));
    if (joint.parent >= 0) numberOf(Carrier::ofBody(elements.body(joint.parent)));
  }
  for (const Tendon::Segment &s : tendon.segments) drawn_ += segmentAsDrawn(scene, tendon, s);
}

int TendonPath::numberOf(const Carrier &carrier) {
  const auto found = std::find(carriers_.begin(), carriers_.end(), carrier);
  if (found != carriers_.end()) return int(found - carriers_.begin());
  carriers_.push_back(carrier);
  return int(carriers_.size()) - 1;
}

TendonPath::Place TendonPath::placeOf(const Carried &p, const Configuration &c) const {
  auto wordsAt = [&](int slot) {
    return Place{c.positionAt(slot), c.values().vector(Configuration::position_low, slot)};
  };
  if (p.carrier < 0) return p.told < 0 ? Place{p.point.arm, Vec3::Zero()} : wordsAt(p.told);
  const Carrier &carrier = carriers_[std::size_t(p.carrier)];
  Place place = wordsAt(carrier.slot[0]);
  if (!carrier.isBody() && p.point.at != 0) {
    if (p.point.at == 1) return wordsAt(carrier.slot[1]);
    place.low += p.point.at * c.displacements<double>(carrier.slot[1], c, carrier.slot[0]);
  }
  if (!p.point.arm.isZero(0)) place.low += armOf(carrier, p.point, c);
  return place;
}

TendonPath::Seen TendonPath::seen(const Tendon::Segment &s, const Configuration &c) const {
  const Round &round = rounds_[std::size_t(s.wrap)];
  const int carrier = round.centre.carrier;
  Seen seen{tendon().wraps[std::size_t(s.wrap)],
            carrier < 0 ? round.axes : Mat3(c.rotationAt(carriers_[std::size_t(carrier)].slot[1]) * round.axes),
            placeOf(round.centre, c),
            {}};
  for (const std::size_t k : {0u, 1u})
    seen.end[k] = seen.axes.transpose() * placeOf(points_[std::size_t(k == 0 ? s.from : s.to)], c).from(seen.centre);
  return seen;
}

WayLength TendonPath::wayOf(const Tendon::Segment &s, const Configuration &c) const {
  if (s.wrap < 0)
    return straightWay(placeOf(points_[std::size_t(s.to)], c).from(placeOf(points_[std::size_t(s.from)], c)));
  const Seen round = seen(s, c);
  return wayRound(round.wrap, round.axes, round.end[0], round.end[1]);
}

double TendonPath::length(const Configuration &c) const {
  double sum = 0;
  for (const Tendon::Segment &s : tendon().segments) sum += wayOf(s, c).value;
  return sum;
}

std::vector<double> TendonPath::lengths(const Configuration &c) const {
  std::vector<double> all;
  for (const Tendon::Segment &s : tendon().segments) all.push_back(wayOf(s, c).value);
  return all;
}

double TendonPath::turningAt(const Tendon::Rub &rub, const Configuration &c) const {
  const Tendon::Segment *const s = &tendon().segments[std::size_t(rub.segment)];
  const WayLength way = wayOf(s[0], c);
  if (rub.winds) return way.turning;
  const Vec3 in = way.gradient.tail<3>(), out = -wayOf(s[1], c).gradient.head<3>();
  return std::atan2(in.cross(out).norm(), in.dot(out));
}

std::array<Vec3, 2> TendonPath::endOf(int segment, const Configuration &c) const {
  const Tendon::Segment &s = tendon().segments[std::size_t(segment)];
  const Seen round = seen(s, c);
  return {round.end[1], round.axes.transpose() * wayOf(s, c).gradient.tail<3>()};
}

WayLength TendonPath::workOf(int segment, const Configuration &c, const TensionsAlong *along) const {
  const Tendon::Segment &s = tendon().segments[std::size_t(segment)];
  WayLength way = wayOf(s, c);
  if (!along) return way;
  const auto part = std::size_t(tendon().firstPart(segment));
  const Vec3 arriving = s.wrap < 0 || along->arriving.empty()
                            ? Vec3(way.gradient.tail<3>())
                            : Vec3(seen(s, c).axes * along->arriving[std::size_t(segment)]);
  way.gradient *= along->part[part];
  way.hessian *= along->part[part];
  if (s.wrap >= 0) way.gradient.tail<3>() += (along->part[part + 1] - along->part[part]) * arriving;
  return way;
}

/// The coordinate of its joint.
static JointRow rowOf(const Scene &scene, const Elements &elements, const Tendon::Pull &pull, const Configuration &c) {
  const Joint &joint = scene.joints[std::size_t(pull.joint)];
  return jointRow(joint, placeOf(joint, elements.pairOf(pull.joint), elements, c), coordinate_row);
}

double TendonPath::coordinates(const Configuration &c) const {
  double sum = 0;
  for (const Tendon::Pull &pull : tendon().joints) sum += pull.coefficient * rowOf(*scene_, *elements_, pull, c).value;
  return sum;
}

double TendonPath::factorOf(const Tendon::Pull &pull, const TensionsAlong *along) const {
  const auto last = std::size_t(std::max(0, tendon().firstPart(pull.after) - 1));
  return pull.coefficient * (along ? along->part[last] : 1);
}

TendonPath::Derivatives TendonPath::derivatives(const Configuration &c, bool second, const TensionsAlong *along) const {
  const auto size = Eigen::Index(width * carriers_.size());
  Derivatives out{Eigen::VectorXd::Zero(size), {}};
  if (second) out.hessian = Eigen::MatrixXd::Zero(size, size);
  for (int n = 0; n < int(tendon().segments.size()); ++n) addSegment(n, c, second, along, out);
  for (const Tendon::Pull &pull : tendon().joints) addJoint(pull, c, second, factorOf(pull, along), out);
  return out;
}

/// With w the place of an end x as the body sees that it winds round, exp(-d) (x - p), its derivatives are those of
/// x - p and w x d, docs/theory.md (20.1), (20.2); of second order g.w has what x has, that of the arm w, and -d x (dx
/// - dp).
void TendonPath::addSegment(int segment, const Configuration &c, bool second, const TensionsAlong *along,
                            Derivatives &out) const {
  const Tendon::Segment &s = tendon().segments[std::size_t(segment)];
  const WayLength way = workOf(segment, c, along);
  const Carried *const centre = s.wrap < 0 ? nullptr : &rounds_[std::size_t(s.wrap)].centre;
  const int body = centre ? centre->carrier : -1;
  /// Derivatives of an end by the variables of its carrier, and by those of the body.
  struct End {
    int carrier;
    Carrier::By by = Carrier::By::Zero(), by_body = Carrier::By::Zero();
  };
  std::array<End, 2> ends;
  for (const int k : {0, 1}) {
    const Carried &point = points_[std::size_t(k == 0 ? s.from : s.to)];
    const Vec3 g = way.gradient.segment<3>(3 * k);
    End &end = ends[std::size_t(k)];
    end.carrier = point.carrier;
    if (point.carrier >= 0) {
      const Carrier &carrier = carriers_[std::size_t(point.carrier)];
      end.by = byPoint(carrier, point.point, c);
      out.gradient.segment<width>(width * point.carrier) += end.by.transpose() * g;
      if (second)
        addCurvature(carrier, point.point, g, c,
                     out.hessian.block<width, width>(width * point.carrier, width * point.carrier));
    }
    if (body < 0) continue;
    const Carrier &of = carriers_[std::size_t(body)];
    const Vec3 arm =
        placeOf(point, c).from({c.positionAt(of.slot[0]), c.values().vector(Configuration::position_low, of.slot[0])});
    end.by_body << -Mat3::Identity(), crossMatrix<double>(arm), Vec3::Zero();
    out.gradient.segment<width>(width * body) += end.by_body.transpose() * g;
    if (!second) continue;
    const int spin = width * body + 3;
    out.hessian.block<3, 3>(spin, spin) += curvatureOfArm(g, arm);
    const Mat3 cross = crossMatrix<double>(g);
    auto couple = [&](int at, const Carrier::By &moved) {
      const Carrier::By turned = cross * moved;
      out.hessian.block<3, width>(spin, at) += turned;
      out.hessian.block<width, 3>(at, spin) += turned.transpose();
    };
    if (point.carrier >= 0) couple(width * point.carrier, end.by);
    Carrier::By own = Carrier::By::Zero();
    own.leftCols<3>() = -Mat3::Identity();
    couple(width * body, own);
  }
  if (!second) return;
  for (const int j : {0, 1})
    for (const int k : {0, 1}) {
      const Mat3 h = way.hessian.block<3, 3>(3 * j, 3 * k);
      const std::array<std::pair<int, const Carrier::By *>, 2> left{
          {{ends[std::size_t(j)].carrier, &ends[std::size_t(j)].by}, {body, &ends[std::size_t(j)].by_body}}},
          right{{{ends[std::size_t(k)].carrier, &ends[std::size_t(k)].by}, {body, &ends[std::size_t(k)].by_body}}};
      for (const auto &[a, by_a] : left)
        for (const auto &[b, by_b] : right)
          if (a >= 0 && b >= 0) out.hessian.block<width, width>(width * a, width * b) += by_a->transpose() * h * *by_b;
    }
}

void TendonPath::addJoint(const Tendon::Pull &pull, const Configuration &c, bool second, double times,
                          Derivatives &out) const {
  const Joint &joint = scene_->joints[std::size_t(pull.joint)];
  const JointRow row = rowOf(*scene_, *elements_, pull, c);
  std::array<int, 2> first{-1, -1};
  for (const int k : {0, 1})
    if (const int body = k == 0 ? joint.child : joint.parent; body >= 0)
      first[std::size_t(k)] =
          width * int(std::find(carriers_.begin(), carriers_.end(), Carrier::ofBody(elements_->body(body))) -
                      carriers_.begin());
  for (std::size_t j = 0; j < 2; ++j) {
    if (first[j] < 0) continue;
    out.gradient.segment<6>(first[j]) += times * row.gradient.segment<6>(6 * Eigen::Index(j));
    for (std::size_t k = 0; k < 2 && second; ++k)
      if (first[k] >= 0)
        out.hessian.block<6, 6>(first[j], first[k]) +=
            times * row.hessian.block<6, 6>(6 * Eigen::Index(j), 6 * Eigen::Index(k));
  }
}

std::vector<Vec3> TendonPath::points(const Configuration &c) const {
  std::vector<Vec3> all;
  for (const Carried &p : points_) {
    const Place place = placeOf(p, c);
    all.push_back(place.high + place.low);
  }
  return all;
}

std::vector<Vec3> TendonPath::drawn(const Configuration &c) const {
  const std::vector<Vec3> at = points(c);
  std::vector<Vec3> all;
  for (std::size_t k = 0; k < at.size(); ++k) {
    all.push_back(at[k]);
    for (const Tendon::Segment &s : tendon().segments) {
      if (s.from != int(k) || s.wrap < 0) continue;
      const auto [wrap, axes, place, end] = seen(s, c);
      const auto &[p, q] = end;
      const Vec3 centre = place.high + place.low;
      constexpr int between = Tendon::drawn_points;
      const std::vector<Vec3> on = wrap.sphere ? drawnRoundSphere(p, q, wrap.radius, between)
                                               : drawnRoundCylinder(p, q, wrap.radius, wrap.side, between);
      for (int n = 0; n < between; ++n)
        all.push_back(centre +
                      axes * (on.empty() ? Vec3(p + (n + 1.0) / (between + 1) * (q - p)) : on[std::size_t(n)]));
    }
  }
  return all;
}

std::vector<Vec3> TendonPath::byTold(const Configuration &c, const TensionsAlong *along) const {
  std::vector<Vec3> by(points_.size(), Vec3::Zero()), told;
  for (int n = 0; n < int(tendon().segments.size()); ++n) {
    const Tendon::Segment &s = tendon().segments[std::size_t(n)];
    const WayLength way = workOf(n, c, along);
    by[std::size_t(s.from)] += way.gradient.head<3>();
    by[std::size_t(s.to)] += way.gradient.tail<3>();
  }
  for (std::size_t k = 0; k < points_.size(); ++k)
    if (points_[k].told >= 0) told.push_back(by[k]);
  return told;
}

std::array<Vec3, 2> TendonPath::byParent(const Tendon::Pull &pull, const Configuration &c,
                                         const TensionsAlong *along) const {
  if (scene_->joints[std::size_t(pull.joint)].parent >= 0) return {Vec3::Zero(), Vec3::Zero()};
  const JointRow row = rowOf(*scene_, *elements_, pull, c);
  const double times = factorOf(pull, along);
  return {Vec3(times * row.gradient.segment<3>(6)), Vec3(times * row.gradient.segment<3>(9))};
}

double TendonPath::rate(const State &state, const Configuration &c) const {
  const Derivatives d = derivatives(c, false);
  double sum = 0;
  for (std::size_t k = 0; k < carriers_.size(); ++k) {
    const Carrier &carrier = carriers_[k];
    Carrier::Gradient velocity = Carrier::Gradient::Zero();
    if (carrier.isBody()) {
      const BodyRate &rate = state.body_rate[std::size_t(carrier.body())];
      velocity.head<6>() << rate.translation, rate.spin;
    } else {
      const int edge = elements_->rods[std::size_t(carrier.rod)].first_edge + carrier.edge;
      velocity << state.velocity[std::size_t(elements_->vertex0[std::size_t(edge)])],
          state.velocity[std::size_t(elements_->vertex1[std::size_t(edge)])], state.twist_rate[std::size_t(edge)];
    }
    sum += d.gradient.segment<width>(width * Eigen::Index(k)).dot(velocity);
  }
  const std::vector<Vec3> by = byTold(c);
  auto next = by.begin();
  for (const Waypoint &p : tendon().points)
    if (p.isTold()) sum += next++->dot(p.motion.velocityAt(state.time));
  for (const Tendon::Pull &pull : tendon().joints) {
    const Motion &parent = scene_->joints[std::size_t(pull.joint)].motion;
    if (!parent.moves()) continue;
    const std::array<Vec3, 2> of = byParent(pull, c);
    sum += of[0].dot(parent.velocityAt(state.time)) + of[1].dot(parent.angularVelocityAt(state.time));
  }
  return sum;
}

double TendonPath::clearance(const Configuration &c) const {
  double least = HUGE_VAL;
  for (const Tendon::Segment &s : tendon().segments) {
    if (s.wrap < 0) continue;
    const Seen round = seen(s, c);
    for (const Vec3 &arm : round.end)
      least = std::min(least, (round.wrap.sphere ? arm.norm() : arm.head<2>().norm()) / round.wrap.radius - 1);
  }
  return least;
}

double TendonPath::blur(const Configuration &c) const {
  double size = 0;
  for (const Carried &p : points_) {
    const Place place = placeOf(p, c);
    size += std::numeric_limits<double>::epsilon() * place.low.norm() + 1e-32 * place.high.norm();
  }
  return 4 * (size + std::numeric_limits<double>::epsilon() * (std::abs(drawn_) + std::abs(coordinates(c))));
}

} // namespace tendril
