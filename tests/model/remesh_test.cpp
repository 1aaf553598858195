/// Scenes with other numbers of edges: everything keeps its place, and the errors that are compared form one series.
#include "tendril/dynamics/prolong.hpp"
#include "tendril/model/remesh.hpp"

#include "support/rods.hpp"

namespace tendril::test {
namespace {

Drawing drawingOf(const Polyline &shape) { return {shape.curve, false}; }

const HelixShape helix{Vec3::Zero(), Vec3::UnitZ(), Vec3::UnitX(), 1, 0.5, 2, 0.2, 24};

TEST(Remesh, VerticesSupportsAndForcesKeepTheirPlaces) {
  const Polyline shape = helixShape(helix);
  Scene scene = clampedScene(inextensibleRod(shape.points));
  scene.supports.push_back(hold(scene, 0, 16, Support::Kind::pin));
  scene.forces = {{0, 24, Vec3(0, 0, 1)}, {0, 12, Vec3(1, 0, 0)}};
  const Scene fine = remesh(scene, {drawingOf(shape)}, {48});
  ASSERT_EQ(fine.rods[0].edges(), 48);
  for (int v = 0; v <= 24; ++v)
    EXPECT_LT((fine.rods[0].position[2 * v] - scene.rods[0].position[v]).norm(), 1e-14); // rounding
  EXPECT_EQ(fine.supports[1].vertex, 32);
  EXPECT_EQ(fine.forces[0].vertex, 48);
  EXPECT_EQ(fine.forces[1].vertex, 24);
}

TEST(Remesh, NamedVerticesMustStayVertices) {
  const Polyline shape = lineShape(Vec3::Zero(), Vec3::UnitX(), 24);
  Scene scene = clampedScene(straightRod(24));
  const Drawing curve = drawingOf(shape);
  EXPECT_EQ(edgeMultiple(scene, curve, 0), 1); // its ends are vertices of any number
  scene.forces = {{0, 8, Vec3(0, 0, 1)}};
  EXPECT_EQ(edgeMultiple(scene, curve, 0), 3);
  scene.supports.push_back(hold(scene, 0, 12, Support::Kind::pin));
  EXPECT_EQ(edgeMultiple(scene, curve, 0), 6);
  EXPECT_EQ(edgeMultiple(scene, {}, 0), 24); // points all stay
  EXPECT_EQ(remesh(scene, {curve}, {30}).supports[1].vertex, 15);
  EXPECT_THROW(remesh(scene, {curve}, {31}), SceneError);
}

TEST(Remesh, SupportsFollowTheRodUnlessTheSceneSaysHow) {
  const Polyline shape = helixShape(helix);
  Scene scene = clampedScene(inextensibleRod(shape.points));
  const Scene fine = remesh(scene, {drawingOf(shape)}, {96});
  EXPECT_LT((fine.supports[0].frame.tangent - frameAtVertex(fine.rods[0], 0).tangent).norm(), 1e-14);
  scene.supports[0].tangent_given = true;
  EXPECT_EQ(remesh(scene, {drawingOf(shape)}, {96}).supports[0].frame.tangent, scene.supports[0].frame.tangent);
}

double midpointError(int edges) {
  std::vector<Vec3> points;
  for (int i = 0; i <= edges; ++i) {
    const double s = double(i) / edges, angle = 2 * (s + 0.2 * s * s); // edges of different lengths
    points.emplace_back(std::cos(angle), std::sin(angle), 0);
  }
  const Curve curve = curveThrough(inextensibleRod(points));
  double worst = 0;
  for (int i = 0; i < edges; ++i) worst = std::max(worst, std::abs(curve((i + 0.5) / edges).norm() - 1));
  return worst;
}

TEST(CurveThrough, MidpointsAreOfFourthOrder) { EXPECT_NEAR(order(midpointError(16), midpointError(32)), 4, 0.2); }

TEST(CurveThrough, CornersStay) {
  const Rod rod = inextensibleRod({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(2, 1.1, 0), Vec3(3, 1.1, 0)});
  const Curve curve = curveThrough(rod);
  EXPECT_LT((curve(0.5 / 4) - Vec3(0.5, 0, 0)).norm(), 1e-14);
  EXPECT_LT((curve(1.5 / 4) - Vec3(1, 0.5, 0)).norm(), 1e-14);
  EXPECT_GT((curve(2.5 / 4) - Vec3(1.5, 1.05, 0)).norm(), 1e-3); // no corner behind: a parabola through three points
}

TEST(CurveThrough, RingsHaveNoEnds) {
  Rod ring;
  ring.closed = true;
  ring.position = ringShape(Vec3::Zero(), Vec3::UnitZ(), 1, 32).points;
  const Curve curve = curveThrough(ring);
  for (int i = 0; i < 32; ++i) EXPECT_NEAR(curve((i + 0.5) / 32).norm(), curve(0.5 / 32).norm(), 1e-14);
  EXPECT_NEAR(curve(0.5 / 32).norm(), 1, 1e-4); // (h/2)^4 9/24 is 3e-5
}

TEST(Remesh, GivenDirectorsKeepTheirTwist) {
  Rod rod = straightRod(8);
  const double per_edge = 0.3;
  for (int i = 0; i < 8; ++i) rod.director[i] = rotateAbout<double>(Vec3::UnitY(), Vec3::UnitX(), per_edge * i);
  Scene scene = clampedScene(rod);
  const Rod fine = remesh(scene, {{lineShape(Vec3::Zero(), Vec3::UnitX(), 8).curve, true}}, {16}).rods[0];
  for (int i = 0; i < 16; ++i) // the middle of edge i lies at (i + 1/2)/2 edges
    EXPECT_LT((fine.director[i] - rotateAbout<double>(Vec3::UnitY(), Vec3::UnitX(), per_edge * (0.5 * (i + 0.5) - 0.5)))
                  .norm(),
              1e-14);
}

/// Tip of a clamped rod of unit length under a couple on one of its 10 edges, with `factor` times as many.
Vec3 tipUnderCouple(int edge, const Vec3 &couple, double torque, int factor) {
  Scene scene = clampedScene(straightRod(10, Measure::angle));
  scene.rods[0].material.flexural_stiffness = {1, 1.5};
  scene.moments = {{0, edge, torque, couple}};
  scene.forces = {{0, 10, Vec3(0, 0.5, 0.2)}};
  Simulation sim;
  runTo(sim, remesh(scene, {drawingOf(lineShape(Vec3::Zero(), Vec3::UnitX(), 10))}, {10 * factor}), statics());
  return sim.state.position.back();
}

TEST(Remesh, CouplesGiveACleanSeries) {
  for (const int edge : {0, 4, 8, 9})        // at the clamp, inside, by the end, and as an end couple
    for (const double torque : {0.0, 0.5}) { // one by one: with both, Newton stops where its linear convergence lets it
      const Vec3 couple = torque == 0 ? Vec3(0.3, 0.8, 1) : Vec3::Zero();
      const Vec3 x1 = tipUnderCouple(edge, couple, torque, 1), x2 = tipUnderCouple(edge, couple, torque, 2),
                 x4 = tipUnderCouple(edge, couple, torque, 4);
      const Vec3 limit = x4 + (x4 - x2) / 3;
      EXPECT_NEAR(order((x1 - x2).norm(), (x2 - x4).norm()), 2, 0.1) << edge << " " << torque;
      EXPECT_LT((x2 + (x2 - x1) / 3 - limit).norm(), 0.05 * (x2 - limit).norm()) << edge << " " << torque;
    }
}

/// Tip of a parabola under a couple on one of its 12 edges as written, graded, with `edges`; clamped where it is
/// straightest, for a clamp on a curved rod that is twisted has a cubic term.
Vec3 tipOfParabola(int edge, const Vec3 &couple, double torque, int edges) {
  const Curve curve = [](double s) { return Vec3(1 - s, 2 * (1 - s) * (1 - s), 0); };
  std::vector<Vec3> points;
  for (int i = 0; i <= 12; ++i) points.push_back(curve(i / 12.0));
  Scene scene = clampedScene(inextensibleRod(points, Measure::angle));
  scene.supports[0].tangent_given = true;
  scene.supports[0].frame.tangent = Vec3(-1, -4, 0).normalized();
  scene.rods[0].material.flexural_stiffness = {1, 1.5};
  scene.moments = {{0, edge, torque, couple}};
  scene.forces = {{0, 12, Vec3(0, 0.1, 0.05)}};
  std::vector<Drawing> drawings{{curve, false}};
  grade(scene, drawings);
  Simulation sim;
  runTo(sim, remesh(scene, drawings, {edges}), statics());
  return sim.state.position.back();
}

TEST(Remesh, CouplesOnGradedEdgesGiveACleanSeries) {
  for (const int edge : {1, 5, 8}) // a place of its own among the graded edges
    for (const double torque : {0.0, 0.2}) {
      const Vec3 couple = torque == 0 ? Vec3(0.05, 0.1, 0.2) : Vec3::Zero();
      const Vec3 x1 = tipOfParabola(edge, couple, torque, 34), x2 = tipOfParabola(edge, couple, torque, 68),
                 x4 = tipOfParabola(edge, couple, torque, 136);
      const Vec3 limit = x4 + (x4 - x2) / 3;
      EXPECT_NEAR(order((x1 - x2).norm(), (x2 - x4).norm()), 2, 0.1) << edge << " " << torque;
      EXPECT_LT((x2 + (x2 - x1) / 3 - limit).norm(), 0.05 * (x2 - limit).norm()) << edge << " " << torque;
    }
}

/// Largest distance of vertices prolonged at rest from those of the graded rod with twice the edges.
double prolongedError(int edges) {
  const Curve curve = [](double s) { return Vec3(s, 2 * s * s, 0); };
  std::vector<Vec3> points;
  for (int i = 0; i <= 12; ++i) points.push_back(curve(i / 12.0));
  const Scene scene = clampedScene(inextensibleRod(points));
  std::vector<Drawing> drawings{{curve, false}};
  grade(scene, drawings);
  Simulation a, b;
  EXPECT_EQ(a.setUp(remesh(scene, drawings, {edges}), statics()), PetscErrorCode(0));
  EXPECT_EQ(b.setUp(remesh(scene, drawings, {2 * edges}), statics()), PetscErrorCode(0));
  const State state = prolonged(a.state, a.scene, *a.elements, b.scene, *b.elements);
  double worst = 0;
  for (std::size_t v = 0; v < state.position.size(); ++v)
    worst = std::max(worst, (state.position[v] - b.state.position[v]).norm());
  for (std::size_t e = 0; e < state.director.size(); ++e)
    EXPECT_LT((state.director[e] - b.state.director[e]).norm(), 1e-3);
  return worst;
}

TEST(Prolonged, GradedEdgesAreCutWhereTheyAreAtRest) {
  EXPECT_NEAR(order(prolongedError(32), prolongedError(64)), 4, 0.5);
} // in their middles, 2

TEST(Prolonged, TwistKeepsItsWholeTurns) {
  for (const Support::Kind kind : {Support::Kind::clamp, Support::Kind::fix_twist}) {
    Rod rod = straightRod(8, Measure::angle);
    rod.initial_turns = 10; // more than one a cell
    Scene scene = clampedScene(rod);
    scene.supports.push_back(hold(scene, 0, 8, Support::Kind::clamp));
    scene.supports.push_back(hold(scene, 0, 3, kind)); // half cells along the rod
    const Scene fine = remesh(scene, {drawingOf(lineShape(Vec3::Zero(), Vec3::UnitX(), 8))}, {16});
    Simulation a, b;
    EXPECT_PETSC(a.setUp(scene, statics()));
    EXPECT_PETSC(b.setUp(fine, statics()));
    b.state = prolonged(a.state, a.scene, *a.elements, b.scene, *b.elements);
    const double coarse = energyBudget(a.scene, *a.elements, a.state, 1).twist,
                 energy = energyBudget(b.scene, *b.elements, b.state, 1).twist;
    EXPECT_GT(coarse, 100);
    EXPECT_NEAR(energy, coarse, 0.2 * coarse); // a lost turn of a cell would be more than a third of it
  }
}

} // namespace
} // namespace tendril::test
