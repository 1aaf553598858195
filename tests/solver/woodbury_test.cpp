/// The factorisation by low-rank updates against dense matrices and MUMPS.
#include "tendril/solver/woodbury.hpp"

#include "support/net.hpp"

namespace tendril::test {
namespace {

/// One hundred sets of tied rods, most of them indefinite, a third with junctions: solutions as of the dense matrix,
/// negative pivots as MUMPS and the eigenvalues have them.
TEST(Woodbury, SolvesAndCountsAsTheWholeMatrixDoes) {
  Random random(17);
  int indefinite = 0, with_junctions = 0;
  for (int repeat = 0; repeat < 100; ++repeat) {
    Net net;
    draw(net, random, 3 + pick(random, 12), 3 + pick(random, 6), repeat % 2 > 0);
    if (repeat % 3 > 0) net.scene.junctions.clear();
    tie(net, random, 1 + pick(random, repeat % 5 == 0 ? 90 : 20)); // the capacitance dense, or sparse
    if (net.scene.constraints.empty()) continue;
    fill(net, random, repeat % 4 == 0 ? 14.0 : repeat % 4 == 1 ? 4.0 : -1.0);
    ASSERT_TRUE(WoodburyFactor::suits(net.dofs, net.dofs.all()));
    with_junctions += !net.scene.junctions.empty();
    BandedWorkspace workspace;
    WoodburyFactor woodbury(net.dofs, net.dofs.all(), workspace);
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(net.dense.rows(), -1, 2);
    Eigen::VectorXd x(b.size());
    woodbury.factor(net.system);
    woodbury.solve(b.data(), x.data());
    EXPECT_LT((net.dense * x - b).norm(), 1e-7 * b.norm()) << repeat; // neither part is pivoted
    const int negative =
        int((Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(net.dense).eigenvalues().array() < 0).count());
    EXPECT_EQ(woodbury.negative(), negative) << repeat;
    EXPECT_EQ(woodbury.zero(), 0) << repeat;
    EXPECT_EQ(negativeByMumps(net.matrix), negative) << repeat;
    indefinite += negative > 0;
    x = b;
    woodbury.solve(x.data(), x.data());
    EXPECT_LT((net.dense * x - b).norm(), 1e-7 * b.norm()) << repeat;
  }
  EXPECT_GT(indefinite, 45);
  EXPECT_GT(with_junctions, 20);
}

} // namespace
} // namespace tendril::test
