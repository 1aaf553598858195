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
    tie(net, random, 1 + pick(random, repeat % 5 == 0 ? 90 : 20));
    if (net.scene.constraints.empty()) continue;
    fill(net, random, repeat % 4 == 0 ? 14.0 : repeat % 4 == 1 ? 4.0 : -1.0);
    ASSERT_TRUE(WoodburyFactor::suits(net.dofs, net.dofs.all()));
    with_junctions += !net.scene.junctions.empty();
    BandedWorkspace workspace;
    WoodburyFactor woodbury(net.dofs, net.dofs.all(), workspace);
    indefinite += expectAsWhole(net, woodbury, 1e-7, repeat); // neither part is pivoted
  }
  EXPECT_GT(indefinite, 45);
  EXPECT_GT(with_junctions, 20);
}

} // namespace
} // namespace tendril::test
