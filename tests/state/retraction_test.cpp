/// The move from one configuration to another: what it keeps, and that it is what its increments say to first order.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include "tendril/geometry/rotation.hpp"
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

/// A move of a lone rod and its negative from where it leads: exactly back where positions go straight; lengths that
/// are right to first order come back to second order.
TEST(Retraction, GoesBackByTheNegativeIncrement) {
  auto left = [](RetractionKind kind, double scale) {
    Moved m({0}, 0.01);
    EXPECT_TRUE(m.move(kind, scale));
    const Configuration start = m.from;
    std::swap(m.from, m.to);
    EXPECT_TRUE(m.move(kind, -scale));
    double most = 0;
    for (int s = m.rod->first_slot; s < m.rod->vertexEnd(); ++s)
      most = std::max(most, m.to.displacementAt(s, start).norm());
    return most;
  };
  EXPECT_LE(left(RetractionKind::additive, 1), 1e-16); // displacements of 0.01, in two words
  const double coarse = left(RetractionKind::length, 1e-1);
  EXPECT_GT(coarse, 1e-7); // or there is no order to tell
  EXPECT_NEAR(order(coarse, left(RetractionKind::length, 5e-2)), 2, 0.1);
}

/// An open rod, one that goes on beyond the place where it is joined, and a ring, each with a vertex at a place.
Scene threeAt(const std::array<Vec3, 3> &place) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {
      inextensibleRod(lineShape(place[0] + Vec3(1, 0.2, 0), place[0], 5).points, Measure::angle),
      inextensibleRod(lineShape(place[1] - Vec3(0, 0.6, 0.3), place[1] + Vec3(0, 0.6, 0.3), 6).points, Measure::angle),
      inextensibleRod(ringShape(Vec3::Zero(), Vec3(1, 2, 0).normalized(), 0.5, 9).points, Measure::angle)};
  const Vec3 off = place[2] - scene.rods[2].position[0];
  for (Vec3 &x : scene.rods[2].position) x += off;
  scene.rods[2].closed = true;
  const std::array<int, 3> vertex{5, 3, 0};
  for (int r = 0; r < 3; ++r) {
    scene.rods[r].position[vertex[r]] = place[r]; // to the last bit
    setBishopDirectors(scene.rods[r]);
  }
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  return scene;
}

/// The three in one junction.
Scene meeting(bool rigid) {
  const Vec3 node(0.1, 0.7, -0.3);
  Scene scene = threeAt({node, node, node});
  const int group = rigid ? 0 : -1;
  scene.junctions = {{"node", {{0, 5, group}, {1, 3, group}, {2, 0, group}}, rigid ? 1 : 0}};
  return scene;
}

/// The three on one body, and a vertex of the first that a spring draws to a point of it.
Scene onBody(bool weld) {
  Scene scene = threeAt({Vec3(0.1, 0.7, -0.3), Vec3(-0.2, 0.5, 0.1), Vec3(0, 0.9, 0.2)});
  Body body;
  body.own = {2, Vec3(-0.1, 0.6, 0), Vec3(1, 2, 2.5).asDiagonal()};
  scene.bodies = {body};
  const std::array<int, 3> vertex{5, 3, 0};
  for (int r = 0; r < 3; ++r)
    scene.attachments.push_back({"tie", r, vertex[r], 0, weld, frameAtVertex(scene.rods[r], vertex[r])});
  scene.constraints = {pinTo(scene, 0, 2, Vec3(0, 0.2, 0), 3)};
  scene.constraints[0].to_body = 0;
  scene.hostBodies();
  return scene;
}

/// Joined rods and a random move of them, straight.
struct MovedTogether {
  Simulation sim;
  Configuration from, to;
  Planes increment;

  MovedTogether(Scene scene, double size, double spin) {
    EXPECT_EQ(sim.setUp(std::move(scene), statics()), PetscErrorCode(0));
    from = to = configurationOf(sim.state, sim.scene, *sim.elements, 0);
    increment = sim.dofs.makePlanes();
    Random random(3);
    std::vector<char> spins(std::size_t(sim.dofs.slots()), false);
    for (const JoinedEdge &j : sim.elements->joinedEdges(all())) spins[j.frame] = true;
    for (const JoinedBody &b : sim.elements->bodies(all())) spins[b.rotation] = true;
    for (int s = 0; s < sim.dofs.slots(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (sim.dofs.unknown(s, a) >= 0) increment[a][s] = (spins[s] ? spin : size) * random();
    spread(from);
  }
  RodSet all() const { return sim.dofs.all(); }
  /// Gives copies their increments, with arms as they are.
  void spread(const Configuration &at) {
    for (const JoinedVertex &j : sim.elements->joinedVertices(all()))
      if (j.isOnBody()) sim.dofs.setArm(j, at.rotationAt(j.frame) * sim.elements->armAsDrawn(j));
    for (const RodRange &rod : sim.dofs.rods()) sim.dofs.copyBehindRing(rod, increment);
    sim.dofs.copyJoined(all(), increment);
  }
  bool move(double scale = 1) {
    Retraction retraction(*sim.elements);
    bool possible = true;
    for (int r = 0; r < all().end; ++r)
      possible = retraction.apply(from, increment, scale, r, RetractionKind::additive, to) && possible;
    return possible;
  }
  template <class Visit> void forVertices(Visit visit) const {
    for (const RodRange &rod : sim.dofs.rods())
      for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) visit(s);
  }
  template <class Visit> void forEdges(Visit visit) const {
    for (const RodRange &rod : sim.dofs.rods())
      for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) visit(s);
  }
};

/// Both words of a position to the last bit.
void expectSamePlace(const Configuration &a, int at, const Configuration &b, int other, const std::string &what) {
  EXPECT_EQ(a.positionAt(at), b.positionAt(other)) << what;
  EXPECT_EQ(a.values().vector(C::position_low, at), b.values().vector(C::position_low, other)) << what;
}

TEST(Retraction, KeepsSharedVerticesTogether) {
  for (const bool rigid : {true, false}) {
    MovedTogether m(meeting(rigid), 0.02, 0.7);
    ASSERT_TRUE(m.move());
    const std::span<const JoinedVertex> shared = m.sim.elements->joinedVertices(m.all());
    ASSERT_EQ(shared.size(), 3u);
    EXPECT_GT(m.to.displacementAt(shared[0].slot, m.from).norm(), 1e-3);
    for (const JoinedVertex &j : shared)
      expectSamePlace(m.to, j.slot, m.to, j.first_slot, "rod " + std::to_string(j.rod));
    const RodRange &ring = m.sim.dofs.rods()[2];
    for (const int k : {0, 1}) expectSamePlace(m.to, ring.slot(9 + k), m.to, ring.slot(k), "behind the ring");
    // Frames of its edges turn as one: two rods that pass and one that ends make five.
    const std::span<const JoinedEdge> edges = m.sim.elements->joinedEdges(m.all());
    ASSERT_EQ(edges.size(), rigid ? 5u : 0u);
    for (const JoinedEdge &j : edges) {
      const Mat3 turned = matrixOf(m.to.frameAt(j.frame)) * matrixOf(m.from.frameAt(j.frame)).transpose();
      const Vec3 spin = m.increment.vector(0, edges[0].first_frame);
      EXPECT_GT(spin.norm(), 0.2);
      EXPECT_LE((turned - rotationBy(spin)).norm(), 3e-15); // rounding of two products of matrices
      EXPECT_EQ(m.to.positionAt(j.frame), spin) << "the sum of spins";
    }
  }
}

TEST(Retraction, KeepsVerticesOnTheirBody) {
  for (const bool weld : {true, false}) {
    MovedTogether m(onBody(weld), 0.02, 0.7);
    ASSERT_TRUE(m.move());
    const JoinedBody &body = m.sim.elements->body(0);
    const Mat3 rotation = m.to.rotationAt(body.rotation);
    const Vec3 spin = m.increment.vector(0, body.rotation);
    EXPECT_GT(spin.norm(), 0.2);
    EXPECT_LE((rotation - rotationBy(spin)).norm(), 3e-15); // rounding of a product of matrices
    EXPECT_LE((m.to.displacementAt(body.position, m.from) - m.increment.vector(0, body.position)).norm(), 1e-16);
    const std::span<const JoinedVertex> on_body = m.sim.elements->joinedVertices(m.all());
    ASSERT_EQ(on_body.size(), 4u); // and the point to which the spring draws
    for (const JoinedVertex &j : on_body) {
      const Vec3 arm = m.to.displacements<double>(j.slot, m.to, body.position);
      EXPECT_LE((arm - rotation * m.sim.elements->armAsDrawn(j)).norm(), 1e-15) << j.rod; // rounding, of 0.4
      EXPECT_LE((m.to.rotationAt(j.frame) - rotation).norm(), 1e-15) << j.rod; // of the same products, of units
    }
    const RodRange &ring = m.sim.dofs.rods()[2];
    for (const int k : {0, 1}) expectSamePlace(m.to, ring.slot(9 + k), m.to, ring.slot(k), "behind the ring");
    const std::span<const JoinedEdge> edges = m.sim.elements->joinedEdges(m.all());
    ASSERT_EQ(edges.size(), weld ? 5u : 0u);
    for (const JoinedEdge &j : edges) {
      const Mat3 turned = matrixOf(m.to.frameAt(j.frame)) * matrixOf(m.from.frameAt(j.frame)).transpose();
      EXPECT_LE((turned - rotation).norm(), 3e-15) << j.rod;
    }
  }
}

/// Free vertices and those of junctions go where increments lead; those on bodies leave their straight way by squares,
/// and so do lengths.
TEST(Retraction, OfJoinedRodsIsItsIncrementToFirstOrder) {
  for (const Scene &scene : {meeting(true), meeting(false), onBody(true), onBody(false)}) {
    MovedTogether m(scene, 0.02, 0.5);
    auto astray = [&](double scale) {
      EXPECT_TRUE(m.move(scale));
      std::array<double, 3> most{}; // of free vertices and those of junctions, of those on bodies, of lengths
      std::vector<char> turns(std::size_t(m.sim.dofs.slots()), false);
      for (const JoinedVertex &j : m.sim.elements->joinedVertices(m.all())) turns[j.slot] = j.isOnBody();
      m.forVertices([&](int s) {
        double &of = most[turns[s] ? 1 : 0];
        of = std::max(of, (m.to.displacementAt(s, m.from) - scale * m.increment.vector(0, s)).norm());
      });
      m.forEdges([&](int s) {
        const Vec3 de = scale * (m.increment.vector(0, s + 1) - m.increment.vector(0, s));
        const double linear = m.from[C::length][s] + m.from.frameAt(s).tangent.dot(de);
        most[2] = std::max(most[2], std::abs(m.to[C::length][s] - linear));
      });
      return most;
    };
    const bool body = !scene.bodies.empty();
    const std::array<double, 3> coarse = astray(1e-2), fine = astray(5e-3);
    EXPECT_LE(coarse[0], 1e-16); // exactly
    EXPECT_NEAR(order(coarse[2], fine[2]), 2, 0.05);
    if (body)
      EXPECT_NEAR(order(coarse[1], fine[1]), 2, 0.05);
    else
      EXPECT_EQ(coarse[1], 0);
  }
}

/// Edges are between the vertices as these have moved, with frames of their own turned by their twists, also where
/// vertices are copies.
TEST(Retraction, GivesJoinedRodsTheEdgesBetweenTheirVertices) {
  for (const Scene &scene : {meeting(true), meeting(false), onBody(true), onBody(false)}) {
    MovedTogether m(scene, 0.02, 0.3);
    ASSERT_TRUE(m.move());
    m.forEdges([&](int s) {
      const Vec3 edge = m.to.edges<double>(s);
      const Frame f = m.to.frameAt(s);
      EXPECT_NEAR(m.to[C::length][s], edge.norm(), 1e-15); // rounding, of up to 0.35
      EXPECT_LE((f.tangent - edge.normalized()).norm(), 1e-15);
      EXPECT_NEAR(f.director.norm(), 1, 1e-15);
      EXPECT_NEAR(f.tangent.dot(f.director), 0, 1e-15);
      EXPECT_NEAR(halfAngleBetween(m.from.frameAt(s), f).angle(), m.increment[3][s], 1e-14); // beside minimal rotation
      EXPECT_NEAR(m.to[C::spin][s], m.increment[3][s], 1e-16);
    });
  }
}

/// All positions to their last bits; frames are made anew from those.
TEST(Retraction, OfNothingLeavesJoinedRodsAsTheyAre) {
  for (const Scene &scene : {meeting(true), meeting(false), onBody(true), onBody(false)}) {
    MovedTogether m(scene, 0.02, 0.3);
    ASSERT_TRUE(m.move(0));
    m.forVertices([&](int s) { expectSamePlace(m.to, s, m.from, s, "slot " + std::to_string(s)); });
    m.forEdges([&](int s) {
      EXPECT_NEAR(m.to[C::length][s], m.from[C::length][s], 1e-15); // rounding, of up to 0.35, and of units
      EXPECT_LE((m.to.frameAt(s).tangent - m.from.frameAt(s).tangent).norm(), 1e-15);
      EXPECT_LE((m.to.frameAt(s).director - m.from.frameAt(s).director).norm(), 1e-15);
      EXPECT_EQ(m.to[C::spin][s], m.from[C::spin][s]);
    });
    m.sim.dofs.forBeside(m.all(), [&](int s) {
      expectSamePlace(m.to, s, m.from, s, "beside, slot " + std::to_string(s));
      EXPECT_EQ(m.to.rotationAt(s), m.from.rotationAt(s)) << s;
    });
  }
}

/// With arms as they are there, the way back is exact: directors are carried back the way they came, and bodies turn
/// about the same axis.
TEST(Retraction, OfJoinedRodsGoesBackByTheNegativeIncrement) {
  for (const Scene &scene : {meeting(true), meeting(false), onBody(true), onBody(false)}) {
    MovedTogether m(scene, 0.02, 0.5);
    ASSERT_TRUE(m.move());
    const Configuration start = m.from;
    std::swap(m.from, m.to);
    m.spread(m.from);
    ASSERT_TRUE(m.move(-1));
    // Rounding: of displacements in two words, but for those on bodies by products of rotations with arms of 0.4; of
    // frames by two rotations each.
    m.forVertices(
        [&](int s) { EXPECT_LE(m.to.displacementAt(s, start).norm(), scene.bodies.empty() ? 1e-17 : 1e-15); });
    m.forEdges([&](int s) {
      EXPECT_LE((m.to.frameAt(s).tangent - start.frameAt(s).tangent).norm(), 1e-14);
      EXPECT_LE((m.to.frameAt(s).director - start.frameAt(s).director).norm(), 1e-14);
      EXPECT_EQ(m.to[C::spin][s], 0);
    });
    m.sim.dofs.forBeside(m.all(), [&](int s) {
      EXPECT_LE(m.to.displacementAt(s, start).norm(), 1e-15) << s;
      EXPECT_LE((m.to.rotationAt(s) - start.rotationAt(s)).norm(), 3e-15) << s;
    });
  }
}

/// The incremental potential moves joined rods straight, whatever it is asked for: their lengths hang together.
TEST(Retraction, OfJoinedRodsGoesStraight) {
  for (const Scene &scene : {meeting(true), onBody(true)}) {
    MovedTogether m(scene, 0.02, 0.3);
    IncrementalPotential &potential = *m.sim.potential;
    ASSERT_EQ(m.sim.solver.begin(m.sim.state, TimeLoop::stepOf(statics(), m.sim.state, 1)), PetscErrorCode(0));
    Configuration straight, asked;
    ASSERT_TRUE(potential.tryMove(m.increment, 1, m.all(), RetractionKind::additive, straight));
    ASSERT_TRUE(potential.tryMove(m.increment, 1, m.all(), RetractionKind::length, asked));
    m.forVertices([&](int s) {
      expectSamePlace(asked, s, straight, s, "slot " + std::to_string(s));
      EXPECT_GT(straight.displacementAt(s, potential.iterate()).norm() + !m.sim.elements->freedom()[s], 0);
    });
  }
}

} // namespace
} // namespace tendril::test
