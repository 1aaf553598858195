/// The condensed factorisation against dense matrices and MUMPS.
#include "tendril/solver/condensed.hpp"

#include "support/net.hpp"

namespace tendril::test {
namespace {

/// One hundred nets, most of them indefinite: solutions as of the dense matrix, negative pivots as MUMPS and the
/// eigenvalues have them.
TEST(Condensed, SolvesAndCountsAsTheWholeMatrixDoes) {
  Random random(11);
  int indefinite = 0;
  for (int repeat = 0; repeat < 100; ++repeat) {
    Net net;
    const int rods = 4 + pick(random, 20), nodes = 3 + pick(random, 6);
    draw(net, random, rods, nodes, repeat % 3 > 0);
    if (net.scene.junctions.empty()) continue;
    fill(net, random, repeat % 4 == 0 ? 14.0 : repeat % 4 == 1 ? 3.0 : -1.0);
    ASSERT_TRUE(CondensedFactor::suits(net.dofs, net.dofs.all()));
    BandedWorkspace workspace;
    CondensedFactor condensed(net.dofs, net.dofs.all(), workspace);
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(net.dense.rows(), -1, 2);
    Eigen::VectorXd x(b.size());
    for (int again = 0; again < 2; ++again) {
      condensed.factor(net.system);
      condensed.solve(b.data(), x.data());
      // The runs are not pivoted: some growth for the indefinite ones.
      EXPECT_LT((net.dense * x - b).norm(), 1e-8 * b.norm()) << repeat;
    }
    const int negative =
        int((Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(net.dense).eigenvalues().array() < 0).count());
    EXPECT_EQ(condensed.negative(), negative) << repeat;
    EXPECT_EQ(condensed.zero(), 0) << repeat;
    EXPECT_EQ(negativeByMumps(net.matrix), negative) << repeat;
    indefinite += negative > 0;
    x = b;
    condensed.solve(x.data(), x.data());
    EXPECT_LT((net.dense * x - b).norm(), 1e-8 * b.norm()) << repeat;
  }
  EXPECT_GT(indefinite, 50);
}

} // namespace
} // namespace tendril::test
