/// Rods that nothing joins are solved in blocks: what one holds or does changes nothing of another.
#include "support/rods.hpp"

namespace tendril::test {

Scene curtain(int rods, int edges) {
  Scene scene;
  scene.gravity = Vec3(0, 0, -9.81);
  for (int r = 0; r < rods; ++r) {
    Rod rod = straightRod(edges, Measure::angle);
    rod.material.axial_stiffness = 1e5;
    for (Vec3 &x : rod.position) x.y() += r;
    scene.rods.push_back(rod);
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::clamp));
  }
  return scene;
}

TEST(Blocks, StayWhereARodIsClampedAlongIt) {
  constexpr int rods = 16, edges = 200;
  Simulation alone, all;
  Scene held = curtain(1, edges), scene = curtain(rods, edges);
  for (Scene *s : {&held, &scene}) s->supports.push_back(hold(*s, 0, 70, Support::Kind::clamp));
  runTo(alone, held, dynamics(0.01, 0.03));
  runTo(all, scene, dynamics(0.01, 0.03));
  EXPECT_EQ(alone.solver.blocks().size(), 1u);
  EXPECT_GT(all.solver.blocks().size(), 1u);
  for (int v = 0; v <= edges; ++v) EXPECT_EQ(all.state.position[v], alone.state.position[v]) << v;
  EXPECT_EQ(all.state.position[70], held.rods[0].position[70]);
}

} // namespace tendril::test
