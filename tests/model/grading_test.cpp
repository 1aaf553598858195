/// Edges graded by curvature: where they are short, what stays a vertex, what stays uniform.
#include "tendril/model/remesh.hpp"

#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// A parabola, 16 times more strongly bent where it begins than at its end; `edges` as written.
Polyline parabola(int edges) {
  Polyline p;
  p.curve = [](double s) { return Vec3(s, 2 * s * s, 0); };
  for (int i = 0; i <= edges; ++i) p.points.push_back(p.curve(double(i) / edges));
  return p;
}

/// The scene's only rod along a curve, or only points.
std::vector<Drawing> graded(const Scene &scene, const Curve &curve, bool directors_given = false) {
  std::vector<Drawing> drawings{{curve, directors_given}};
  grade(scene, drawings);
  return drawings;
}

double longest(const Rod &rod, double &growth) {
  double least = 1e300, most = 0;
  growth = 1;
  for (int i = 0; i < rod.edges(); ++i) {
    const double h = rod.edge(i).norm(), before = rod.edge(std::max(i - 1, 0)).norm();
    least = std::min(least, h);
    most = std::max(most, h);
    growth = std::max({growth, h / before, before / h});
  }
  return most / least;
}

TEST(Grading, IsShortWhereTheDrawingBends) {
  const Scene scene = clampedScene(inextensibleRod(parabola(24).points));
  for (const Curve &curve : {parabola(24).curve, Curve()}) { // a curve, and its points
    const std::vector<Drawing> drawings = graded(scene, curve);
    EXPECT_EQ(edgeMultiple(scene, drawings[0], 0), 1);
    double growth;
    const Rod few = remesh(scene, drawings, {8}).rods[0], many = remesh(scene, drawings, {64}).rods[0];
    EXPECT_GT(longest(few, growth), 1.1);
    EXPECT_LT(growth, 1.5);
    EXPECT_LT(longest(many, growth), 2.2);
    EXPECT_LT(growth, 1.07); // 1.5 to the power of 8/64, and a little for the middle of the step
    EXPECT_LT(many.edge(0).norm(), many.edge(63).norm());
    EXPECT_NEAR(many.position.back().y(), 2, 1e-12);
  }
}

TEST(Grading, CutsEveryEdgeInTwo) {
  const Scene scene = clampedScene(inextensibleRod(parabola(24).points));
  for (const Curve &curve : {parabola(24).curve, Curve()}) {
    const std::vector<Drawing> drawings = graded(scene, curve);
    const Scene coarse = remesh(scene, drawings, {19}), fine = remesh(scene, drawings, {38});
    for (int v = 0; v <= 19; ++v) EXPECT_EQ(coarse.rods[0].position[v], fine.rods[0].position[2 * v]); // to the bit
  }
}

TEST(Grading, LeavesUniformCurvesAlone) {
  for (const Polyline &shape :
       {lineShape(Vec3::Zero(), Vec3::UnitX(), 24), ringShape(Vec3::Zero(), Vec3::UnitZ(), 1, 24),
        helixShape({Vec3::Zero(), Vec3::UnitZ(), Vec3::UnitX(), 1, 0.5, 3, 0, 24})}) {
    Rod rod;
    rod.closed = shape.closed;
    rod.position = shape.points;
    setBishopDirectors(rod);
    Scene scene;
    scene.rods = {rod};
    scene.forces = {{0, 8, Vec3::UnitX()}, {0, 12, Vec3::UnitX()}};
    const std::vector<Drawing> drawings = graded(scene, shape.curve);
    EXPECT_FALSE(drawings[0].grading);
    EXPECT_EQ(edgeMultiple(scene, drawings[0], 0), 6);
  }
}

TEST(Grading, SparesDearMultiples) {
  Scene scene = clampedScene(straightRod(1000));
  scene.forces = {{0, 501, Vec3(0, 0, 1)}};
  const std::vector<Drawing> drawings = graded(scene, lineShape(Vec3::Zero(), Vec3::UnitX(), 1000).curve);
  EXPECT_EQ(edgeMultiple(scene, drawings[0], 0), 2); // uniform edges would come in thousands
  const Scene coarse = remesh(scene, drawings, {10});
  EXPECT_EQ(coarse.forces[0].vertex, 5);
  EXPECT_LT((coarse.rods[0].position[5] - Vec3(0.501, 0, 0)).norm(), 1e-15);
}

TEST(Grading, NamedVerticesAndCornersStay) {
  std::vector<Vec3> points;
  for (int i = 0; i <= 30; ++i) points.emplace_back(0.1 * i, 0.3 * std::sin(0.2 * i), 0);
  for (int i = 1; i <= 20; ++i) points.emplace_back(3, points[30].y(), -0.1 * i); // corner at vertex 30
  Scene scene = clampedScene(inextensibleRod(points));
  scene.forces = {{0, 13, Vec3(0, 0, 1)}};
  scene.supports.push_back(hold(scene, 0, 41, Support::Kind::pin));
  const std::vector<Drawing> drawings = graded(scene, {});
  const int multiple = edgeMultiple(scene, drawings[0], 0);
  EXPECT_LE(multiple, 8); // instead of 50
  for (const int n : {multiple, 5 * multiple}) {
    const Scene drawn = remesh(scene, drawings, {n});
    EXPECT_LT((drawn.rods[0].position[drawn.forces[0].vertex] - points[13]).norm(), 1e-14);
    EXPECT_LT((drawn.rods[0].position[drawn.supports[1].vertex] - points[41]).norm(), 1e-14);
    EXPECT_TRUE(std::any_of(drawn.rods[0].position.begin(), drawn.rods[0].position.end(),
                            [&](const Vec3 &x) { return (x - points[30]).norm() < 1e-14; }));
  }
  EXPECT_THROW(remesh(scene, drawings, {5 * multiple + 1}), SceneError);
}

TEST(Grading, GoesRoundClosedRods) {
  std::vector<Vec3> ellipse;
  for (int i = 0; i < 60; ++i) ellipse.emplace_back(std::cos(pi / 30 * i), 0.25 * std::sin(pi / 30 * i), 0);
  Scene scene;
  Rod &rod = scene.rods.emplace_back();
  rod.closed = true;
  rod.position = ellipse;
  setBishopDirectors(rod);
  scene.forces = {{0, 30, Vec3::UnitY()}};
  const std::vector<Drawing> drawings = graded(scene, {});
  const Scene drawn = remesh(scene, drawings, {48});
  ASSERT_EQ(drawn.rods[0].edges(), 48);
  EXPECT_LT((drawn.rods[0].position[drawn.forces[0].vertex] - ellipse[30]).norm(), 1e-14);
  const Rod &r = drawn.rods[0];
  EXPECT_NEAR(r.edge(0).norm() / r.edge(47).norm(), 1, 1e-3); // both sides of the sharp end are alike
  EXPECT_LT(r.edge(0).norm(), 0.5 * r.edge(12).norm());
  for (const Vec3 &x : r.position)
    EXPECT_NEAR(std::hypot(x.x(), 4 * x.y()), 1, 5e-3); // cubics through points 24 degrees apart at the sharp ends
}

TEST(Grading, IsSharedByCopies) {
  Scene scene = clampedScene(inextensibleRod(parabola(24).points));
  scene.rods.push_back(scene.rods[0]);
  for (Vec3 &x : scene.rods[1].position) x += Vec3(0, 0, 1);
  std::vector<Drawing> drawings(2);
  grade(scene, drawings);
  EXPECT_EQ(drawings[0].grading, drawings[1].grading);
  scene.forces = {{1, 7, Vec3::UnitX()}};
  grade(scene, drawings);
  EXPECT_NE(drawings[0].grading, drawings[1].grading);
}

TEST(Grading, GivenDirectorsKeepTheirTwist) {
  const Curve curve = parabola(24).curve;
  Rod rod = inextensibleRod(parabola(24).points);
  auto twisted = [&](const Rod &r, int i) { // 2 rad per unit of x, from Bishop's frames of a plane curve
    const Vec3 t = r.edge(i).normalized();
    return rotateAbout<double>(Vec3::UnitZ(), t, r.position[i].x() + r.position[i + 1].x());
  };
  for (int i = 0; i < 24; ++i) rod.director[i] = twisted(rod, i);
  const Scene scene = clampedScene(rod);
  const Rod fine = remesh(scene, graded(scene, curve, true), {96}).rods[0];
  for (int i = 0; i < 96; ++i)
    EXPECT_LT((fine.director[i] - twisted(fine, i)).norm(), 1e-3); // h^2/8 of an edge as written
}

TEST(Grading, TangentsOfSupportsAreOfSecondOrder) {
  auto error = [](int factor) {
    Scene scene = clampedScene(inextensibleRod(parabola(24).points));
    scene.supports.push_back(hold(scene, 0, 7, Support::Kind::clamp)); // edges differ on its sides by whole numbers
    const std::vector<Drawing> drawings = graded(scene, parabola(24).curve);
    const double x = 7.0 / 24;
    const Vec3 exact = Vec3(1, 4 * x, 0).normalized();
    return (remesh(scene, drawings, {factor * edgeMultiple(scene, drawings[0], 0)}).supports[1].frame.tangent - exact)
        .norm();
  };
  EXPECT_GT(order(error(8), error(16)), 1.9);
}

/// At vertices all along a graded curve, where edges grow on one side and shrink on the other.
TEST(Grading, TangentsOfSupportsLeanToTheShorterEdge) {
  double weighted = 0, worst = 0;
  for (int v = 2; v < 23; ++v) {
    Scene scene = clampedScene(inextensibleRod(parabola(24).points));
    scene.supports.push_back(hold(scene, 0, v, Support::Kind::clamp));
    const std::vector<Drawing> drawings = graded(scene, parabola(24).curve);
    const Scene fine = remesh(scene, drawings, {16 * edgeMultiple(scene, drawings[0], 0)});
    const int at = fine.supports[1].vertex;
    const Vec3 exact = Vec3(1, 4 * v / 24.0, 0).normalized();
    const Frame before = referenceFrame(fine.rods[0], at - 1), after = referenceFrame(fine.rods[0], at);
    const Vec3 mean = (before.tangent + after.tangent).normalized();
    weighted = std::max(weighted, (mean - exact).norm());
    worst = std::max(worst, (fine.supports[1].frame.tangent - exact).norm());
  }
  EXPECT_LT(worst, 0.2 * weighted); // than the mean of both edges would do; a tenth
}

} // namespace
} // namespace tendril::test
