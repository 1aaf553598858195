#include "support/random_cell.hpp"

#include "tendril/energy/bend.hpp"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

namespace tendril::test {
namespace {

/// Of two edges in `n` dimensions that turn by `fold`, with the constants of a cell.
template <int n> struct Case {
  VectorOf<double, n> e0, e1;
  BendOf<double> cell;
};

template <int n> Case<n> randomCase(Random &random, double fold, bool seed) {
  const RandomCell c = seed ? randomCell(random, fold) : classical(randomCell(random, fold));
  Case<n> out;
  if constexpr (n == 2) {
    const double angle = 3 * random(), turn = random() > 0 ? fold : -fold;
    out.e0 = c.f0.length * VectorOf<double, 2>(std::cos(angle), std::sin(angle));
    out.e1 = c.f1.length * VectorOf<double, 2>(std::cos(angle + turn), std::sin(angle + turn));
  } else {
    out.e0 = c.f0.length * c.f0.tangent;
    out.e1 = c.f1.length * c.f1.tangent;
  }
  out.cell = {c.cell.stiffness[0], n == 2 ? c.cell.rest[0] : 0, c.cell.base, c.cell.weight, c.cell.free};
  return out;
}

template <int n, class T> EdgePair<T, n> pairOf(const VectorOf<T, n> &e0, const VectorOf<T, n> &e1) {
  using std::sqrt;
  const T l0 = sqrt(e0.squaredNorm()), l1 = sqrt(e1.squaredNorm());
  return {e0 / l0, e1 / l1, l0, l1};
}

template <int n> using Matrix = Eigen::Matrix<double, 2 * n, 2 * n>;

template <int n> Matrix<n> hessianOf(const BendDerivatives<double, n> &d) {
  Matrix<n> h;
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) {
      h(r, c) = d.own0(std::min(r, c), std::max(r, c));
      h(n + r, n + c) = d.own1(std::min(r, c), std::max(r, c));
      h(r, n + c) = h(n + c, r) = d.mixed(r, c);
    }
  return h;
}

/// 1e-10 relative, and near a fold what is left of 1 + cos, which enters with its third power; tangents round to
/// epsilon, which the stiffness turns into forces.
template <Measure measure, int n> void expectMatch(const Case<n> &c, double fold) {
  using D = Dual<2 * n>;
  VectorOf<D, n> e0, e1;
  for (int a = 0; a < n; ++a) { // the frame of a clamp does not move
    e0[a] = c.cell.free[0] != 0 ? D::variable(c.e0[a], a) : D(c.e0[a]);
    e1[a] = c.cell.free[1] != 0 ? D::variable(c.e1[a], n + a) : D(c.e1[a]);
  }
  const BendOf<D> cell{D(c.cell.stiffness),
                       D(c.cell.rest),
                       D(c.cell.base),
                       {D(c.cell.weight[0]), D(c.cell.weight[1])},
                       {D(c.cell.free[0]), D(c.cell.free[1])}};
  const D reference = bendEnergy<measure>(pairOf<n, D>(e0, e1), cell);
  const auto d = bendDerivatives<measure>(pairOf<n, double>(c.e0, c.e1), c.cell);
  const double tolerance = 1e-10 + 80 * std::numeric_limits<double>::epsilon() / (1 + std::cos(fold));
  const double of_gradient = tolerance * reference.g.cwiseAbs().maxCoeff() + 1e-15 * reference.h.cwiseAbs().maxCoeff();
  for (int a = 0; a < n; ++a) {
    EXPECT_NEAR(d.first[a], reference.g[a], of_gradient);
    EXPECT_NEAR(d.second[a], reference.g[n + a], of_gradient);
  }
  EXPECT_LT((hessianOf<n>(d) - reference.h).cwiseAbs().maxCoeff(), tolerance * reference.h.cwiseAbs().maxCoeff());
}

template <int n> void expectAllMatch() {
  Random random(5);
  for (const double fold : {1e-6, 0.1, 1.0, 2.0, 2.5, 170.0 * pi / 180, 179.0 * pi / 180})
    for (int repeat = 0; repeat < 20; ++repeat)
      for (const int held : {-1, 0, 1}) {
        Case<n> c = randomCase<n>(random, fold, repeat % 2 == 0);
        if (held >= 0) c.cell.free[held] = c.cell.weight[held] = 0;
        expectMatch<Measure::tan>(c, fold);
        expectMatch<Measure::angle>(c, fold);
      }
}

TEST(Bend, DerivativesInThePlaneMatchAutomaticDifferentiation) { expectAllMatch<2>(); }
TEST(Bend, DerivativesWithoutTwistMatchAutomaticDifferentiation) { expectAllMatch<3>(); }

/// Without second derivatives of the strains no Hessian is indefinite, however far the cell is from its rest.
template <int n> void expectNeverIndefinite() {
  Random random(6);
  for (const double fold : {0.0, 0.5, 2.0, 3.0})
    for (int repeat = 0; repeat < 20; ++repeat) {
      const Case<n> c = randomCase<n>(random, fold, repeat % 2 == 0);
      const Matrix<n> h = hessianOf<n>(bendDerivatives<Measure::tan, false>(pairOf<n, double>(c.e0, c.e1), c.cell));
      const Eigen::SelfAdjointEigenSolver<Matrix<n>> eigen(h);
      EXPECT_GT(eigen.eigenvalues()[0], -1e-12 * eigen.eigenvalues()[2 * n - 1]);
    }
}
TEST(Bend, GaussNewtonIsNeverIndefinite) {
  expectNeverIndefinite<2>();
  expectNeverIndefinite<3>();
}

/// An isotropic cell that nothing twists stores the same in all three kernels.
TEST(Bend, StoresWhatTheCellWithTwistStores) {
  Random random(7);
  for (int repeat = 0; repeat < 20; ++repeat) {
    RandomCell c = randomCell(random, 1.2);
    c.cell.stiffness[1] = c.cell.stiffness[0];
    c.cell.rest = {0, 0, 0};
    c.f1.director = transport<double>(c.f0.director, c.f0.tangent, c.f1.tangent);
    const BendOf<double> cell{c.cell.stiffness[0], 0, c.cell.base, c.cell.weight, c.cell.free};
    const double energy = cellEnergy<Measure::angle>(c.f0, c.f1, c.cell);
    const EdgePair<double, 3> edges{c.f0.tangent, c.f1.tangent, c.f0.length, c.f1.length};
    EXPECT_NEAR(bendEnergy<Measure::angle>(edges, cell), energy, 1e-14 * energy);
    const EdgePair<double, 2> flat{{1, 0}, {std::cos(1.2), std::sin(1.2)}, c.f0.length, c.f1.length};
    EXPECT_NEAR(bendEnergy<Measure::angle>(flat, cell), energy, 1e-13 * energy);
  }
}

} // namespace
} // namespace tendril::test
