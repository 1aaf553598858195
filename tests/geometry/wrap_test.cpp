/// Shortest ways round cylinders and spheres: reference values, derivatives, where they begin to wind.
#include "tendril/geometry/wrap.hpp"

#include "support/random_cell.hpp"
#include "support/rods.hpp"

namespace tendril::test {
namespace {

TEST(Wrap, LengthsAndSlopesAreThoseOfTheTable) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/bodies_wrapping.csv");
  std::string line;
  int rows = 0, wound = 0;
  while (std::getline(in, line)) {
    if (line.empty() || line[0] == '#' || line.rfind("kind", 0) == 0) continue;
    std::istringstream cells(line);
    std::string kind, cell;
    std::getline(cells, kind, ',');
    std::vector<double> v;
    while (std::getline(cells, cell, ',')) v.push_back(std::stod(cell));
    ASSERT_EQ(v.size(), 13u);
    const Vec3 p(v[1], v[2], v[3]), q(v[4], v[5], v[6]);
    const WayLength way = kind == "cylinder" ? wayRoundCylinder(p, q, v[0], 0) : wayRoundSphere(p, q, v[0]);
    EXPECT_NEAR(way.value, v[7], 1e-13 * v[7]) << line;
    EXPECT_NEAR(way.angle, v[8], 1e-12) << line;
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(way.gradient[a], v[std::size_t(10 + a)], 1e-8) << line; // differences there
    ++rows;
    wound += way.angle > 0;
  }
  EXPECT_EQ(rows, 12);
  EXPECT_GE(wound, 7);
}

using D6 = Dual<6>;
using V6 = Vector3<D6>;

V6 variables(const Vec3 &x, int first) {
  return {D6::variable(x[0], first), D6::variable(x[1], first + 1), D6::variable(x[2], first + 2)};
}
D6 arcCosine(const D6 &x) { return atan2(sqrt(D6(1.0) - x * x), x); }

/// Lengths as their definitions have them, against the derivatives in closed form.
TEST(Wrap, DerivativesMatchAutomaticDifferentiation) {
  Random random(3);
  int wound = 0;
  for (int repeat = 0; repeat < 200; ++repeat) {
    const double r = 0.4;
    const Vec3 p = (1.1 + 0.5 * random()) * random.direction(), q = (1.1 + 0.5 * random()) * random.direction();
    if (p.head<2>().norm() < 1.05 * r || q.head<2>().norm() < 1.05 * r) continue;
    const V6 x = variables(p, 0), y = variables(q, 3);
    for (const int side : {0, 1, -1}) {
      const WayLength way = wayRoundCylinder(p, q, r, side);
      if (!std::isfinite(way.value)) continue; // of neither side
      D6 exact;
      if (way.angle > 0) {
        D6 between = atan2(x[0] * y[1] - x[1] * y[0], x[0] * y[0] + x[1] * y[1]);
        const double sense = side != 0 ? side : between.v < 0 ? -1 : 1;
        between = between * D6(sense);
        if (between.v < -0.5 * pi) between = between + D6(2 * pi);
        const D6 a = sqrt(x[0] * x[0] + x[1] * x[1]), b = sqrt(y[0] * y[0] + y[1] * y[1]);
        const D6 h = sqrt(a * a - D6(r * r)) + sqrt(b * b - D6(r * r)) +
                     D6(r) * (between - arcCosine(D6(r) / a) - arcCosine(D6(r) / b));
        exact = sqrt(h * h + (x[2] - y[2]) * (x[2] - y[2]));
        ++wound;
      } else
        exact = sqrt((x - y).squaredNorm());
      EXPECT_NEAR(way.value, exact.v, 1e-13);
      EXPECT_LT((way.gradient - exact.g).norm(), 1e-12);
      EXPECT_LT((way.hessian - exact.h).norm(), 1e-11 * (1 + exact.h.norm())) << side << " " << way.angle;
    }
    const WayLength way = wayRoundSphere(p, q, r);
    if (!(way.angle > 0)) continue;
    const D6 a = sqrt(x.squaredNorm()), b = sqrt(y.squaredNorm());
    const D6 exact = sqrt(a * a - D6(r * r)) + sqrt(b * b - D6(r * r)) +
                     D6(r) * (arcCosine(x.dot(y) / (a * b)) - arcCosine(D6(r) / a) - arcCosine(D6(r) / b));
    EXPECT_NEAR(way.value, exact.v, 1e-13);
    EXPECT_LT((way.gradient - exact.g).norm(), 1e-11);
    EXPECT_LT((way.hessian - exact.h).norm(), 1e-9 * (1 + exact.h.norm())); // dual acos of angles near a half turn
    ++wound;
  }
  EXPECT_GT(wound, 100);
}

/// Where a way begins to wind, its length and its slope are those of the straight one.
TEST(Wrap, BeginsToWindWithoutAJump) {
  const Vec3 p(-1, 0.4, -0.2), q(1.3, 0.4, 0.5);
  const Vec3 up(0, 1e-7, 0);
  for (const int side : {0, -1}) {
    const WayLength above = wayRoundCylinder(p + up, q + up, 0.4, side),
                    below = wayRoundCylinder(p - up, q - up, 0.4, side);
    EXPECT_EQ(above.angle, 0);
    EXPECT_GT(below.angle, 0);
    EXPECT_NEAR(above.value, below.value, 1e-12);
    EXPECT_LT((above.gradient - below.gradient).norm(), 1e-6);
  }
  // Held to the other side it goes the long way; within the cylinder is none.
  EXPECT_GT(wayRoundCylinder(p, q, 0.4, 1).value, wayRoundCylinder(p, q, 0.4, -1).value + 0.1);
  EXPECT_EQ(wayRoundCylinder({0.1, 0, 0}, q, 0.4, 0).value, HUGE_VAL);
  // By a side on which it would wind by more than three quarters of a turn it does not go straight through.
  const double angle = 80 * pi / 180;
  EXPECT_EQ(wayRoundCylinder({1.02, 0, 0}, {1.02 * std::cos(angle), 1.02 * std::sin(angle), 0}, 1, -1).value, HUGE_VAL);
  EXPECT_EQ(wayRoundSphere({0.1, 0, 0}, q, 0.4).value, HUGE_VAL);
  EXPECT_EQ(straightWay(Vec3::Zero()).value, HUGE_VAL);
}

/// What pictures show of a way is as long as it.
TEST(Wrap, DrawnPointsLieOnTheWay) {
  const Vec3 p(-1, 0.1, -0.2), q(1.3, 0.2, 0.5);
  for (const bool sphere : {true, false}) {
    const double r = 0.4;
    const auto on = sphere ? drawnRoundSphere(p, q, r, 400) : drawnRoundCylinder(p, q, r, 0, 400);
    ASSERT_EQ(on.size(), 400u);
    double length = (on.front() - p).norm() + (q - on.back()).norm();
    for (std::size_t k = 1; k < on.size(); ++k) {
      length += (on[k] - on[k - 1]).norm();
      EXPECT_NEAR(sphere ? on[k].norm() : on[k].head<2>().norm(), r, 1e-14);
    }
    const double exact = sphere ? wayRoundSphere(p, q, r).value : wayRoundCylinder(p, q, r, 0).value;
    EXPECT_NEAR(length, exact, 1e-5); // chords of 400 parts
  }
}

} // namespace
} // namespace tendril::test
