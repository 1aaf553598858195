#include "tendril/geometry/solids.hpp"

#include "support/dual.hpp"

#include <gtest/gtest.h>
#include <random>

namespace tendril::test {

template <int N> Dual<N> abs(const Dual<N> &x) { return x.v < 0 ? -x : x; }

namespace {

struct Named {
  std::string name;
  std::shared_ptr<const Shape> shape;
  std::function<Dual<3>(const Vector3<Dual<3>> &)> distance;
};

template <class Solid> Named named(const char *name, std::shared_ptr<const Shape> shape, const Solid &solid) {
  return {name, std::move(shape), [solid](const Vector3<Dual<3>> &x) { return solid.distance(x); }};
}

/// Sizes of about s.
std::vector<Named> shapes(double s) {
  const double inf = HUGE_VAL;
  return {named("half space", makeHalfSpace(), HalfSpaceSolid{}),
          named("sphere", makeSphere(s), CapsuleSolid{s, 0}),
          named("capsule", makeCapsule(0.4 * s, 1.5 * s), CapsuleSolid{0.4 * s, 0.75 * s}),
          named("cylinder", makeCylinder(0.7 * s, s), TubeSolid{-1, 0.7 * s, 0.5 * s}),
          named("endless cylinder", makeCylinder(0.7 * s, inf), TubeSolid{-1, 0.7 * s, inf}),
          named("box", makeBox(Vec3(s, 0.5 * s, 2 * s)), BoxSolid{Vec3(0.5 * s, 0.25 * s, s)}),
          named("pipe", makeTube(0.5 * s, 0.8 * s, 2 * s), TubeSolid{0.5 * s, 0.8 * s, s}),
          named("bore", makeTube(0.5 * s, inf, inf), TubeSolid{0.5 * s, inf, inf})};
}

std::mt19937 generator(7);
Vec3 randomPoint(double size) {
  std::uniform_real_distribution<double> side(-size, size);
  return {side(generator), side(generator), side(generator)};
}

double distanceOf(const Shape &shape, const Vec3 &x) {
  const double *const point[3] = {&x[0], &x[1], &x[2]};
  double out;
  shape.distances(point, 1, &out);
  return out;
}

/// Automatic differentiation cannot go through the root of zero inside solids; there, gradients are constant along the
/// way to the surface, which the differences of the next test show.
TEST(Shape, DerivativesAreThoseOfTheDistance) {
  for (const double scale : {1e-4, 1.0, 1e2})
    for (const Named &s : shapes(scale))
      for (int n = 0; n < 300; ++n) {
        const Vec3 x = randomPoint(2 * scale);
        Vector3<Dual<3>> dual;
        for (int k = 0; k < 3; ++k) dual[k] = Dual<3>::variable(x[k], k);
        const Dual<3> expected = s.distance(dual);
        const Distance found = s.shape->at(x);
        const double curved = 1 / std::max(std::abs(found.value), 1e-3 * scale); // bound of second derivatives outside
        EXPECT_NEAR(found.value, expected.v, 1e-14 * scale) << s.name;
        EXPECT_NEAR(found.gradient.norm(), 1, 1e-14) << s.name;
        if (expected.v <= 0 && !expected.h.allFinite()) continue;
        EXPECT_LT((found.gradient - expected.g).norm(), 1e-12) << s.name << " at " << x.transpose();
        EXPECT_LT((found.hessian - expected.h).norm(), 1e-10 * (curved + 1 / scale)) << s.name << " " << x.transpose();
      }
}

TEST(Shape, DerivativesInsideAreThoseOfDifferences) {
  constexpr double h = 1e-6;
  for (const Named &s : shapes(1)) {
    int compared = 0;
    for (int n = 0; n < 2000 && compared < 100; ++n) {
      const Vec3 x = randomPoint(1);
      const Distance here = s.shape->at(x);
      if (here.value > -10 * h) continue;
      Mat3 hessian;
      bool smooth = true;
      for (int k = 0; k < 3; ++k) {
        const Distance ahead = s.shape->at(x + h * Vec3::Unit(k)), behind = s.shape->at(x - h * Vec3::Unit(k));
        smooth = smooth && (ahead.gradient - behind.gradient).norm() < 1e-3; // both nearest to one face
        hessian.col(k) = (ahead.gradient - behind.gradient) / (2 * h);
        if (smooth) EXPECT_NEAR((ahead.value - behind.value) / (2 * h), here.gradient[k], 1e-8) << s.name;
      }
      if (!smooth) continue;
      ++compared;
      EXPECT_LT((hessian - here.hessian).norm(), 1e-6) << s.name; // of second order in h, and rounding over h
    }
    EXPECT_GT(compared, 20) << s.name;
  }
}

TEST(Shape, DistancesOfManyAreThoseOfOne) {
  for (const Named &s : shapes(1)) {
    constexpr int count = 37;
    std::array<std::array<double, count>, 3> x;
    std::array<double, count> out;
    for (int i = 0; i < count; ++i) {
      const Vec3 p = randomPoint(2);
      for (int k = 0; k < 3; ++k) x[k][i] = p[k];
    }
    const double *const point[3] = {x[0].data(), x[1].data(), x[2].data()};
    s.shape->distances(point, count, out.data());
    for (int i = 0; i < count; ++i)
      EXPECT_NEAR(out[i], s.shape->at(Vec3(x[0][i], x[1][i], x[2][i])).value, 1e-15 * 4) << s.name;
  }
}

TEST(Shape, DistancesChangeByNoMoreThanPointsAreApart) {
  for (const Named &s : shapes(1))
    for (int n = 0; n < 2000; ++n) {
      const Vec3 x = randomPoint(2), y = x + 0.1 * randomPoint(2);
      EXPECT_LE(std::abs(distanceOf(*s.shape, x) - distanceOf(*s.shape, y)), (x - y).norm() * (1 + 1e-14) + 1e-15)
          << s.name;
    }
}

/// The foot of a point outside lies on the surface, and nothing of the solid is nearer.
TEST(Shape, TheFootOfAPointLiesOnTheSurface) {
  for (const Named &s : shapes(1))
    for (int n = 0; n < 500; ++n) {
      const Vec3 x = randomPoint(2);
      const Distance d = s.shape->at(x);
      if (d.value <= 0) continue;
      EXPECT_NEAR(distanceOf(*s.shape, x - d.value * d.gradient), 0, 1e-14) << s.name << " at " << x.transpose();
    }
}

TEST(Shape, AxesAndCentresHaveFiniteDerivatives) {
  for (const Named &s : shapes(1))
    for (const Vec3 &x : {Vec3(0, 0, 0), Vec3(0, 0, 0.3), Vec3(0, 0, 5), Vec3(0.5, 0.25, 1), Vec3(0.7, 0, 0.5)}) {
      const Distance d = s.shape->at(x);
      EXPECT_TRUE(std::isfinite(d.value) && d.gradient.allFinite() && d.hessian.allFinite()) << s.name;
      EXPECT_NEAR(d.gradient.norm(), 1, 1e-14) << s.name;
    }
}

TEST(Shape, FarPointsKeepTheirDigits) {
  for (const Named &s : shapes(1)) {
    const Vec3 x(600, -700, 800);
    EXPECT_NEAR(s.shape->at(x).value, distanceOf(*s.shape, x), 1e-12) << s.name;
    EXPECT_LT(s.shape->at(x).hessian.norm(), 1) << s.name;
  }
}

} // namespace
} // namespace tendril::test
