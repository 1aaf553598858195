/// Paths of equilibria: critical loads by inertia (data/reference/buckling_loads.csv), limit points by arc length.
#include "support/rods.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/io/scene_reader.hpp"

namespace tendril::test {
namespace {

constexpr double order_tolerance = 0.1; // asked of every boundary: 2.0 +- 0.1
constexpr double load_tolerance = 5e-3; // asked of critical loads at 64 edges

/// Value of data/reference/buckling_loads.csv.
double criticalLoad(const std::string &id) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/buckling_loads.csv");
  for (std::string line; std::getline(in, line);)
    if (line.rfind(id + ";", 0) == 0) return std::stod(line.substr(id.size() + 1));
  ADD_FAILURE() << "no row " << id;
  return 0;
}

struct Path {
  std::vector<CriticalPoint> critical;
  std::vector<double> factor, step, rounding_error, work;
  std::vector<int> negative;
  std::vector<State> states;
  std::string failure;
  State end;
};

Path follow(const Scene &scene, const LoopSettings &settings) {
  Path path;
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, settings), PetscErrorCode(0));
  bool finished = false;
  auto critical = [&](const CriticalPoint &point) {
    path.critical.push_back(point);
    return PetscErrorCode(0);
  };
  auto observe = [&](const State &state, const Diagnostics &row) {
    path.factor.push_back(row.time);
    path.step.push_back(row.dt);
    path.rounding_error.push_back(row.rounding_error);
    path.work.push_back(row.work.total());
    path.negative.push_back(row.negative_pivots);
    path.states.push_back(state);
    return PetscErrorCode(0);
  };
  if (settings.continuation == Continuation::arclength) {
    ArcLength loop(sim.solver, settings);
    loop.on_critical = critical;
    EXPECT_EQ(loop.run(sim.state, observe, &finished), PetscErrorCode(0));
    path.failure = loop.failure();
  } else {
    TimeLoop loop(sim.solver, settings);
    loop.on_critical = critical;
    EXPECT_EQ(loop.run(sim.state, observe, &finished), PetscErrorCode(0));
    path.failure = loop.failure();
  }
  EXPECT_TRUE(finished) << path.failure;
  path.end = sim.state;
  return path;
}

LoopSettings stopping(int load_steps = 1) {
  LoopSettings s = statics(load_steps);
  s.bifurcation = Bifurcation::stop;
  return s;
}

LoopSettings along(int load_steps, int steps) {
  LoopSettings s = statics(load_steps);
  s.continuation = Continuation::arclength;
  s.arclength_steps = steps;
  return s;
}

/// Critical load factor of a scene that has one.
double criticalFactor(const Scene &scene, int load_steps = 1) {
  const Path path = follow(scene, stopping(load_steps));
  EXPECT_EQ(path.critical.size(), 1u);
  if (path.critical.size() != 1) return 0;
  EXPECT_FALSE(path.critical[0].limit);
  EXPECT_EQ(path.end, *path.critical[0].state);
  return path.critical[0].load_factor;
}

Scene column(int edges, double load) {
  Scene scene = clampedScene(straightRod(edges));
  scene.forces = {{0, edges, Vec3(-load, 0, 0)}};
  return scene;
}

TEST(Buckling, EulerLoadOfAClampedColumnIsSecondOrder) {
  const double exact = criticalLoad("euler_clamped_free"), full = 4;
  std::array<double, 3> error{};
  for (int k = 0; k < 3; ++k) error[k] = std::abs(full * criticalFactor(column(16 << k, full)) - exact);
  EXPECT_NEAR(order(error[0], error[1]), 2, order_tolerance);
  EXPECT_NEAR(order(error[1], error[2]), 2, order_tolerance);
  EXPECT_LT(error[2], load_tolerance * exact);
}

TEST(Buckling, GreenhillsColumnUnderItsWeightIsSecondOrder) {
  const double exact = criticalLoad("greenhill_clamped_free"), full = 12;
  std::array<double, 3> error{};
  for (int k = 0; k < 3; ++k) {
    Scene scene = clampedScene(straightRod(16 << k));
    scene.gravity = Vec3(-full, 0, 0);
    error[k] = std::abs(full * criticalFactor(scene, 3) - exact);
  }
  EXPECT_NEAR(order(error[0], error[1]), 2, order_tolerance);
  EXPECT_NEAR(order(error[1], error[2]), 2, order_tolerance);
  EXPECT_LT(error[2], load_tolerance * exact);
}

/// Ends pushed together by 1e-3 of the length, EA L^2/EI = 1e5: the axial force at the critical state is the load.
double shorteningLoad(int edges, Support::Kind first, Support::Kind last) {
  Scene scene = clampedScene(straightRod(edges));
  scene.rods[0].material.axial_stiffness = 1e5;
  scene.supports = {hold(scene, 0, 0, first), hold(scene, 0, edges, last)};
  if (first == Support::Kind::pin) scene.supports.push_back(hold(scene, 0, 0, Support::Kind::fix_twist));
  scene.supports[1].motion.velocity = Vec3(-1e-3, 0, 0);
  const Path path = follow(scene, stopping(2));
  EXPECT_EQ(path.critical.size(), 1u);
  return path.critical.size() == 1 ? -path.end.axial_force[0] : 0;
}

TEST(Buckling, AxialForceWhereEndsArePushedTogetherIsEulersLoad) {
  using enum Support::Kind;
  const struct {
    const char *id;
    Support::Kind first, last;
  } cases[] = {
      {"euler_pinned_pinned", pin, pin}, {"euler_clamped_pinned", clamp, pin}, {"euler_clamped_clamped", clamp, clamp}};
  for (const auto &c : cases) {
    const double exact = criticalLoad(c.id);
    const double coarse = std::abs(shorteningLoad(32, c.first, c.last) - exact),
                 fine = std::abs(shorteningLoad(64, c.first, c.last) - exact);
    EXPECT_NEAR(order(coarse, fine), 2, order_tolerance) << c.id;
    EXPECT_LT(fine, load_tolerance * exact) << c.id;
  }
}

TEST(Buckling, IsLocatedOnceAndTheRunGoesOnAlongTheStableBranch) {
  LoopSettings settings = statics(8);
  const Path located = follow(column(32, 4), settings);
  EXPECT_EQ(located.critical.size(), 1u);
  EXPECT_EQ(located.factor.back(), 1);
  EXPECT_GT(located.end.position.back().tail<2>().norm(), 0.1);
  EXPECT_EQ(located.negative.back(), 0);
  settings.bifurcation = Bifurcation::off;
  EXPECT_TRUE(follow(column(32, 4), settings).critical.empty());
}

TEST(Buckling, IsNotReportedForCouples) {
  Scene scene = clampedScene(straightRod(32));
  scene.moments = {{0, 31, 0, Vec3(0, 0, 2 * pi)}};
  EXPECT_TRUE(follow(scene, statics(4)).critical.empty());
}

TEST(LoadSteps, GrowToFourTimesTheFirstWhereNewtonIsQuick) {
  Scene scene = clampedScene(straightRod(16));
  scene.forces = {{0, 16, Vec3(0, -0.5, 0)}};
  const Path path = follow(scene, statics(64));
  EXPECT_DOUBLE_EQ(*std::max_element(path.step.begin(), path.step.end()), 4.0 / 64);
  EXPECT_EQ(path.factor.back(), 1);
}

TEST(ArcLength, EndsAtFullLoadWhereLoadStepsEnd) {
  Scene scene = clampedScene(straightRod(32));
  scene.forces = {{0, 32, Vec3(0, -5, 0)}};
  const Path load = follow(scene, statics()), path = follow(scene, along(10, 200));
  ASSERT_EQ(path.end.time, 1);
  for (std::size_t v = 0; v < load.end.position.size(); ++v)
    EXPECT_LT((path.end.position[v] - load.end.position[v]).norm(), 1e-6); // both converged to 1e-6 of the load
  EXPECT_TRUE(path.critical.empty());
}

/// F L^3/(3 EI) with the discrete beam's 1 + 1/(2 n^2), where rounding keeps the residual above its tolerance.
TEST(ArcLength, LeavesSmallBendingOfFineRodsRight) {
  for (const int edges : {200, 2000, 20000}) {
    Scene scene = clampedScene(straightRod(edges));
    scene.forces = {{0, edges, Vec3(0, -3e-6, 0)}};
    const Path path = follow(scene, along(4, 40));
    ASSERT_EQ(path.end.time, 1);
    EXPECT_NEAR(path.end.position.back().y() / -1e-6, 1 + 0.5 / edges / edges, 1e-5) << edges;
    EXPECT_GT(path.rounding_error[0], 0) << edges;
    EXPECT_LT(*std::max_element(path.rounding_error.begin(), path.rounding_error.end()), 1e-9)
        << edges; // 1e-3 of what the load moves
  }
}

/// An arc about the origin, `half` of its angle on either side of the top.
Rod arcRod(int edges, double radius, double half, Measure measure) {
  Rod rod;
  rod.name = "arch";
  rod.measure = measure;
  for (int i = 0; i <= edges; ++i) {
    const double angle = half * (1 - 2.0 * i / edges);
    rod.position.emplace_back(-radius * std::sin(angle), radius * std::cos(angle), 0);
  }
  return rod;
}

/// Deep circular arch of 215 degrees, clamped at one end and hinged at the other, pushed down at the crown: DaDeppo &
/// Schmidt (1975). Stiff out of its plane, for the path lies in it.
Scene deepArch(int edges, double load, Measure measure = Measure::angle) {
  Rod rod = arcRod(edges, 100, 107.5 * pi / 180, measure);
  rod.material = {1, 1e-6, 1e8, 1e9, {1e6, 1e9}, 0, 0};
  setBishopDirectors(rod, Vec3::UnitZ());
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {rod};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 0, edges, Support::Kind::pin)};
  scene.forces = {{0, edges / 2, Vec3(0, -load, 0)}};
  return scene;
}

double limitLoad(int edges, int load_steps) {
  const Path path = follow(deepArch(edges, 1000), along(load_steps, 200));
  EXPECT_EQ(path.critical.size(), 2u); // the limit load and, below zero, the one from which it rises again
  EXPECT_EQ(path.end.time, 1);
  if (path.critical.empty()) return 0;
  EXPECT_TRUE(path.critical[0].limit);
  return 1000 * path.critical[0].load_factor;
}

TEST(ArcLength, LimitLoadOfTheDeepArchIsSecondOrder) {
  const double exact = 8.97 * 1e6 / 1e4, load = limitLoad(64, 20);
  EXPECT_NEAR(load, exact, 0.01 * exact); // the reference has three digits
  EXPECT_NEAR(order(load - limitLoad(32, 20), limitLoad(128, 20) - load), 2, order_tolerance);
  EXPECT_NEAR(limitLoad(64, 80), load,
              1e-6 * load); // a point of the path, however the steps fall: to the solver's 1e-6 of the load
}

TEST(ArcLength, DoesNotTurnBackAtASharpLimitPoint) {
  for (const int steps : {10, 20, 40})
    for (const Measure measure : {Measure::tan, Measure::angle}) {
      const Path path = follow(deepArch(64, 1000, measure), along(steps, 200));
      EXPECT_EQ(path.critical.size(), 2u) << steps;
      EXPECT_EQ(path.end.time, 1) << steps;
      EXPECT_LT(path.end.position[32].y(), -100) << steps; // snapped through, as far as load steps find it: y = -108
    }
}

TEST(ArcLength, LoadFallsAndOnePivotIsNegativeBehindTheLimitPoint) {
  const Path path = follow(deepArch(64, 1000), along(20, 24));
  ASSERT_EQ(path.critical.size(), 1u);
  EXPECT_EQ(path.factor.size(), 24u);
  EXPECT_LT(path.end.time, 0.8 * path.critical[0].load_factor);
  const auto across = std::size_t(std::find(path.negative.begin(), path.negative.end(), 1) -
                                  path.negative.begin()); // the step with the limit point in it
  ASSERT_GT(across, 2u);
  ASSERT_LT(across, path.factor.size() - 2);
  EXPECT_LT(path.factor[across], path.critical[0].load_factor);
  for (std::size_t k = 1; k < path.factor.size(); ++k) {
    if (k == across) continue;
    EXPECT_EQ(path.factor[k]<path.factor[k - 1], k> across) << k;
    EXPECT_EQ(path.negative[k], k > across ? 1 : 0) << k;
  }
}

TEST(ArcLength, RollsTheRodIntoACircleByACouple) {
  Scene scene = clampedScene(straightRod(32, Measure::angle));
  scene.moments = {{0, 31, 0, Vec3(0, 0, 2 * pi)}};
  const Path path = follow(scene, along(4, 200));
  EXPECT_EQ(path.end.time, 1);
  EXPECT_LT(path.end.position.back().norm(),
            1e-6); // every vertex turns by exactly 2 pi/n; the solver's 1e-6 of the load
}

TEST(ArcLength, FailureKeepsTheStateAndSaysWhy) {
  Scene scene = deepArch(16, 1000);
  scene.forces[0].force.y() = std::nan("");
  const LoopSettings settings = along(20, 60);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, settings));
  const State before = sim.state;
  ArcLength path(sim.solver, settings);
  bool finished = true;
  EXPECT_PETSC(path.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_FALSE(finished);
  EXPECT_EQ(sim.state, before);
  EXPECT_NE(path.failure().find("not finite"), std::string::npos) << path.failure();
}

TEST(ArcLength, StaysOnTheUnstableBranchBeyondABifurcation) {
  Scene scene = column(32, 4);
  scene.rods[0].material.flexural_stiffness = {1, 4}; // one pivot at a time
  const Path path = follow(scene, along(10, 200));
  ASSERT_EQ(path.end.time, 1) << path.failure;
  EXPECT_EQ(path.negative.back(), 1);
  EXPECT_EQ(path.negative.front(), 0);
  EXPECT_LT(path.end.position.back().tail<2>().norm(), 1e-9); // straight but for rounding
}

TEST(ArcLength, RefusesPrescribedMotionsAndScenesWithoutLoad) {
  Scene scene = clampedScene(straightRod(4));
  EXPECT_THROW(requireDeadLoads(scene), SceneError);
  scene.gravity = Vec3(0, -1, 0);
  EXPECT_NO_THROW(requireDeadLoads(scene));
  scene.supports[0].motion.velocity = Vec3(1, 0, 0);
  EXPECT_THROW(requireDeadLoads(scene), SceneError);
}

constexpr double step_tolerance = 1e-8; // what two ways to a critical factor may differ by: asked for

Scene sceneOf(const std::string &file) {
  return readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/" + file).scene;
}

/// The linear equations of the discrete column, half cell at its foot, have the solution sin(w (i + 1/2)) with w =
/// pi/(2 n).
double discreteEulerLoad(int edges) { return 2.0 * edges * edges * (1 - std::cos(pi / (2 * edges))); }

TEST(CriticalFactor, OfAColumnIsOneWhateverTheSteps) {
  const Scene scene = sceneOf("column.yaml");
  const double euler = discreteEulerLoad(64), exact = euler / 4 * (1 - euler / 1e8); // compressed by the load over EA
  for (const int steps : {1, 2, 3, 5, 7, 10, 13, 20, 40, 80, 160}) {
    const Path path = follow(scene, statics(steps));
    ASSERT_EQ(path.critical.size(), 1u) << steps;
    EXPECT_FALSE(path.critical[0].limit) << steps;
    EXPECT_NEAR(path.critical[0].load_factor, exact, step_tolerance * exact) << steps;
  }
}

TEST(CriticalFactor, OfAHeavyColumnIsOneWhateverTheSteps) {
  Scene scene = clampedScene(straightRod(20));
  scene.rods[0].material.axial_stiffness = 1.6e5; // 5 mm thick, 1 m long
  scene.gravity = Vec3(-18.86, 0, 0);
  const double greenhill = criticalLoad("greenhill_clamped_free") / 18.86;
  double first = 0;
  for (const int steps : {1, 2, 3, 5, 7, 10, 20, 40, 80, 160}) {
    const Path path = follow(scene, statics(steps));
    ASSERT_EQ(path.critical.size(), 1u) << steps;
    EXPECT_FALSE(path.critical[0].limit) << steps;
    if (first == 0) first = path.critical[0].load_factor;
    EXPECT_NEAR(path.critical[0].load_factor, first, step_tolerance * first) << steps;
  }
  EXPECT_NEAR(first, greenhill, 2e-3 * greenhill); // of 20 edges: 2.0e-3 x (16/20)^2 in docs/critical_loads.md
}

/// A tight twisted rod that is let go: where it loses its stiffness other motions almost do, and Newton's answers are
/// rough (bisection of them is off by 2e-7).
TEST(CriticalFactor, OfATwistedRodIsOneWhateverTheSteps) {
  const Scene scene = sceneOf("verify/writhing.yaml");
  double first = 0;
  for (const Bifurcation bifurcation : {Bifurcation::stop, Bifurcation::locate})
    for (const int steps : {1, 3, 7, 20, 21, 40}) { // of 20 and 21 Newton goes on to the buckle and meets no saddle
      LoopSettings settings = statics(steps);
      settings.bifurcation = bifurcation;
      const Path path = follow(scene, settings);
      ASSERT_EQ(path.critical.size(), 1u) << steps;
      if (first == 0) first = path.critical[0].load_factor;
      EXPECT_NEAR(path.critical[0].load_factor, first, 3e-8 * first) << steps; // measured 2.8e-8, of rounding
    }
}

/// Also on it, and so little beside it that Newton takes the saddle there for a motion that costs nothing.
TEST(CriticalFactor, IsFoundBesideTheEndOfAStep) {
  const double euler = discreteEulerLoad(64);
  for (const double beside : {-1e-4, -1e-6, -2e-8, -1e-8, -5e-9, 0.0, 5e-9, 1e-8, 1e-6, 1e-4}) {
    const double factor = 0.3 * (1 + beside);
    Scene scene = sceneOf("column.yaml");
    scene.forces[0].force *= euler / 4 * (1 - euler / 1e8) / factor;
    for (const int steps : {10, 40}) { // steps of 0.1 end at 0.1, 0.3 and 0.7
      const Path path = follow(scene, statics(steps));
      ASSERT_EQ(path.critical.size(), 1u) << beside << " " << steps;
      EXPECT_NEAR(path.critical[0].load_factor, factor, step_tolerance * factor) << beside << " " << steps;
    }
  }
}

/// What is searched within a step changes nothing of what is told of it.
TEST(CriticalFactor, LeavesTheStepAsItIs) {
  const Scene scene = sceneOf("verify/writhing.yaml");
  LoopSettings settings = statics(10);
  const Path located = follow(scene, settings);
  settings.bifurcation = Bifurcation::off;
  const Path steps = follow(scene, settings);
  EXPECT_EQ(located.critical.size(), 1u);
  EXPECT_EQ(located.end, steps.end);
  EXPECT_EQ(located.work, steps.work);
}

/// A rod that hangs out from an axis about which it turns may stand anywhere around it.
TEST(CriticalFactor, IsNoneWhereAMotionCostsNothing) {
  const Scene scene = sceneOf("verify/conical.yaml");
  for (const int steps : {1, 2, 3, 5, 7, 10, 20, 40, 80, 160})
    EXPECT_TRUE(follow(scene, statics(steps)).critical.empty()) << steps;
}

TEST(CriticalFactor, AlongTheArcLengthIsThatOfLoadSteps) {
  const Scene scene = sceneOf("column.yaml");
  const double euler = discreteEulerLoad(64), exact = euler / 4 * (1 - euler / 1e8);
  for (const int steps : {3, 10, 20, 40}) {
    const Path path = follow(scene, along(steps, 200));
    ASSERT_EQ(path.critical.size(), 1u) << steps;
    EXPECT_FALSE(path.critical[0].limit) << steps;
    EXPECT_NEAR(path.critical[0].load_factor, exact, step_tolerance * exact) << steps;
    EXPECT_EQ(path.end.time, 1);
    EXPECT_EQ(path.negative.back(), 2); // in both planes
  }
  LoopSettings settings = along(10, 200);
  settings.bifurcation = Bifurcation::off;
  EXPECT_TRUE(follow(scene, settings).critical.empty());
  settings.bifurcation = Bifurcation::stop;
  const Path stopped = follow(scene, settings);
  ASSERT_EQ(stopped.critical.size(), 1u);
  EXPECT_EQ(stopped.end, *stopped.critical[0].state);
}

/// Two columns of the scene, the second stiffer: both are found, within one step or in two, whatever else has buckled.
TEST(CriticalFactor, OfTwoRodsAreBothFoundWhateverTheSteps) {
  Scene scene = column(64, pi * pi); // four times the critical load of the first
  scene.rods[0].material.axial_stiffness = 1e6;
  Rod stiffer = scene.rods[0];
  stiffer.name = "stiffer";
  for (Vec3 &x : stiffer.position) x.y() += 1;
  stiffer.material.flexural_stiffness = {1.05, 1.05};
  scene.rods.push_back(stiffer);
  scene.supports.push_back(scene.supports[0]);
  scene.supports.back().rod = 1;
  scene.forces.push_back(scene.forces[0]);
  scene.forces.back().rod = 1;
  const double exact = discreteEulerLoad(64) / (pi * pi);
  for (const LoopSettings &settings :
       {statics(1), statics(2), statics(5), statics(7), statics(40), along(3, 200), along(40, 200)}) {
    const Path path = follow(scene, settings);
    ASSERT_EQ(path.critical.size(), 2u) << settings.dt;
    for (int r = 0; r < 2; ++r)
      EXPECT_NEAR(path.critical[r].load_factor, (r == 0 ? 1 : 1.05) * exact, 3e-6) << settings.dt; // F/EA = 2.5e-6
  }
}

/// A round column between clamps buckles in any plane, and may turn its plane at no cost. Just past the critical load
/// that turn looks unstable.
TEST(CriticalFactor, OfAShortenedRoundColumnIsOneWhateverTheSteps) {
  Scene scene;
  scene.gravity.setZero();
  scene.rods = {straightRod(40)};
  scene.rods[0].material = {1, 0, 1e4, 1, {1, 1}, 0, 0};
  for (const Support::Kind kind : {Support::Kind::clamp, Support::Kind::pin}) {
    scene.supports = {hold(scene, 0, 0, kind), hold(scene, 0, 40, kind)};
    const double critical = (kind == Support::Kind::clamp ? 4 : 1) * pi * pi / 1e4;
    scene.supports[1].motion.velocity = Vec3(-2.5 * critical, 0, 0);
    double first = 0;
    for (const int steps : {1, 3, 10, 40, 80, 160, 320}) {
      const Path path = follow(scene, statics(steps));
      ASSERT_EQ(path.critical.size(), 1u) << steps;
      EXPECT_FALSE(path.critical[0].limit) << steps;
      EXPECT_EQ(path.end.time, 1) << steps;
      if (first == 0) first = path.critical[0].load_factor;
      EXPECT_NEAR(path.critical[0].load_factor, first, step_tolerance * first) << steps;
    }
    EXPECT_NEAR(first, 0.4, 0.4 * 3e-3); // 40 edges, and EA
  }
}

/// The end of a rod comes back to where it was: its stiffness grows without bound, and Newton fails there. That is no
/// critical load.
TEST(CriticalFactor, IsNoneWhereNewtonOnlyFails) {
  const Scene scene = sceneOf("verify/tangent_loop.yaml");
  for (const int steps : {1, 2, 5, 20, 36}) EXPECT_TRUE(follow(scene, statics(steps)).critical.empty()) << steps;
}

/// The other branch of an imperfect column turns back near the critical load of the perfect one. The way from the start
/// does not lead there.
TEST(CriticalFactor, IsNoneOfAnImperfectColumn) {
  for (const double aside : {1e-5, 1e-4})
    for (const double stiffer : {1.0, 1.3}) {
      Scene scene = column(32, 6);
      scene.rods[0].material.flexural_stiffness = {1, stiffer};
      scene.rods[0].material.axial_stiffness = 1e5;
      scene.forces[0].force += Vec3(0, aside, 2 * aside);
      for (const int steps : {1, 3, 10, 20})
        EXPECT_TRUE(follow(scene, statics(steps)).critical.empty()) << aside << " " << stiffer << " " << steps;
    }
}

TEST(ArcLength, RefusesARodThatIsFreeToSwingWithoutLoads) {
  Scene scene = clampedScene(straightRod(20));
  scene.supports = {hold(scene, 0, 0, Support::Kind::pin)};
  scene.gravity = Vec3(0, -9.81, 0);
  Simulation sim;
  ASSERT_EQ(sim.setUp(scene, along(10, 20)), PetscErrorCode(0));
  ArcLength loop(sim.solver, along(10, 20));
  bool finished = true;
  ASSERT_EQ(loop.run(
                sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished),
            PetscErrorCode(0));
  EXPECT_FALSE(finished);
  EXPECT_NE(loop.failure().find("without loads a rod is free to move"), std::string::npos) << loop.failure();
}

/// Load steps snap past it to a stable shape far off.
TEST(CriticalFactor, OfALimitPointIsThatOfTheArcLength) {
  const Path path = follow(deepArch(64, 1000), along(20, 30));
  ASSERT_GE(path.critical.size(), 1u);
  for (const int steps : {1, 2, 5, 10, 20, 80}) {
    const Path load = follow(deepArch(64, 1000), stopping(steps));
    ASSERT_EQ(load.critical.size(), 1u) << steps;
    EXPECT_TRUE(load.critical[0].limit) << steps;
    EXPECT_NEAR(load.critical[0].load_factor, path.critical[0].load_factor, step_tolerance) << steps;
  }
}

/// A clamped column of length 1 is half of a pinned one of length 2: load P/4, tip at (1 - shortening, 2 ymax) of
/// elastica_postbuckling.csv.
double buckledTipError(int edges, double slope, LoopSettings settings) {
  auto exact = referenceRow("elastica_postbuckling.csv", slope);
  settings.bifurcation = Bifurcation::switch_branch;
  Scene scene = column(edges, exact["P"] / 4);
  scene.rods[0].measure = Measure::angle;
  scene.rods[0].material.axial_stiffness = 1e8; // F/EA = 3e-8
  const Path path = follow(scene, settings);
  EXPECT_EQ(path.critical.size(), 1u);
  EXPECT_EQ(path.end.time, 1);
  EXPECT_EQ(path.failure, "");
  const Vec3 tip = path.end.position.back();
  return Eigen::Vector2d(tip.x() - (1 - exact["shortening"]), tip.tail<2>().norm() - 2 * exact["ymax"]).norm();
}

TEST(SwitchedBranch, OfEulersColumnIsTheElasticaToSecondOrder) {
  for (const double slope : {30, 60, 90})
    for (const bool arclength : {false, true}) {
      std::array<double, 3> error{};
      for (int k = 0; k < 3; ++k) error[k] = buckledTipError(16 << k, slope, arclength ? along(20, 200) : statics(20));
      EXPECT_NEAR(order(error[0], error[1]), 2, order_tolerance) << slope << arclength;
      EXPECT_NEAR(order(error[1], error[2]), 2, order_tolerance) << slope << arclength;
      EXPECT_LT(error[2], load_tolerance) << slope << arclength;
    }
}

/// Hinged at both ends, so that it is its own mirror image.
Scene symmetricArch(int edges) {
  Scene scene = deepArch(edges, 335);
  scene.supports[0] = hold(scene, 0, 0, Support::Kind::pin);
  scene.supports.push_back(hold(scene, 0, 0, Support::Kind::fix_twist));
  return scene;
}

/// The arch sways to a side under 3.27 EI/R^2. From there the load rises with the square of the sway.
TEST(SwitchedBranch, OfADeepArchSways) {
  constexpr double radius = 100;
  std::array<double, 3> load{};
  LoopSettings settings = along(20, 60);
  settings.bifurcation = Bifurcation::stop;
  for (int k = 0; k < 3; ++k) {
    const Scene scene = symmetricArch(32 << k);
    const Path path = follow(scene, settings);
    ASSERT_EQ(path.critical.size(), 1u);
    EXPECT_FALSE(path.critical[0].limit);
    load[k] = path.critical[0].load_factor;
    EXPECT_LT(std::abs(path.end.position[16 << k].x()),
              1e-3 * radius); // where the mode costs nothing, rounding moves along it
    EXPECT_NEAR(criticalFactor(scene, 20), load[k], step_tolerance * load[k]);
  }
  EXPECT_NEAR(order(load[1] - load[0], load[2] - load[1]), 2, order_tolerance);
  settings.bifurcation = Bifurcation::switch_branch;
  const Path path = follow(symmetricArch(32), settings);
  auto sway = [&](const State &state) { return std::abs(state.position[16].x()); };
  ASSERT_EQ(path.critical.size(), 1u);
  ASSERT_EQ(path.end.time, 1);
  EXPECT_GT(sway(path.end), 0.2 * radius);
  const auto first = std::size_t(
      std::find_if(path.states.begin(), path.states.end(), [&](const State &s) { return sway(s) > 1e-3 * radius; }) -
      path.states.begin());
  ASSERT_LT(first + 2, path.states.size());
  const double ratio = (path.factor[first + 2] - load[0]) / (path.factor[first + 1] - load[0]);
  EXPECT_NEAR(ratio, std::pow(sway(path.states[first + 2]) / sway(path.states[first + 1]), 2),
              0.02 * ratio); // sways of 0.03 and 0.06 of the radius
  settings = statics(20);
  settings.bifurcation = Bifurcation::switch_branch;
  const Path load_steps = follow(symmetricArch(32), settings);
  EXPECT_EQ(load_steps.critical.size(), 1u);
  EXPECT_NEAR(sway(load_steps.end), sway(path.end),
              1e-4 * radius); // Newton's 1e-6 of the load, over the little by which the load rises
  EXPECT_NEAR(load_steps.end.position[16].y(), path.end.position[16].y(), 1e-4 * radius);
}

/// Half a circle between pins, pushed together at its quarters along the line through them, about which it turns as it
/// likes: no critical load and no mode to follow. A round one leaves its plane.
TEST(SwitchedBranch, IsThatOfTheCriticalModeWhereAnotherMotionCostsNothing) {
  constexpr int edges = 32;
  Rod rod = arcRod(edges, 1, pi / 2, Measure::angle);
  rod.material = {1, 1e-6, 1e6, 1, {1, 1}, 0, 0};
  setBishopDirectors(rod, Vec3::UnitZ());
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {rod};
  scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, edges, Support::Kind::pin)};
  scene.forces = {{0, edges / 4, Vec3(60, 0, 0)}, {0, 3 * edges / 4, Vec3(-60, 0, 0)}};
  std::array<double, 2> across{}, factor{};
  for (const bool arclength : {false, true}) {
    SCOPED_TRACE(arclength ? "along the arc length" : "by load steps");
    LoopSettings settings = arclength ? along(20, 200) : statics(20);
    settings.bifurcation = Bifurcation::switch_branch;
    const Path path = follow(scene, settings);
    ASSERT_EQ(path.critical.size(), 1u);
    EXPECT_FALSE(path.critical[0].limit);
    ASSERT_EQ(path.end.time, 1);
    EXPECT_EQ(path.negative.back(), 0); // it leaves to the side that lowers its energy
    factor[arclength] = path.critical[0].load_factor;
    // Its points lie in no plane through the line, whatever it has turned by: the two moments of their places across
    // it.
    Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
    for (const Vec3 &x : path.end.position) moments += x.tail<2>() * x.tail<2>().transpose();
    across[arclength] = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(moments).eigenvalues()[0];
    EXPECT_GT(across[arclength], 0.1);
  }
  EXPECT_NEAR(factor[1], factor[0], step_tolerance * factor[0]);
  EXPECT_NEAR(across[1], across[0], 1e-5); // the same shape, each to Newton's 1e-6 of the load
}

/// A column between pins, pushed down in its middle: half of it buckles, but it cannot get shorter, so that the load
/// rises steeply.
TEST(SwitchedBranch, MayRiseSteeply) {
  constexpr int edges = 32;
  Scene scene = clampedScene(straightRod(edges));
  scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, edges, Support::Kind::pin)};
  scene.rods[0].material.axial_stiffness = 1e8;
  scene.forces = {{0, edges / 2, Vec3(-120, 0, 0)}};
  std::array<double, 2> bent{};
  for (const bool arclength : {false, true}) {
    LoopSettings settings = arclength ? along(20, 200) : statics(20);
    settings.bifurcation = Bifurcation::switch_branch;
    const Path path = follow(scene, settings);
    ASSERT_EQ(path.critical.size(), 1u) << arclength;
    ASSERT_EQ(path.end.time, 1) << arclength;
    EXPECT_EQ(path.negative.back(), 0) << arclength;
    for (const Vec3 &x : path.end.position) bent[arclength] = std::max(bent[arclength], x.tail<2>().norm());
  }
  EXPECT_GT(bent[0], 1e-4);
  EXPECT_NEAR(bent[1], bent[0], 1e-3 * bent[0]); // Newton's 1e-6 of the load, of which bending carries little
}

TEST(CriticalFactor, IsFoundInTheFirstLoadStep) {
  const Path path = follow(deepArch(64, 1000), along(20, 30));
  ASSERT_GE(path.critical.size(), 1u);
  const double factor = path.critical[0].load_factor;
  for (const bool arclength : {false, true}) {
    LoopSettings settings = arclength ? along(1, 30) : statics(1);
    settings.bifurcation = Bifurcation::stop;
    const Path stopped = follow(deepArch(64, 1000), settings);
    ASSERT_EQ(stopped.critical.size(), 1u) << arclength;
    EXPECT_TRUE(stopped.critical[0].limit) << arclength;
    EXPECT_NEAR(stopped.critical[0].load_factor, factor, step_tolerance) << arclength;
    EXPECT_EQ(stopped.end, *stopped.critical[0].state) << arclength;
  }
  // Of a scene with none a first step that meets indefinite Hessians finds none: a cantilever bent far over.
  Scene scene = clampedScene(straightRod(32));
  scene.forces = {{0, 32, Vec3(0, -20, 0)}};
  const Path none = follow(scene, stopping(1));
  EXPECT_TRUE(none.critical.empty());
  EXPECT_EQ(none.end.time, 1);
}

/// Lee's frame: two members of length 120, joined rigidly and hinged at their ends, pushed down 24 from the corner
/// (data/reference/frames_lee.csv). As one polyline; without `held` it may turn about the line through its hinges.
struct LeeFrame {
  static constexpr double load = 2, member = 120;
  int edges;
  Energy energy = Energy::classical;
  bool held = true;
  double axial_stiffness = 4320;

  Scene scene(const Mat3 &turn = Mat3::Identity(), const Vec3 &place = Vec3::Zero()) const {
    const int leg = edges / 2;
    Rod rod;
    rod.name = "frame";
    for (int i = 0; i <= leg; ++i) rod.position.push_back(turn * Vec3(0, member * i / leg, 0) + place);
    for (int i = 1; i <= leg; ++i) rod.position.push_back(turn * Vec3(member * i / leg, member, 0) + place);
    rod.material = {1, 0, axial_stiffness, 1000, {1440, 1440}, 0, 0};
    rod.measure = Measure::angle;
    rod.energy = energy;
    setBishopDirectors(rod, turn * Vec3::UnitZ());
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {rod};
    scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, edges, Support::Kind::pin)};
    if (held) scene.supports.push_back(hold(scene, 0, 0, Support::Kind::fix_twist));
    scene.forces = {{0, leg + leg / 5, turn * Vec3(0, -load, 0)}};
    return scene;
  }

  /// Limit points of the path to full load, in its order: a maximum, and a minimum behind it.
  std::vector<CriticalPoint> limits() const {
    const Path path = follow(scene(), along(20, 200));
    EXPECT_EQ(path.end.time, 1);
    std::vector<CriticalPoint> limits;
    for (const CriticalPoint &point : path.critical) {
      if (point.limit) limits.push_back(point);
      EXPECT_GT(std::abs(point.load_factor),
                1e-2); // at no load the frame turns about its hinges: that is no critical load
    }
    EXPECT_EQ(limits.size(), 2u);
    limits.resize(2);
    return limits;
  }

  static double reference(const std::string &row) {
    std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/frames_lee.csv");
    for (std::string line; std::getline(in, line);)
      if (line.rfind(row + ",", 0) == 0) return std::stod(line.substr(row.size() + 1));
    ADD_FAILURE() << "no row " << row;
    return 0;
  }
};

TEST(LeeFrame, LimitLoadsAreSecondOrder) {
  for (const int k : {0, 1}) {
    const double exact = LeeFrame::reference(k == 0 ? "lin,limit1" : "lin,limit2");
    std::array<double, 4> limit{};
    for (int i = 0; i < 4; ++i) limit[i] = LeeFrame::load * LeeFrame{20 << i}.limits()[k].load_factor;
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(order(limit[i] - exact, limit[i + 1] - exact), 2, 0.03)
          << k << " at " << (20 << i); // 0.02 at 20 edges
    EXPECT_NEAR((4 * limit[3] - limit[2]) / 3, exact, 1e-6 * std::abs(exact))
        << k; // what is left of the fourth order and of the flat load there
  }
}

/// Second order, 3.87/n^2; with `energy: seed` less by what the axial strain P/EA and the softness of the corner turn
/// it, theta P/EA + theta^2 EI/(2 EA h L).
TEST(LeeFrame, PassesTheLimitPointsAtAnyNumberOfEdges) {
  const double exact = LeeFrame::reference("lin,limit1"), theta = pi / 2;
  for (int edges = 20; edges <= 160; edges += 10)
    for (const bool held : {true, false}) {
      SCOPED_TRACE(testing::Message() << edges << " edges" << (held ? ", held in its plane" : ""));
      const double limit = LeeFrame::load * LeeFrame{edges, Energy::classical, held}.limits()[0].load_factor;
      EXPECT_NEAR(limit, exact, 4.0 / (edges * edges) * exact);
      const LeeFrame seed{edges, Energy::seed, held};
      const double less = limit - LeeFrame::load * seed.limits()[0].load_factor;
      const double corner = dimensionlessGroups(seed.scene().rods[0], Vec3::Zero()).corner_softness;
      EXPECT_NEAR(corner, theta * theta * 1440 / (2 * 4320 * (240.0 / edges) * 240), 1e-12);
      EXPECT_GT(less, 0.5 * exact * (theta * limit / 4320 + corner));
      EXPECT_LT(less, exact * (theta * limit / 4320 + corner));
    }
}

/// So the corner of `seed` is one of stretch alone, and rods that hardly stretch do not see it.
TEST(LeeFrame, CornersOfSeedOpenByStretch) {
  std::array<double, 2> less{};
  for (const int k : {0, 1}) {
    const double stiff = k == 0 ? 4320 : 432000;
    less[k] = LeeFrame{160, Energy::classical, true, stiff}.limits()[0].load_factor -
              LeeFrame{160, Energy::seed, true, stiff}.limits()[0].load_factor;
  }
  EXPECT_NEAR(less[0] / less[1], 100, 1); // linear in 1/EA, but for the square of 1e-3
}

TEST(LeeFrame, PathDoesNotDependOnPlaceAndDirection) {
  const std::array<Vec3, 5> axes{Vec3(1, 2, 3), Vec3(-3, 1, 0.5), Vec3(0.2, -0.1, 2), Vec3(1, 1, 0),
                                 Vec3(0, 4, -1)}; // rotation vectors
  for (const bool held : {true, false})
    for (const int edges : {40, 80}) {
      const LeeFrame frame{edges, Energy::classical, held};
      const Path path = follow(frame.scene(), along(20, 200));
      for (const Vec3 &axis : axes) {
        SCOPED_TRACE(testing::Message() << edges << " edges, turned by " << axis.transpose()
                                        << (held ? ", held in its plane" : ""));
        const Mat3 turn = Eigen::AngleAxisd(axis.norm(), axis.normalized()).toRotationMatrix();
        const Vec3 place = 300 * Vec3(axis.z(), axis.x(), -axis.y());
        const Path turned = follow(frame.scene(turn, place), along(20, 200));
        ASSERT_EQ(turned.factor.size(), path.factor.size());
        double apart = 0;
        for (std::size_t k = 0; k < path.factor.size(); ++k) {
          EXPECT_NEAR(turned.factor[k], path.factor[k], 1e-8);
          for (std::size_t v = 0; v < path.states[k].position.size(); ++v)
            apart = std::max(apart, (turn * path.states[k].position[v] + place - turned.states[k].position[v]).norm());
        }
        EXPECT_LT(apart, 1e-8 * 2 * LeeFrame::member);
      }
    }
}

/// A free ring of a naturally straight round rod with `turns` turns of twist: is the plane circle unstable? The polygon
/// is in equilibrium by symmetry. A little mass (a step far longer than any period) lifts the seven motions that cost
/// nothing above zero.
bool ringIsUnstable(int edges, int turns, double torsional) {
  Rod rod = inextensibleRod(ringShape(Vec3::Zero(), Vec3::UnitZ(), 0.5 / (edges * std::sin(pi / edges)), edges).points,
                            Measure::angle);
  rod.closed = true;
  rod.natural = Rod::Natural::given; // straight
  rod.initial_turns = turns;
  rod.material.axial_stiffness = 1e7;
  rod.material.torsional_stiffness = torsional;
  rod.material.linear_rotational_inertia = 1;
  setBishopDirectors(rod);
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {rod};
  Simulation sim;
  const LoopSettings settings = dynamics(100, 100); // unit stiffness, mass and length: periods are below one
  EXPECT_EQ(sim.setUp(scene, settings), 0);
  NewtonReport report;
  // Plain Newton keeps the symmetry; it only has to compress the edges a little (S = -B kappa^2).
  EXPECT_EQ(sim.solver.solve(sim.state, TimeLoop::stepOf(settings, sim.state, 100), &report, Seek::equilibrium), 0);
  EXPECT_TRUE(report.converged) << report.reason;
  int negative = 0;
  EXPECT_EQ(sim.solver.inertiaAtIterate(&negative), 0);
  return negative != 0;
}

/// Michell's ring: unstable beyond a total twist of 2 pi sqrt(3) B/C. The twist of a closed ring comes in whole turns,
/// so C is what is varied.
TEST(MichellRing, CriticalTwistIsSecondOrder) {
  for (const int turns : {1, 2, 3}) {
    std::vector<double> error;
    for (const int edges : {16, 32, 64}) {
      const double exact = std::sqrt(3.0) / turns; // C/B
      double low = 0.5 * exact, high = 2 * exact;
      ASSERT_FALSE(ringIsUnstable(edges, turns, low));
      ASSERT_TRUE(ringIsUnstable(edges, turns, high));
      while (high - low > 1e-7 * exact) {
        const double middle = 0.5 * (low + high);
        (ringIsUnstable(edges, turns, middle) ? high : low) = middle;
      }
      error.push_back(std::abs(low / exact - 1));
    }
    EXPECT_LT(error[2], 5e-3); // 0.5 % at 64 edges
    EXPECT_NEAR(order(error[1], error[2]), 2.0, 0.1);
  }
}

} // namespace
} // namespace tendril::test
