/// The work of loads and supports, and what the energies lose beyond it.
#include "support/rods.hpp"

#include "tendril/dynamics/arc_length.hpp"
#include "tendril/energy/derived.hpp"

namespace tendril::test {
namespace {

struct Balance {
  double loads = 0, supports = 0, dissipated = 0,
         least = 0; ///< sums over a run, and the least dissipation of a step [J]
  EnergyBudget start, end;
};

Balance run(Simulation &sim, const Scene &scene, const LoopSettings &settings, const char *tolerance = "1e-10") {
  Balance b;
  EXPECT_EQ(PetscOptionsSetValue(nullptr, "-snes_rtol", tolerance), PetscErrorCode(0));
  EXPECT_EQ(sim.setUp(scene, settings), PetscErrorCode(0));
  EXPECT_EQ(PetscOptionsClearValue(nullptr, "-snes_rtol"), PetscErrorCode(0));
  b.start = energyBudget(sim.scene, *sim.elements, sim.state, settings.dynamic ? 1 : 0);
  bool finished = false;
  auto observe = [&](const State &, const Diagnostics &row) {
    b.loads += row.work.loads;
    b.supports += row.work.supports;
    b.dissipated += row.dissipated;
    b.least = std::min(b.least, row.dissipated);
    b.end = row.energy;
    return PetscErrorCode(0);
  };
  TimeLoop loop(sim.solver, settings);
  EXPECT_EQ(loop.run(sim.state, observe, &finished), PetscErrorCode(0));
  EXPECT_TRUE(finished) << loop.failure();
  EXPECT_NEAR(b.end.total() - b.start.total(), b.loads + b.supports - b.dissipated,
              1e-12 * (std::abs(b.loads) + std::abs(b.supports) + b.end.kinetic));
  return b;
}
Balance run(const Scene &scene, const LoopSettings &settings, const char *tolerance = "1e-10") {
  Simulation sim;
  return run(sim, scene, settings, tolerance);
}

LoopSettings by(const std::string &integrator, double dt, double t_end) {
  LoopSettings settings = dynamics(dt, t_end);
  settings.integrator.name = integrator;
  return settings;
}

Rod softRod(int edges, Measure measure = Measure::angle) {
  Rod rod = straightRod(edges, measure);
  rod.material.axial_stiffness = 50;
  rod.material.flexural_stiffness = {1, 2};
  rod.material.linear_rotational_inertia = 1e-2;
  return rod;
}

/// Pins lift all vertices of a rod from rest: their work is its weight's, and its motion.
TEST(WorkOfSupports, LiftsTheWeightAndMovesTheMass) {
  const double speed = 0.7, time = 0.5;
  Scene scene;
  scene.gravity = Vec3(0.5, -9.81, 0);
  scene.rods = {softRod(2)};
  for (const int v : {0, 1, 2}) {
    scene.supports.push_back(hold(scene, 0, v, Support::Kind::pin));
    scene.supports.back().motion.velocity = Vec3(0, speed, 0);
  }
  for (const std::string &name : integratorNames()) {
    const Balance b = run(scene, by(name, 0.05, time));
    EXPECT_NEAR(b.supports, 9.81 * speed * time + 0.5 * speed * speed, 1e-10) << name; // a mass of 1 kg; rounding
    EXPECT_NEAR(b.dissipated, 0, 1e-10) << name;
    EXPECT_EQ(b.loads, 0) << name;
  }
  const Balance still = run(scene, statics(4));
  EXPECT_NEAR(still.supports, 0.5 * 9.81 * speed, 1e-10); // a weight that grows with the way
  EXPECT_NEAR(still.dissipated, 0, 1e-10);
}

/// A clamp twists a rod of which the other end is clamped, by two turns in one load step: GJ phi^2/(2 L).
TEST(WorkOfSupports, TwistsARodByWholeTurns) {
  const double angle = 4 * pi;
  Scene scene = clampedScene(straightRod(60, Measure::angle));
  scene.supports.push_back(hold(scene, 0, 60, Support::Kind::clamp));
  scene.supports[1].motion.angular_velocity = Vec3(angle, 0, 0);
  for (Rod &rod : scene.rods)
    rod.material.flexural_stiffness = {40, 40}; // straight at 12.6 rad: below 2 pi EI/GJ by far
  Simulation sim;
  const Balance b = run(sim, scene, statics(1));
  const double exact = 0.5 * (2.0 / 3) * angle * angle;
  EXPECT_NEAR(b.supports, exact, 1e-9 * exact);
  EXPECT_NEAR(b.dissipated, 0, 1e-9 * exact);
  const RodActions actions = rodActions(sim.scene, *sim.elements, sim.state, 1, 1);
  EXPECT_NEAR(actions.reaction_moment[1][0], (2.0 / 3) * angle, 1e-8 * angle);
  EXPECT_NEAR(actions.reaction_moment[0][0], -(2.0 / 3) * angle, 1e-8 * angle);
}

/// Everything that does work, on a rod that bends by radians.
Scene loaded(int edges = 10) {
  Scene scene = clampedScene(softRod(edges));
  scene.gravity = Vec3(0.3, -4, 1);
  scene.forces = {{0, edges, Vec3(0.2, 1.5, -0.8)}, {0, edges / 2, Vec3(0, -1, 0)}};
  scene.moments = {{0, edges - 1, 0.2, Vec3(0.1, 0.3, 0.5)}};
  scene.supports[0].motion.velocity = Vec3(0.2, -0.3, 0.1);
  scene.supports[0].motion.angular_velocity = Vec3(0.8, 0, 0);
  return scene;
}

/// Nothing dissipates in statics: what the trapezoidal rule leaves of it falls with the second power of the load step.
TEST(WorkInStatics, IsWhatIsStored) {
  std::array<double, 3> left{};
  Balance b;
  for (int k = 0; k < 3; ++k) {
    LoopSettings settings = statics(16 << k);
    b = run(loaded(), settings, "1e-8");
    left[k] = b.dissipated;
  }
  EXPECT_GT(std::abs(b.loads), 0.1);
  EXPECT_GT(std::abs(b.supports), 0.1);
  EXPECT_LT(std::abs(left[2]), 1e-3 * std::abs(b.loads));
  EXPECT_NEAR(order(left[0], left[1]), 2, 0.2);
  EXPECT_NEAR(order(left[1], left[2]), 2, 0.2);
}

/// What damping takes, with the work of supports and forces in the balance, comes out to the order of the method; where
/// couples act, too, to second order. The start is without a jump: of a rod that moves along with its clamp, damped by
/// its mass, or of one at rest whose clamp turns, damped by its stiffness too.
TEST(WorkInDynamics, IsOfTheOrderOfTheMethod) {
  auto dissipated = [](const Scene &scene, const std::string &name, double dt) {
    return run(scene, by(name, dt, 0.4), "1e-10").dissipated;
  };
  enum class Case { travels, turns, couples };
  for (const Case c : {Case::travels, Case::turns, Case::couples}) {
    Scene scene = loaded(4);
    scene.rods[0].material.mass_damping_coefficient = 0.5;
    if (c == Case::travels)
      scene.rods[0].initial_velocity = scene.supports[0].motion.velocity;
    else {
      scene.supports[0].motion.velocity.setZero();
      scene.rods[0].material.stiffness_damping_coefficient = 0.02;
    }
    if (c != Case::couples) scene.moments.clear();
    const double fine = dissipated(scene, "sdirk33", 1.25e-3);
    for (const std::string &name : integratorNames()) {
      if (c != Case::travels && name == "generalized_alpha")
        continue; // its accelerations at the start do not know that supports set off
      SCOPED_TRACE(name + " " + std::to_string(int(c)));
      // Multistep methods damp waves of up to 65 rad/s, which the start sets going, before they are of their order;
      // others come to rounding soon.
      const double longest = makeIntegrator({name})->remembersActions() > 0 || name == "euler" ? 2e-3 : 1e-2;
      std::array<double, 3> d{};
      for (int k = 0; k < 3; ++k) d[k] = dissipated(scene, name, longest / (1 << k));
      EXPECT_GT(d[2], 0.02);
      const double off = std::abs(d[2] - fine);
      if (c == Case::travels) // waves that nothing else damps
        EXPECT_LT(off, (name == "euler" ? 0.1 : 1e-3) * fine);
      else if (c == Case::couples) // a sixteenth by theory, half as much for the terms that follow
        EXPECT_LT(off, std::max(std::abs(d[0] - fine) / (name == "euler" ? 3 : 8), 1e-5 * fine));
      else
        EXPECT_NEAR(order(std::abs(d[1] - d[0]), std::abs(d[2] - d[1])), makeIntegrator({name})->order(), 0.35);
    }
  }
}

/// Backward Euler dissipates in every step of a driven rod, and energy_momentum nothing that counts.
TEST(WorkInDynamics, LeavesDissipationThatIsNotNegative) {
  Scene scene = loaded();
  scene.moments.clear();
  const Balance euler = run(scene, by("euler", 0.01, 1)), kept = run(scene, by("energy_momentum", 0.01, 1));
  EXPECT_GE(euler.least, 0);
  EXPECT_GT(euler.dissipated, 0.05);
  EXPECT_LT(std::abs(kept.dissipated), 1e-3 * kept.end.kinetic);
}

/// Fixed in space, a couple and a torque on a shaft that turns freely: C phi, for the integral of the spin.
TEST(WorkOfLoads, OfATorqueIsItsTurn) {
  const double torque = 0.3;
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {softRod(6)};
  for (const int v : {0, 6}) scene.supports.push_back(hold(scene, 0, v, Support::Kind::pin));
  scene.moments = {{0, 5, torque, Vec3(torque, 0, 0)}};
  for (const std::string &name : integratorNames()) {
    const Balance b = run(scene, by(name, 0.005, 1));
    if (name != "euler")
      EXPECT_NEAR(b.loads, b.end.kinetic + b.end.twist - b.start.total(), 1e-2 * b.loads)
          << name;                  // second order, in 200 steps
    EXPECT_GT(b.loads, 10) << name; // some turns: (2 C t)^2/(2 J)
    EXPECT_EQ(b.supports, 0) << name;
  }
}

/// Along the arc length, past two limit points, nothing dissipates either.
TEST(WorkInStatics, AlongTheArcLengthIsWhatIsStored) {
  Rod rod = softRod(16);
  for (int v = 0; v <= 16; ++v) rod.position[v] = Vec3(v / 16.0, 0.1 * std::sin(pi * v / 16.0), 0);
  rod.director.clear();
  setBishopDirectors(rod);
  rod.material.axial_stiffness = 5e3;
  Scene scene;
  scene.rods = {rod};
  scene.gravity = Vec3(0, -1, 0);
  for (const int v : {0, 16}) scene.supports.push_back(hold(scene, 0, v, Support::Kind::pin));
  for (const int v : {0, 16}) scene.supports.push_back(hold(scene, 0, v, Support::Kind::fix_twist));
  scene.forces = {{0, 8, Vec3(0, -40, 0)}};
  LoopSettings settings = statics(64);
  settings.continuation = Continuation::arclength;
  settings.arclength_steps = 2000;
  settings.bifurcation = Bifurcation::off;
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, settings));
  double work = 0, dissipated = 0;
  EnergyBudget end;
  ArcLength path(sim.solver, settings);
  bool finished = false;
  EXPECT_PETSC(path.run(
      sim.state,
      [&](const State &, const Diagnostics &row) {
        work += row.work.total();
        dissipated += row.dissipated;
        end = row.energy;
        return PetscErrorCode(0);
      },
      &finished));
  EXPECT_TRUE(finished) << path.failure();
  EXPECT_GT(work, 0.1);
  EXPECT_LT(std::abs(dissipated), 1e-2 * work); // the trapezoidal rule on steps that may grow to four times the first
  EXPECT_NEAR(end.total(), work - dissipated, 1e-9 * work);
}

} // namespace
} // namespace tendril::test
