/// Reference frames, motions, checks and sizes of rods.
#include "support/files.hpp"
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include <numeric>

namespace tendril::test {
namespace {

constexpr double of_rotations = 1e-13; // of a product of some hundred rotations

/// A coil wound on a torus, of uneven edges: its transported frame does not come back to itself.
Rod bentRing(int edges) {
  Rod rod;
  rod.closed = true;
  for (int i = 0; i < edges; ++i) {
    const double a = 2 * pi * i / edges + 0.3 * std::sin(2 * pi * i / edges);
    const double radius = 1 + 0.3 * std::cos(3 * a);
    rod.position.emplace_back(radius * std::cos(a), radius * std::sin(a), 0.3 * std::sin(3 * a));
  }
  return rod;
}

double angleOver(const Rod &rod, int from, int to) {
  return halfAngleBetween(referenceFrame(rod, from), referenceFrame(rod, to)).angle();
}

TEST(BishopFrames, OfAnOpenRodDoNotTwist) {
  Rod rod;
  rod.position = helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 1, 0.2, 3, 0.1, 60}).points;
  const Vec3 start = Vec3(0.1, 0.7, -0.4);
  setBishopDirectors(rod, start);
  EXPECT_LT((rod.director[0] - orthonormalised(start, rod.edge(0).normalized())).norm(), of_rotations);
  for (int i = 0; i < rod.edges(); ++i) {
    EXPECT_NEAR(rod.director[i].norm(), 1, of_rotations);
    EXPECT_NEAR(rod.director[i].dot(rod.edge(i).normalized()), 0, of_rotations);
    if (i > 0) EXPECT_NEAR(angleOver(rod, i - 1, i), 0, of_rotations);
  }
}

TEST(BishopFrames, OfARingShareItsHolonomyByArcLength) {
  Rod rod = bentRing(40);
  setBishopDirectors(rod);
  const int n = rod.edges();
  std::vector<double> twist(n), between(n);
  double length = 0;
  for (int i = 0; i < n; ++i) {
    const int next = rod.next(i);
    twist[i] = angleOver(rod, i, next);
    between[i] = 0.5 * (rod.edge(i).norm() + rod.edge(next).norm());
    length += rod.edge(i).norm();
  }
  const double total = std::accumulate(twist.begin(), twist.end(), 0.0);
  EXPECT_GT(std::abs(total), 0.1); // there is something to spread
  for (int i = 0; i < n; ++i) EXPECT_NEAR(twist[i], total * between[i] / length, of_rotations) << i;
  // Frames transported once round and turned by the whole holonomy meet the first frame.
  Frame f = referenceFrame(rod, 0);
  for (int i = 1; i <= n; ++i) {
    const Vec3 t = rod.edge(i % n).normalized();
    f.director = transport<double>(f.director, f.tangent, t);
    f.tangent = t;
  }
  EXPECT_LT((rotateAbout<double>(f.director, f.tangent, total) - rod.director[0]).norm(), of_rotations);
}

TEST(BishopFrames, OfAPlaneRingHaveNoTwist) {
  Rod rod;
  const Polyline p = ringShape(Vec3::Zero(), Vec3::UnitZ(), 1, 24);
  rod.position = p.points;
  rod.closed = true;
  setBishopDirectors(rod);
  for (int i = 0; i < rod.edges(); ++i) EXPECT_NEAR(angleOver(rod, i, rod.next(i)), 0, of_rotations);
}

TEST(FrameAtVertex, ExtrapolatesACircleToItsEndTangentAtSecondOrder) {
  auto error = [](int edges) {
    std::vector<Vec3> points;
    for (int i = 0; i <= edges; ++i)
      points.emplace_back(std::sin(double(i) / edges), 1 - std::cos(double(i) / edges), 0);
    const Rod rod = inextensibleRod(points);
    return (frameAtVertex(rod, 0).tangent - Vec3::UnitX()).norm() +
           (frameAtVertex(rod, edges).tangent - Vec3(std::cos(1), std::sin(1), 0)).norm();
  };
  EXPECT_GE(order(error(20), error(40)), 1.9); // on a circle even the h^2 term cancels
  const Rod straight = straightRod(3);
  EXPECT_EQ(frameAtVertex(straight, 0).tangent, Vec3::UnitX());
}

TEST(Motion, IsLinearBetweenTheRowsOfItsTableAndRestsOutside) {
  Motion m;
  EXPECT_FALSE(m.moves());
  m.table = {{1, Vec3(0, 0, 0), Vec3::Zero()}, {2, Vec3(1, 0, 0), Vec3(0, 0, 1)}, {4, Vec3(1, 2, 0), Vec3(0, 0, 1)}};
  EXPECT_TRUE(m.moves());
  EXPECT_EQ(m.displacementAt(0), Vec3::Zero());
  EXPECT_EQ(m.displacementAt(1.5), Vec3(0.5, 0, 0));
  EXPECT_EQ(m.displacementAt(2), Vec3(1, 0, 0));
  EXPECT_EQ(m.displacementAt(3), Vec3(1, 1, 0));
  EXPECT_EQ(m.displacementAt(9), Vec3(1, 2, 0));
  EXPECT_LT((m.rotationAt(1.5) - Eigen::AngleAxisd(0.5, Vec3::UnitZ()).toRotationMatrix()).norm(), of_rotations);
  Motion steady;
  steady.velocity = Vec3(0, 2, 0);
  steady.angular_velocity = Vec3(3, 0, 0);
  EXPECT_EQ(steady.displacementAt(0.5), Vec3(0, 1, 0));
  EXPECT_LT((steady.rotationAt(2) - Eigen::AngleAxisd(6, Vec3::UnitX()).toRotationMatrix()).norm(), of_rotations);
}

TEST(CheckRod, NamesWhatCannotBeComputed) {
  Rod rod;
  rod.name = "r";
  auto message = [&](std::vector<Vec3> points, bool closed = false) {
    rod.position = std::move(points);
    rod.closed = closed;
    return messageOf([&] { checkRod(rod); });
  };
  EXPECT_TRUE(says(message({{0, 0, 0}}), "rod 'r': has 1 vertices"));
  EXPECT_TRUE(says(message({{0, 0, 0}, {1, 0, 0}}, true), "at least 3"));
  EXPECT_TRUE(says(message({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}}), "edge 1 (vertex 1 to 2) has zero length"));
  EXPECT_TRUE(says(message({{0, 0, 0}, {1, 0, 0}, {0, 1e-4, 0}}), "folds back on itself at vertex 1"));
  EXPECT_TRUE(says(message({{0, 0, 0}, {1, 0, 0}, {0.5, 0, 0}}, true), "folds back on itself at vertex 0"));
  EXPECT_TRUE(says(message({{0, 0, 0}, {NAN, 0, 0}}), "vertex 1 has a coordinate that is not finite"));
  EXPECT_TRUE(says(message({{0, 0, 0}, {1e200, 0, 0}}), "too long"));
  rod.position = {{0, 0, 0}, {1e-200 + 1, 0, 0}, {1, 1e-3, 0}};
  rod.closed = false;
  EXPECT_NO_THROW(checkRod(rod)); // a short edge and a right angle are no mistakes
}

TEST(DimensionlessGroups, FollowTheirDefinitions) {
  Rod rod = straightRod(10, Measure::tan, 2);
  rod.material.linear_density = 3;
  const DimensionlessGroups g = dimensionlessGroups(rod, Vec3(0, 0, -10));
  EXPECT_NEAR(g.length, 2, of_rotations);
  EXPECT_NEAR(g.gravito_bending, 3 * 10 * 8 / 1.0, 1e-12 * 240); // rho g L^3/EI
  EXPECT_NEAR(g.axial_to_bending, 4e10, 1e-12 * 4e10);           // EA L^2/EI
  EXPECT_EQ(g.largest_turning, 0);
  Rod ring;
  ring.position = ringShape(Vec3::Zero(), Vec3::UnitZ(), 1, 8).points;
  ring.closed = true;
  setBishopDirectors(ring);
  ring.director[3] = rotateAbout<double>(ring.director[3], ring.edge(3).normalized(), 0.2);
  const DimensionlessGroups r = dimensionlessGroups(ring, Vec3::Zero());
  EXPECT_NEAR(r.largest_turning, 45, 1e-12);
  EXPECT_NEAR(r.largest_twist, 0.2 * 180 / pi, 1e-12);
}

TEST(Motion, VelocityAtARowOfTheTableIsThatBefore) {
  Motion motion;
  motion.table = {{1, Vec3::Zero(), Vec3::Zero()}, {2, Vec3(4, 0, 0), Vec3::Zero()}, {4, Vec3(4, 6, 0), Vec3::Zero()}};
  EXPECT_EQ(motion.velocityAt(1), Vec3(0, 0, 0));
  EXPECT_EQ(motion.velocityAt(1.5), Vec3(4, 0, 0));
  EXPECT_EQ(motion.velocityAt(2), Vec3(4, 0, 0));
  EXPECT_EQ(motion.velocityAt(4), Vec3(0, 3, 0));
  EXPECT_EQ(motion.velocityAt(4.5), Vec3(0, 0, 0));
}

} // namespace
} // namespace tendril::test
