/// Backward Euler's own sums, dissipation, convergence of Newton, independence of its path, and rejection of steps.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include "tendril/energy/edge.hpp"

namespace tendril::test {
namespace {

Scene freeScene(Rod rod) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {std::move(rod)};
  return scene;
}

/// A soft spring of two turns, clamped, that moves and twists a lot in a step.
Scene springScene(int edges = 40) {
  HelixShape h{Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 0.5, 0.1, 2, 0.1, edges};
  Rod rod;
  rod.name = "spring";
  rod.position = helixShape(h).points;
  rod.material = homogeneousMaterial({SectionShape::rectangle, {0.01, 0.006}}, 1e7, 4e6, 1000);
  setBishopDirectors(rod);
  Scene scene = clampedScene(rod);
  scene.gravity = Vec3(0, -9.8, 3);
  return scene;
}

/// A tolerance relative to EI/L^2 alone would accept standing still: its forces exceed those of so light a rod's
/// inertia.
TEST(FreeFlight, OfASlowLightRodKeepsItsVelocity) {
  Rod rod = straightRod(10, Measure::tan, 1e-4);
  rod.material = homogeneousMaterial({SectionShape::circle, {1e-6, 1e-6}}, 1e9, 4e8, 1000);
  rod.initial_velocity = Vec3(1e-3, 0, 0);
  Simulation sim;
  runTo(sim, freeScene(rod), dynamics(1e-3, 1e-2));
  for (const Vec3 &v : sim.state.velocity)
    EXPECT_NEAR(v[0], 1e-3, 1.1e-7); // ten steps, each to 1e-6 of the momentum of eleven vertices
}

/// The state is turned as a whole, ten thousand times, by the same moves that a step makes: additive increments of
/// positions, twist increments beyond parallel transport, directors made orthonormal at the end. Parallel transport
/// itself depends on the path; strains must not.
TEST(RigidMotion, RepeatedTenThousandTimesLeavesTheStrains) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(), dynamics(0.01, 1)));
  runTo(sim, springScene(), dynamics(0.02, 0.2)); // bent and twisted
  State s = sim.state;
  const Elements &e = *sim.elements;
  auto strains = [&] {
    std::vector<double> all;
    const Configuration c = configurationOf(s, sim.scene, e, 0);
    for (const int n : e.cell_slot)
      if (e.cells()[cell_free][n] * e.cells()[cell_free + 1][n] ==
          1) // not the half cell of the clamp, whose frame stays
        for (const double strain : presentStrain<double>(e, c, 0, {n, n - 1, n, n})) all.push_back(strain);
    for (const int i : e.edge_slot) all.push_back(c[Configuration::strain][i]);
    return all;
  };
  const std::vector<double> before = strains();
  Random random(18);
  for (int step = 0; step < 10000; ++step) {
    const Mat3 r = Eigen::AngleAxisd(1.5 * random(), random.direction()).toRotationMatrix();
    const Vec3 centre = s.position[20]; // stays near the origin
    for (std::size_t i = 0; i < s.director.size(); ++i) {
      const Frame f{(s.position[i + 1] - s.position[i]).normalized(), s.director[i], 1},
          turned{r * f.tangent, r * f.director, 1};
      const double beyond = twistIncrement(f, turned);
      s.director[i] = orthonormalised(
          rotateAbout<double>(transport<double>(f.director, f.tangent, turned.tangent), turned.tangent, beyond),
          turned.tangent);
    }
    for (Vec3 &x : s.position) x = centre + r * (x - centre);
  }
  const std::vector<double> after = strains();
  for (std::size_t k = 0; k < before.size(); ++k) EXPECT_NEAR(after[k], before[k], 1e-12);
}

/// A clamp led around a closed loop brings the rod back to the energy it had.
TEST(ClosedLoop, OfAClampReturnsTheEnergy) {
  Scene scene = clampedScene(straightRod(24, Measure::angle));
  scene.supports.push_back(hold(scene, 0, 24, Support::Kind::clamp));
  scene.supports[1].motion.table = {{0, Vec3(-0.2, 0, 0), Vec3(0, 0, 0.5)},
                                    {0.25, Vec3(-0.3, 0.1, 0), Vec3(0, 0.4, 0.5)},
                                    {0.5, Vec3(-0.3, 0.1, 0.2), Vec3(0.6, 0.4, 0)},
                                    {0.75, Vec3(-0.2, -0.1, 0.1), Vec3(0.3, 0, 1)},
                                    {1, Vec3(-0.2, 0, 0), Vec3(0, 0, 0.5)}};
  EXPECT_PETSC(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-10"));
  Simulation sim;
  const LoopSettings settings = statics(16);
  EXPECT_PETSC(sim.setUp(scene, settings));
  std::vector<double> energies;
  NewtonReport report;
  for (const double time : {1e-12, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
    EXPECT_PETSC(sim.solver.solve(sim.state, TimeLoop::stepOf(settings, sim.state, time - sim.state.time), &report));
    ASSERT_TRUE(report.converged) << time << ": " << report.reason;
    sim.potential->commit(sim.state);
    energies.push_back(energyBudget(sim.scene, *sim.elements, sim.state, 1).total());
  }
  EXPECT_PETSC(PetscOptionsClearValue(nullptr, "-snes_rtol"));
  EXPECT_GT(energies[5], 1.1 * energies[0]);                                // it went somewhere
  EXPECT_NEAR(energies.back(), energies.front(), 1e-10 * energies.front()); // the first point lies 1e-12 along the loop
}

/// Runs into a failure of the first step: the state stays bit for bit, and the reason holds `word`.
void expectFailure(Simulation &sim, const LoopSettings &settings, const std::string &word) {
  const State before = sim.state;
  TimeLoop loop(sim.solver, settings);
  bool finished = true;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_FALSE(finished);
  EXPECT_TRUE(sim.state == before);
  EXPECT_NE(loop.failure().find(word), std::string::npos) << loop.failure();
}

/// A load that is not a number, as a faulty coupling would give: every step is rejected, the state stays bit for bit,
/// the reason is told.
TEST(TimeLoop, RejectsALoadThatIsNotANumber) {
  Scene scene = clampedScene(straightRod(8));
  scene.forces.push_back({0, 8, Vec3(0, NAN, 0)});
  Simulation sim;
  const LoopSettings settings = dynamics(0.01, 0.1);
  EXPECT_PETSC(sim.setUp(scene, settings));
  expectFailure(sim, settings, "not finite");
}

TEST(FoldBarrier, IsNotSteppedOver) {
  auto corner = [](double degrees) { return Vec3(1 + std::cos(degrees * pi / 180), std::sin(degrees * pi / 180), 0); };
  for (const Measure measure : {Measure::tan, Measure::angle}) {
    Rod rod = inextensibleRod({Vec3(0, 0, 0), Vec3(1, 0, 0), corner(170)}, measure);
    Simulation sim;
    EXPECT_PETSC(sim.setUp(clampedScene(rod), dynamics(0.01, 1)));
    sim.solver.begin(sim.state, TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01));
    Planes increment = sim.dofs.makePlanes();
    Configuration trial;
    auto possible = [&](double degrees) {
      const Vec3 d = corner(degrees) - corner(170);
      increment.setVector(0, sim.elements->vertex_slot[2], d);
      return sim.potential->tryMove(increment, 1, trial);
    };
    EXPECT_TRUE(possible(179));
    EXPECT_EQ(possible(190), measure == Measure::angle); // `angle` has no barrier there
  }
}

/// A clamp that travels by a table and turns, in both modes: the vertex is where the table says, and the edge beside it
/// follows its frame.
TEST(Motion, OfAClampIsFollowedExactly) {
  for (const bool dynamic : {false, true}) {
    Scene scene = clampedScene(straightRod(20));
    scene.rods[0].material.mass_damping_coefficient = 1e3; // dynamics without waves
    Motion &motion = scene.supports[0].motion;
    motion.table = {{0, Vec3::Zero(), Vec3::Zero()},
                    {0.5, Vec3(0.1, 0.2, 0), Vec3(0, 0, 0.4)},
                    {1, Vec3(0.3, 0.2, 0.1), Vec3(0, 0, 1.2)}};
    Simulation sim;
    runTo(sim, scene, dynamic ? dynamics(0.02, 1) : statics(7)); // 7: the break of the table lies inside a load step
    EXPECT_LT((sim.state.position[0] - Vec3(0.3, 0.2, 0.1)).norm(), 1e-15);
    if (dynamic) continue; // the rod bends behind the clamp
    const Vec3 axis(std::cos(1.2), std::sin(1.2), 0);
    for (int v = 0; v <= 20; ++v)
      EXPECT_LT((sim.state.position[v] - sim.state.position[0] - axis * (v / 20.0)).norm(),
                1e-7); // residual 1e-6 of EI/L^2
  }
}

/// Turns by six whole turns in a fiftieth of the way, in two corners of the table, and half a turn back after it:
/// however a step lies about them, all are counted, in the twist, in what is stored and in the work.
TEST(Motion, OfATableIsCountedInWholeTurnsWhateverTheSteps) {
  Rod rod = straightRod(20, Measure::angle);
  rod.material.flexural_stiffness = {1e8, 1e8}; // too stiff to writhe
  Scene scene = clampedScene(rod);
  scene.supports.push_back(hold(scene, 0, 20, Support::Kind::clamp));
  const double most = 12 * pi, last = 11 * pi;
  scene.supports[1].motion.table = {{0.3, Vec3::Zero(), Vec3::Zero()},
                                    {0.31, Vec3::Zero(), Vec3(most, 0, 0)},
                                    {0.32, Vec3::Zero(), Vec3(last, 0, 0)}};
  const Motion &motion = scene.supports[1].motion;
  EXPECT_NEAR(motion.turnBetween(0, 1).x(), last, 1e-12 * most);
  EXPECT_NEAR(motion.turnBetween(1, 0).x(), -last, 1e-12 * most);
  double before = 0;
  for (const double time : motion.stopsBetween(0, 1)) {
    EXPECT_LT((motion.rotationVectorAt(time) - motion.rotationVectorAt(before)).norm(), 0.5);
    before = time;
  }
  EXPECT_EQ(before, 1);
  const double stored = 0.5 * rod.material.torsional_stiffness * last * last; // GJ phi^2/(2 L), L = 1 m
  for (const int steps : {1, 2, 3, 4, 5, 7, 50}) {
    Simulation sim;
    double work = 0;
    runAndWatch(sim, scene, statics(steps), [&](const Diagnostics &row) { work += row.work.supports; });
    EXPECT_NEAR(energyBudget(sim.scene, *sim.elements, sim.state, 1).twist, stored, 1e-9 * stored) << steps;
    EXPECT_NEAR(work, stored, 1e-6 * stored) << steps; // of -snes_rtol
  }
}

TEST(TwistBarrier, IsNotSteppedOver) {
  for (const Measure measure : {Measure::tan, Measure::angle}) {
    Rod rod = straightRod(4, measure);
    rod.material.flexural_stiffness = {1e8, 1e8}; // too stiff to writhe
    Scene scene = clampedScene(rod);
    scene.supports.push_back(hold(scene, 0, 4, Support::Kind::clamp));
    scene.supports[1].motion.angular_velocity = Vec3(30, 0, 0); // rad at load factor 1: 7.5 per cell
    Simulation sim;
    const LoopSettings settings = statics(20);
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished;
    EXPECT_PETSC(loop.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_EQ(finished, measure == Measure::angle) << loop.failure() << sim.state.time;
    if (measure == Measure::angle) {
      const EnergyBudget e = energyBudget(sim.scene, *sim.elements, sim.state, 1);
      EXPECT_NEAR(e.twist, 0.5 * rod.material.torsional_stiffness * 30 * 30,
                  1e-9 * e.twist); // GJ phi^2/(2 L), exact for uniform twist
    } else {
      EXPECT_LT(sim.state.time, 5 * pi / 30); // three cells and two half cells, each below 180 degrees
      EXPECT_NE(loop.failure().find("barrier"), std::string::npos) << loop.failure();
    }
  }
}

TEST(FreeFall, IsBackwardEulersOwnSum) {
  Scene scene = freeScene(straightRod(10));
  scene.rods[0].initial_velocity = Vec3(1, 2, 0);
  scene.gravity = Vec3(0, -9.81, 0);
  Simulation sim;
  const int n = 50;
  const double h = 0.01;
  EXPECT_PETSC(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-11"));
  runTo(sim, scene, dynamics(h, n * h));
  EXPECT_PETSC(PetscOptionsClearValue(nullptr, "-snes_rtol"));
  const Vec3 moved = Vec3(1, 2, 0) * n * h + scene.gravity * h * h * n * (n + 1) / 2;
  for (int v = 0; v <= 10; ++v)
    EXPECT_LT((sim.state.position[v] - scene.rods[0].position[v] - moved).norm(),
              1e-11); // 50 steps of the solver's 1e-11 of the weight
}

TEST(MassDamping, SlowsByItsOwnFactor) {
  const double alpha = 3, h = 0.02;
  const int n = 40;
  Scene scene = freeScene(straightRod(8));
  scene.rods[0].initial_velocity = Vec3(0.3, -1, 2);
  scene.rods[0].material.mass_damping_coefficient = alpha;
  Simulation sim;
  runTo(sim, scene, dynamics(h, n * h));
  for (const Vec3 &v : sim.state.velocity)
    EXPECT_LT((v - scene.rods[0].initial_velocity / std::pow(1 + alpha * h, n)).norm(), 1e-7);
}

TEST(StiffnessDamping, DoesNotSeeRigidMotion) {
  Scene scene = springScene();
  scene.supports.clear();
  Simulation damped, plain;
  const LoopSettings settings = dynamics(0.01, 1);
  scene.rods[0].material.stiffness_damping_coefficient = 0.5;
  EXPECT_PETSC(damped.setUp(scene, settings));
  scene.rods[0].material.stiffness_damping_coefficient = 0;
  EXPECT_PETSC(plain.setUp(scene, settings));
  State turned = plain.state;
  const Mat3 r = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  for (Vec3 &x : turned.position) x = r * x + Vec3(0.1, 0.2, 0.3);
  for (Vec3 &d : turned.director) d = r * d;
  Step step;
  step.dt = 0.01;
  step.time = 0.01;
  damped.solver.begin(damped.state, step);
  plain.solver.begin(plain.state, step);
  const double a = damped.potential->energy(configurationOf(turned, damped.scene, *damped.elements, 0));
  const double b = plain.potential->energy(configurationOf(turned, plain.scene, *plain.elements, 0));
  EXPECT_NEAR(a, b, 1e-12 * std::abs(b));
}

TEST(StiffnessDamping, IsTheRatePotentialOfTheStoredEnergy) {
  // E with damping - E without = beta/dt x (stored energy of the strain increments), for every strain: h R((q -
  // q_n)/h).
  Scene scene = springScene();
  const LoopSettings settings = dynamics(0.01, 1);
  const double beta = 0.02;
  Simulation damped, plain, increments;
  EXPECT_PETSC(plain.setUp(scene, settings));
  scene.rods[0].material.stiffness_damping_coefficient = beta;
  EXPECT_PETSC(damped.setUp(scene, settings));
  State moved = plain.state;
  Random random(5);
  for (Vec3 &x : moved.position) x += 2e-3 * random.vector();
  Configuration to = configurationOf(moved, plain.scene, *plain.elements, 0);
  for (const int i : plain.elements->edge_slot) {
    Frame f = to.frameAt(i);
    f.director = orthonormalised(f.director, f.tangent);
    to.setFrame(i, f);
  }
  Step step;
  step.dt = step.time = 0.01;
  auto added = [&](const Configuration &c) { return damped.potential->energy(c) - plain.potential->energy(c); };
  plain.solver.begin(plain.state, step);
  damped.solver.begin(damped.state, step);
  const Configuration from = plain.potential->iterate();
  double expected = 0;
  const Elements &e = *plain.elements;
  for (const int i : e.edge_slot)
    expected += 0.5 * e.axialStiffness()[i] * e.restLength()[i] *
                std::pow(to[Configuration::strain][i] - from[Configuration::strain][i], 2);
  for (const int c : e.cell_slot) {
    const LooseCell cell{c, c - 1, c, c};
    const auto s0 = presentStrain<double>(e, from, 0, cell), s1 = presentStrain<double>(e, to, 0, cell);
    for (int k = 0; k < 3; ++k) expected += 0.5 * e.cells()[cell_stiffness + k][c] * std::pow(s1[k] - s0[k], 2);
  }
  const double measured = added(to) - added(from);
  EXPECT_NEAR(measured, beta / step.dt * expected, 1e-10 * std::abs(beta / step.dt * expected));
}

TEST(StiffnessDamping, LeavesStaticsUnchanged) {
  Scene scene = springScene();
  Simulation plain, damped;
  runTo(plain, scene, statics());
  scene.rods[0].material.stiffness_damping_coefficient = 1;
  scene.rods[0].material.mass_damping_coefficient = 10;
  runTo(damped, scene, statics());
  for (std::size_t v = 0; v < plain.state.position.size(); ++v)
    EXPECT_EQ(plain.state.position[v], damped.state.position[v]);
}

/// One step of a simulation from its state.
NewtonReport oneStep(Simulation &sim, double dt, const Guess *guess = nullptr) {
  Step step;
  step.dt = dt;
  step.time = sim.state.time + dt;
  NewtonReport report;
  EXPECT_EQ(sim.solver.solve(sim.state, step, &report, Seek::minimum, guess), PetscErrorCode(0));
  EXPECT_TRUE(report.converged) << report.reason;
  return report;
}

TEST(Newton, ConvergesQuadratically) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(), dynamics(0.05, 1)));
  EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-11, 0, 50, PETSC_MAX_INT));
  for (int k = 0; k < 3; ++k) {
    oneStep(sim, 0.05);
    sim.potential->commit(sim.state);
  }
  const std::vector<double> r = oneStep(sim, 0.1).history;
  // The order over the last drop that starts inside the quadratic range and ends above rounding.
  double best = 0;
  for (std::size_t k = 2; k < r.size(); ++k)
    if (r[k - 1] < 1e-2 && r[k] > 1e-13)
      best = std::max(best, std::log(r[k] / r[k - 1]) / std::log(r[k - 1] / r[k - 2]));
  EXPECT_GE(best, 1.8);
}

TEST(Newton, AnswerDoesNotDependOnTheFirstGuess) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(springScene(), dynamics(0.02, 1)));
  EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-12, 0, 50, PETSC_MAX_INT));
  oneStep(sim, 0.02);
  sim.potential->commit(sim.state);
  oneStep(sim, 0.02);
  State plain = sim.state, guessed = sim.state;
  sim.potential->commit(plain);
  Random random(7);
  Guess guess{sim.dofs.makePlanes(), {}};
  for (const int s : sim.elements->vertex_slot)
    for (int a = 0; a < slot_size; ++a) guess.unknowns[a][s] = 2e-3 * random() * (a == 3 ? 100 : 1);
  const NewtonReport report = oneStep(sim, 0.02, &guess);
  EXPECT_GT(report.iterations, 2);
  sim.potential->commit(guessed);
  double largest = 0;
  for (std::size_t v = 0; v < plain.position.size(); ++v)
    largest = std::max(largest, (plain.position[v] - guessed.position[v]).norm() / 0.5);
  for (std::size_t i = 0; i < plain.director.size(); ++i) {
    largest = std::max(largest, (plain.director[i] - guessed.director[i]).norm());
    largest = std::max(largest, std::abs(plain.twist_rate[i] - guessed.twist_rate[i]) / 100);
  }
  EXPECT_LT(largest, 1e-9);
}

TEST(Newton, HelixTakesAtMostFiveIterationsPerStep) {
  Rod rod;
  rod.name = "spring";
  rod.position = helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 1.25, 0.125, 8, 0.1, 128}).points;
  rod.material = homogeneousMaterial({SectionShape::circle, {0.01, 0}}, 1e9, 1e9, 1e3);
  setBishopDirectors(rod);
  for (const double factor : {1.0, 1e4}) {
    Scene scene;
    scene.gravity = Vec3(0, -9.8, 0);
    scene.rods = {rod};
    scene.rods[0].material.axial_stiffness *= factor;
    scene.supports = {hold(scene, 0, 0, Support::Kind::pin)};
    Simulation sim;
    int iterations = 0;
    runTo(sim, scene, dynamics(1.0 / 60, 1), &iterations);
    EXPECT_LE(iterations / 60.0, 5);
  }
}

TEST(TimeLoop, RestoresTheStateWhenAStepFails) {
  Simulation sim;
  LoopSettings settings = dynamics(0.05, 1);
  EXPECT_PETSC(sim.setUp(springScene(), settings));
  EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-6, 0, 1, PETSC_MAX_INT)); // one iteration is never enough
  settings.dt_min = 0.01;
  expectFailure(sim, settings, "iteration limit");
}

TEST(TimeLoop, HalvesTheStepAndRecoversIt) {
  Simulation sim;
  LoopSettings settings = dynamics(0.2, 2);
  EXPECT_PETSC(sim.setUp(springScene(), settings));
  EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-6, 0, 5, PETSC_MAX_INT));
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  int rejected = 0, in_vain = 0;
  double smallest = 1, last = 0;
  EXPECT_PETSC(loop.run(
      sim.state,
      [&](const State &, const Diagnostics &row) {
        rejected += row.rejected_steps;
        in_vain += row.rejected_iterations;
        smallest = std::min(smallest, row.dt);
        last = row.dt;
        return PetscErrorCode(0);
      },
      &finished));
  EXPECT_TRUE(finished) << loop.failure();
  EXPECT_GT(rejected, 0);
  EXPECT_EQ(in_vain, 5 * rejected); // each went on to the limit
  EXPECT_LT(smallest, 0.2);
  EXPECT_GT(last, smallest);
  EXPECT_DOUBLE_EQ(sim.state.time, 2);
}

TEST(Statics, CompressedColumnLeavesTheUnstableStraightState) {
  // Clamped and free, compressed at 2.6 times the Euler load pi^2/4: the straight state is an equilibrium, but not a
  // minimum.
  const int n = 32;
  Scene scene = clampedScene(straightRod(n));
  scene.forces = {{0, n, Vec3(-2.6 * pi * pi / 4, 0, 0)}};
  Simulation sim;
  runTo(sim, scene, statics(2));
  EXPECT_LT(sim.state.position.back().x(), 0.9);
}

} // namespace
} // namespace tendril::test
