/// The condensed factorisation against dense matrices and MUMPS.
#include "tendril/solver/condensed.hpp"

#include "support/net.hpp"

namespace tendril::test {
namespace {

/// One hundred nets, most of them indefinite: solutions as of the dense matrix, negative pivots as MUMPS and the
/// eigenvalues have them.
void expectAsWhole(bool bodies) {
  Random random(11);
  int indefinite = 0;
  for (int repeat = 0; repeat < 100; ++repeat) {
    Net net;
    const int rods = 4 + pick(random, 20), nodes = 3 + pick(random, 6);
    draw(net, random, rods, nodes, repeat % 3 > 0);
    if (net.scene.junctions.empty()) continue;
    if (bodies) embody(net);
    fill(net, random, repeat % 4 == 0 ? 14.0 : repeat % 4 == 1 ? 3.0 : -1.0);
    ASSERT_TRUE(CondensedFactor::suits(net.dofs, net.dofs.all()));
    BandedWorkspace workspace;
    CondensedFactor condensed(net.dofs, net.dofs.all(), workspace);
    indefinite +=
        expectAsWhole(net, condensed, 1e-8, repeat); // the runs are not pivoted: some growth for the indefinite ones
  }
  EXPECT_GT(indefinite, 50);
}

TEST(Condensed, SolvesAndCountsAsTheWholeMatrixDoes) { expectAsWhole(false); }
TEST(Condensed, SolvesWithBodiesAsTheWholeMatrixDoes) { expectAsWhole(true); }

} // namespace
} // namespace tendril::test
