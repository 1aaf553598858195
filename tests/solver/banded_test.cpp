#include "tendril/solver/banded.hpp"

#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include <Eigen/Dense>

namespace tendril::test {
namespace {

/// Chains and rings of bare vertices and edges, each named by its number of vertices; a negative number is a ring.
struct Problem {
  Scene scene;
  DofMap dofs;
  BandedSystem system;
  std::vector<char> active;
  std::vector<double> shift;
  EdgeBlocks blocks;
  Planes metric;
  Eigen::MatrixXd dense; ///< over the unknowns
};

void addRods(Scene &scene, const std::vector<int> &rods) {
  for (const int n : rods) {
    const int count = std::abs(n);
    std::vector<Vec3> points;
    for (int i = 0; i < count; ++i)
      points.push_back(n < 0 ? Vec3(std::cos(2 * pi * i / count), std::sin(2 * pi * i / count), 0) : Vec3(i, 0, 0));
    Rod rod = inextensibleRod(points);
    rod.closed = n < 0;
    if (rod.closed) setBishopDirectors(rod);
    scene.rods.push_back(rod);
  }
}

/// What an edge variable, or the position of a vertex, is made of: a row over the unknowns (e_i = x_{i+1} - x_i).
Eigen::RowVectorXd rowOf(const Problem &p, std::vector<std::pair<PetscInt, double>> parts) {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(p.dense.cols());
  for (const auto &[unknown, sign] : parts)
    if (unknown >= 0) row[unknown] += sign;
  return row;
}

/// Fills the blocks with what vertices, edges and cells could put there, and the dense matrix with the same by the
/// definition of the variables.
void fill(Problem &p, double diagonal, double spread = 1, bool joins = false) {
  Random random(3);
  p.blocks = EdgeBlocks(p.dofs.slots(), joins);
  p.metric = p.dofs.makePlanes();
  const int n = int(p.dofs.unknowns());
  p.dense = Eigen::MatrixXd::Zero(n, n);
  for (const RodRange &rod : p.dofs.rods()) {
    auto slot = [&](int i) { return rod.slot(i % rod.vertices); };
    auto edge = [&](int i, int r) {
      if (r == 3) return rowOf(p, {{p.dofs.unknown(slot(i), 3), 1}});
      return rowOf(p, {{p.dofs.unknown(slot(i), r), -1}, {p.dofs.unknown(slot(i + 1), r), 1}});
    };
    auto put = [&](int plane, int i, double v, const Eigen::RowVectorXd &a, const Eigen::RowVectorXd &b, bool once) {
      p.blocks.entry(rod, plane)[i] = v;
      p.dense += v * a.transpose() * b;
      if (!once) p.dense += v * b.transpose() * a;
    };
    for (int i = 0; i < rod.edges; ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = r; c < edge_size; ++c)
          put(EdgeBlocks::own(r, c), i, spread * random() + (r == c ? diagonal : 0), edge(i, r), edge(i, c), r == c);
    for (int i = 1; i < rod.edges + (rod.closed ? 1 : 0); ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = 0; c < edge_size; ++c)
          put(EdgeBlocks::across(r, c), i, spread * random(), edge(i - 1, r), edge(i, c), false);
    for (int i = 0; i < rod.edges && joins; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < edge_size; ++c)
          put(EdgeBlocks::joined(r, c), i, 0.5 * spread * random(), rowOf(p, {{p.dofs.unknown(rod.slot(i), r), 1}}),
              edge(i, c), false);
    for (int i = 0; i < rod.vertices; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c) {
          auto position = [&](int k) { return rowOf(p, {{p.dofs.unknown(rod.slot(i), k), 1}}); };
          put(EdgeBlocks::vertex(r, c), i, spread * random() + (r == c ? diagonal : 0), position(r), position(c),
              r == c);
        }
  }
  for (const RodRange &rod : p.dofs.rods())
    for (int i = 0; i < rod.vertices; ++i)
      for (int a = 0; a < slot_size; ++a) p.metric[a][rod.slot(i)] = 1;
  p.active.assign(p.dofs.rods().size(), true);
  p.shift.assign(p.active.size(), 0);
  p.system = {&p.dofs, p.dofs.all(), &p.blocks, &p.metric, &p.active, &p.shift};
}

int negativeEigenvalues(const Eigen::MatrixXd &a) {
  return int((Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues().array() < 0).count());
}

void expectSolvesAndCounts(const std::vector<int> &rods, double diagonal, bool held = true, bool joins = false) {
  Problem p;
  addRods(p.scene, rods);
  if (held) p.scene.supports = {hold(p.scene, 0, 0, Support::Kind::pin), hold(p.scene, 0, 3, Support::Kind::pin)};
  if (held && p.scene.rods[0].vertices() > 9)
    p.scene.supports.push_back(hold(p.scene, 0, 4, Support::Kind::pin)); // an edge held at both ends
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, diagonal, 1, joins);
  BandedWorkspace workspace;
  BandedFactor banded(p.dofs, p.dofs.all(), workspace);
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(p.dense.rows(), -1, 2);
  Eigen::VectorXd x(b.size());
  for (int repeat = 0; repeat < 2; ++repeat) { // refactoring starts afresh
    banded.factor(p.system);
    banded.solve(b.data(), x.data());
    EXPECT_LT((p.dense * x - b).norm(), 1e-9 * b.norm()); // no pivoting: some growth for the indefinite ones
    int negative = 0, zero = 0;
    for (std::size_t r = 0; r < rods.size(); ++r) {
      negative += banded.negativePivots(int(r));
      zero += banded.zeroPivots(int(r));
    }
    EXPECT_EQ(negative, negativeEigenvalues(p.dense));
    EXPECT_EQ(zero, 0);
  }
}

TEST(Banded, SolvesPositionsJoinedWithEdges) {
  for (const double diagonal : {14.0, 3.0, -1.0}) {
    for (const bool held : {false, true}) expectSolvesAndCounts({11}, diagonal, held, true);
    expectSolvesAndCounts({-10}, diagonal, false, true);
    expectSolvesAndCounts({-10}, diagonal, true, true);
    expectSolvesAndCounts(std::vector<int>(2 * lanes, 6), diagonal, false, true);
  }
}

TEST(Banded, SolvesChainsRingsAndSetsOfThem) {
  for (const double diagonal : {12.0, 3.0, -1.0}) { // definite, indefinite
    expectSolvesAndCounts({11}, diagonal);
    expectSolvesAndCounts({-10}, diagonal, false);
    expectSolvesAndCounts({-3, -4, -5}, diagonal, false);
    expectSolvesAndCounts({-10, 5, -14, 4}, diagonal);
  }
}

/// Where the border of a ring falls off along it and is dropped on the way.
TEST(Banded, SolvesRingsWhoseBorderFallsOff) {
  for (const double diagonal : {400.0, -400.0}) {
    for (const bool held : {false, true}) expectSolvesAndCounts({-32}, diagonal, held);
    expectSolvesAndCounts(std::vector<int>(lanes, -20), diagonal, false);
  }
}

/// More rods of one shape than lanes, so that some are factored in packs, some in a pack that is not full, and some
/// alone.
TEST(Banded, SolvesManyRodsOfOneShape) {
  for (const int shape : {7, -9}) expectSolvesAndCounts(std::vector<int>(2 * lanes + 5, shape), 3.0);
  std::vector<int> mixed(lanes + 1, 6);
  mixed.insert(mixed.begin() + 2, -6);
  expectSolvesAndCounts(mixed, -1.0);
}

/// Held vertices anywhere, two in a row and on both sides of the seam of a ring too; rods held alike share a pack,
/// others do not.
TEST(Banded, SolvesWhateverIsHeld) {
  for (const int shape : {6, -6})
    for (int pattern = 0; pattern < 64; ++pattern) {
      Problem p;
      addRods(p.scene, std::vector<int>(lanes + 1, shape));
      for (int r = 0; r <= lanes; ++r)
        for (int v = 0; v < 6; ++v)
          if ((r == 1 ? 63 - pattern : pattern) >> v & 1)
            p.scene.supports.push_back(hold(p.scene, r, v, Support::Kind::pin));
      ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
      fill(p, 12);
      for (int r = 0; r <= lanes; ++r) { // shifts of some rods, by a metric that differs from place to place
        const RodRange &rod = p.dofs.rods()[r];
        p.shift[r] = pattern % 2 * (r % 3);
        for (int i = 0; i < rod.vertices; ++i)
          for (int a = 0; a < slot_size; ++a) {
            p.metric[a][rod.slot(i)] = a < 3 ? 1 + i : 0.5 + i;
            if (const PetscInt u = p.dofs.unknown(rod.slot(i), a); u >= 0)
              p.dense(u, u) += p.shift[r] * p.metric[a][rod.slot(i)];
          }
      }
      BandedWorkspace workspace;
      BandedFactor banded(p.dofs, p.dofs.all(), workspace);
      const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(p.dense.rows(), -1, 2);
      Eigen::VectorXd x(b.size());
      banded.factor(p.system);
      banded.solve(b.data(), x.data());
      EXPECT_LT((p.dense * x - b).norm(), 1e-12 * b.norm()) << pattern; // definite: rounding alone
    }
}

/// The blocks of a matrix times a vector, against the dense one.
TEST(EdgeBlocks, MultiplyAsTheirDefinitionSays) {
  for (const int shape : {7, -7, -3}) {
    Problem p;
    addRods(p.scene, {shape});
    ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
    fill(p, 2);
    const RodRange &rod = p.dofs.rods()[0];
    Planes x = p.dofs.makePlanes(), y = p.dofs.makePlanes();
    Eigen::VectorXd in = Eigen::VectorXd::LinSpaced(p.dense.rows(), -1, 2), out(in.size());
    auto each = [&](auto visit) {
      for (int i = 0; i < rod.vertices; ++i)
        for (int a = 0; a < slot_size; ++a)
          if (const PetscInt u = p.dofs.unknown(rod.slot(i), a); u >= 0) visit(a, rod.slot(i), u);
    };
    each([&](int a, int s, PetscInt u) { x[a][s] = in[u]; });
    p.dofs.copyBehindRing(rod, x);
    p.blocks.multiply(rod, {}, x, y);
    p.dofs.fold(rod, y);
    each([&](int a, int s, PetscInt u) { out[u] = y[a][s]; });
    EXPECT_LT((p.dense * in - out).norm(), 1e-13 * out.norm()) << shape;
  }
}

/// A cantilever of unit bending stiffness under a tip load, as a chain of edges that springs couple: a solve keeps its
/// digits however short the edges are.
TEST(Banded, KeepsItsDigitsOnFineMeshes) {
  for (const int edges : {100, 10000, 1000000}) {
    Problem p;
    addRods(p.scene, {edges + 1});
    p.scene.supports = {hold(p.scene, 0, 0, Support::Kind::pin)};
    ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
    p.blocks = EdgeBlocks(p.dofs.slots());
    p.metric = p.dofs.makePlanes();
    p.active = {true};
    p.shift = {0};
    p.system = {&p.dofs, p.dofs.all(), &p.blocks, &p.metric, &p.active, &p.shift};
    const RodRange &rod = p.dofs.rods()[0];
    const double h = 1.0 / edges, cell = 1 / (h * h * h);
    for (int i = 0; i < edges; ++i) {
      for (int a = 0; a < 3; ++a) {
        p.blocks.entry(rod, EdgeBlocks::own(a, a))[i] = i == 0 ? 3 * cell
                                                        : i + 1 < edges
                                                            ? 2 * cell
                                                            : cell; // the clamp's half cell is twice as stiff
        if (i > 0) p.blocks.entry(rod, EdgeBlocks::across(a, a))[i] = -cell;
      }
      p.blocks.entry(rod, EdgeBlocks::own(3, 3))[i] = 1;
    }
    BandedWorkspace workspace;
    BandedFactor banded(p.dofs, p.dofs.all(), workspace);
    std::vector<double> b(p.dofs.unknowns(), 0.0), x(b.size());
    const PetscInt tip = p.dofs.unknown(rod.slot(edges), 1);
    b[tip] = 1;
    banded.factor(p.system);
    banded.solve(b.data(), x.data());
    // The discrete beam bends by 1/3 (1 + h^2/2). A million roundings of 1e-16 add up to less than 1e-10, in vertex
    // coordinates the first digit is wrong.
    EXPECT_NEAR(x[tip], (1 + 0.5 * h * h) / 3, 1e-10) << edges;
    EXPECT_EQ(banded.negativePivots(0) + banded.zeroPivots(0), 0) << edges;
  }
}

TEST(Banded, RodsThatAreNotWantedStandStill) {
  Problem p;
  addRods(p.scene, std::vector<int>(2 * lanes, 6));
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, 12);
  BandedWorkspace workspace;
  BandedFactor banded(p.dofs, p.dofs.all(), workspace);
  Eigen::VectorXd b = Eigen::VectorXd::Constant(p.dense.rows(), 1.0), all(b.size()), some(b.size());
  banded.factor(p.system);
  banded.solve(b.data(), all.data());
  for (std::size_t r = 0; r < p.active.size(); ++r) p.active[r] = r % 3 == 1;
  banded.factor(p.system);
  banded.solve(b.data(), some.data());
  for (std::size_t r = 0; r < p.active.size(); ++r) {
    const PetscInt u = p.dofs.unknown(p.dofs.rods()[r].slot(2), 1);
    EXPECT_NEAR(some[u], p.active[r] ? all[u] : 0.0, 1e-14);
  }
}

TEST(Banded, AShiftOfOneRodIsAddedToItsDiagonal) {
  Problem p;
  addRods(p.scene, std::vector<int>(lanes + 1, 6));
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, -1);
  BandedWorkspace workspace;
  BandedFactor banded(p.dofs, p.dofs.all(), workspace);
  p.shift[2] = 40; // more than the sum of the others in any row
  p.shift[lanes] = 40;
  banded.factor(p.system);
  for (int r = 0; r <= lanes; ++r) EXPECT_EQ(banded.negativePivots(r) == 0, r == 2 || r == lanes) << r;
}

TEST(Banded, CountsMotionsWithoutStiffnessAndLeavesThemOut) {
  // A free chain of springs along x: its translation costs nothing.
  Problem p;
  addRods(p.scene, {12});
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, 1, 0);
  const RodRange &rod = p.dofs.rods()[0];
  p.blocks.clear(rod);
  for (int i = 0; i < 12; ++i) {
    for (int a = 0; a < 3 && i < 11; ++a) p.blocks.entry(rod, EdgeBlocks::own(a, a))[i] = 1.3;
    for (int a = 1; a < 3; ++a) p.blocks.entry(rod, EdgeBlocks::vertex(a, a))[i] = 1;
    p.blocks.entry(rod, EdgeBlocks::own(3, 3))[i] = 1;
  }
  BandedWorkspace workspace;
  BandedFactor banded(p.dofs, p.dofs.all(), workspace);
  banded.factor(p.system);
  EXPECT_EQ(banded.negativePivots(0), 0);
  EXPECT_EQ(banded.zeroPivots(0), 1);
  // Forces in balance have a solution, and it keeps the first vertex where it is; a lone force leaves all but one
  // equation satisfied.
  std::vector<double> b(p.dofs.unknowns(), 0.0), x(b);
  auto force = [&](int i) -> double & { return b[p.dofs.unknown(rod.slot(i), 0)]; };
  auto moved = [&](int i) { return x[p.dofs.unknown(rod.slot(i), 0)]; };
  force(3) = -2.6;
  force(7) = 2.6;
  banded.solve(b.data(), x.data());
  for (int i = 0; i <= 11; ++i) EXPECT_NEAR(moved(i), 2 * std::clamp(i - 3, 0, 4), 1e-14) << i;
  force(3) = 0;
  banded.solve(b.data(), x.data());
  for (int i = 0; i <= 11; ++i) EXPECT_NEAR(moved(i), 2 * std::min(i, 7), 1e-14) << i;
}

} // namespace
} // namespace tendril::test
