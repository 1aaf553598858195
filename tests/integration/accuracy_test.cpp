/// Estimated errors against those to exact solutions, and the edges chosen by them.
#include "tendril/accuracy/accuracy.hpp"
#include "tendril/io/scene_reader.hpp"

#include "support/files.hpp"
#include "support/rods.hpp"

namespace tendril::test {
namespace {

SceneFile verifyScene(const std::string &name) {
  return readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/verify/" + name + ".yaml");
}

Vec3 elasticaTip(double load) {
  auto exact = referenceRow("elastica_tip_load.csv", load);
  return {exact["x_tip"], -exact["delta"], 0};
}

/// Largest distance from the exact helix of data/scenes/verify/spring.yaml over the rod's length.
double springError(const std::vector<Vec3> &x) {
  const double radius = 0.995204585596881, height = 4.12280613908148,
               length = 31.5359302715388; // helical_spring.csv, fixed, 5 degrees, zr 1.5
  double worst = 0;
  for (std::size_t v = 0; v < x.size(); ++v) {
    const double s = double(v) / double(x.size() - 1), angle = 10 * pi * s;
    worst = std::max(worst,
                     (x[v] - Vec3(1 - radius + radius * std::cos(angle), radius * std::sin(angle), height * s)).norm() /
                         length);
  }
  return worst;
}

void estimateOf(const SceneFile &file, const std::vector<int> &edges, const LoopSettings &settings, Simulation &run,
                Estimate &estimate) {
  std::vector<int> twice = edges;
  for (int &n : twice) n *= 2;
  Answer answer;
  EXPECT_PETSC(solveStatics(run, remesh(file.scene, file.drawings, edges), settings, &answer));
  ASSERT_TRUE(answer.found);
  EXPECT_PETSC(estimateError(run, answer.rounding_error, answer.critical, remesh(file.scene, file.drawings, twice),
                             settings, &estimate));
}

TEST(ErrorEstimate, IsTheErrorOfTheElastica) {
  const Vec3 exact = elasticaTip(10);
  SceneFile file = verifyScene("tip_load");
  for (const Measure measure : {Measure::angle, Measure::tan})
    for (const int n : {16, 32, 64}) {
      file.scene.rods[0].measure = measure;
      Simulation run;
      Estimate e;
      estimateOf(file, {n}, statics(), run, e);
      ASSERT_EQ(e.none, "");
      const double error = (run.state.position.back() - exact).norm(),
                   extrapolated = (e.position.back() - exact).norm();
      const bool clean = measure == Measure::angle;
      EXPECT_NEAR(e.error.back(), error, (clean ? 0.01 : 0.06) * error)
          << n; // of the next term in the series: h^4, or that of the boundary layer's
      EXPECT_LT(extrapolated, error / 4 / (clean ? 100 : 2.5)) << n; // error/4: that of the answer at h/2
    }
}

/// A bar rolled up by an end couple of 9: the edges of a rod that keeps its length lie on a circle, edge i at (i + 1/2)
/// 9/n from the clamp; the tip of the exact one is at (sin 9, 1 - cos 9)/9. Measure `angle`: within 1 %.
TEST(ErrorEstimate, IsTheErrorOfAClassicalBar) {
  SceneFile file = readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/rolled_up.yaml", {});
  Simulation run;
  Estimate e;
  estimateOf(file, {32}, statics(10), run, e);
  ASSERT_EQ(e.none, "");
  const Vec3 exact(std::sin(9) / 9, (1 - std::cos(9)) / 9, 0);
  const double error = (run.state.position.back() - exact).norm();
  EXPECT_GT(error, 1e-4);
  EXPECT_NEAR(e.error.back(), error, 0.01 * error);
}

TEST(ErrorEstimate, IsTheErrorOfASpring) {
  const SceneFile file = verifyScene("spring");
  Simulation run;
  Estimate e;
  estimateOf(file, {160}, statics(10), run, e);
  ASSERT_EQ(e.none, "");
  const double error = springError(run.state.position);
  EXPECT_NEAR(e.relativeError(), error,
              0.06 * error); // the clamps' tangents, extrapolated from the drawing, add a cubic term
  EXPECT_LT(springError(e.position), error / 4 / 3);
}

TEST(ErrorEstimate, OfPointsIsThatOfTheirCurve) {
  SceneFile file = verifyScene("hanging_helix");
  Simulation curve, points;
  Estimate of_curve, of_points;
  estimateOf(file, {64}, statics(), curve, of_curve);
  file.scene = remesh(file.scene, file.drawings, {64});
  file.drawings[0].curve = nullptr;
  estimateOf(file, {64}, statics(), points, of_points);
  EXPECT_NEAR(of_points.relativeError(), of_curve.relativeError(),
              0.1 * of_curve.relativeError()); // the cubics are off by h^4
}

TEST(ErrorEstimate, StaysOnTheBranchOfABuckledColumn) {
  SceneFile file = readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/column.yaml");
  file.scene.rods[0].material.flexural_stiffness = {1, 4}; // a round one may turn about its axis for nothing
  Simulation run;
  Estimate e;
  estimateOf(file, {32}, statics(10), run, e); // its load steps may buckle to either side
  EXPECT_EQ(e.none, "");
  ASSERT_EQ(e.critical.size(), 1u);
  EXPECT_NEAR(e.critical[0], pi * pi / 16, 1e-6); // error at 64 edges 3e-5
}

TEST(ErrorEstimate, TellsWhenAnswersAreNotNeighbours) {
  const SceneFile file = verifyScene("tip_load");
  Simulation coarse, fine;
  Answer a, b;
  EXPECT_PETSC(solveStatics(coarse, file.scene, statics(), &a));
  Scene up = remesh(file.scene, file.drawings, {32});
  up.forces[0].force *= -1;
  EXPECT_PETSC(solveStatics(fine, up, statics(), &b));
  const Estimate e = richardson(coarse.scene, a, b);
  EXPECT_TRUE(says(e.none, "different branches"));
  EXPECT_TRUE(says(describe(e, coarse.scene)[0], "no estimate"));
}

/// Two answers may agree because both are lost in rounding.
TEST(ErrorEstimate, IsNotBelowTheRoundingOfEitherAnswer) {
  const Scene scene = clampedScene(straightRod(1, Measure::angle, 2));
  Answer coarse{true, "", 1, {Vec3(0, 0, 0), Vec3(2, 1, 0)}, {}, {}, 1e-3},
      fine{true, "", 1, {Vec3(0, 0, 0), Vec3(1, 0.5, 0), Vec3(2, 1, 0)}, {}, {}, 2e-3};
  const Estimate e = richardson(scene, coarse, fine);
  EXPECT_DOUBLE_EQ(e.rods[0].error, 3e-3 * 2); // both, over the length of 2
  EXPECT_DOUBLE_EQ(e.rods[0].tip, 3e-3 * 2);
}

TEST(Accuracy, IsMetOnTheElastica) {
  const SceneFile file = verifyScene("tip_load");
  for (const Quantity of : {Quantity::position, Quantity::tip})
    for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5}) {
      Choice choice;
      EXPECT_PETSC(chooseEdges(file.scene, file.drawings, statics(), {tolerance, of}, &choice));
      Simulation run;
      runTo(run, remesh(file.scene, file.drawings, choice.edges), statics());
      const double error = (run.state.position.back() - elasticaTip(10)).norm();
      EXPECT_LT(error, tolerance);
      EXPECT_GT(error, tolerance / 2) << "too many edges: " << choice.edges[0];
      EXPECT_TRUE(says(choice.lines.back(), "edges " + std::to_string(choice.edges[0])));
    }
}

TEST(Accuracy, OfTheEnergyIsMetOnTheElastica) {
  const SceneFile file = verifyScene("tip_load");
  Choice choice;
  EXPECT_PETSC(chooseEdges(file.scene, file.drawings, statics(), {1e-4, Quantity::energy}, &choice));
  Simulation run;
  runTo(run, remesh(file.scene, file.drawings, choice.edges), statics());
  const double exact = 1.79535565212409; // elastica_tip_load.csv
  EXPECT_NEAR(energyBudget(run.scene, *run.elements, run.state, 1).bend, exact, 1e-4 * exact);
}

TEST(Accuracy, IsMetOnASpring) {
  const SceneFile file = verifyScene("spring");
  for (const double tolerance : {2e-5, 1e-6}) {
    Choice choice;
    EXPECT_PETSC(chooseEdges(file.scene, file.drawings, statics(10), {tolerance}, &choice));
    Simulation run;
    runTo(run, remesh(file.scene, file.drawings, choice.edges), statics(10));
    const double error = springError(run.state.position);
    EXPECT_LT(error, tolerance);
    EXPECT_GT(error, tolerance / 3) << "too many edges: "
                                    << choice.edges[0]; // predicted from few edges, where the cubic term counts
  }
}

/// How many edges of which kind an accuracy takes, and what error they have.
struct Price {
  int edges;
  double estimated, error; ///< over the length
};

Price priceOf(const SceneFile &file, const LoopSettings &settings, double tolerance) {
  Choice choice;
  EXPECT_EQ(chooseEdges(file.scene, file.drawings, settings, {tolerance}, &choice), PetscErrorCode(0));
  const int n = choice.edges[0];
  std::vector<std::vector<Vec3>> x;
  double length = 0;
  for (const int m : {n, 2 * n, 4 * n}) {
    Simulation run;
    runTo(run, remesh(file.scene, file.drawings, {m}), settings);
    x.push_back(run.state.position);
    length = 0;
    for (int i = 0; i < m; ++i) length += run.scene.rods[0].edge(i).norm();
  }
  Price price{n, choice.error[0], 0};
  for (std::size_t v = 0; v < x[0].size(); ++v) // the last two extrapolated are good to h^4
    price.error = std::max(price.error, (x[0][v] - x[2][4 * v] - (x[2][4 * v] - x[1][2 * v]) / 3).norm() / length);
  return price;
}

/// Edges of equal length: a grading without a weight.
void setEqualEdges(SceneFile &file) {
  Grading equal = gradingByCurvature(file.scene.rods[0], file.drawings[0].curve, {});
  for (std::size_t j = 0; j < equal.place.size(); ++j) equal.place[j] = equal.length[j] / equal.length.back();
  file.drawings[0].grading = std::make_shared<Grading>(equal);
}

TEST(Accuracy, GradedEdgesAreFewer) { // prints the table of docs/theory.md
  struct Row {
    const char *name;
    SceneFile file;
    int load_steps;
    std::vector<double> tolerances;
  };
  std::vector<Row> rows{
      {"hook", verifyScene("hook"), 4, {1e-2, 1e-3, 1e-4}},
      {"helix", readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/helix.yaml"), 10, {1e-2, 1e-3, 1e-4}}};
  rows[1].file.scene.supports[0].kind = Support::Kind::clamp; // by its pin alone it could turn for nothing
  std::printf("%-6s %9s %8s %8s %8s %10s %10s\n", "scene", "tolerance", "as drawn", "equal", "graded", "estimated",
              "true");
  for (Row &row : rows)
    for (const double tolerance : row.tolerances) {
      const LoopSettings settings = statics(row.load_steps);
      SceneFile equal = row.file, graded = row.file;
      setEqualEdges(equal);
      grade(graded.scene, graded.drawings);
      const Price a = priceOf(row.file, settings, tolerance), b = priceOf(equal, settings, tolerance),
                  c = priceOf(graded, settings, tolerance);
      std::printf("%-6s %9.0e %8d %8d %8d %10.2e %10.2e\n", row.name, tolerance, a.edges, b.edges, c.edges, c.estimated,
                  c.error);
      EXPECT_LT(c.error, tolerance) << row.name;
      EXPECT_NEAR(c.estimated, c.error, (tolerance > 5e-3 ? 0.05 : 0.03) * c.error)
          << row.name; // the first number of edges turns by 30 degrees a vertex
      EXPECT_LE(c.edges, std::min(a.edges, b.edges)) << row.name;
      if (tolerance < 5e-3 && &row == &rows[0]) EXPECT_LT(c.edges, 0.75 * std::min(a.edges, b.edges));
    }
}

TEST(ErrorEstimate, OfGradedEdgesIsThatOfACleanSeries) {
  SceneFile file = verifyScene("hook");
  grade(file.scene, file.drawings);
  const int n = 37; // no vertex but the ends is one of the points
  std::vector<std::vector<Vec3>> x;
  for (int factor = 1; factor <= 8; factor *= 2) {
    Simulation run;
    runTo(run, remesh(file.scene, file.drawings, {factor * n}), statics(4));
    x.push_back(run.state.position);
  }
  double error[3] = {0, 0, 0};
  for (int v = 0; v <= n; ++v)
    for (int k = 0; k < 3; ++k) {
      const Vec3 limit = x[3][8 * v] + (x[3][8 * v] - x[2][4 * v]) / 3;
      error[k] = std::max(error[k], (x[k][v << k] - limit).norm());
    }
  EXPECT_NEAR(order(error[0], error[1]), 2, 0.05);
  EXPECT_NEAR(order(error[1], error[2]), 2, 0.05);
  Simulation run;
  Estimate e;
  estimateOf(file, {n}, statics(4), run, e);
  ASSERT_EQ(e.none, "");
  EXPECT_NEAR(e.rods[0].error, error[0], 0.01 * error[0]); // the next term of the series
}

TEST(Accuracy, IsChosenRodByRod) {
  SceneFile file = verifyScene("tip_load");
  file.scene.rods.push_back(file.scene.rods[0]);
  file.scene.rods[1].name = "light";
  file.drawings.push_back(file.drawings[0]);
  file.scene.supports.push_back(file.scene.supports[0]);
  file.scene.supports[1].rod = 1;
  file.scene.forces.push_back({1, 16, Vec3(0, -0.5, 0)});
  Choice choice;
  EXPECT_PETSC(chooseEdges(file.scene, file.drawings, statics(), {1e-4}, &choice));
  EXPECT_LT(choice.edges[1], choice.edges[0] / 2);
  EXPECT_LT(choice.error[0], 1e-4);
  EXPECT_LT(choice.error[1], 1e-4);
}

TEST(Accuracy, ThatCannotBeReachedIsTold) {
  const SceneFile file = verifyScene("tip_load");
  const std::string message = messageOf([&] {
    Choice choice;
    (void)chooseEdges(file.scene, file.drawings, statics(), {1e-15}, &choice);
  });
  EXPECT_TRUE(says(message, "option -accuracy"));
  EXPECT_TRUE(says(message, "larger tolerance"));
}

} // namespace
} // namespace tendril::test
