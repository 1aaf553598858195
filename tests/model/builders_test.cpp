/// Shapes against their formulas.
#include "tendril/model/builders.hpp"

#include <algorithm>
#include <gtest/gtest.h>

namespace tendril::test {
namespace {

constexpr double rounding = 1e-15; // coordinates of order one, a few operations each

TEST(Line, DividesEvenlyAndEndsExactly) {
  const Polyline p = lineShape(Vec3(1, 2, 3), Vec3(2, 0, 3.3), 7);
  ASSERT_EQ(p.points.size(), 8u);
  EXPECT_FALSE(p.closed);
  EXPECT_EQ(p.points.front(), Vec3(1, 2, 3));
  EXPECT_LT((p.points.back() - Vec3(2, 0, 3.3)).norm(), rounding);
  for (int i = 0; i < 7; ++i) EXPECT_LT((p.points[i + 1] - p.points[i] - Vec3(1, -2, 0.3) / 7).norm(), 4 * rounding);
}

TEST(Ring, IsARegularPolygonCounterClockwiseAboutItsNormal) {
  const Vec3 normal = Vec3(1, -2, 0.5).normalized(), center(3, 2, 1);
  const int n = 12;
  const Polyline p = ringShape(center, normal, 0.7, n);
  ASSERT_EQ(p.points.size(), std::size_t(n));
  EXPECT_TRUE(p.closed);
  for (int i = 0; i < n; ++i) {
    const Vec3 a = p.points[i] - center, b = p.points[(i + 1) % n] - center;
    EXPECT_NEAR(a.norm(), 0.7, 4 * rounding);
    EXPECT_NEAR(a.dot(normal), 0, 4 * rounding);
    EXPECT_NEAR(a.cross(b).dot(normal), 0.49 * std::sin(2 * pi / n), 4 * rounding);
  }
}

TEST(Helix, FollowsItsFormula) {
  // (1.25 s, 0.125 T cos 16 pi s, 0.125 T sin 16 pi s), T a smooth step over the first and last tenth:
  // data/scenes/helix.yaml at the origin.
  const Polyline p = helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 1.25, 0.125, 8, 0.1, 128});
  ASSERT_EQ(p.points.size(), 129u);
  for (int k = 0; k <= 128; ++k) {
    const double s = k / 128.0, q = std::min(std::min(s, 1 - s) / 0.1, 1.0), taper = q * q * (3 - 2 * q);
    const Vec3 expected(1.25 * s, 0.125 * taper * std::cos(16 * pi * s), 0.125 * taper * std::sin(16 * pi * s));
    EXPECT_LT((p.points[k] - expected).norm(), 2e-15) << k; // the angle of 50 rad is good to 7e-15
  }
  EXPECT_EQ(p.points[0], Vec3::Zero());
}

TEST(Helix, WithoutTaperKeepsItsRadius) {
  const Vec3 axis = Vec3(1, 1, 0).normalized(), start = Vec3(0, 0, 1), origin(1, 2, 3);
  for (const Vec3 &x : helixShape({origin, axis, start, 2, 0.3, 1.5, 0, 30}).points) {
    const Vec3 d = x - origin;
    EXPECT_NEAR((d - axis * d.dot(axis)).norm(), 0.3, 4 * rounding);
  }
}

} // namespace
} // namespace tendril::test
