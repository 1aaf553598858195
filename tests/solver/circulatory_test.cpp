/// Newton's direction where couples act: the derivative of all forces, not only its symmetric part.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include "tendril/solver/circulatory.hpp"

namespace tendril::test {
namespace {

/// A rod in space under a couple fixed there, a torque about its tangent, and both in the middle, with their gradient
/// by finite differences.
Scene coupleScene() {
  Rod rod = straightRod(12, Measure::angle);
  rod.material.axial_stiffness = 1e4;
  rod.material.flexural_stiffness = {1, 1.6};
  Scene scene = clampedScene(std::move(rod));
  scene.moments = {{0, 11, 0, Vec3(0.8, 0.5, 1.5)}, {0, 11, 0.9, Vec3::Zero()}, {0, 5, 0.6, Vec3(-0.4, 0.7, 0.2)}};
  scene.forces = {{0, 12, Vec3(0.5, -1, 0.7)}};
  return scene;
}

/// At an equilibrium the derivative of the forces does not depend on how configurations are told by coordinates: K
/// solved with a random right-hand side must change the forces by it. The symmetric part alone misses by as much as it
/// changes them.
TEST(Circulatory, DirectionSolvesTheWholeDerivative) {
  Simulation sim;
  LoopSettings settings = statics();
  settings.mixed = false;
  settings.solve.retraction = RetractionKind::additive;
  EXPECT_PETSC(sim.setUp(coupleScene(), settings));
  EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-10, 0, 50, PETSC_MAX_INT));
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  ASSERT_TRUE(finished) << loop.failure();

  IncrementalPotential &potential = *sim.potential;
  Circulatory circulatory(potential, {potential.all()}, potential.all());
  ASSERT_FALSE(circulatory.isNone());
  int negative;
  EXPECT_PETSC(sim.solver.inertiaAtIterate(&negative));
  Random random(3);
  const RodRange &rod = sim.dofs.rods()[0];
  Planes right = sim.dofs.makePlanes(), symmetric = right;
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
    for (int a = 0; a < slot_size; ++a)
      if (sim.dofs.unknown(s, a) >= 0) right[a][s] = random();
  const NewtonSolver &solver = sim.solver.front();
  auto solve = [&](const Planes &r, Planes &x) { return const_cast<NewtonSolver &>(solver).solveLinear(r, x); };
  EXPECT_PETSC(solve(right, symmetric));
  EXPECT_PETSC(circulatory.update(solve));
  Planes whole = symmetric;
  ASSERT_TRUE(circulatory.correct(whole));

  const Configuration here = potential.iterate();
  auto change = [&](const Planes &d) { // of the forces along d
    constexpr double small = 1e-5;
    Planes sum = sim.dofs.makePlanes();
    for (const double sign : {1.0, -1.0}) {
      Configuration trial = here;
      EXPECT_TRUE(potential.tryMove(d, sign * small, 0, trial));
      potential.accept(trial, 0);
      const Planes &g = potential.derivatives().gradient;
      for (int a = 0; a < slot_size; ++a)
        for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) sum[a][s] += sign * g[a][s] / (2 * small);
      potential.accept(here, 0);
    }
    return sum;
  };
  auto miss = [&](const Planes &d) {
    const Planes got = change(d);
    double wrong = 0, all = 0;
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (sim.dofs.unknown(s, a) >= 0) {
          wrong += std::pow(got[a][s] - right[a][s], 2);
          all += std::pow(right[a][s], 2);
        }
    return std::sqrt(wrong / all);
  };
  EXPECT_LT(miss(whole), 1e-6); // differences over 1e-5 leave about 1e-8 of the stiffest force
  EXPECT_GT(miss(symmetric), 1e-2);
}

/// Two coils by a couple out of the plane, in one load step, by Newton's full steps past where the symmetric part is
/// indefinite; the answer is that of many small steps.
TEST(Circulatory, CoilsInOneStep) {
  auto tip = [](int steps) {
    Scene scene = clampedScene(straightRod(32, Measure::angle));
    scene.moments = {{0, 31, 0, 4 * pi * Vec3(0.5, 0, std::sqrt(0.75))}};
    Simulation sim;
    runTo(sim, scene, statics(steps));
    return sim.state.position.back();
  };
  const Vec3 exact(0.25, 0, 0.4330127018922193); // data/reference/end_moment_helix_exact.csv
  const Vec3 many = tip(100);
  EXPECT_LT((many - exact).norm(), 5e-3);  // (4 pi / 32)^2 / 24 = 6e-3 is the error of the chords of such coils
  EXPECT_LT((tip(1) - many).norm(), 1e-5); // both to -snes_rtol
}

} // namespace
} // namespace tendril::test
