/// Splines through points.
#include "tendril/geometry/spline.hpp"

#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// Points on a circle of radius 1 at uneven distances.
std::vector<Vec3> arc(int edges) {
  std::vector<Vec3> points;
  for (int i = 0; i <= edges; ++i) {
    const double s = double(i) / edges, angle = 2 * (s + 0.2 * s * s);
    points.emplace_back(std::cos(angle), std::sin(angle), 0);
  }
  return points;
}

Vec3 on(const std::vector<Vec3> &x, const std::vector<Vec3> &m, int edge, double t) {
  return hermite(x[edge], x[edge + 1], m[edge], m[edge + 1], (x[edge + 1] - x[edge]).norm(), t);
}

TEST(Spline, IsOfFourthOrderUpToItsEnds) {
  auto error = [](int edges) {
    const std::vector<Vec3> x = arc(edges), m = splineSlopes(x);
    double worst = 0;
    for (int e = 0; e < edges; ++e)
      for (const double t : {0.2, 0.5, 0.8}) worst = std::max(worst, std::abs(on(x, m, e, t).norm() - 1));
    return worst;
  };
  EXPECT_NEAR(order(error(16), error(32)), 4, 0.3); // the edges at the ends lead, by their larger constant
}

TEST(Spline, HasACurvatureAtItsPoints) {
  const std::vector<Vec3> x = arc(9), m = splineSlopes(x);
  const double step = 1e-4;
  for (int v = 1; v < 9; ++v) { // second differences over the length
    const double a = step * (x[v] - x[v - 1]).norm(), b = step * (x[v + 1] - x[v]).norm();
    const Vec3 before = (on(x, m, v - 1, 1) - 2 * on(x, m, v - 1, 1 - step) + on(x, m, v - 1, 1 - 2 * step)) / (a * a);
    const Vec3 after = (on(x, m, v, 0) - 2 * on(x, m, v, step) + on(x, m, v, 2 * step)) / (b * b);
    EXPECT_LT((before - after).norm(), 1e-3); // of 1: the third derivative times the step
  }
}

TEST(Spline, OfFewPointsIsAParabolaOrALine) {
  const std::vector<Vec3> line{Vec3(0, 0, 0), Vec3(2, 0, 0)}, m = splineSlopes(line);
  EXPECT_LT((on(line, m, 0, 0.3) - Vec3(0.6, 0, 0)).norm(), 1e-15);
  const std::vector<Vec3> bend{Vec3(-1, 1, 0), Vec3(0, 0, 0), Vec3(1, 1, 0)}, slopes = splineSlopes(bend);
  EXPECT_LT((on(bend, slopes, 0, 0.5) - Vec3(-0.5, 0.25, 0)).norm(), 1e-15);
}

} // namespace
} // namespace tendril::test
