/// Rods that junctions join, against the same thing without junctions and against closed forms.
#include "support/beams.hpp"
#include "support/random_cell.hpp"
#include "tendril/dynamics/state_access.hpp"

namespace tendril::test {
namespace {

Rod member(const Vec3 &from, const Vec3 &to, int edges, const std::string &name) {
  return beam(from, to, edges, name, 1e5);
}

Junction join(std::vector<Junction::Member> members, bool rigid) {
  Junction junction{"joint", std::move(members), rigid ? 1 : 0};
  for (Junction::Member &m : junction.members) m.group = rigid ? 0 : -1;
  return junction;
}

/// A cantilever under a load at its tip, whole or cut into two rods that are joined rigidly.
Scene cantilever(bool cut, bool plane) {
  Scene scene;
  scene.gravity = Vec3(0, 0, plane ? 0 : -0.5);
  if (cut)
    scene.rods = {member({0, 0, 0}, {0.5, 0, 0}, 10, "a"), member({0.5, 0, 0}, {1, 0, 0}, 10, "b")};
  else
    scene.rods = {member({0, 0, 0}, {1, 0, 0}, 20, "whole")};
  for (Rod &rod : scene.rods) setBishopDirectors(rod, Vec3(0, 0, 1));
  if (cut) scene.junctions = {join({{0, 10, 0}, {1, 0, 0}}, true)};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  scene.forces = {{cut ? 1 : 0, cut ? 10 : 20, Vec3(0, -3, plane ? 0 : 1)}};
  return scene;
}

/// Two half cells to a frame without mass are one cell: springs in series.
TEST(Junctions, ARigidJointOfTwoRodsIsOneRod) {
  for (const bool plane : {true, false})
    for (const bool dynamic : {false, true}) {
      Simulation whole, cut;
      LoopSettings settings = dynamic ? dynamics(0.01, 0.2) : statics(4);
      if (dynamic) settings.integrator.name = "bdf2";
      runTo(whole, cantilever(false, plane), settings);
      runTo(cut, cantilever(true, plane), settings);
      double off = 0;
      for (int i = 0; i <= 20; ++i)
        off = std::max(off, (whole.state.position[i] - cut.state.position[i <= 10 ? i : i + 1]).norm());
      // Newton stops at 1e-6 of the load; out of the plane a cell turns its two halves by the minimal rotation, too.
      EXPECT_LT(off, 1e-6) << plane << dynamic;
      EXPECT_GT((whole.state.position[20] - Vec3(1, 0, 0)).norm(), dynamic ? 0.02 : 0.3);
      EXPECT_EQ(cut.state.position[10], cut.state.position[11]);
    }
}

/// A cross of two equal beams on pins that turn freely against each other: each carries half of the load.
TEST(Junctions, AScissorSharesALoad) {
  auto beam = [](const Vec3 &along, const std::string &name) { return member(-0.5 * along, 0.5 * along, 20, name); };
  auto onPins = [](Scene &scene, int r) {
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::pin));
    scene.supports.push_back(hold(scene, r, 20, Support::Kind::pin));
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::fix_twist));
  };
  Scene one, two;
  one.gravity = two.gravity = Vec3::Zero();
  one.rods = {beam({1, 0, 0}, "a")};
  two.rods = {beam({1, 0, 0}, "a"), beam({0, 1, 0}, "b")};
  onPins(one, 0);
  for (const int r : {0, 1}) onPins(two, r);
  one.forces = {{0, 10, Vec3(0, 0, -0.5)}};
  two.forces = {{0, 10, Vec3(0, 0, -1)}};
  two.junctions = {join({{0, 10, -1}, {1, 10, -1}}, false)};
  Simulation alone, crossed;
  runTo(alone, one, statics());
  runTo(crossed, two, statics());
  const double deflection = alone.state.position[10][2];
  EXPECT_LT(deflection, -0.005);
  for (const int v : {10, 31}) EXPECT_NEAR(crossed.state.position[v][2], deflection, 1e-8);
}

/// Two bars between pins with a ball between: a truss, whose apex goes down by P L/(2 EA sin^2), to first order.
TEST(Junctions, BallsMakeTrusses) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {member({-1, 0, 0}, {0, 1, 0}, 4, "a"), member({0, 1, 0}, {1, 0, 0}, 4, "b")};
  scene.junctions = {join({{0, 4, -1}, {1, 0, -1}}, false)};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 1, 4, Support::Kind::clamp)};
  for (Rod &rod : scene.rods) rod.material.flexural_stiffness = {1e-2, 1e-2};
  const double load = 1e-2;
  scene.forces = {{0, 4, Vec3(0, -load, 0)}};
  Simulation sim;
  runTo(sim, scene, statics());
  const double down = load * std::sqrt(2.0) / (2 * 1e5 * 0.5);  // sin^2 of 45 degrees
  EXPECT_NEAR(1 - sim.state.position[4][1], down, 1e-3 * down); // bending bears B/(EA L^2) of it
}

/// Nothing depends on the order in which rods and members are written.
TEST(Junctions, OrderDoesNotMatter) {
  auto tripod = [](std::vector<int> order) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -1);
    const Vec3 feet[] = {{1, 0, 0}, {-0.5, 0.8, 0}, {-0.5, -0.8, 0.1}};
    for (const int k : order) scene.rods.push_back(member(Vec3(0, 0, 1), feet[k], 8, std::to_string(k)));
    std::vector<Junction::Member> members;
    for (const int k : {0, 1, 2})
      members.push_back({int(std::find(order.begin(), order.end(), k) - order.begin()), 0, 0});
    scene.junctions = {join(members, true)};
    for (const int r : {0, 1, 2})
      scene.supports.push_back(hold(scene, r, 8, order[r] == 0 ? Support::Kind::clamp : Support::Kind::pin));
    scene.forces = {{int(std::find(order.begin(), order.end(), 2) - order.begin()), 0, Vec3(1, 0.5, -4)}};
    return scene;
  };
  Simulation first, other;
  runTo(first, tripod({0, 1, 2}), statics(2));
  runTo(other, tripod({2, 0, 1}), statics(2));
  EXPECT_GT((first.state.position[0] - Vec3(0, 0, 1)).norm(), 1e-3);
  EXPECT_LT((first.state.position[0] - other.state.position[0]).norm(), 1e-8);
}

/// A frame may turn by more than half a turn in one step: whole turns of the twist are those of a rod in one piece.
TEST(Junctions, FramesTurnManyTimes) {
  for (const bool cut : {false, true}) {
    Scene scene = cantilever(cut, true);
    for (Rod &rod : scene.rods) rod.material.torsional_stiffness = 0.1;
    scene.forces.clear();
    scene.moments = {{cut ? 1 : 0, cut ? 9 : 19, 1, Vec3::Zero()}};
    Simulation sim;
    runTo(sim, scene, statics());
    double twist = 0;
    for (int r = 0; r < int(sim.scene.rods.size()); ++r)
      for (const double angle : RodAccess(sim, r).twists()) twist += angle;
    EXPECT_NEAR(twist, 0.975 / 0.1, 1e-6) << cut; // up to the middle of the last edge
  }
}

/// What is one point stays one, whatever velocities its rods are given; and the momentum of all is kept.
TEST(Junctions, DifferentVelocitiesMeet) {
  for (const char *method : {"euler", "midpoint", "generalized_alpha"}) {
    Scene scene = cantilever(true, true);
    scene.supports.clear();
    scene.forces.clear();
    scene.rods[0].initial_velocity = Vec3(0, 0, 1);
    Simulation sim;
    LoopSettings settings = dynamics(1e-3, 0.05);
    settings.integrator.name = method;
    runTo(sim, scene, settings);
    EXPECT_EQ(sim.state.position[10], sim.state.position[11]) << method;
    EXPECT_EQ(sim.state.velocity[10], sim.state.velocity[11]) << method;
    double momentum = 0, mass = 0;
    for (int v = 0; v < 22; ++v) {
      momentum += sim.elements->mass()[sim.elements->vertex_slot[v]] * sim.state.velocity[v][2];
      mass += sim.elements->mass()[sim.elements->vertex_slot[v]];
    }
    EXPECT_NEAR(momentum, 0.5 * mass, 1e-6) << method;
  }
}

/// Strain rates of half cells are those of the cell that they make together, also where velocities give them.
TEST(Junctions, DampingIsThatOfAWholeRod) {
  for (const char *method : {"bdf2", "sdirk33", "sdirk23"}) {
    EnergyBudget end[2];
    for (const bool cut : {false, true}) {
      Scene scene = cantilever(cut, true);
      for (Rod &rod : scene.rods) rod.material.stiffness_damping_coefficient = 2e-2;
      Simulation sim;
      LoopSettings settings = dynamics(0.01, 0.2);
      settings.integrator.name = method;
      runTo(sim, scene, settings);
      end[cut] = energyBudget(sim.scene, *sim.elements, sim.state, 1);
    }
    EXPECT_NEAR(end[1].bend, end[0].bend, 1e-3 * end[0].bend) << method;
  }
}

/// Iterations hardly grow with the axial stiffness, though straight steps stretch edges.
TEST(Junctions, StiffRodsTakeNoMoreIterations) {
  std::vector<int> iterations;
  for (const double stiffness : {1e4, 1e6, 1e8, 1e10}) {
    Scene scene = cantilever(true, false);
    for (Rod &rod : scene.rods) rod.material.axial_stiffness = stiffness;
    Simulation sim;
    iterations.push_back(0);
    runTo(sim, scene, dynamics(0.02, 0.4), &iterations.back());
  }
  EXPECT_LE(*std::max_element(iterations.begin(), iterations.end()), 2 * iterations.front());
  EXPECT_LE(iterations.front(), 80); // four a step
}

/// A rod of two that swings keeps its energy as a whole one does, by every kind of method: forces that balance at the
/// end of the step, in its middle, or between.
TEST(Junctions, EnergyIsKeptAsByAWholeRod) {
  for (const char *method : {"midpoint", "bdf2", "generalized_alpha", "sdirk23", "energy_momentum"}) {
    double gained[2], stored = 0;
    for (const bool cut : {false, true}) {
      Scene scene = cantilever(cut, false);
      scene.forces.clear();
      scene.gravity = Vec3(0, -2, 0.5);
      Simulation sim;
      LoopSettings settings = dynamics(2e-3, 0.4);
      settings.integrator.name = method;
      runTo(sim, scene, settings);
      const EnergyBudget end = energyBudget(sim.scene, *sim.elements, sim.state, 1),
                         start = energyBudget(sim.scene, *sim.elements, initialState(sim.scene, *sim.elements), 1);
      gained[cut] = end.total() - start.total();
      stored = end.kinetic + end.bend;
    }
    EXPECT_LT(std::abs(gained[1]), 1e-4 * stored) << method;    // of second order in the step
    EXPECT_NEAR(gained[1], gained[0], 1e-5 * stored) << method; // the frame has no mass: it adds nothing
    EXPECT_GT(stored, 0.1) << method;
  }
}

} // namespace
} // namespace tendril::test
