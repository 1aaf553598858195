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
  std::vector<char> wanted;
  std::vector<double> shift;
  Band band;
  Planes metric;
  Eigen::MatrixXd dense; ///< over the unknowns
};

void addRods(Scene &scene, const std::vector<int> &rods) {
  for (const int n : rods) {
    const int count = std::abs(n);
    std::vector<Vec3> points;
    for (int i = 0; i < count; ++i) points.push_back(n < 0 ? Vec3(std::cos(2 * pi * i / count), std::sin(2 * pi * i / count), 0) : Vec3(i, 0, 0));
    Rod rod = inextensibleRod(points);
    rod.closed = n < 0;
    if (rod.closed) setBishopDirectors(rod);
    scene.rods.push_back(rod);
  }
}

/// Fills the band with what cells could put there: the 11 unknowns of three neighbouring vertices meet.
void fill(Problem &p, double diagonal) {
  Random random(3);
  p.band = Band(p.dofs.slots());
  p.metric = p.dofs.makePlanes();
  const int n = int(p.dofs.unknowns());
  p.dense = Eigen::MatrixXd::Zero(n, n);
  for (const RodRange &rod : p.dofs.rods())
    for (int i = 0; i < rod.vertices; ++i)
      for (int a = 0; a < slot_size; ++a)
        for (int k = 0; k < band_width - a; ++k) {
          const int away = (a + k) / slot_size, b = (a + k) % slot_size;
          if (!rod.closed && i + away >= rod.vertices) continue;
          if (rod.closed && i + away >= rod.vertices + 2) continue;
          const int to = rod.slot((i + away) % rod.vertices);
          const double v = k == 0 ? diagonal + random() : random();
          p.band.entry(rod, a, k)[i] = v;
          const PetscInt u = p.dofs.unknown(rod.slot(i), a), w = p.dofs.unknown(to, b);
          if (u < 0 || w < 0) continue;
          p.dense(u, w) += v;
          if (k > 0) p.dense(w, u) += v;
        }
  for (const RodRange &rod : p.dofs.rods())
    for (int i = 0; i < rod.vertices; ++i)
      for (int a = 0; a < slot_size; ++a) p.metric[a][rod.slot(i)] = 1;
  p.wanted.assign(p.dofs.rods().size(), true);
  p.shift.assign(p.wanted.size(), 0);
  p.system = {&p.dofs, p.dofs.all(), &p.band, &p.metric, &p.wanted, &p.shift};
}

int negativeEigenvalues(const Eigen::MatrixXd &a) { return int((Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues().array() < 0).count()); }

void expectSolvesAndCounts(const std::vector<int> &rods, double diagonal, bool held = true) {
  Problem p;
  addRods(p.scene, rods);
  if (held) p.scene.supports = {hold(p.scene, 0, 0, Support::Kind::pin), hold(p.scene, 0, 3, Support::Kind::pin)};
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, diagonal);
  BandedRoom room;
  BandedFactor banded(p.dofs, p.dofs.all(), room);
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(p.dense.rows(), -1, 2);
  Eigen::VectorXd x(b.size());
  for (int repeat = 0; repeat < 2; ++repeat) { // refactoring starts afresh
    banded.factor(p.system);
    banded.solve(b.data(), x.data());
    EXPECT_LT((p.dense * x - b).norm(), 1e-9 * b.norm()); // no pivoting: some growth for the indefinite ones
    int negative = 0, neutral = 0;
    for (std::size_t r = 0; r < rods.size(); ++r) {
      negative += banded.negativePivots(int(r));
      neutral += banded.neutralPivots(int(r));
    }
    EXPECT_EQ(negative, negativeEigenvalues(p.dense));
    EXPECT_EQ(neutral, 0);
  }
}

TEST(Banded, SolvesChainsRingsAndSetsOfThem) {
  for (const double diagonal : {12.0, 3.0, -1.0}) { // definite, indefinite
    expectSolvesAndCounts({11}, diagonal);
    expectSolvesAndCounts({-10}, diagonal, false);
    expectSolvesAndCounts({-3, -4, -5}, diagonal, false); // the corner lies within the band
    expectSolvesAndCounts({-10, 5, -14, 4}, diagonal);
  }
}

/// More rods of one shape than lanes, so that some are factored in packs, some in a pack that is not full, and some alone.
TEST(Banded, SolvesManyRodsOfOneShape) {
  for (const int shape : {7, -9}) expectSolvesAndCounts(std::vector<int>(2 * lanes + 5, shape), 3.0);
  std::vector<int> mixed(lanes + 1, 6);
  mixed.insert(mixed.begin() + 2, -6);
  expectSolvesAndCounts(mixed, -1.0);
}

TEST(Banded, RodsThatAreNotWantedStandStill) {
  Problem p;
  addRods(p.scene, std::vector<int>(2 * lanes, 6));
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, 12);
  BandedRoom room;
  BandedFactor banded(p.dofs, p.dofs.all(), room);
  Eigen::VectorXd b = Eigen::VectorXd::Constant(p.dense.rows(), 1.0), all(b.size()), some(b.size());
  banded.factor(p.system);
  banded.solve(b.data(), all.data());
  for (std::size_t r = 0; r < p.wanted.size(); ++r) p.wanted[r] = r % 3 == 1;
  banded.factor(p.system);
  banded.solve(b.data(), some.data());
  for (std::size_t r = 0; r < p.wanted.size(); ++r) {
    const PetscInt u = p.dofs.unknown(p.dofs.rods()[r].slot(2), 1);
    EXPECT_NEAR(some[u], p.wanted[r] ? all[u] : 0.0, 1e-14);
  }
}

TEST(Banded, AShiftOfOneRodIsAddedToItsDiagonal) {
  Problem p;
  addRods(p.scene, std::vector<int>(lanes + 1, 6));
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, -1);
  BandedRoom room;
  BandedFactor banded(p.dofs, p.dofs.all(), room);
  p.shift[2] = 20; // more than the sum of the others in any row
  p.shift[lanes] = 20;
  banded.factor(p.system);
  for (int r = 0; r <= lanes; ++r) EXPECT_EQ(banded.negativePivots(r) == 0, r == 2 || r == lanes) << r;
}

TEST(Banded, CountsNeutralMotionsAndStandsStill) {
  // A free chain of springs along x: its translation costs nothing.
  Problem p;
  addRods(p.scene, {12});
  ASSERT_EQ(p.dofs.setUp(p.scene), PetscErrorCode(0));
  fill(p, 1);
  p.band.clear(p.dofs.rods()[0]);
  for (int i = 0; i < 12; ++i) {
    for (int a = 1; a < slot_size; ++a) p.band.entry(p.dofs.rods()[0], a, 0)[i] = 1;
    p.band.entry(p.dofs.rods()[0], 0, 0)[i] = 1.3 * ((i > 0) + (i < 11));
    if (i < 11) p.band.entry(p.dofs.rods()[0], 0, slot_size)[i] = -1.3;
  }
  BandedRoom room;
  BandedFactor banded(p.dofs, p.dofs.all(), room);
  banded.factor(p.system);
  EXPECT_EQ(banded.negativePivots(0), 0);
  EXPECT_EQ(banded.neutralPivots(0), 1);
}

} // namespace
} // namespace tendril::test
