/// Half cells to the frames of junctions against automatic differentiation.
#include "tendril/energy/joint_cell.hpp"

#include "support/random_cell.hpp"

#include <gtest/gtest.h>

namespace tendril::test {
namespace {

using D7 = Dual<7>;

Vector3<D7> asDual(const Vec3 &v) { return {D7(v[0]), D7(v[1]), D7(v[2])}; }

/// Turned by the first three variables.
Vector3<D7> spun(const Vec3 &v) { return turnedBy<7>(v, 0); }

/// An edge whose vector changes by the next three variables, and whose twist by the last.
FrameOf<D7> moved(const Frame &f) {
  Vector3<D7> e;
  for (int a = 0; a < 3; ++a) e[a] = D7::variable(f.tangent[a] * f.length, 3 + a);
  const D7 length = sqrt(e.squaredNorm());
  const Vector3<D7> t = e / length;
  return {t, rotateAbout<D7>(transport<D7>(asDual(f.director), asDual(f.tangent), t), t, D7::variable(0, 6)), length};
}

template <Measure measure> void expectMatch(RandomCell c, int frame) {
  Frame &turns = frame == 0 ? c.f0 : c.f1;
  turns.length = 1;
  c.cell.weight[frame] = 0;
  c.cell.free = {frame == 0 ? 0.0 : 1.0, frame == 0 ? 1.0 : 0.0}; // as cells have it; both turn all the same
  const FrameOf<D7> joint{spun(turns.tangent), spun(turns.director), D7(1.0)}, edge = moved(frame == 0 ? c.f1 : c.f0);
  const D7 exact = frame == 0 ? cellEnergy<measure>(joint, edge, cast<D7>(c.cell))
                              : cellEnergy<measure>(edge, joint, cast<D7>(c.cell));
  const JointCellDerivatives d = jointCellDerivatives<measure>(c.f0, c.f1, c.cell, frame);
  Eigen::Matrix<double, 7, 1> gradient;
  gradient << d.spin, d.edge;
  Eigen::Matrix<double, 7, 7> hessian;
  hessian << d.spin_spin, d.spin_edge, d.spin_edge.transpose(), d.edge_edge;
  // As those of cells: rounding, times what a sharp fold makes of it.
  EXPECT_LT((gradient - exact.g).norm(), 1e-10 * exact.g.norm());
  EXPECT_LT((hessian - exact.h).norm(), 1e-10 * exact.h.norm());
}

TEST(JointCell, DerivativesMatchAutomaticDifferentiation) {
  Random random(5);
  for (const double fold : {0.0, 1e-6, 0.1, 1.0, 2.5})
    for (int repeat = 0; repeat < 10; ++repeat)
      for (const int frame : {0, 1}) {
        const RandomCell seed = randomCell(random, fold);
        for (const RandomCell &c : {seed, classical(seed)}) {
          expectMatch<Measure::tan>(c, frame);
          expectMatch<Measure::angle>(c, frame);
        }
      }
}

} // namespace
} // namespace tendril::test
