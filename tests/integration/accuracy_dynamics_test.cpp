/// Edges and steps chosen in dynamics: the true errors of the runs that they make.
#include "tendril/accuracy/samples.hpp"
#include "tendril/io/scene_reader.hpp"

#include "support/files.hpp"
#include "support/rods.hpp"

namespace tendril::test {
namespace {

SceneFile sceneFile(const std::string &name) {
  return readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/" + name + ".yaml");
}

LoopSettings methodAt(const std::string &integrator, double dt, double t_end) {
  LoopSettings s = dynamics(dt, t_end);
  s.integrator.name = integrator;
  return s;
}

/// Positions of a run at some times, by cubics through positions and velocities at the ends of its steps.
std::vector<std::vector<Vec3>> positionsAt(const std::vector<double> &times, const Scene &scene,
                                           const LoopSettings &settings) {
  std::vector<std::vector<Vec3>> out;
  Simulation run;
  EXPECT_EQ(run.setUp(scene, settings), PetscErrorCode(0));
  TimeLoop loop(run.solver, settings);
  State before = run.state;
  bool finished = false;
  const auto observe = [&](const State &now, const Diagnostics &) {
    for (; out.size() < times.size() && times[out.size()] <= now.time * (1 + 1e-12);) {
      const double h = now.time - before.time, s = (times[out.size()] - before.time) / h;
      std::vector<Vec3> &x = out.emplace_back();
      for (std::size_t v = 0; v < now.position.size(); ++v)
        x.push_back((1 + 2 * s) * (1 - s) * (1 - s) * before.position[v] +
                    s * (1 - s) * (1 - s) * h * before.velocity[v] + s * s * (3 - 2 * s) * now.position[v] +
                    s * s * (s - 1) * h * now.velocity[v]);
    }
    before = now;
    return PetscErrorCode(0);
  };
  EXPECT_EQ(loop.run(run.state, observe, &finished), PetscErrorCode(0));
  EXPECT_TRUE(finished) << loop.failure();
  return out;
}

std::vector<double> timesTo(double end, int count) {
  std::vector<double> times;
  for (int k = 1; k <= count; ++k) times.push_back(end * k / count);
  return times;
}

double rmsOfLast(const std::vector<std::vector<Vec3>> &a, const std::vector<std::vector<Vec3>> &b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += (a[k].back() - b[k].back()).squaredNorm();
  return std::sqrt(sum / double(a.size()));
}

/// Tips of a case of dyn_stretch_law.csv (same energy, another method; off by 1e-6), at its times.
std::vector<std::vector<Vec3>> tipOfReference(const std::string &name) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/dyn_stretch_law.csv");
  std::vector<std::vector<Vec3>> tips;
  for (std::string line; std::getline(in, line);) {
    double t, x, y;
    if (line.rfind(name + ",", 0) == 0 && std::sscanf(line.c_str() + name.size(), ",%lf,%lf,%lf", &t, &x, &y) == 3)
      tips.push_back({Vec3(x, y, 0)});
  }
  return tips;
}

TEST(AccuracyInDynamics, IsMetOnTheReleasedCantilever) {
  const SceneFile file = sceneFile("cantilever");
  const std::vector<double> times = timesTo(1, 20);
  const std::vector<std::vector<Vec3>> exact = tipOfReference("dyn_cantilever_A");
  ASSERT_EQ(exact.size(), times.size());
  for (const char *integrator : {"generalized_alpha", "bdf2"}) {
    std::vector<Choice> choices;
    for (const double tolerance : {1e-2, 1e-3}) {
      Choice &choice = choices.emplace_back();
      EXPECT_PETSC(chooseEdgesAndSteps(file.scene, file.drawings, methodAt(integrator, 0.005, 1),
                                       {tolerance, Quantity::tip}, &choice));
      const double error =
          rmsOfLast(positionsAt(times, remesh(file.scene, file.drawings, choice.edges), choice.loop), exact);
      EXPECT_LT(error, tolerance) << integrator;
      EXPECT_GT(error, tolerance / 4) << integrator << ": too dear, edges " << choice.edges[0] << ", dt "
                                      << choice.loop.dt; // 0.5 to 0.6 of it
      EXPECT_LE(choice.error[0], 0.8 * tolerance * (1 + 1e-9));
      EXPECT_TRUE(says(choice.lines[choice.lines.size() - 2], "edges " + std::to_string(choice.edges[0])));
    }
    // Both of second order: sqrt(10) times as many. Edges converge faster than that between the two, where few still
    // fold.
    EXPECT_NEAR(choices[0].loop.dt / choices[1].loop.dt, std::sqrt(10.0), 0.5) << integrator;
    EXPECT_NEAR(double(choices[1].edges[0]) / choices[0].edges[0], std::sqrt(10.0), 1.5) << integrator;
    EXPECT_NEAR(choices[1].edge_error[0] / choices[1].step_error[0], 1, 0.3)
        << "equal parts are cheapest where both orders are 2";
  }
}

TEST(AccuracyInDynamics, OfAFirstOrderMethodSpendsMoreOnSteps) {
  const SceneFile file = sceneFile("verify/released");
  Choice euler, second;
  EXPECT_PETSC(chooseEdgesAndSteps(file.scene, file.drawings, methodAt("euler", 0.01, 1), {1e-2}, &euler));
  EXPECT_PETSC(chooseEdgesAndSteps(file.scene, file.drawings, methodAt("bdf2", 0.01, 1), {1e-2}, &second));
  EXPECT_LT(euler.loop.dt, second.loop.dt / 3);
  EXPECT_GT(euler.step_error[0],
            1.2 * euler.edge_error[0]); // sqrt 2 or 2 times, as the two errors have to do with each other
}

TEST(AccuracyInDynamics, IsMetOnASpring) {
  const SceneFile file = sceneFile("helix");
  const std::vector<double> times = timesTo(1, 20);
  const LoopSettings fine = methodAt("bdf2", 2e-3, 1);
  const std::vector<std::vector<Vec3>> reference =
      positionsAt(times, remesh(file.scene, file.drawings, {512}), fine); // off by about a tenth of the tolerance
  for (const bool adapts : {false, true}) {
    LoopSettings settings = methodAt("bdf2", 0.02, 1);
    settings.adapt = adapts ? Adaptation::error : Adaptation::none;
    Choice choice;
    EXPECT_PETSC(chooseEdgesAndSteps(file.scene, file.drawings, settings, {1e-3, Quantity::tip}, &choice));
    const double error =
        rmsOfLast(positionsAt(times, remesh(file.scene, file.drawings, choice.edges), choice.loop), reference) /
        lengthOf(file.scene.rods[0]);
    EXPECT_LT(error, 1e-3);
    EXPECT_GT(error, 1e-3 / 10) << "too dear, edges " << choice.edges[0] << (adapts ? ", dt_rtol " : ", dt ")
                                << (adapts ? choice.loop.dt_rtol : choice.loop.dt);
    EXPECT_EQ(choice.loop.adapt == Adaptation::error, adapts);
  }
}

TEST(AccuracyInDynamics, IsChosenRodByRod) {
  SceneFile file = sceneFile("cantilever");
  file.scene.rods.push_back(file.scene.rods[0]);
  file.scene.rods[1].name = "stiff";
  for (double &k : file.scene.rods[1].material.flexural_stiffness) k *= 100;
  file.drawings.push_back(file.drawings[0]);
  file.scene.supports.push_back(file.scene.supports[0]);
  file.scene.supports[1].rod = 1;
  Choice choice;
  EXPECT_PETSC(
      chooseEdgesAndSteps(file.scene, file.drawings, methodAt("generalized_alpha", 0.005, 0.5), {3e-3}, &choice));
  EXPECT_LT(choice.edges[1], choice.edges[0] / 2);
}

TEST(AccuracyInDynamics, OfCopiesIsThatOfOne) {
  SceneFile file = sceneFile("cantilever");
  const Accuracy accuracy{1e-2};
  Choice one, all;
  EXPECT_PETSC(chooseResolution(file.scene, file.drawings, methodAt("generalized_alpha", 0.005, 0.5), accuracy, &one));
  for (int r = 1; r < 3; ++r) {
    file.scene.rods.push_back(file.scene.rods[0]);
    file.drawings.push_back(file.drawings[0]);
    file.scene.supports.push_back(file.scene.supports[0]);
    file.scene.supports[r].rod = r;
  }
  EXPECT_PETSC(chooseResolution(file.scene, file.drawings, methodAt("generalized_alpha", 0.005, 0.5), accuracy, &all));
  EXPECT_EQ(all.edges, std::vector<int>(3, one.edges[0]));
  EXPECT_EQ(all.error, std::vector<double>(3, one.error[0]));
  EXPECT_EQ(all.loop.dt, one.loop.dt);
}

TEST(AccuracyInDynamics, SeesMotionShorterThanTheSteps) {
  SceneFile file = sceneFile("cantilever");
  for (double &k : file.scene.rods[0].material.flexural_stiffness)
    k *= 1e3; // periods of 0.25 s, amplitudes of 0.02; a damped step of 1 s ends at rest
  Choice choice;
  EXPECT_PETSC(chooseEdgesAndSteps(file.scene, file.drawings, methodAt("bdf2", 0.01, 4), {5e-3}, &choice));
  EXPECT_LT(choice.loop.dt, 0.25 / 20);
}

TEST(AccuracyInDynamics, ThatDoesNotConvergeIsTold) {
  SceneFile file = sceneFile("cantilever");
  file.scene.rods[0].material.flexural_stiffness = {1e-5, 1e-5}; // a whip: it folds at its ends
  const std::string message = messageOf([&] {
    Choice choice;
    (void)chooseEdgesAndSteps(file.scene, file.drawings, methodAt("generalized_alpha", 0.1, 3), {1e-4}, &choice);
  });
  EXPECT_TRUE(says(message, "option -accuracy"));
  EXPECT_TRUE(says(message, "smaller -t_end"));
}

TEST(Samples, CorrelationIsThatOfDirectionsInTime) {
  const Errors a{{Vec3(1, 0, 0), Vec3(0, 2, 0)}}, b{{Vec3(0, 0, 1), Vec3(0, 1, 0)}},
      opposite{{Vec3(-1, 0, 0), Vec3(0, -2, 0)}};
  EXPECT_NEAR(sizeOf(a), std::sqrt(2.5), 1e-15);
  EXPECT_NEAR(correlation(a, a), 1, 1e-15);
  EXPECT_NEAR(correlation(a, b), 2 / std::sqrt(5.0 * 2), 1e-15);
  EXPECT_EQ(correlation(a, opposite), 0);
}

} // namespace
} // namespace tendril::test
