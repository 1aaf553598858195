/// The words for what keeps an iterate from being an answer.
#include "support/rods.hpp"

#include "tendril/dynamics/arc_length.hpp"
#include "tendril/solver/imbalance.hpp"

namespace tendril::test {
namespace {

/// Clamped rods of length 1 that have not moved yet: a under a force, b under a torque, c without loads.
Scene threeRods() {
  Scene scene = clampedScene(straightRod(10));
  for (const char *name : {"a", "b", "c"}) {
    if (*name != 'a') scene.rods.push_back(scene.rods[0]);
    scene.rods.back().name = name;
  }
  for (const int r : {1, 2}) scene.supports.push_back(hold(scene, r, 0, Support::Kind::clamp));
  scene.forces.push_back({0, 7, Vec3(0, 12, 0)});
  scene.moments.push_back({1, 4, 0.5, Vec3::Zero()});
  return scene;
}

TEST(Imbalance, NamesValueToleranceAndPlace) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(threeRods(), statics()));
  IncrementalPotential &potential = *sim.potential;
  sim.solver.begin(sim.state, TimeLoop::stepOf(statics(), sim.state, 1));
  potential.focus(potential.all());
  EXPECT_EQ(imbalanceOf(potential, 0, {1e-6}),
            "forces out of balance by 1 of its load of 12 N (asked: 1e-06, -snes_rtol), most at vertex 7");
  EXPECT_EQ(imbalanceOf(potential, 1, {1e-8, 0.01}), "moments out of balance by 1 of 0.5 N m, its load times its "
                                                     "length, (asked: 1e-08, -snes_rtol x 0.01), most at edge 4");
  EXPECT_EQ(imbalanceOf(potential, 2, {1e-6}), "");
  EXPECT_EQ(tellImbalance(potential, 2, {1e-6}), "");
  // A force of 1e7 N that no strain of EA = 1e10 N goes with, in one edge: it pulls at both its vertices. GJ/L^2
  // measures a rod that bends by no load.
  Planes force(1, sim.dofs.slots());
  force[0][potential.elements().rods[2].slot(3)] = 1e7;
  potential.setAxialForces(2, force[0]);
  EXPECT_EQ(
      imbalanceOf(potential, 2, {1e-6}),
      "forces out of balance by 2.121e+07 of 0.6667 N, which deforms it, (asked: 1e-06, -snes_rtol), most at vertex 3, "
      "strains of -stretch mixed off by 0.001 (asked: 1e-10, 1e-4 of -snes_rtol), most at edge 3");
  EXPECT_EQ(farthestRod(potential, potential.all(), {1e-6}), 2);
  const std::vector<char> wanted{true, true, false};
  EXPECT_EQ(farthestRod(potential, {0, 3}, {1e-6}, &wanted), 0); // the first of two alike
  EXPECT_EQ(tellImbalance(potential, 0, {1e-6}), "; rod 'a' (10 edges): forces out of balance by 1 of its load of 12 N "
                                                 "(asked: 1e-06, -snes_rtol), most at vertex 7");
  EXPECT_EQ(farthestRod(potential, {0, 0}, {1e-6}), -1);
  EXPECT_EQ(tellImbalance(potential, -1, {1e-6}), "");
}

/// Fails in its first step, and says why.
std::string failureOf(const Scene &scene, const LoopSettings &settings, int most_iterations = 100) {
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, settings), PetscErrorCode(0));
  for (NewtonSolver &block : sim.solver.blocks())
    EXPECT_EQ(SNESSetTolerances(block.snes(), 0, 1e-6, 0, most_iterations, PETSC_MAX_INT), PetscErrorCode(0));
  const auto observe = [](const State &, const Diagnostics &) { return PetscErrorCode(0); };
  bool finished = true;
  if (settings.continuation == Continuation::arclength) {
    ArcLength path(sim.solver, settings);
    EXPECT_EQ(path.run(sim.state, observe, &finished), PetscErrorCode(0));
    EXPECT_FALSE(finished);
    return path.failure();
  }
  TimeLoop loop(sim.solver, settings);
  EXPECT_EQ(loop.run(sim.state, observe, &finished), PetscErrorCode(0));
  EXPECT_FALSE(finished);
  return loop.failure();
}

void expectWords(const std::string &text, const std::vector<std::string> &words) {
  for (const std::string &w : words) EXPECT_NE(text.find(w), std::string::npos) << w << ": " << text;
}

TEST(Imbalance, IsInWhateverFails) {
  const std::string limit = failureOf(threeRods(), statics(), 1);
  expectWords(limit,
              {"load step at factor 0 failed with increment", "the iteration limit (-snes_max_it) was reached; rod '",
               "' (10 edges): ", " out of balance by ", "(asked: 1e-06, -snes_rtol), most at ", "(1 iteration)"});
  Scene scene = threeRods();
  scene.forces.push_back({2, 8, Vec3(0, NAN, 0)});
  for (const LoopSettings &settings : {statics(), dynamics(0.01, 0.1)})
    expectWords(failureOf(scene, settings),
                {"the forces are not finite; rod 'c' (10 edges): forces out of balance, not finite at vertex 8"});
  LoopSettings path = statics(10);
  path.continuation = Continuation::arclength;
  path.bifurcation = Bifurcation::off;
  Scene loaded = clampedScene(straightRod(10));
  loaded.rods[0].name = "only";
  loaded.forces.push_back({0, 10, Vec3(0, NAN, 0)});
  expectWords(failureOf(loaded, path), {"rod 'only' (10 edges): forces out of balance, not finite at vertex 10"});
}

} // namespace
} // namespace tendril::test
