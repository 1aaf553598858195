#include "tendril/contact/pair_derivatives.hpp"

namespace tendril {
namespace {

constexpr int half = OfPair::half;

} // namespace

Vec3 armOf(const TouchingPair &p, int side, const CarriedPoint &point, const Configuration &c) {
  return armOf(carrierOf(p, side), point, c);
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

OfPair::BySide byPoint(const TouchingPair &p, int side, const CarriedPoint &point, const Configuration &c) {
  return byPoint(carrierOf(p, side), point, c);
}

void addCurvature(const TouchingPair &p, int side, const CarriedPoint &point, const Vec3 &g, const Configuration &c,
                  OfPair &out) {
  addCurvature(carrierOf(p, side), point, g, c, out.hessian.block<half, half>(half * side, half * side));
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
    addOwn(elements, carrierOf(p, side), d.gradient.segment<half>(half * side),
           d.hessian.block<half, half>(half * side, half * side), kind, out);
  if (kind == HessianKind::none) return;
  if (number < 0) return;
  double *to = out.blocks.touching(number);
  for (int a = 0; a < half; ++a)
    for (int b = 0; b < half; ++b) to[half * a + b] += d.hessian(a, half + b);
}

} // namespace tendril
