/// Reading and writing the state of rods between steps.
#include "support/rods.hpp"

#include "tendril/dynamics/state_access.hpp"

namespace tendril::test {
namespace {

/// Run to `t_end`; the state is that of its last step.
void advance(Simulation &sim, LoopSettings settings, double t_end) {
  settings.t_end = t_end;
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_TRUE(finished) << loop.failure();
}

/// A soft helix of 24 edges, clamped where asked; alone, or behind another rod.
Scene springScene(bool clamped, Measure measure = Measure::angle) {
  Scene scene;
  Rod first = straightRod(3, measure);
  first.name = "first";
  Rod rod;
  rod.name = "spring";
  rod.measure = measure;
  rod.position = helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 0.5, 0.1, 2, 0.1, 24}).points;
  rod.material = homogeneousMaterial({SectionShape::rectangle, {0.01, 0.006}}, 1e7, 4e6, 1000);
  setBishopDirectors(rod);
  scene.rods = {first, rod};
  if (clamped) scene.supports = {hold(scene, 1, 0, Support::Kind::clamp)};
  return scene;
}

double energyOf(const Simulation &sim) {
  const EnergyBudget e = energyBudget(sim.scene, *sim.elements, sim.state, 1);
  return e.stretch + e.bend + e.twist;
}

template <class Call> std::string mistakeOf(Call call) {
  try {
    call();
  } catch (const SceneError &error) {
    return error.what();
  }
  return "";
}

TEST(StateAccess, WritingWhatWasReadChangesNothing) {
  LoopSettings settings = dynamics(0.01, 1);
  settings.integrator.name = "bdf2"; // remembers
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(true), settings));
  advance(sim, settings, 0.1);
  const State before = sim.state;
  ASSERT_FALSE(before.memory.empty());
  RodAccess rod(sim, "spring");
  ASSERT_EQ(rod.vertices(), 25);
  EXPECT_EQ(rod.positions()[24], before.position[28]);
  EXPECT_EQ(rod.directors()[23], before.director[26]);
  EXPECT_EQ(rod.axialForces()[23], before.axial_force[26]);
  rod.setPositions(rod.positions());
  rod.setDirectors(rod.directors());
  rod.setTwists(rod.twists());
  rod.setVelocities(rod.velocities());
  rod.setTwistRates(rod.twistRates());
  EXPECT_TRUE(sim.state == before);
  // One vertex alone: the others keep their second words.
  std::vector<Vec3> x = rod.positions();
  x[10] += Vec3(1e-3, 0, 0);
  rod.setPositions(x);
  EXPECT_EQ(sim.state.position_low[28], before.position_low[28]);
  EXPECT_EQ(sim.state.position_low[14], Vec3(Vec3::Zero()));
  EXPECT_TRUE(sim.state.memory.empty()); // of another motion
}

/// Directors go along, so that a turned rod has the same energy but for rounding, and stretched it has EA strain.
TEST(StateAccess, PositionsTakeFramesAndForcesAlong) {
  LoopSettings settings = dynamics(0.01, 1);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(false), settings));
  sim.state.winding[2 + 7] = 2 * pi; // of the spring, behind two cells of the first rod
  const double energy = energyOf(sim);
  RodAccess rod(sim, 1);
  const std::vector<double> twists = rod.twists();
  EXPECT_NEAR(twists[8], 2 * pi, 1e-9);
  const Vec3 axis = Vec3(1, 2, 3).normalized();
  for (int step = 0; step < 40;
       ++step) { // minimal rotations of every edge in small parts leave the twist but for their square
    std::vector<Vec3> x = rod.positions();
    for (Vec3 &v : x) v = Eigen::AngleAxisd(0.05, axis) * v;
    std::vector<Vec3> d = rod.directors();
    for (Vec3 &v : d) v = Eigen::AngleAxisd(0.05, axis) * v;
    rod.setPositions(x);
    rod.setDirectors(d); // a rigid rotation is no minimal rotation of each edge
  }
  EXPECT_NEAR(energyOf(sim), energy, 1e-10 * energy);
  for (int v = 0; v < rod.vertices(); ++v) EXPECT_NEAR(rod.twists()[v], twists[v], 1e-9) << v;
  std::vector<Vec3> x = rod.positions();
  for (Vec3 &v : x) v *= 1.25;
  rod.setPositions(x);
  for (const double force : rod.axialForces())
    EXPECT_NEAR(force, 0.25 * 1e7 * 0.01 * 0.006 * 1.125, 1e-8); // seed's strain, (l^2/L^2 - 1)/2
  Scene classical = sim.scene;
  for (Rod &r : classical.rods) r.energy = Energy::classical;
  Simulation other;
  EXPECT_PETSC(other.setUp(classical, statics()));
  RodAccess bar(other, 1);
  x = bar.positions();
  for (Vec3 &v : x) v *= 1.25;
  bar.setPositions(x);
  for (const double force : bar.axialForces()) EXPECT_NEAR(force, 0.25 * 1e7 * 0.01 * 0.006, 1e-8);
}

/// Twist angles count whole turns and give the energy GJ phi^2 / 2 Lbar of each cell.
TEST(StateAccess, TwistsAreWhatIsWritten) {
  for (const bool held : {false, true}) {
    Scene scene;
    scene.rods = {straightRod(8, Measure::angle)};
    if (held)
      scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 0, 5, Support::Kind::fix_twist),
                        hold(scene, 0, 8, Support::Kind::clamp)};
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, statics()));
    RodAccess rod(sim, 0);
    std::vector<double> angle{0.3, 1, -2, 4, 7, 11, 0.2, -0.1, 0};
    if (held) // the last follows up to whole turns: three of them
      for (int v = 0; v < 8; ++v) angle[8] -= angle[v];
    if (held) angle[8] += 6 * pi;
    rod.setTwists(angle);
    if (!held) angle[0] = 0; // of a free end
    double energy = 0;
    for (int v = 0; v <= 8; ++v) {
      EXPECT_NEAR(rod.twists()[v], angle[v], 1e-12) << v;
      const double length = v % 8 == 0 ? 1.0 / 16 : 1.0 / 8;
      if (v != 5 || !held) energy += 0.5 * 2.0 / 3 * angle[v] * angle[v] / length;
    }
    if (!held) {
      EXPECT_NEAR(energyOf(sim), energy, 1e-11 * energy);
      continue;
    }
    // Two half cells at vertex 5 share 11 rad: edge 4 has turned by the sum of the angles before it.
    double before = 0;
    for (int v = 0; v < 5; ++v) before += angle[v];
    energy += 0.5 * 2.0 / 3 * 16 * (before * before + std::pow(before + 11, 2));
    EXPECT_NEAR(energyOf(sim), energy, 1e-11 * energy);
  }
}

TEST(StateAccess, ARingClosesUpToWholeTurns) {
  Scene scene;
  const Polyline ring = ringShape(Vec3::Zero(), Vec3::UnitZ(), 0.2, 12);
  Rod rod = inextensibleRod({Vec3::Zero(), Vec3::UnitX()}, Measure::angle);
  rod.closed = true;
  rod.position = ring.points;
  setBishopDirectors(rod);
  scene.rods = {rod};
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
  RodAccess access(sim, 0);
  std::vector<double> angle(12, 2 * pi / 12); // one turn
  access.setTwists(angle);
  for (const double a : access.twists()) EXPECT_NEAR(a, 2 * pi / 12, 1e-12);
  const State before = sim.state;
  angle[3] += 0.1;
  EXPECT_NE(
      mistakeOf([&] { access.setTwists(angle); }).find("the twist angle at vertex 0 follows from the others: 0.4235"),
      std::string::npos);
  EXPECT_TRUE(sim.state == before);
}

/// midpoint is its own adjoint: with velocities reversed it goes back the way it came, to Newton's tolerance.
TEST(StateAccess, ReversedVelocitiesGoBackToTheStart) {
  LoopSettings settings = dynamics(2e-3, 1);
  settings.integrator.name = "midpoint";
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(true), settings));
  const State start = sim.state;
  advance(sim, settings, 0.1);
  RodAccess rod(sim, "spring"), first(sim, "first");
  EXPECT_GT((rod.positions()[24] - start.position[28]).norm(), 1e-3);
  for (RodAccess *one : {&rod, &first}) {
    std::vector<Vec3> v = one->velocities();
    for (Vec3 &each : v) each = -each;
    one->setVelocities(v);
    std::vector<double> w = one->twistRates();
    for (double &each : w) each = -each;
    one->setTwistRates(w);
  }
  advance(sim, settings, 0.2);
  for (int v = 0; v < 25; ++v)
    EXPECT_LT((rod.positions()[v] - start.position[4 + v]).norm(), 1e-6)
        << v; // moved by up to centimetres, 100 steps of 1e-6
}

/// Also from within the loop: every integrator begins anew, so that the rods go on as from a state of the same content.
TEST(StateAccess, IsAllowedAfterEachStep) {
  for (const char *name : {"euler", "bdf2", "sdirk2", "midpoint", "energy_momentum", "generalized_alpha"}) {
    LoopSettings settings = dynamics(5e-3, 0.1);
    settings.integrator.name = name;
    Simulation inside, between;
    for (Simulation *sim : {&inside, &between}) EXPECT_PETSC(sim->setUp(springScene(true), settings));
    TimeLoop loop(inside.solver, settings);
    bool finished = false;
    auto stopHalfway = [&](const State &state, const Diagnostics &) {
      if (state.step == 10) RodAccess(inside, "spring").stop();
      return PetscErrorCode(0);
    };
    EXPECT_PETSC(loop.run(inside.state, stopHalfway, &finished));
    EXPECT_TRUE(finished) << name << ": " << loop.failure();
    advance(between, settings, 0.05);
    RodAccess(between, "spring").stop();
    advance(between, settings, 0.1);
    for (int v = 0; v < 29; ++v)
      EXPECT_LT((inside.state.position[v] - between.state.position[v]).norm(), 1e-12)
          << name << " " << v; // the steps differ by rounding
  }
}

TEST(StateAccess, NeedsASimulationThatIsSetUp) {
  Simulation sim;
  EXPECT_EQ(mistakeOf([&] { RodAccess(sim, 0); }), "the simulation has no rods yet: set it up first");
  EXPECT_EQ(mistakeOf([&] { RodAccess(sim, "a"); }), "the simulation has no rods yet: set it up first");
}

/// A written state is only where a static search begins: the equilibrium is the same.
TEST(StateAccess, StaticsComeBackToTheirEquilibrium) {
  Scene scene = clampedScene(straightRod(10));
  scene.forces = {{0, 10, Vec3(0, -1, 0)}};
  Simulation sim;
  runTo(sim, scene, statics());
  const std::vector<Vec3> answer = sim.state.position;
  RodAccess rod(sim, 0);
  std::vector<Vec3> x = answer;
  for (int v = 2; v <= 10; ++v) x[v][1] += 0.01 * v;
  rod.setPositions(x);
  EXPECT_EQ(sim.state.time, 0); // what was written is no equilibrium
  advance(sim, statics(2), 1);
  for (int v = 0; v <= 10; ++v)
    EXPECT_LT((sim.state.position[v] - answer[v]).norm(), 1e-7) << v; // -snes_rtol 1e-6 of a deflection of 0.3
}

TEST(StateAccess, StopAndReset) {
  LoopSettings settings = dynamics(0.01, 1);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(true), settings));
  const State start = sim.state;
  advance(sim, settings, 0.1);
  const State moving = sim.state;
  RodAccess rod(sim, "spring");
  rod.stop();
  for (const Vec3 &v : rod.velocities()) EXPECT_EQ(v, Vec3(Vec3::Zero()));
  for (const double w : rod.twistRates()) EXPECT_EQ(w, 0);
  EXPECT_EQ(sim.state.velocity[3], moving.velocity[3]); // of the other rod
  EXPECT_EQ(sim.state.position, moving.position);
  rod.reset();
  EXPECT_EQ(sim.state.position[28], start.position[28]);
  EXPECT_EQ(sim.state.director[26], start.director[26]);
  EXPECT_EQ(sim.state.position[3], moving.position[3]);
}

/// Each mistake names the rod, what is wrong, and leaves the state as it was.
TEST(StateAccess, MistakesAreRefusedWhole) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(true, Measure::tan), dynamics(0.01, 1)));
  RodAccess rod(sim, "spring");
  const State before = sim.state;
  const std::vector<Vec3> x = rod.positions(), d = rod.directors();
  auto with = [](auto values, int i, auto value) {
    values[i] = value;
    return values;
  };
  const std::vector<std::pair<std::string, std::function<void()>>> mistakes{
      {"no rod is called 'springs'; there are 'first', 'spring'", [&] { RodAccess(sim, "springs"); }},
      {"rod 2 does not exist; rods are 0 to 1", [&] { RodAccess(sim, 2); }},
      {"rod 'spring': 24 positions given where it takes 25",
       [&] {
         rod.setPositions({x.begin(), x.end() - 1});
       }},
      {"rod 'spring': vertex 0 is held at (", [&] { rod.setPositions(with(x, 0, Vec3(x[0] + Vec3(0, 1, 0)))); }},
      {"rod 'spring': vertex 3 has a coordinate that is not finite",
       [&] { rod.setPositions(with(x, 3, Vec3(0, NAN, 0))); }},
      {"rod 'spring': edge 3 (vertex 3 to 4) has zero length", [&] { rod.setPositions(with(x, 4, x[3])); }},
      {"rod 'spring': folds back on itself at vertex 4",
       [&] { rod.setPositions(with(x, 5, Vec3(0.5 * (x[3] + x[4])))); }},
      {"rod 'spring': the director of edge 2 is (", [&] { rod.setDirectors(with(d, 2, Vec3(2 * d[2]))); }},
      {"rod 'spring': the director of edge 2 is (",
       [&] { rod.setDirectors(with(d, 2, Vec3((x[3] - x[2]).normalized()))); }},
      {"rod 'spring': is twisted by half a turn at vertex 2, the barrier",
       [&] { rod.setDirectors(with(d, 2, Vec3(-d[2]))); }},
      {"measure tan takes less than half a turn", [&] { rod.setTwists(with(rod.twists(), 2, 3.2)); }},
      {"the twist angle at vertex 2 is not finite", [&] { rod.setTwists(with(rod.twists(), 2, HUGE_VAL)); }},
      {"rod 'spring': the velocity of vertex 1 is not finite", [&] { rod.setVelocities(with(x, 1, Vec3(NAN, 0, 0))); }},
      {"rod 'spring': 25 twist rates given where it takes 24",
       [&] { rod.setTwistRates(std::vector<double>(25, 0.0)); }},
  };
  for (const auto &[message, call] : mistakes) {
    EXPECT_NE(mistakeOf(call).find(message), std::string::npos) << mistakeOf(call) << "\nwanted: " << message;
    EXPECT_TRUE(sim.state == before) << message;
  }
}

} // namespace
} // namespace tendril::test
