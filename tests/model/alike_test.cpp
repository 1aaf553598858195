/// Copies are known by all that makes them move alike.
#include "tendril/model/alike.hpp"

#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// Four rods beside each other, the third one changed by `change(scene, 2)`, and the rod that each is like.
template <class Change> std::vector<int> kindsAfter(Change change) {
  const Rod rod = straightRod(8);
  Scene scene;
  for (int r = 0; r < 4; ++r) {
    scene.rods.push_back(rod);
    for (Vec3 &x : scene.rods[r].position) x += r * Vec3(0.1, 1e3, 1 / 3.0); // rounded
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::clamp));
    scene.forces.push_back({r, 8, Vec3(0, -1, 0)});
  }
  change(scene, 2);
  return firstAlike(scene, std::vector<Drawing>(4));
}

TEST(Alike, CopiesAreShiftsOfOneRod) {
  EXPECT_EQ(kindsAfter([](Scene &, int) {}), (std::vector<int>{0, 0, 0, 0}));
}

TEST(Alike, WhateverMovesARodCounts) {
  const std::vector<int> others{0, 0, 2, 0};
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.rods[r].position[4].y() += 1e-3; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.rods[r].material.mass_damping_coefficient = 1; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.rods[r].initial_velocity.z() = 1; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.rods[r].measure = Measure::angle; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.rods[r].energy = Energy::classical; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) {
              s.rods[r].director[3] = s.rods[r].edge(3).normalized().cross(s.rods[r].director[3]);
            }),
            others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.supports[r].kind = Support::Kind::pin; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) {
              s.supports[r].motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3::UnitX(), Vec3::Zero()}};
            }),
            others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.forces[r].force.x() = 1; }), others);
  EXPECT_EQ(kindsAfter([](Scene &s, int r) { s.moments.push_back({r, 2, 0.1, Vec3::Zero()}); }), others);
  for (const EdgeMoment &other : {EdgeMoment{0, 2, 0.2, Vec3::UnitX()}, EdgeMoment{0, 3, 0.1, Vec3::UnitX()},
                                  EdgeMoment{0, 2, 0.1, Vec3::UnitY()}}) {
    const auto change = [&](Scene &s, int r) {
      for (int k = 0; k < 4; ++k) s.moments.push_back({k, 2, 0.1, Vec3::UnitX()});
      s.moments[r] = other;
      s.moments[r].rod = r;
    };
    EXPECT_EQ(kindsAfter(change), others);
  }
  EXPECT_EQ(kindsAfter([](Scene &s, int) { s.rotation.angular_velocity.z() = 1; }), (std::vector<int>{0, 1, 2, 3}));
}

TEST(Alike, SomeRodsKeepWhatHoldsThem) {
  Scene scene;
  for (int r = 0; r < 3; ++r) {
    scene.rods.push_back(straightRod(4 + r));
    scene.supports.push_back(hold(scene, r, r, Support::Kind::pin));
    scene.forces.push_back({r, 1, Vec3(r, 0, 0)});
  }
  const Scene some = withRods(scene, {0, 2});
  ASSERT_EQ(some.rods.size(), 2u);
  EXPECT_EQ(some.rods[1].edges(), 6);
  EXPECT_EQ(some.supports[1].rod, 1);
  EXPECT_EQ(some.supports[1].vertex, 2);
  EXPECT_EQ(some.forces[1].force.x(), 2);
}

} // namespace
} // namespace tendril::test
