#include "tendril/contact/pair_derivatives.hpp"

#include "tendril/energy/constraint.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {
namespace {

constexpr int half = OfPair::half;

void addEdge(const RodRange &rod, int i, int at, const OfPair &d, EdgeBlocks &blocks) {
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

void addBody(const RodRange &rod, const BodyPair &pair, int at, const OfPair &d, EdgeBlocks &blocks) {
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) {
      const auto [plane, slot] = EdgeBlocks::pair(i, j);
      blocks.entry(rod, plane)[pair.first + slot - rod.first_slot] += d.hessian(at + i, at + j);
    }
}

} // namespace

Vec3 armOf(const TouchingPair &p, int side, const CarriedPoint &point, const Configuration &c) {
  const std::size_t first = std::size_t(2 * side);
  return matrixOf(c.frameAt(p.isBody(side) ? p.slot[first + 1] : p.slot[first])) * point.arm;
}

Vec3 wayBetween(const TouchingPair &p, int side, const CarriedPoint &own, const CarriedPoint &other,
                const Configuration &c) {
  const std::size_t first = std::size_t(2 * side), to = 2 - first;
  Vec3 way =
      c.displacements<double>(p.slot[first], c, p.slot[to]) + armOf(p, side, own, c) - armOf(p, 1 - side, other, c);
  if (!p.isBody(side)) way += own.at * c.displacements<double>(p.slot[first + 1], c, p.slot[first]);
  if (!p.isBody(1 - side)) way -= other.at * c.displacements<double>(p.slot[to + 1], c, p.slot[to]);
  return way;
}

/// An edge has y = x + s e + o with the arm o turned by its spin, a body y = p + o.
OfPair::BySide byPoint(const TouchingPair &p, int side, const CarriedPoint &point, const Configuration &c) {
  OfPair::BySide by;
  if (p.isBody(side)) {
    by << Mat3::Identity(), -crossMatrix<double>(armOf(p, side, point, c)), Vec3::Zero();
    return by;
  }
  const ByEdge edge = byEdge(point, c.frameAt(p.slot[std::size_t(2 * side)]));
  by << Mat3::Identity() - edge.leftCols<3>(), edge;
  return by;
}

void addCurvature(const TouchingPair &p, int side, const CarriedPoint &point, const Vec3 &g, const Configuration &c,
                  OfPair &out) {
  if (point.arm.isZero(0)) return;
  const Vec3 arm = armOf(p, side, point, c);
  const int first = half * side;
  const Mat3 by_spin = curvatureOfArm(g, arm);
  if (p.isBody(side)) {
    out.hessian.block<3, 3>(first + 3, first + 3) += by_spin;
    return;
  }
  const EdgeDerivatives bent = overEdge(c.frameAt(p.slot[std::size_t(2 * side)]), {arm.cross(g), by_spin}, true);
  Eigen::Matrix<double, 4, half> edge; // its variables by those of its vertices
  edge << -Mat3::Identity(), Mat3::Identity(), Vec3::Zero(), Eigen::Matrix<double, 1, 6>::Zero(), 1;
  out.hessian.block<half, half>(first, first) += edge.transpose() * bent.hessian * edge;
}

void addFriction(const SlidingPair &p, const SlidingForce &force, const Configuration &c, HessianKind kind,
                 OfPair &out) {
  Eigen::Matrix<double, 3, OfPair::size> by;
  for (const int side : {0, 1}) {
    const bool own = side == p.side;
    const double sign = own ? 1 : -1;
    by.middleCols<half>(half * side) = sign * byPoint(p.pair, side, own ? p.own : p.other, c);
    if (kind != HessianKind::none) addCurvature(p.pair, side, own ? p.own : p.other, sign * force.gradient, c, out);
  }
  out.gradient += by.transpose() * force.gradient;
  if (kind != HessianKind::none) out.hessian += by.transpose() * force.hessian * by;
}

void addOnSkin(const Elements &elements, const TouchingPair &p, int side, const OnSkinOfPair &on,
               const Configuration &c, HessianKind kind, Derivatives &out) {
  const RodRange &rod = elements.rods[std::size_t(p.rodOf(side))];
  const BlockPlanes blocks(out.blocks, rod);
  addAt(on.point, on.gradient, on.hessian, kind != HessianKind::gauss_newton, c,
        kind == HessianKind::none ? nullptr : &blocks, out);
  spread(on.point, on.gradient, c, out.gradient); // equilibrium has it
  if (kind == HessianKind::none) return;
  const OfPair::BySide by_body = on.hessian * on.by_body + on.turned;
  for (std::size_t k = 0; k < std::size_t(on.point.edges); ++k) {
    const EdgePoint::By &by = on.point.by[k];
    TouchingPair own = p;
    own.slot[std::size_t(2 * side)] = by.slot;
    own.slot[std::size_t(2 * side + 1)] = by.next;
    const Eigen::Matrix<double, half, half> between = by.weight * byPoint(own, side, by.point, c).transpose() * by_body;
    double *const to = out.blocks.touching(on.number[k]);
    for (int a = 0; a < half; ++a)
      for (int b = 0; b < half; ++b) to[half * a + b] += side == 0 ? between(a, b) : between(b, a);
  }
}

void addPair(const Elements &elements, const TouchingPair &p, int number, const OfPair &d, HessianKind kind,
             Derivatives &out) {
  for (const int side : {0, 1})
    for (int k = 0; k < (p.isBody(side) ? 6 : half); ++k) {
      const auto [slot, a] = p.place(side, k);
      out.gradient[a][slot] += d.gradient[half * side + k];
      out.equilibrium[a][slot] += d.gradient[half * side + k];
    }
  if (kind == HessianKind::none) return;
  for (const int side : {0, 1}) {
    const RodRange &rod = elements.rods[std::size_t(p.rodOf(side))];
    if (p.isBody(side))
      addBody(rod, elements.pairOfBody(p.body(side)), half * side, d, out.blocks);
    else
      addEdge(rod, p.edgeOf(side), half * side, d, out.blocks);
  }
  if (number < 0) return;
  double *to = out.blocks.touching(number);
  for (int a = 0; a < half; ++a)
    for (int b = 0; b < half; ++b) to[half * a + b] += d.hessian(a, half + b);
}

} // namespace tendril
