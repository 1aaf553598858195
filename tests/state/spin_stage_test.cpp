/// The balance of angular momentum of a stage, against automatic differentiation.
#include "support/dual.hpp"
#include "support/random_cell.hpp"
#include "tendril/state/spin_stage.hpp"

#include <gtest/gtest.h>

namespace tendril::test {
namespace {

Vec3 randomVector(Random &random, double size) { return size * Vec3(random(), random(), random()); }

SpinStage randomStage(Random &random, bool keeps_energy) {
  Mat3 a;
  for (int c = 0; c < 3; ++c) a.col(c) = randomVector(random, 1);
  const Mat3 inertia = a * a.transpose() + 0.5 * Mat3::Identity();
  return {inertia,
          rotationBy(randomVector(random, 2)),
          0.02,
          keeps_energy ? 1.0 : 1.3,
          keeps_energy ? Vec3(Vec3::Zero()) : randomVector(random, 2),
          randomVector(random, 3),
          keeps_energy};
}

TEST(SpinStage, DerivativeIsThatOfTheRate) {
  Random random(7);
  using D = Dual<3>;
  for (const bool keeps_energy : {false, true})
    for (const double size : {1e-4, 0.003, 0.1, 0.8}) {
      const SpinStage stage = randomStage(random, keeps_energy);
      const Vec3 f = randomVector(random, size);
      Vector3<D> x;
      for (int k = 0; k < 3; ++k) x[k] = D::variable(f[k], k);
      const Vector3<D> momentum = stage.momentum<D>(x);
      Mat3 by_f;
      for (int k = 0; k < 3; ++k) by_f.row(k) = momentum[k].g.transpose();
      const Mat3 expected = stage.mass / stage.dt * by_f * inverseTangent(f), found = stage.derivative(f);
      // Series below 0.01 rad are cut after the fourth power.
      EXPECT_LT((found - expected).norm(), 1e-10 * expected.norm()) << keeps_energy << " " << size;
    }
}

TEST(SpinStage, TangentMapsAreThoseOfTheExponential) {
  Random random(3);
  for (const double size : {1e-3, 0.3, 2.0}) {
    const Vec3 f = randomVector(random, size);
    EXPECT_LT((tangentMap(f) * inverseTangent(f) - Mat3::Identity()).norm(), 1e-12);
    const double h = 1e-5;
    for (int k = 0; k < 3; ++k) {
      const Vec3 d = h * Vec3::Unit(k);
      const Mat3 turned = exponential<double>(Vec3(f + d)) * exponential<double>(Vec3(f - d)).transpose();
      const Vec3 spin(turned(2, 1) - turned(1, 2), turned(0, 2) - turned(2, 0), turned(1, 0) - turned(0, 1));
      EXPECT_LT((spin / (4 * h) - tangentMap(f).col(k)).norm(), 1e-8) << size;
    }
  }
}

/// Free of couples, the rule keeps the momentum where its rate is zero, and the energy, whatever the step.
TEST(SpinStage, AFreeBodyKeepsItsEnergy) {
  Random random(5);
  for (int n = 0; n < 20; ++n) {
    SpinStage stage = randomStage(random, true);
    stage.dt = 0.05;
    const Vec3 momentum = -stage.past_momentum;
    auto energy = [&](const Mat3 &r) {
      const Vec3 body = r.transpose() * momentum;
      return 0.5 * body.dot(stage.inertia.ldlt().solve(body));
    };
    Vec3 f = Vec3::Zero();
    for (int k = 0; k < 30; ++k) { // Newton
      const Vec3 d = -stage.derivative(f).partialPivLu().solve(stage.rate(f));
      const Mat3 moved = exponential<double>(d) * exponential<double>(f);
      const Eigen::AngleAxisd turn(moved);
      f = turn.angle() * turn.axis();
    }
    EXPECT_LT(stage.rate(f).norm() * stage.dt, 1e-12 * momentum.norm());
    const double before = energy(stage.start), after = energy(exponential<double>(Vec3(2 * f)) * stage.start);
    EXPECT_NEAR(after, before, 1e-12 * before);
  }
}

} // namespace
} // namespace tendril::test
