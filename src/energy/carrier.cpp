#include "tendril/energy/carrier.hpp"

#include "tendril/energy/constraint.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {
namespace {

void addEdge(const RodRange &rod, int i, const Carrier::Hessian &h, EdgeBlocks &blocks) {
  const Mat3 second = h.block<3, 3>(3, 3), between = h.block<3, 3>(0, 3),
             whole = h.block<3, 3>(0, 0) + between + between.transpose() + second;
  Eigen::Matrix<double, 3, 4> joined;
  joined << between + second, h.block<3, 1>(0, 6) + h.block<3, 1>(3, 6);
  for (int a = 0; a < 3; ++a) {
    for (int b = a; b < 3; ++b) blocks.entry(rod, EdgeBlocks::vertex(a, b))[i] += whole(a, b);
    for (int b = 0; b < edge_size; ++b) blocks.entry(rod, EdgeBlocks::joined(a, b))[i] += joined(a, b);
  }
  for (int a = 0; a < edge_size; ++a)
    for (int b = a; b < edge_size; ++b) blocks.entry(rod, EdgeBlocks::own(a, b))[i] += h(3 + a, 3 + b);
}

void addBody(const RodRange &rod, const BodyPair &pair, const Carrier::Hessian &h, EdgeBlocks &blocks) {
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) {
      const auto [plane, slot] = EdgeBlocks::pair(i, j);
      blocks.entry(rod, plane)[pair.first + slot - rod.first_slot] += h(i, j);
    }
}

} // namespace

TouchingPair pairOf(const Carrier &a, const Carrier &b) {
  const Carrier &later = a.rod < b.rod ? b : a, &other = a.rod < b.rod ? a : b;
  return {later.rod, later.edge, other.rod, other.edge, {later.slot[0], later.slot[1], other.slot[0], other.slot[1]}};
}

Vec3 armOf(const Carrier &carrier, const CarriedPoint &point, const Configuration &c) {
  return matrixOf(c.frameAt(carrier.slot[carrier.isBody() ? 1 : 0])) * point.arm;
}

/// An edge has y = x + s e + o with the arm o turned by its spin, a body y = p + o.
Carrier::By byPoint(const Carrier &carrier, const CarriedPoint &point, const Configuration &c) {
  Carrier::By by;
  if (carrier.isBody()) {
    by << Mat3::Identity(), -crossMatrix<double>(armOf(carrier, point, c)), Vec3::Zero();
    return by;
  }
  const ByEdge edge = byEdge(point, c.frameAt(carrier.slot[0]));
  by << Mat3::Identity() - edge.leftCols<3>(), edge;
  return by;
}

void addCurvature(const Carrier &carrier, const CarriedPoint &point, const Vec3 &g, const Configuration &c,
                  Eigen::Ref<Carrier::Hessian, 0, Eigen::OuterStride<>> hessian) {
  if (point.arm.isZero(0)) return;
  const Vec3 arm = armOf(carrier, point, c);
  const Mat3 by_spin = curvatureOfArm(g, arm);
  if (carrier.isBody()) {
    hessian.block<3, 3>(3, 3) += by_spin;
    return;
  }
  const EdgeDerivatives bent = overEdge(c.frameAt(carrier.slot[0]), {arm.cross(g), by_spin}, true);
  Eigen::Matrix<double, 4, Carrier::variables> edge; // its variables by those of its vertices
  edge << -Mat3::Identity(), Mat3::Identity(), Vec3::Zero(), Eigen::Matrix<double, 1, 6>::Zero(), 1;
  hessian += edge.transpose() * bent.hessian * edge;
}

void addOwn(const Elements &elements, const Carrier &carrier, const Carrier::Gradient &gradient,
            const Carrier::Hessian &hessian, HessianKind kind, Derivatives &out) {
  for (int k = 0; k < carrier.count(); ++k) {
    const auto [slot, a] = carrier.place(k);
    out.gradient[a][slot] += gradient[k];
    out.equilibrium[a][slot] += gradient[k];
  }
  if (kind == HessianKind::none) return;
  const RodRange &rod = elements.rods[std::size_t(carrier.rod)];
  if (carrier.isBody())
    addBody(rod, elements.pairOfBody(carrier.body()), hessian, out.blocks);
  else
    addEdge(rod, carrier.edge, hessian, out.blocks);
}

} // namespace tendril
