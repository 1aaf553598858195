/// Any linear solver gives the same run: `banded` reads the band itself, the others get a matrix of PETSc's.
#include "support/option_set.hpp"
#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// A cantilever and a ring that falls beside it, under weight.
Scene chainAndRing() {
  Scene scene;
  scene.gravity = Vec3(0, 1, -9.8);
  Rod bar = straightRod(20, Measure::tan);
  bar.material = homogeneousMaterial({SectionShape::circle, {0.005, 0.005}}, 1e7, 4e6, 1200);
  Rod ring = bar;
  ring.name = "ring";
  const Polyline shape = ringShape(Vec3(0, 2, 0), Vec3(0, 0.3, 1).normalized(), 0.3, 16);
  ring.position = shape.points;
  ring.closed = shape.closed;
  setBishopDirectors(ring);
  scene.rods = {bar, ring};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 1, 5, Support::Kind::pin)};
  return scene;
}

TEST(LinearSolvers, GiveTheSameRun) {
  auto run = [](int *iterations) {
    Simulation sim;
    runTo(sim, chainAndRing(), dynamics(0.02, 0.1), iterations);
    return sim.state;
  };
  int banded_iterations = 0;
  const State banded = run(&banded_iterations);
  for (const char *type : {"petsc", "mumps"}) {
    const OptionSet option("-pc_factor_mat_solver_type", type);
    int iterations = 0;
    const State other = run(&iterations);
    EXPECT_EQ(iterations, banded_iterations) << type;
    for (std::size_t v = 0; v < banded.position.size(); ++v)
      EXPECT_LT((other.position[v] - banded.position[v]).norm(), 1e-9)
          << type << ", vertex " << v; // rounding of solves, of displacements of 0.1
  }
}

/// Directions come before line searches: those of PETSc go along them, too, where supports move and couples act.
TEST(LineSearches, OfPetscComeToTheSameAnswer) {
  Scene both = chainAndRing(), bar = both;
  both.supports[0].motion.velocity = Vec3(0, 0.1, 0);
  both.supports[0].motion.angular_velocity = Vec3(0, 0, 1);
  both.moments = {{0, 19, 0, Vec3(0, 0, 1e-4)}};
  bar.rods.pop_back();
  bar.supports.pop_back();
  bar.supports[0].motion = both.supports[0].motion;
  const OptionSet sharp("-snes_rtol", "1e-9");
  for (const auto &[scene, settings] : {std::pair(both, dynamics(0.01, 0.05)), std::pair(bar, statics(10))}) {
    auto run = [&, &scene = scene, &settings = settings] {
      Simulation sim;
      runTo(sim, scene, settings);
      return sim.state;
    };
    const State ours = run();
    for (const char *type : {"basic", "l2", "cp"}) {
      const OptionSet option("-snes_linesearch_type", type);
      const State other = run();
      for (std::size_t v = 0; v < ours.position.size(); ++v)
        EXPECT_LT((other.position[v] - ours.position[v]).norm(), 1e-6) << type << ", vertex " << v; // of -snes_rtol
    }
  }
}

/// Linear and nonlinear iterations of a run.
std::pair<int, int> iterationsWith(Scene scene, const LoopSettings &settings,
                                   std::initializer_list<std::pair<const char *, const char *>> options) {
  std::vector<std::unique_ptr<OptionSet>> set;
  for (const auto &[name, value] : options) set.push_back(std::make_unique<OptionSet>(name, value));
  Simulation sim;
  int nonlinear = 0;
  runTo(sim, std::move(scene), settings, &nonlinear);
  KSP ksp;
  PetscInt linear = 0;
  EXPECT_EQ(SNESGetKSP(sim.solver.front().snes(), &ksp), PetscErrorCode(0));
  EXPECT_EQ(KSPGetTotalIterations(ksp, &linear), PetscErrorCode(0));
  return {int(linear), nonlinear};
}

/// Without fill its factors are those of the whole elimination where the band is full, as it is between neighbours of
/// an open rod.
TEST(LinearSolvers, IncompleteFactorsAreExactOnAnOpenRod) {
  Scene bar = chainAndRing(), ring = bar;
  bar.rods.pop_back();
  bar.supports.pop_back();
  ring.rods.erase(ring.rods.begin());
  ring.supports = {hold(ring, 0, 5, Support::Kind::pin)};
  const auto [one, steps] =
      iterationsWith(bar, dynamics(0.02, 0.1), {{"-ksp_type", "cg"}, {"-pc_type", "ilu"}, {"-ksp_rtol", "1e-8"}});
  EXPECT_EQ(one, steps);
  EXPECT_GT(steps, 5);
  const auto [more, others] =
      iterationsWith(ring, dynamics(0.02, 0.1), {{"-ksp_type", "cg"}, {"-pc_type", "ilu"}, {"-ksp_rtol", "1e-8"}});
  EXPECT_GT(more, others);
  const auto [fewer, also] = iterationsWith(ring, dynamics(0.02, 0.1),
                                            {{"-ksp_type", "cg"},
                                             {"-pc_type", "ilu"},
                                             {"-snes_ksp_ew", "true"},
                                             {"-snes_ksp_ew_version", "3"},
                                             {"-snes_ksp_ew_rtol0", "0.01"},
                                             {"-snes_ksp_ew_rtolmax", "0.01"}});
  EXPECT_LT(fewer, more);          // what the forcing terms are for
  EXPECT_LE(also, 2 * others + 5); // Newton pays with iterations of its own
}

/// Each way to search and to solve comes to the same motion, and none stays at the column's straight equilibrium, which
/// is unstable.
TEST(Newton, ComesToTheSameAnswerByEveryWay) {
  Scene column = clampedScene(straightRod(32));
  column.forces = {{0, 32, Vec3(-4, 0, 0)}};
  auto deflection = [&](const LoopSettings &settings) {
    Simulation sim;
    runTo(sim, column, settings);
    return Vec3(sim.state.position.back() - Vec3(1, 0, 0)).norm();
  };
  auto motion = [](const LoopSettings &settings, int *iterations) {
    Simulation sim;
    runTo(sim, chainAndRing(), settings, iterations);
    return sim.state.position;
  };
  int usual = 0;
  const double bent = deflection(statics(5));
  const std::vector<Vec3> moved = motion(dynamics(0.02, 0.1), &usual);
  EXPECT_GT(bent, 0.5);
  auto compare = [&](const std::string &name, auto change) {
    LoopSettings still = statics(5), moving = dynamics(0.02, 0.1);
    change(still);
    change(moving);
    EXPECT_NEAR(deflection(still), bent, 1e-4) << name; // -snes_rtol 1e-6 of a load at 1.6 of the critical one
    int iterations = 0;
    const std::vector<Vec3> x = motion(moving, &iterations);
    for (std::size_t v = 0; v < x.size(); ++v)
      EXPECT_LT((x[v] - moved[v]).norm(), 2e-6) << name << " " << v; // 1e-6 of displacements of 0.1, twenty times
    return iterations;
  };
  const int wolfe = compare("wolfe", [](LoopSettings &s) { s.solve.line_search = LineSearchKind::wolfe; });
  compare("residual", [](LoopSettings &s) { s.solve.line_search = LineSearchKind::residual; });
  const int secants = compare("secants", [](LoopSettings &s) { s.solve.quasi_newton = 4; });
  const int gauss_newton = compare("Gauss-Newton", [](LoopSettings &s) { s.hessian = HessianKind::gauss_newton; });
  EXPECT_LE(wolfe, usual + 5);
  EXPECT_GT(secants, usual); // or the Hessian was exact
  EXPECT_GT(gauss_newton, usual);
  for (const char *type : {"lu", "ilu"}) {
    const OptionSet pc("-pc_type", type), ksp("-ksp_type", "gmres"), tolerance("-ksp_rtol", "1e-10");
    compare(type, [](LoopSettings &) {});
  }
}

} // namespace
} // namespace tendril::test
