/// What joints hold, as functions of the poses of two bodies, against automatic differentiation.
#include "tendril/energy/joint.hpp"

#include "support/random_cell.hpp"

#include <gtest/gtest.h>

namespace tendril::test {
namespace {

using D12 = Dual<12>;

Vector3<D12> turned(const Vec3 &v, int first) { return turnedBy<12>(v, first); }
Vector3<D12> moved(const Vec3 &v, int first) {
  return {D12::variable(v[0], first), D12::variable(v[1], first + 1), D12::variable(v[2], first + 2)};
}

Mat3 randomRotation(Random &random) {
  return Eigen::AngleAxisd(0.6 + 0.4 * random(), random.direction()).toRotationMatrix();
}

TEST(JointRows, DerivativesMatchAutomaticDifferentiation) {
  Random random(11);
  for (int repeat = 0; repeat < 20; ++repeat) {
    JointPlace p;
    const Vec3 parent_at = random.direction(), child_at = random.direction();
    p.arm = random.direction();
    p.parent_arm = random.direction();
    p.reach = child_at - parent_at + p.arm;
    p.axes = randomRotation(random);
    p.parent_axes = randomRotation(random);
    p.spun = Vec3::Zero();
    p.before = 4 * pi; // two whole turns
    std::array<Vector3<D12>, 3> s, t;
    for (int k = 0; k < 3; ++k) {
      s[std::size_t(k)] = turned(p.parent_axes.col(k), 9);
      t[std::size_t(k)] = turned(p.axes.col(k), 3);
    }
    const Vector3<D12> gap = (moved(child_at, 0) + turned(p.arm, 3)) - (moved(parent_at, 6) + turned(p.parent_arm, 9));
    for (const Joint::Type type : {Joint::Type::hinge, Joint::Type::prismatic, Joint::Type::ball}) {
      Joint joint{};
      joint.type = type;
      joint.upper = 1;
      for (int k = 0; k < joint_rows; ++k) {
        D12 exact;
        double turns = 0;
        if (k < 3)
          exact = type == Joint::Type::prismatic ? s[std::size_t(k)].dot(gap) : gap[k];
        else if (k < 5)
          exact = s[std::size_t(k - 3)].dot(t[2]);
        else if (k == 5)
          exact = s[0].dot(t[1]);
        else if (k == cosine_row) {
          if (type == Joint::Type::ball) continue;
          exact = s[2].dot(t[2]);
          if (type == Joint::Type::prismatic) exact = (s[0].dot(t[0]) + s[1].dot(t[1]) + exact - D12(1.0)) * D12(0.5);
        } else if (type == Joint::Type::prismatic)
          exact = s[2].dot(gap);
        else if (type == Joint::Type::hinge) {
          exact = atan2(s[1].dot(t[0]), s[0].dot(t[0]));
          turns = 4 * pi;
        } else { // the angle of the rotation: of a half angle q, sin q = |skew|/2 and cos q = (trace - 1)/2
          const D12 cosine_of = (s[0].dot(t[0]) + s[1].dot(t[1]) + s[2].dot(t[2]) - D12(1.0)) * D12(0.5);
          exact = atan2(sqrt(D12(1.0) - cosine_of * cosine_of), cosine_of);
        }
        const JointRow row = jointRow(joint, p, k);
        const double size = 1 + exact.h.norm();
        EXPECT_NEAR(row.value, exact.v + turns, 1e-13) << k;
        EXPECT_LT((row.gradient - exact.g).norm(), 1e-12 * size) << k;
        EXPECT_LT((row.hessian - exact.h).norm(), 1e-11 * size) << k;
      }
    }
  }
}

/// What a joint leaves free costs nothing, and what it holds does.
TEST(JointRows, HoldWhatTheirTypesSay) {
  for (int type = 0; type < 6; ++type) {
    Joint joint{};
    joint.type = Joint::Type(type);
    joint.point = Vec3::Zero();
    joint.axes = Mat3::Identity();
    auto held = [&](const Vec3 &gap, const Vec3 &turn) {
      JointPlace p{Vec3::Zero(), Vec3::Zero(), gap, rotationBy(turn), Mat3::Identity(), Vec3::Zero()};
      double most = 0;
      for (int k = 0; k < coordinate_row; ++k)
        if (holds(joint, k)) most = std::max(most, std::abs(jointRow(joint, p, k).value));
      return most > 1e-3;
    };
    const Joint::Held all = joint.held();
    EXPECT_EQ(held({0.1, 0, 0}, Vec3::Zero()), all.across) << type;
    EXPECT_EQ(held({0, 0.1, 0}, Vec3::Zero()), all.across) << type;
    EXPECT_EQ(held({0, 0, 0.1}, Vec3::Zero()), all.along) << type;
    EXPECT_EQ(held(Vec3::Zero(), {0.1, 0, 0}), all.tilt) << type;
    EXPECT_EQ(held(Vec3::Zero(), {0, 0.1, 0}), all.tilt) << type;
    EXPECT_EQ(held(Vec3::Zero(), {0, 0, 0.1}), all.turn) << type;
  }
}

} // namespace
} // namespace tendril::test
