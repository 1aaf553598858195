/// The move from one configuration to another: what it keeps, and that it is what its increments say to first order.
#include "support/rods.hpp"

#include "tendril/state/retraction.hpp"

#include <random>

namespace tendril::test {
namespace {

using C = Configuration;

/// A helix of 24 edges, held at the vertices given.
struct Moved {
  Simulation sim;
  Configuration from, to;
  Planes increment;
  const RodRange *rod;

  explicit Moved(const std::vector<int> &held, double size, unsigned seed = 1) {
    Scene scene;
    scene.rods = {inextensibleRod(helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 0.3, 0.1, 2, 0, 24}).points)};
    for (const int v : held) scene.supports.push_back(hold(scene, 0, v, Support::Kind::pin));
    EXPECT_EQ(sim.setUp(scene, statics()), PetscErrorCode(0));
    from = to = configurationOf(sim.state, sim.scene, *sim.elements, 0);
    increment = sim.dofs.makePlanes();
    rod = &sim.elements->rods[0];
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> any(-size, size);
    for (int i = 0; i < rod->vertices; ++i)
      for (int a = 0; a < slot_size; ++a)
        if (sim.dofs.unknown(rod->slot(i), a) >= 0) increment[a][rod->slot(i)] = any(random);
  }

  bool move(RetractionKind kind, double scale = 1) {
    Retraction retraction(*sim.elements);
    return retraction.apply(from, increment, scale, 0, kind, to);
  }
  /// Largest distance between where vertices are and where their increments lead.
  double astray(double scale) const {
    double most = 0;
    for (int s = rod->first_slot; s < rod->vertexEnd(); ++s)
      most = std::max(most, (to.displacementAt(s, from) - scale * increment.vector(0, s)).norm());
    return most;
  }
};

constexpr RetractionKind both[] = {RetractionKind::additive, RetractionKind::length};

TEST(Retraction, OfNothingLeavesAllAsItIs) {
  for (const RetractionKind kind : both) {
    Moved m({0}, 0.1);
    ASSERT_TRUE(m.move(kind, 0));
    for (int s = m.rod->first_slot; s < m.rod->edgeEnd(); ++s) {
      EXPECT_LE((m.to.positionAt(s) - m.from.positionAt(s)).norm(), 1e-15); // rounding of lengths
      EXPECT_LE((m.to.frameAt(s).director - m.from.frameAt(s).director).norm(), 1e-15);
    }
  }
}

TEST(Retraction, IsItsIncrementToFirstOrder) {
  Moved additive({0}, 0.01);
  ASSERT_TRUE(additive.move(RetractionKind::additive));
  EXPECT_LE(additive.astray(1), 1e-16); // exactly
  for (const std::vector<int> &held : {std::vector<int>{}, {0}, {0, 24}}) {
    Moved m(held, 0.01);
    ASSERT_TRUE(m.move(RetractionKind::length, 1e-1));
    const double coarse = m.astray(1e-1);
    ASSERT_TRUE(m.move(RetractionKind::length, 5e-2));
    EXPECT_NEAR(order(coarse, m.astray(5e-2)), 2, 0.1) << held.size() << " held";
  }
}

TEST(Retraction, GivesEdgesTheirLinearisedLength) {
  Moved m({0}, 0.02);
  ASSERT_TRUE(m.move(RetractionKind::length));
  for (int s = m.rod->first_slot; s < m.rod->edgeEnd(); ++s) {
    const Vec3 de = m.increment.vector(0, s + 1) - m.increment.vector(0, s);
    const double expected = m.from[C::length][s] + m.from.frameAt(s).tangent.dot(de);
    EXPECT_NEAR(m.to[C::length][s], expected, 1e-15); // rounding, of 0.16
  }
}

TEST(Retraction, LeavesHeldVerticesWhereTheyAre) {
  for (const RetractionKind kind : both) {
    Moved m({0, 9, 24}, 0.03);
    ASSERT_TRUE(m.move(kind));
    for (const int v : {0, 9, 24}) EXPECT_EQ(m.to.positionAt(m.rod->slot(v)), m.from.positionAt(m.rod->slot(v))) << v;
  }
}

TEST(Retraction, KeepsFramesOrthonormalAndTurnsThemByTheTwist) {
  for (const RetractionKind kind : both) {
    Moved m({}, 0.02);
    ASSERT_TRUE(m.move(kind));
    for (int s = m.rod->first_slot; s < m.rod->edgeEnd(); ++s) {
      const Frame f = m.to.frameAt(s);
      EXPECT_NEAR(f.tangent.norm(), 1, 1e-15);
      EXPECT_NEAR(f.director.norm(), 1, 1e-15);
      EXPECT_NEAR(f.tangent.dot(f.director), 0, 1e-15);
      EXPECT_NEAR(halfAngleBetween(m.from.frameAt(s), f).angle(), m.increment[3][s], 1e-14); // beside minimal rotation
      EXPECT_NEAR(m.to[C::spin][s], m.increment[3][s], 1e-16);
    }
  }
}

TEST(Retraction, RefusesEdgesThatTurnBack) {
  Moved m({}, 0);
  const int s = m.rod->slot(5);
  const Vec3 edge = m.from.frameAt(s).tangent * m.from[C::length][s];
  for (int v = s + 1; v < m.rod->vertexEnd(); ++v) m.increment.setVector(0, v, -2 * edge); // the rest of the rod
  EXPECT_FALSE(m.move(RetractionKind::additive));
  EXPECT_TRUE(m.move(RetractionKind::additive, 0.4)); // shorter, but there
}

} // namespace
} // namespace tendril::test
