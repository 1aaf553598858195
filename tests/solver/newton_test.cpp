/// Newton's method on its own: how fast it converges, what it leaves behind, and what its reports count.
#include "support/option_set.hpp"
#include "support/random_cell.hpp"
#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// A cantilever of length 1 and stiffness 1 whose end a force bends by half its length.
Scene bentRod(double axial_stiffness = 1e4, const Vec3 &force = Vec3(0, -2, 0.5)) {
  Scene scene = clampedScene(straightRod(20, Measure::angle));
  scene.rods[0].material.axial_stiffness = axial_stiffness;
  scene.forces = {{0, 20, force}};
  return scene;
}

/// A scene ready for the only step of statics.
struct OneStep {
  Simulation sim;
  Step step;
  explicit OneStep(Scene scene, const LoopSettings &settings = statics()) {
    EXPECT_EQ(sim.setUp(std::move(scene), settings), PetscErrorCode(0));
    step = TimeLoop::stepOf(settings, sim.state, settings.dt);
  }
  NewtonReport solve(const Guess *guess = nullptr) {
    NewtonReport report;
    EXPECT_EQ(sim.solver.solve(sim.state, step, &report, Seek::minimum, guess), PetscErrorCode(0));
    return report;
  }
  /// What the iterate has moved by.
  Planes moved() const {
    Planes x = sim.dofs.makePlanes();
    sim.potential->coordinates(x);
    return x;
  }
  State after() const {
    State state = sim.state;
    sim.potential->commit(state);
    return state;
  }
};

/// Largest distance between vertices of two states.
double apart(const State &a, const State &b) {
  double most = 0;
  for (std::size_t v = 0; v < a.position.size(); ++v) most = std::max(most, (a.position[v] - b.position[v]).norm());
  return most;
}

/// Order of convergence by the residuals of the last three iterates.
double orderOf(const std::vector<double> &history) {
  const std::size_t n = history.size();
  if (n < 3) return 0;
  return std::log(history[n - 1] / history[n - 2]) / std::log(history[n - 2] / history[n - 3]);
}

/// With the exact Hessian residuals are squared from iterate to iterate, also where stretch is ten orders stiffer than
/// bending; without the second derivatives of strains they fall by the same part each time.
TEST(Newton, ConvergesQuadratically) {
  for (const double axial_stiffness : {1e4, 1e10}) {
    OneStep exact(bentRod(axial_stiffness));
    const NewtonReport report = exact.solve();
    ASSERT_TRUE(report.converged) << report.reason;
    ASSERT_EQ(report.history.size(), std::size_t(report.iterations) + 1);
    EXPECT_EQ(report.shifts, 0);
    // 6e-2, 1e-4, 3e-10: so far from the limit the constants of two squares still differ, by less than a half.
    EXPECT_NEAR(orderOf(report.history), 2, 0.2) << axial_stiffness;
    EXPECT_EQ(report.history.back(), report.residual.force);
    LoopSettings settings = statics();
    settings.hessian = HessianKind::gauss_newton;
    OneStep part(bentRod(axial_stiffness), settings);
    const NewtonReport slower = part.solve();
    ASSERT_TRUE(slower.converged) << slower.reason;
    EXPECT_NEAR(orderOf(slower.history), 1, 0.1) << axial_stiffness;
    EXPECT_GT(slower.iterations, report.iterations);
  }
}

/// Runs a loop to its end or failure from where the simulation is.
bool runOn(Simulation &sim, const LoopSettings &settings, std::string *failure) {
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  EXPECT_EQ(loop.run(
                sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished),
            PetscErrorCode(0));
  *failure = loop.failure();
  return finished;
}

void limit(Simulation &sim, int iterations) {
  for (NewtonSolver &block : sim.solver.blocks())
    EXPECT_EQ(SNESSetTolerances(block.snes(), 0, 1e-6, 0, iterations, PETSC_MAX_INT), PetscErrorCode(0));
}

/// A step that fails leaves the state, and nothing of what it has tried is in the next one: from the same state that is
/// the step of a solver that has not failed, bit for bit.
TEST(Newton, AStepThatFailsLeavesNothingBehind) {
  for (const bool dynamic : {false, true}) {
    Scene scene = bentRod();
    scene.rods[0].material.linear_density = 1;
    LoopSettings settings = dynamic ? dynamics(0.05, 0.1) : statics(2), rest = settings;
    settings.dt_min = rest.dt_min = settings.dt; // no shorter step is tried
    settings.t_end = dynamic ? 0.05 : 0.5;
    Simulation fails, never;
    std::string failure;
    for (Simulation *sim : {&fails, &never}) {
      EXPECT_PETSC(sim->setUp(scene, settings));
      ASSERT_TRUE(runOn(*sim, settings, &failure)) << failure;
    }
    const State before = fails.state;
    EXPECT_TRUE(before == never.state);
    limit(fails, 1);
    EXPECT_FALSE(runOn(fails, rest, &failure));
    EXPECT_NE(failure.find("the iteration limit (-snes_max_it) was reached"), std::string::npos) << failure;
    // The iterate has moved, and the state has not.
    Planes moved = fails.dofs.makePlanes();
    fails.potential->coordinates(moved);
    EXPECT_GT(moved.vector(0, fails.dofs.rods()[0].slot(20)).norm(), 1e-3);
    EXPECT_TRUE(fails.state == before) << dynamic;
    // The iterate at which a step begins.
    for (Simulation *sim : {&fails, &never})
      EXPECT_PETSC(sim->solver.begin(sim->state, TimeLoop::stepOf(rest, sim->state, rest.dt)));
    const Planes &ours = fails.potential->iterate().values(), &others = never.potential->iterate().values();
    ASSERT_EQ(ours.size(), others.size());
    EXPECT_TRUE(std::equal(ours.begin(), ours.end(), others.begin())) << dynamic;
    limit(fails, 100);
    for (Simulation *sim : {&fails, &never}) ASSERT_TRUE(runOn(*sim, rest, &failure)) << failure;
    EXPECT_TRUE(fails.state == never.state) << dynamic;
    EXPECT_GT(apart(fails.state, before), 1e-3);
  }
}

/// From a part of the way, from the mirror image of the answer and from random places near the start.
TEST(Newton, ComesToTheSameAnswerFromAnyGuess) {
  OneStep usual(bentRod()), mirrored(bentRod(1e4, Vec3(0, 2, -0.5)));
  ASSERT_TRUE(usual.solve().converged);
  ASSERT_TRUE(mirrored.solve().converged);
  const State answer = usual.after();
  EXPECT_GT((answer.position.back() - Vec3(1, 0, 0)).norm(), 0.4);
  std::vector<Guess> guesses;
  Guess part{usual.moved(), {}}, near = part;
  for (double &v : part.unknowns) v *= 0.5;
  guesses = {part, {mirrored.moved(), {}}};
  Random random(4);
  for (int k = 0; k < 3; ++k) {
    for (double &v : near.unknowns) v = 1e-3 * random();
    guesses.push_back(near);
  }
  for (const Guess &guess : guesses) {
    OneStep other(bentRod());
    const NewtonReport report = other.solve(&guess);
    ASSERT_TRUE(report.converged) << report.reason;
    EXPECT_GT(report.iterations, 1);
    // Either may be out of balance by 1e-6 of the load of 2.1 N, each of which moves the end by up to 1/3 m.
    EXPECT_LT(apart(other.after(), answer), 1.4e-6) << &guess - guesses.data();
  }
}

/// In statics an answer is one from the first look, as a guess with its axial forces or as the start of the step.
TEST(Newton, ASolvedStepTakesNoIteration) {
  OneStep run(bentRod());
  EXPECT_GT(run.solve().iterations, 2);
  const State answer = run.after();
  Guess complete{run.moved(), Planes(1, run.sim.dofs.slots())};
  std::copy_n(run.sim.potential->iterate()[Configuration::axial_force] + run.sim.dofs.rods()[0].first_slot, 20,
              complete.axial_force[0] + run.sim.dofs.rods()[0].first_slot);
  const NewtonReport guessed = run.solve(&complete);
  EXPECT_TRUE(guessed.converged);
  EXPECT_EQ(guessed.iterations, 0);
  run.sim.state = answer;
  const NewtonReport again = run.solve();
  EXPECT_TRUE(again.converged);
  EXPECT_EQ(again.iterations, 0);
  EXPECT_EQ(again.trials, 0);
  EXPECT_EQ(again.edge_iterations, 0);
  EXPECT_EQ(again.history.size(), 1u);
  const State after = run.after();
  EXPECT_EQ(after.position, answer.position);
  EXPECT_EQ(after.position_low, answer.position_low);
  EXPECT_EQ(after.axial_force, answer.axial_force);
  for (std::size_t e = 0; e < after.director.size(); ++e) // made orthonormal once more: rounding of units
    EXPECT_LE((after.director[e] - answer.director[e]).norm(), 1e-15) << e;
  // But not a little more load.
  run.step.load_factor = 1 + 1e-5;
  EXPECT_EQ(run.solve().iterations, 1);
}

/// In dynamics the guess of a step is no answer, however well it fits: here it is what statics has come to.
TEST(Newton, AStepInTimeTakesAnIteration) {
  Scene scene = bentRod();
  scene.rods[0].material.linear_density = 1;
  OneStep rest(scene), run(scene, dynamics(0.1, 1));
  ASSERT_TRUE(rest.solve().converged);
  const State answer = rest.after();
  run.sim.state.position = answer.position;
  run.sim.state.position_low = answer.position_low;
  run.sim.state.director = answer.director;
  run.sim.state.axial_force = answer.axial_force;
  const NewtonReport report = run.solve();
  EXPECT_TRUE(report.converged);
  EXPECT_LT(report.history.front(), 1e-6); // what -snes_rtol asks for
  EXPECT_EQ(report.iterations, 1);
}

/// Rods beside each other, each pulled by a force of its own, in two blocks.
Scene beside(const std::vector<double> &force) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  for (int r = 0; r < int(force.size()); ++r) {
    Rod rod = straightRod(100, Measure::angle);
    rod.material.axial_stiffness = 1e4;
    for (Vec3 &x : rod.position) x.y() += r;
    scene.rods.push_back(rod);
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::clamp));
    if (force[r] != 0) scene.forces.push_back({r, 100, Vec3(0, -force[r], 0)});
  }
  return scene;
}

/// What a block did is told by what its rods take alone; that of all has the most iterations of any block, and the
/// edges of all rods that took part.
TEST(Newton, EachBlockCountsItsOwnIterations) {
  std::vector<double> force(16, 0.0);
  force[2] = 3, force[5] = 0.01, force[12] = 0.3;
  int alone[3];
  for (const int k : {0, 1, 2}) {
    OneStep one(beside({force[std::array{2, 5, 12}[k]]}));
    alone[k] = one.solve().iterations;
  }
  EXPECT_GT(alone[0], alone[2]);
  EXPECT_GT(alone[2], alone[1]);
  EXPECT_GT(alone[1], 0);
  OneStep all(beside(force));
  std::deque<NewtonSolver> &blocks = all.sim.solver.blocks();
  ASSERT_EQ(blocks.size(), 2u);
  ASSERT_EQ(blocks[1].rods().begin, 8);
  EXPECT_PETSC(all.sim.solver.begin(all.sim.state, all.step));
  NewtonReport own[2];
  for (const int b : {0, 1}) {
    EXPECT_PETSC(blocks[b].solve(all.sim.state, &own[b], Seek::minimum, nullptr));
    EXPECT_TRUE(own[b].converged);
    EXPECT_EQ(own[b].iterations, alone[2 * b]) << b;
    EXPECT_EQ(own[b].history.size(), std::size_t(alone[2 * b]) + 1) << b;
  }
  EXPECT_EQ(own[0].edge_iterations, 100 * (alone[0] + alone[1])); // rods without forces have converged at the start
  EXPECT_EQ(own[1].edge_iterations, 100 * alone[2]);
  const NewtonReport both = all.solve();
  EXPECT_EQ(both.iterations, alone[0]);
  EXPECT_EQ(both.edge_iterations, own[0].edge_iterations + own[1].edge_iterations);
  EXPECT_EQ(both.trials, own[0].trials + own[1].trials);
  EXPECT_EQ(both.history.size(), own[0].history.size());
}

/// PETSc's line search takes full steps, in which supports reach their places at once.
TEST(Newton, FullStepsReachTheSameAnswerWithAMovingSupport) {
  for (const bool dynamic : {false, true}) {
    Scene scene = bentRod();
    scene.rods[0].material.linear_density = 1;
    scene.supports[0].motion.velocity = Vec3(0, 0.1, 0.02);
    scene.supports[0].motion.angular_velocity = Vec3(0.1, 0, 0.4);
    const LoopSettings settings = dynamic ? dynamics(0.1, 1) : statics();
    OneStep ours(scene, settings);
    ASSERT_TRUE(ours.solve().converged);
    const OptionSet option("-snes_linesearch_type", "basic");
    OneStep basic(scene, settings);
    const NewtonReport report = basic.solve();
    ASSERT_TRUE(report.converged) << report.reason;
    EXPECT_EQ(report.trials, 0); // or it was ours again
    for (const OneStep *run : {&ours, &basic}) {
      const Vec3 place = scene.rods[0].position[0] + scene.supports[0].motion.displacementAt(run->step.time);
      EXPECT_LE((run->after().position[0] - place).norm(), 1e-16); // rounding, of 0.1
    }
    EXPECT_LT(apart(ours.after(), basic.after()), 1.4e-6); // as above; inertia holds what statics lets move
  }
}

} // namespace
} // namespace tendril::test
