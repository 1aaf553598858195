#include "tendril/solver/banded.hpp"

#include "support/random_cell.hpp"

#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace tendril::test {
namespace {

/// A random symmetric matrix of blocks, each a band of half-width 10, rings with corners; as dense and as CSR.
struct Problem {
  Eigen::MatrixXd dense;
  std::vector<PetscInt> start{0}, column;
  std::vector<PetscScalar> value;
};

Problem makeProblem(const std::vector<std::pair<int, bool>> &blocks, double diagonal) {
  Random random(3);
  int n = 0;
  for (const auto &[size, ring] : blocks) n += size;
  Problem p;
  p.dense = Eigen::MatrixXd::Zero(n, n);
  std::vector<std::vector<bool>> pattern(n, std::vector<bool>(n, false));
  int begin = 0;
  for (const auto &[size, ring] : blocks) {
    for (int i = 0; i < size; ++i)
      for (int k = 0; k <= 10; ++k) {
        if (!ring && i + k >= size) continue;
        if (ring && i + k >= size && (i < size - 4 || (i + k) % size > 6)) continue; // the corner of a ring of rods: 4 rows meet 7
        const int a = begin + i, b = begin + (i + k) % size;
        const double v = k == 0 ? diagonal + random() : random();
        p.dense(a, b) = p.dense(b, a) = v;
        pattern[a][b] = pattern[b][a] = true;
      }
    begin += size;
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j)
      if (pattern[i][j]) {
        p.column.push_back(j);
        p.value.push_back(p.dense(i, j));
      }
    p.start.push_back(PetscInt(p.column.size()));
  }
  return p;
}

void expectSolvesAndCounts(const std::vector<std::pair<int, bool>> &blocks, double diagonal) {
  const Problem p = makeProblem(blocks, diagonal);
  const int n = int(p.dense.rows());
  BandedCholesky banded;
  ASSERT_TRUE(banded.analyse(n, p.start.data(), p.column.data()));
  for (int repeat = 0; repeat < 2; ++repeat) { // refactoring starts afresh
    banded.factor(p.start.data(), p.column.data(), p.value.data());
    Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(n, -1, 2), x(n);
    banded.solve(b.data(), x.data());
    EXPECT_LT((p.dense * x - b).norm(), 1e-9 * b.norm()); // no pivoting: some growth for the indefinite ones
    const Eigen::VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(p.dense).eigenvalues();
    EXPECT_EQ(banded.negativePivots(), (eigenvalues.array() < 0).count());
    EXPECT_EQ(banded.neutralPivots(), 0);
  }
}

TEST(Banded, SolvesChainsRingsAndSetsOfThem) {
  for (const double diagonal : {12.0, 3.0, -1.0}) { // definite, indefinite
    expectSolvesAndCounts({{43, false}}, diagonal);
    expectSolvesAndCounts({{40, true}}, diagonal);
    expectSolvesAndCounts({{40, true}, {19, false}, {56, true}, {7, false}}, diagonal);
    expectSolvesAndCounts({{24, true}}, diagonal);
  }
}

TEST(Banded, CountsNeutralMotionsAndStandsStill) {
  // A free spring chain: its translation costs nothing.
  const int n = 30;
  Problem p;
  p.start = {0};
  for (int i = 0; i < n; ++i) {
    if (i > 0) p.column.push_back(i - 1), p.value.push_back(-1.3);
    p.column.push_back(i), p.value.push_back((i > 0) * 1.3 + (i + 1 < n) * 1.3);
    if (i + 1 < n) p.column.push_back(i + 1), p.value.push_back(-1.3);
    p.start.push_back(PetscInt(p.column.size()));
  }
  BandedCholesky banded;
  ASSERT_TRUE(banded.analyse(n, p.start.data(), p.column.data()));
  banded.factor(p.start.data(), p.column.data(), p.value.data());
  EXPECT_EQ(banded.negativePivots(), 0);
  EXPECT_EQ(banded.neutralPivots(), 1);
}

TEST(Banded, RefusesWhatIsNeitherChainNorRing) {
  // An arrow: the last row meets all others, the first of them too far apart for a border of one ring.
  std::vector<PetscInt> start{0}, column;
  const int n = 40;
  for (int i = 0; i < n; ++i) {
    column.push_back(i);
    if (i < 20) column.push_back(i + 20);
    else column.insert(column.end() - 1, i - 20);
    start.push_back(PetscInt(column.size()));
  }
  BandedCholesky banded;
  EXPECT_FALSE(banded.analyse(n, start.data(), column.data()));
}

} // namespace
} // namespace tendril::test
