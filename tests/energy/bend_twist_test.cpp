#include "support/random_cell.hpp"

#include <gtest/gtest.h>

namespace tendril::test {
namespace {

using DCell = Dual<cell_size>;

/// The retracted frame of an edge whose ends move by u0, u1 and whose director turns by theta.
FrameOf<DCell> moved(const Frame &f, const Vector3<DCell> &u0, const Vector3<DCell> &u1, const DCell &theta,
                     bool free) {
  const Vector3<DCell> tangent = f.tangent.cast<DCell>(), director = f.director.cast<DCell>();
  if (!free) return {tangent, director, DCell(f.length)};
  const Vector3<DCell> e = tangent * DCell(f.length) + u1 - u0;
  const DCell length = sqrt(e.squaredNorm());
  const Vector3<DCell> t = e / length;
  return {t, rotateAbout<DCell>(transport<DCell>(director, tangent, t), t, theta), length};
}

template <Measure measure> DCell referenceEnergy(const RandomCell &c) {
  std::array<DCell, cell_size> q;
  for (int k = 0; k < cell_size; ++k) q[k] = DCell::variable(0.0, k);
  const Vector3<DCell> u0(q[0], q[1], q[2]), u1(q[4], q[5], q[6]), u2(q[8], q[9], q[10]);
  const FrameOf<DCell> f0 = moved(c.f0, u0, u1, q[3], c.cell.free[0] != 0),
                       f1 = moved(c.f1, u1, u2, q[7], c.cell.free[1] != 0);
  return cellEnergy<measure>(f0, f1, cast<DCell>(c.cell));
}

/// Vertex unknowns from edge variables: e0 = x1 - x0, e1 = x2 - x1.
Eigen::Matrix<double, cell_variables, cell_size> edgeVariables() {
  Eigen::Matrix<double, cell_variables, cell_size> m = Eigen::Matrix<double, cell_variables, cell_size>::Zero();
  for (int edge = 0; edge < 2; ++edge) {
    for (int a = 0; a < 3; ++a) {
      m(4 * edge + a, 4 * edge + a) = -1;
      m(4 * edge + a, 4 * edge + 4 + a) = 1;
    }
    m(4 * edge + 3, 4 * edge + 3) = 1;
  }
  return m;
}

template <Measure measure> void expectMatch(const RandomCell &c, double tolerance) {
  const DCell reference = referenceEnergy<measure>(c);
  CellDerivatives<double> d;
  cellDerivatives<measure>(c.f0, c.f1, c.cell, d);
  double gradient_error = 0, hessian_error = 0;
  for (int r = 0; r < cell_size; ++r)
    gradient_error = std::max(gradient_error, std::abs(d.gradient[r] - reference.g[r]));
  Eigen::Matrix<double, cell_variables, cell_variables> h;
  for (int r = 0, k = 0; r < cell_variables; ++r)
    for (int j = r; j < cell_variables; ++j, ++k) h(r, j) = h(j, r) = d.hessian[k];
  const auto to_edges = edgeVariables();
  const Eigen::Matrix<double, cell_size, cell_size> over_vertices = to_edges.transpose() * h * to_edges;
  for (int r = 0; r < cell_size; ++r)
    for (int j = r; j < cell_size; ++j)
      hessian_error = std::max(hessian_error, std::abs(over_vertices(r, j) - reference.h(r, j)));
  // 1e-10 relative: the conditioning of the fold (1 + cos 170 deg = 0.015, to the third power) times rounding stays
  // well below it.
  EXPECT_LT(gradient_error, tolerance * reference.g.cwiseAbs().maxCoeff());
  EXPECT_LT(hessian_error, tolerance * reference.h.cwiseAbs().maxCoeff());
  const std::array<double, cell_size> alone = cellGradient<measure>(c.f0, c.f1, c.cell);
  for (int r = 0; r < cell_size; ++r)
    EXPECT_NEAR(alone[r], d.gradient[r], tolerance * reference.g.cwiseAbs().maxCoeff());
  EXPECT_NEAR(cellEnergy<measure>(c.f0, c.f1, c.cell), reference.v,
              std::max(1e-13, 0.5 * (tolerance - 1e-10)) * std::abs(reference.v));
}

template <Measure measure> void expectDerivativesMatch(const RandomCell &c, double tolerance = 1e-10) {
  for (const RandomCell &cell : {c, classical(c)}) expectMatch<measure>(cell, tolerance);
}

TEST(BendTwist, DerivativesMatchAutomaticDifferentiation) {
  Random random(1);
  for (const double fold : {0.0, 1e-6, 0.1, 1.0, 2.0, 2.5, 170.0 * pi / 180})
    for (int repeat = 0; repeat < 20; ++repeat) {
      RandomCell c = randomCell(random, fold);
      expectDerivativesMatch<Measure::tan>(c);
      expectDerivativesMatch<Measure::angle>(c);
    }
}

TEST(BendTwist, DerivativesMatchAlmostFolded) {
  Random random(17);
  for (const double degrees : {170.0, 179.0, 179.9}) {
    // 1 + cos is left with a relative error of epsilon over itself, and enters with its third power.
    const double tolerance = 1e-10 + 40 * std::numeric_limits<double>::epsilon() / (1 + std::cos(degrees * pi / 180));
    for (int repeat = 0; repeat < 20; ++repeat) {
      const RandomCell c = randomCell(random, degrees * pi / 180);
      expectDerivativesMatch<Measure::tan>(c, tolerance);
      expectDerivativesMatch<Measure::angle>(c, tolerance);
    }
  }
}

TEST(BendTwist, DerivativesMatchOnTheHalfCellsOfClamps) {
  Random random(2);
  for (int repeat = 0; repeat < 40; ++repeat) {
    RandomCell c = randomCell(random, 1.0);
    const int fixed = repeat % 2;
    c.cell.free[fixed] = 0;
    c.cell.weight[fixed] = 0;
    expectDerivativesMatch<Measure::tan>(c);
    expectDerivativesMatch<Measure::angle>(c);
  }
}

/// Lengthening the edges multiplies the bending strains of `seed` and leaves those of `classical`.
TEST(BendTwist, OnlyTheSeedsStrainsGrowWithTheLength) {
  Random random(4);
  for (const bool seed : {true, false}) {
    RandomCell c = randomCell(random, 0.6);
    if (!seed) c = classical(c);
    const auto before = cellStrain<Measure::angle>(c.f0, c.f1, c.cell);
    for (Frame *f : {&c.f0, &c.f1}) f->length *= 1.25;
    const auto after = cellStrain<Measure::angle>(c.f0, c.f1, c.cell);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(after[k], (seed && k < 2 ? 1.25 : 1) * before[k], 1e-15) << k;
  }
}

TEST(BendTwist, AngleMeasureIsSmoothThroughWholeTurns) {
  Random random(3);
  for (const double turns : {-3.0, -2.0, 1.0, 2.0}) {
    RandomCell c = randomCell(random, 0.7);
    c.cell.winding = 2 * pi * turns;
    c.cell.sign = std::fmod(turns, 2.0) == 0 ? 1 : -1;
    expectDerivativesMatch<Measure::angle>(c);
  }
  // Twisting through 180 degrees: strain on both sides of the seam differs by the step alone.
  RandomCell c = randomCell(random, 0.3);
  auto strainAt = [&](double angle, double turns) {
    Frame f1 = c.f1;
    f1.director = rotateAbout<double>(transport<double>(c.f0.director, c.f0.tangent, f1.tangent), f1.tangent, angle);
    c.cell.winding = 2 * pi * turns;
    c.cell.sign = turns == 0 ? 1 : -1;
    return cellStrain<Measure::angle>(c.f0, f1, c.cell);
  };
  const double step = 1e-7;
  const auto below = strainAt(pi - step, 0), above = strainAt(pi + step, 1);
  EXPECT_NEAR(above[2] - below[2], 2 * step, 1e-14);
  EXPECT_NEAR(above[0], below[0], 2 * step);
  EXPECT_NEAR(above[1], below[1], 2 * step);
}

TEST(BendTwist, PackLanesEqualScalars) {
  Random random(4);
  std::array<RandomCell, Pack::size()> cells;
  for (auto &c : cells) c = randomCell(random, 1.2);
  auto gather = [&](auto member) { return Pack([&](int lane) { return member(cells[lane]); }); };
  FrameOf<Pack> f0, f1;
  CellOf<Pack> cell;
  for (int k = 0; k < 3; ++k) {
    f0.tangent[k] = gather([k](const RandomCell &c) { return c.f0.tangent[k]; });
    f0.director[k] = gather([k](const RandomCell &c) { return c.f0.director[k]; });
    f1.tangent[k] = gather([k](const RandomCell &c) { return c.f1.tangent[k]; });
    f1.director[k] = gather([k](const RandomCell &c) { return c.f1.director[k]; });
    cell.stiffness[k] = gather([k](const RandomCell &c) { return c.cell.stiffness[k]; });
    cell.rest[k] = gather([k](const RandomCell &c) { return c.cell.rest[k]; });
  }
  for (int k = 0; k < 2; ++k) {
    cell.weight[k] = gather([k](const RandomCell &c) { return c.cell.weight[k]; });
    cell.free[k] = gather([k](const RandomCell &c) { return c.cell.free[k]; });
  }
  f0.length = gather([](const RandomCell &c) { return c.f0.length; });
  f1.length = gather([](const RandomCell &c) { return c.f1.length; });
  cell.base = gather([](const RandomCell &c) { return c.cell.base; });
  cell.winding = Pack(0.0);
  cell.sign = Pack(1.0);
  CellDerivatives<Pack> packed;
  cellDerivatives<Measure::angle>(f0, f1, cell, packed);
  for (std::size_t lane = 0; lane < cells.size(); ++lane) {
    CellDerivatives<double> scalar;
    cellDerivatives<Measure::angle>(cells[lane].f0, cells[lane].f1, cells[lane].cell, scalar);
    double size = 0;
    for (double v : scalar.hessian) size = std::max(size, std::abs(v));
    for (int k = 0; k < cell_pairs; ++k)
      EXPECT_NEAR(double(packed.hessian[k][lane]), scalar.hessian[k], 1e-13 * size); // fused multiply-add
  }
}

} // namespace
} // namespace tendril::test
