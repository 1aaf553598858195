/// Scenes within scenes, and scenes of bodies alone.
#include "support/files.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/io/scene_reader.hpp"

namespace tendril::test {
namespace {

const char *const part = R"(
gravity: [0, 0, 0]
rods:
  - {name: cord, line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}, director: [0, 1, 0], material: default, velocity: [0, 1, 0]}
bodies:
  - {name: bob, sphere: {radius: 0.1}, density: 1000, position: [1, 0, 0], force: [0, 2, 0]}
  - {name: post, box: {size: [0.1, 0.1, 0.1]}, mass: 1, position: [2, 0, 0], motion: {amplitude: [0.1, 0, 0], period: 2}}
joints:
  - {name: pivot, type: hinge, child: bob, parent: post, point: [2, 0, 0], axis: [0, 1, 0]}
supports:
  - {rod: cord, vertex: 0, type: clamp, motion: {velocity: [0, 0, 1]}}
constraints:
  - {name: tie, type: weld, rod: cord, vertex: last, body: bob}
loads:
  - {rod: cord, vertex: 2, force: [0, 1, 0]}
tendons:
  - {name: stay, path: [{body: bob, point: [1, 0.05, 0]}, {sphere: world, point: [1.5, 0.2, 0], radius: 0.1}, {body: world, point: [2, 1, 0]}],
     force: {tension: 3}}
)";

/// All that a scene has goes where it is put, and names and numbers find it there.
TEST(Include, PutsAllOfASceneIntoAnother) {
  const Folder folder;
  folder.write("part.yaml", part);
  const std::string whole = folder.write("whole.yaml", R"(
include:
  - {file: part.yaml, prefix: one.}
  - {file: part.yaml, prefix: two., rotation: [0, 0, 1.5707963267948966], translation: [0, 0, 3]}
supports:
  - {rod: two.cord, vertex: 2, type: pin}
)");
  const SceneFile file = readScene(whole);
  const Scene &s = file.scene;
  ASSERT_EQ(s.rods.size(), 2u);
  EXPECT_EQ(s.rods[1].name, "two.cord");
  const Mat3 turn = rotationBy({0, 0, 0.5 * pi});
  auto placed = [&](const Vec3 &x) { return Vec3(turn * x + Vec3(0, 0, 3)); };
  for (int v = 0; v < 5; ++v)
    EXPECT_LT((s.rods[1].position[std::size_t(v)] - placed(s.rods[0].position[std::size_t(v)])).norm(), 1e-15);
  EXPECT_LT((s.rods[1].director[2] - turn * s.rods[0].director[2]).norm(), 1e-15);
  EXPECT_LT((s.rods[1].initial_velocity - Vec3(-1, 0, 0)).norm(), 1e-15);
  ASSERT_EQ(s.bodies.size(), 2u);
  EXPECT_LT((s.bodies[1].own.centre - placed(s.bodies[0].own.centre)).norm(), 1e-15);
  EXPECT_LT((s.bodies[1].force - Vec3(-2, 0, 0)).norm(), 1e-15);
  ASSERT_EQ(s.held_bodies.size(), 2u);
  EXPECT_LT((s.held_bodies[1].motion.displacementAt(1) - Vec3(0, 0.1, 0)).norm(), 1e-15);
  ASSERT_EQ(s.joints.size(), 2u);
  EXPECT_EQ(s.joints[1].child, 1);
  EXPECT_LT((s.joints[1].axes.col(2) - Vec3(-1, 0, 0)).norm(), 1e-15);
  EXPECT_LT((s.joints[1].motion.displacementAt(1) - Vec3(0, 0.1, 0)).norm(), 1e-15);
  ASSERT_EQ(s.supports.size(), 3u);
  EXPECT_EQ(s.supports[1].rod, 1);
  EXPECT_LT((s.supports[1].frame.tangent - Vec3(0, 1, 0)).norm(), 1e-15);
  EXPECT_EQ(s.supports[2].rod, 1);
  ASSERT_EQ(s.attachments.size(), 2u);
  EXPECT_EQ(s.attachments[1].body, 1);
  EXPECT_EQ(s.attachments[1].name, "two.tie");
  EXPECT_LT((s.forces[1].force - Vec3(-1, 0, 0)).norm(), 1e-15);
  ASSERT_EQ(s.tendons.size(), 2u);
  EXPECT_EQ(s.tendons[1].points[0].body, 1);
  EXPECT_EQ(s.tendons[1].rod, 1);
  EXPECT_LT((s.tendons[1].points[1].point - placed({2, 1, 0})).norm(), 1e-15);
  EXPECT_LT((s.tendons[1].wraps[0].centre - placed({1.5, 0.2, 0})).norm(), 1e-15);
  EXPECT_EQ(file.source.paths.size(), 3u);
  EXPECT_EQ(file.source.files.size(), 1u); // one text, though it stands there twice
}

TEST(Include, GivesBodiesARodThatIsThere) {
  const Folder folder;
  folder.write("rod.yaml",
               "rods:\n  - {name: a, line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}, material: default}\n");
  folder.write("body.yaml", "bodies:\n  - {name: b, sphere: {radius: 0.1}, density: 1000}\n");
  const SceneFile file =
      readScene(folder.write("whole.yaml", "include:\n  - {file: rod.yaml}\n  - {file: body.yaml}\n"));
  EXPECT_EQ(file.scene.rods.size(), 1u);
  EXPECT_EQ(file.scene.bodies.at(0).rod, 0);
}

TEST(Include, RefusesWhatWouldNotEnd) {
  const Folder folder;
  folder.write("part.yaml", "include:\n  - {file: whole.yaml}\n");
  const std::string whole = folder.write("whole.yaml", "include:\n  - {file: part.yaml}\n");
  EXPECT_TRUE(says(messageOf([&] { readScene(whole); }), "includes itself"));
  const std::string twice = folder.write("twice.yaml", "include:\n  - {file: one.yaml}\n  - {file: one.yaml}\n");
  folder.write("one.yaml", part);
  EXPECT_TRUE(says(messageOf([&] { readScene(twice); }), "another 'prefix'"));
}

/// Bodies that joints join without a rod get a carrier, each mechanism its own; where there are no rods, all do.
TEST(Carriers, AreForBodiesWithoutRods) {
  const Folder folder;
  const std::string path = folder.write("scene.yaml", R"(
bodies:
  - {name: a, sphere: {radius: 0.1}, density: 1000}
  - {name: b, sphere: {radius: 0.1}, density: 1000, position: [1, 0, 0]}
  - {name: c, sphere: {radius: 0.1}, density: 1000, position: [2, 0, 0]}
joints:
  - {type: hinge, child: b, parent: c, point: [1.5, 0, 0]}
)");
  const SceneFile file = readScene(path);
  ASSERT_EQ(file.scene.rods.size(), 2u);
  EXPECT_EQ(file.scene.rods[0].name, "carrier of a");
  EXPECT_EQ(file.scene.bodies[0].rod, 0);
  EXPECT_EQ(file.scene.bodies[1].rod, 1);
  EXPECT_EQ(file.scene.bodies[2].rod, 1);
  EXPECT_EQ(file.scene.supports.size(), 4u);
  EXPECT_EQ(file.drawings.size(), 2u);
}

} // namespace
} // namespace tendril::test
