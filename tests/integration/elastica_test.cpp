/// Statics against exact solutions of the elastica (data/reference, each with its source), and the order of every
/// boundary.
#include "support/rods.hpp"

namespace tendril::test {
namespace {

constexpr double tolerance = 0.1; // asked of every boundary: 2.0 +- 0.1

double tipLoadError(int edges, double alpha, Measure measure) {
  Scene scene = clampedScene(straightRod(edges, measure));
  scene.forces = {{0, edges, Vec3(0, -alpha, 0)}};
  Simulation sim;
  runTo(sim, scene, statics());
  auto exact = referenceRow("elastica_tip_load.csv", alpha);
  const Vec3 tip = sim.state.position.back();
  return std::hypot(tip.x() - exact["x_tip"], -tip.y() - exact["delta"]);
}

TEST(Elastica, TipLoadConvergesAtSecondOrder) {
  for (const Measure measure : {Measure::tan, Measure::angle})
    for (const double alpha : {1.0, 5.0}) {
      const double coarse = tipLoadError(32, alpha, measure), fine = tipLoadError(64, alpha, measure);
      EXPECT_NEAR(order(coarse, fine), 2, tolerance) << "alpha " << alpha;
      EXPECT_LT(fine, 5e-4); // theory: a few h^2
    }
}

double selfWeightError(int edges, double gamma) {
  Scene scene = clampedScene(straightRod(edges, Measure::angle));
  scene.gravity = Vec3(0, -gamma, 0);
  Simulation sim;
  runTo(sim, scene, statics());
  auto exact = referenceRow("elastica_self_weight.csv", gamma);
  const Vec3 tip = sim.state.position.back();
  return std::hypot(tip.x() - exact["x_tip"], tip.y() - exact["y_tip"]);
}

TEST(Elastica, FreeEndUnderSelfWeightIsSecondOrder) {
  for (const double gamma : {1.0, 10.0, 100.0})
    EXPECT_NEAR(order(selfWeightError(64, gamma), selfWeightError(128, gamma)), 2, tolerance) << gamma;
}

/// Pinned column shortened past buckling; the bump it is drawn with only breaks the symmetry.
double pinnedError(int edges, double shortening, double height) {
  std::vector<Vec3> points;
  for (int i = 0; i <= edges; ++i) points.emplace_back(double(i) / edges, 0, 0);
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {inextensibleRod(points, Measure::angle)};
  scene.rods[0].material.flexural_stiffness = {1,
                                               4}; // it bends about one axis only: a round rod may buckle in any plane
  scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, edges, Support::Kind::pin),
                    hold(scene, 0, 0, Support::Kind::fix_twist)};
  scene.supports[1].motion.velocity = Vec3(-shortening, 0, 0);
  Simulation sim;
  runTo(sim, scene, statics(8));
  double highest = 0;
  for (const Vec3 &x : sim.state.position) highest = std::max(highest, x.tail<2>().norm());
  return std::abs(highest - height);
}

TEST(Elastica, PinnedColumnPastBucklingIsSecondOrder) {
  // alpha = 60 degrees: shortening and height of the middle (elastica_postbuckling.csv).
  const double e = 0.258980393923673, y = 0.296603823082443;
  const double coarse = pinnedError(32, e, y), fine = pinnedError(64, e, y);
  EXPECT_NEAR(order(coarse, fine), 2, tolerance);
  EXPECT_LT(fine, 1e-3);
}

double rollUpError(int edges, Measure measure) {
  Scene scene = clampedScene(straightRod(edges, measure));
  scene.moments = {{0, edges - 1, 0, Vec3(0, 0, 2 * pi)}};
  Simulation sim;
  runTo(sim, scene, statics(4));
  return sim.state.position.back().norm(); // the tip meets the clamp
}

TEST(Elastica, EndMomentRollsTheRodIntoACircle) {
  for (const Measure measure : {Measure::tan, Measure::angle}) {
    const double coarse = rollUpError(16, measure), fine = rollUpError(32, measure);
    if (measure == Measure::tan) EXPECT_NEAR(order(coarse, fine), 2, tolerance);
    // With the angle measure every vertex turns by exactly 2 pi/n: the polygon closes to the tolerance of the solver.
    if (measure == Measure::angle) EXPECT_LT(fine, 1e-6);
  }
}

TEST(Torsion, TorqueTwistsUniformlyAndExactly) {
  const int n = 20;
  const double torque = 3; // 4.5 rad over the rod
  Scene scene = clampedScene(straightRod(n, Measure::angle));
  scene.moments = {{0, n - 1, torque, Vec3::Zero()}};
  Simulation sim;
  runTo(sim, scene, statics());
  for (int i = 0; i < n; ++i) {
    const double expected = torque * (i + 0.5) / n / (2.0 / 3); // edge i lies at (i + 1/2)/n: the clamp's half cell
    const Vec3 d = rotateAbout<double>(sim.scene.rods[0].director[i], Vec3::UnitX(), expected);
    EXPECT_LT((sim.state.director[i] - d).norm(), 1e-8);
  }
}

TEST(Torsion, PrescribedSpinOfBothEndsIsSecondOrderAndStraight) {
  const int n = 16;
  Scene scene = clampedScene(straightRod(n, Measure::angle));
  scene.supports.push_back(hold(scene, 0, n, Support::Kind::clamp));
  scene.supports[1].motion.angular_velocity = Vec3(1.5, 0, 0);
  Simulation sim;
  runTo(sim, scene, statics());
  for (int i = 0; i < n; ++i) {
    const Vec3 d = rotateAbout<double>(sim.scene.rods[0].director[i], Vec3::UnitX(), 1.5 * (i + 0.5) / n);
    EXPECT_LT((sim.state.director[i] - d).norm(), 1e-9);
  }
}

TEST(FixTwist, HoldsTheSpinOfAPinnedRodAtSecondOrder) {
  // Twisted at one end, pinned and held against spin at the other: the same uniform twist as between clamps.
  const int n = 16;
  Scene scene = clampedScene(straightRod(n, Measure::angle));
  scene.supports.push_back(hold(scene, 0, n, Support::Kind::pin));
  scene.supports.push_back(hold(scene, 0, n, Support::Kind::fix_twist));
  scene.supports[2].motion.angular_velocity = Vec3(1.0, 0, 0);
  Simulation sim;
  runTo(sim, scene, statics());
  const Vec3 d = rotateAbout<double>(sim.scene.rods[0].director[n - 1], Vec3::UnitX(), 1.0 * (n - 0.5) / n);
  EXPECT_LT((sim.state.director[n - 1] - d).norm(), 1e-9);
}

} // namespace
} // namespace tendril::test
