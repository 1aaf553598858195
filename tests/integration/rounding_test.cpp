/// What rounding does to answers: fine meshes, slivers, stiffness ratios, small loads, far origins.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include "tendril/energy/derived.hpp"

namespace tendril::test {
namespace {

struct Outcome {
  bool finished = false;
  std::string failure;
  double rounding_error = 0; ///< over rod lengths
  int iterations = 0, rejected = 0;
  State state;
};

Outcome run(const Scene &scene, const LoopSettings &settings) {
  Simulation sim;
  Outcome out;
  EXPECT_EQ(sim.setUp(scene, settings), PetscErrorCode(0));
  TimeLoop loop(sim.solver, settings);
  EXPECT_EQ(loop.run(
                sim.state,
                [&](const State &, const Diagnostics &row) {
                  out.rounding_error = row.rounding_error;
                  out.iterations += row.newton_iterations;
                  out.rejected += row.rejected_steps;
                  return PetscErrorCode(0);
                },
                &out.finished),
            PetscErrorCode(0));
  out.failure = loop.failure();
  out.state = sim.state;
  return out;
}

Scene cantilever(const std::vector<double> &stations, const Vec3 &force) {
  std::vector<Vec3> points;
  for (const double s : stations) points.emplace_back(s, 0, 0);
  Rod rod = inextensibleRod(points);
  rod.material = {1, 0, 1e6, 0.7, {1, 1}, 0, 0};
  Scene scene = clampedScene(rod);
  scene.forces = {{0, rod.edges(), force}};
  return scene;
}

std::vector<double> even(int edges, double length = 1) {
  std::vector<double> s;
  for (int i = 0; i <= edges; ++i) s.push_back(length * i / edges);
  return s;
}

/// Steel rod of 1 m and 2 cm thick, straight along x.
Scene steelRod(int edges, bool clamped) {
  constexpr double young = 2e11;
  Rod rod = straightRod(edges);
  rod.material = homogeneousMaterial({SectionShape::circle, {0.01, 0.01}}, young, young / 2.6, 7800);
  Scene scene = clampedScene(rod);
  if (!clamped) scene.supports.clear();
  scene.gravity = Vec3(0, -9.81, 0);
  return scene;
}

/// The tip of a cantilever to 1e-4 whatever the edges, from loads that bend it by 1e-8 of its length to those that bend
/// it by a third.
TEST(Rounding, LeavesTheTipOfACantileverRightAtEveryResolution) {
  for (const int edges : {100, 1000, 10000, 100000}) {
    // F L^3/(3 EI) where it is small; 0.0989908 for F L^2/EI = 0.3 is the elastica's (Richardson from 64 and 128
    // edges). Both with the discrete beam's 1 + 1/(2 n^2).
    for (const auto &[force, tip] :
         {std::pair(3e-8, 1e-8), std::pair(3e-6, 1e-6), std::pair(3e-4, 1e-4), std::pair(0.3, 0.0989908)}) {
      const Outcome out = run(cantilever(even(edges), Vec3(0, force, 0)), statics());
      ASSERT_TRUE(out.finished) << out.failure;
      EXPECT_NEAR(out.state.position.back().y() / tip, 1 + 0.5 / edges / edges, 1e-5)
          << edges << " edges, force " << force;
      EXPECT_GT(out.rounding_error, 0); // told for every static answer
      EXPECT_LT(out.rounding_error, 1e-3 * tip) << edges << " edges, force " << force;
      EXPECT_LE(out.iterations, 5) << edges << " edges, force " << force; // Newton's own, none spent on rounding
    }
  }
}

/// Ten backward Euler steps of 0.01 s: x_n = -g dt^2 n (n + 1)/2 in free fall; the clamped rod by 100 edges.
TEST(Rounding, LetsSteelRodsFallAtEveryResolution) {
  for (const int edges : {100, 1000, 3000, 10000, 100000}) {
    const Outcome free = run(steelRod(edges, false), dynamics(0.01, 0.1));
    ASSERT_TRUE(free.finished) << free.failure;
    EXPECT_NEAR(free.state.position.back().y(), -9.81e-4 * 55, 1e-9) << edges;
    const Outcome held = run(steelRod(edges, true), dynamics(0.01, 0.1));
    ASSERT_TRUE(held.finished) << held.failure;
    EXPECT_NEAR(held.state.position.back().y(), -0.0018555, 2e-7) << edges; // 100 edges are 1.4e-7 off
    EXPECT_LT(held.rounding_error, 1e-6);
  }
}

/// A ring clamped at one vertex and pulled at the opposite one, in both modes. Values at 1000 and more edges agree to
/// 1e-5 (order 2).
TEST(Rounding, LeavesRingsRightAtEveryResolution) {
  for (const int edges : {1000, 10000, 100000}) {
    std::vector<Vec3> points;
    for (int i = 0; i < edges; ++i)
      points.emplace_back(0.5 * std::cos(2 * pi * i / edges), 0.5 * std::sin(2 * pi * i / edges), 0);
    Rod ring = inextensibleRod(points);
    ring.closed = true;
    setBishopDirectors(ring);
    ring.material = {1, 0, 1e6, 0.7, {1, 1}, 0, 0};
    Scene scene = clampedScene(ring);
    scene.forces = {{0, edges / 2, Vec3(0, 3e-4, 0)}};
    const Outcome pulled = run(scene, statics());
    ASSERT_TRUE(pulled.finished) << pulled.failure;
    EXPECT_NEAR(pulled.state.position[edges / 2].y(), 4.06115e-5, 1e-9) << edges;
    scene.forces.clear();
    scene.gravity = Vec3(0, -9.81, 0);
    const Outcome falls = run(scene, dynamics(0.01, 0.05));
    ASSERT_TRUE(falls.finished) << falls.failure;
    EXPECT_NEAR(falls.state.position[edges / 2].y(), -0.01647335, 1e-7) << edges;
  }
}

/// A step load lets a cantilever swing to nearly twice its static deflection, with every integrator the same on 64 and
/// on 4096 edges.
TEST(Rounding, LeavesTheSwingAfterAStepLoadAlone) {
  for (const std::string &name : integratorNames()) {
    if (name == "bdf3") continue; // waves that nothing damps grow, others on other meshes
    std::vector<double> amplitude;
    for (const int edges : {64, 4096}) {
      Simulation sim;
      LoopSettings settings = dynamics(0.01, 1.0);
      settings.integrator.name = name;
      EXPECT_PETSC(sim.setUp(cantilever(even(edges), Vec3(0, 0.003, 0)), settings));
      TimeLoop loop(sim.solver, settings);
      double highest = 0;
      bool finished;
      EXPECT_PETSC(loop.run(
          sim.state,
          [&](const State &state, const Diagnostics &) {
            highest = std::max(highest, state.position.back().y() / 0.001);
            return PetscErrorCode(0);
          },
          &finished));
      EXPECT_TRUE(finished) << name << loop.failure();
      amplitude.push_back(highest);
    }
    EXPECT_NEAR(amplitude[0], amplitude[1], 1e-3)
        << name; // 64 edges are 1/(2 n^2) softer, and damp axial waves otherwise
    EXPECT_GT(amplitude[1], 1.9) << name;
    EXPECT_LT(amplitude[1], 2.0) << name;
  }
}

/// Edges that shrink and grow by up to a million to one: the answer's error is that of its longest edges, as with twice
/// as many.
TEST(Rounding, LeavesGradedEdgesToTheirOrder) {
  for (const double ratio : {1e3, 1e4, 1e6}) {
    auto tip = [&](int edges) {
      std::vector<double> s{0};
      for (int i = 0; i < edges; ++i) s.push_back(s.back() + std::pow(ratio, -std::abs(2 * (i + 0.5) / edges - 1)));
      const double length = s.back();
      for (double &x : s) x /= length;
      const Outcome out = run(cantilever(s, Vec3(0, 3e-4, 0)), statics());
      EXPECT_TRUE(out.finished) << out.failure;
      return out.state.position.back().y() / 1e-4 - 1;
    };
    const double coarse = tip(100), fine = tip(200);
    EXPECT_LT(coarse, 5e-3) << ratio;
    EXPECT_NEAR(order(coarse, fine), 2, 0.1) << ratio;
  }
}

/// One sliver of 10 micrometres, or two of one, among edges a thousand to a million times as long.
TEST(Rounding, LeavesSliversHarmless) {
  std::vector<double> s = even(40);
  s.insert(s.begin() + 21, 0.50001);
  const Vec3 force(0, 0.3, 0);
  const Vec3 with = run(cantilever(s, force), statics()).state.position.back(),
             without = run(cantilever(even(40), force), statics()).state.position.back();
  EXPECT_LT((with - without).norm(), 1e-5); // the sliver's cells are a little shorter
  std::vector<double> long_edges = even(10, 10);
  long_edges.insert(long_edges.begin() + 6, {5 + 1e-6, 5 + 2e-6});
  const Outcome two = run(cantilever(long_edges, Vec3(0, 1e-4, 0)), statics());
  ASSERT_TRUE(two.finished) << two.failure;
  EXPECT_NEAR(two.state.position.back().y(), 1e-4 * 1000 / 3, 0.01 * 1e-4 * 1000 / 3); // ten edges are 0.5 % off
}

/// Bending about the soft axis does not feel how stiff the other is. F L^3/(3 EI) for a small force; 0.7137915 for F
/// L^2/EI = 5 is the elastica's (elastica_tip_load.csv). The discrete beam is 1/(2 n^2) softer.
TEST(Rounding, LeavesTheSoftDirectionOfRibbonsRight) {
  for (const double ratio : {1e5, 1e6, 1e8, 1e10, 1e12})
    for (const int edges : {64, 128, 256})
      for (const auto &[force, tip] : {std::pair(1e-4, 1e-4 / 3), std::pair(5.0, 0.7137915)}) {
        Scene scene = cantilever(even(edges), Vec3(0, force, 0));
        Rod &rod = scene.rods[0];
        rod.measure = Measure::angle;
        rod.material = {1, 0, 1e7, 1, {ratio, 1}, 0, 0};
        for (Vec3 &d : rod.director) d = Vec3(0, 1, 0);
        scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
        const Outcome out = run(scene, statics());
        ASSERT_TRUE(out.finished) << out.failure;
        EXPECT_NEAR(out.state.position.back().y(), tip, 1.3e-4 * tip * std::pow(64.0 / edges, 2))
            << ratio << ", " << edges << " edges";
      }
}

TEST(Rounding, DoesNotDependOnTheOrigin) {
  std::vector<Vec3> ends;
  for (const double offset : {0.0, 1e6}) {
    std::vector<double> s = even(64, 0.125); // exact at both places
    Scene scene = cantilever(s, Vec3::Zero());
    Rod &rod = scene.rods[0];
    for (Vec3 &x : rod.position) x += Vec3(offset, offset, -offset);
    rod.material = homogeneousMaterial({SectionShape::circle, {4e-5, 4e-5}}, 3e9, 1.1e9, 1300); // a hair
    scene.gravity = Vec3(0, -9.81, 0);
    scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
    // In short steps a displacement is no larger than the spacing of coordinates out there.
    for (const LoopSettings &settings : {statics(), dynamics(0.01, 0.2), dynamics(2e-5, 1e-3)}) {
      const Outcome out = run(scene, settings);
      ASSERT_TRUE(out.finished) << out.failure;
      ends.push_back(out.state.position.back() - rod.position.back());
      EXPECT_LT(ends.back().y(), -1e-6);
    }
  }
  for (const int k : {0, 1, 2})
    EXPECT_LT((ends[k] - ends[k + 3]).norm(), 1e-9); // the answers' own rounding to coordinates is 1e-10
}

/// A rod that flies bends as one that stands: what is left of its answer is held against what bends, not against the
/// way it makes.
TEST(Rounding, DoesNotHideInAFlight) {
  Outcome out[2];
  for (const int fast : {0, 1}) {
    Scene scene = steelRod(1000, false);
    scene.gravity = Vec3::Zero();
    scene.rods[0].initial_velocity = fast * Vec3(1e6, 0, -1e6);
    scene.forces = {{0, 0, Vec3(0, 100, 0)}, {0, 500, Vec3(0, -200, 0)}, {0, 1000, Vec3(0, 100, 0)}};
    out[fast] = run(scene, dynamics(1e-3, 0.01));
    ASSERT_TRUE(out[fast].finished) << out[fast].failure;
  }
  auto sag = [](const Outcome &o) {
    return o.state.position[500].y() - 0.5 * (o.state.position[0].y() + o.state.position[1000].y());
  };
  EXPECT_LT(sag(out[0]), -1e-4);
  EXPECT_NEAR(sag(out[0]), sag(out[1]), 1e-5 * std::abs(sag(out[0]))); // -snes_rtol is 1e-6 of the load
}

/// What is computed from a state, in files or after a restart, knows its edges as well as the solver did: the moment of
/// a tip load over 10 micrometres.
TEST(Rounding, LeavesMomentsOfStatesRight) {
  Simulation sim;
  runTo(sim, cantilever(even(100000), Vec3(0, 3e-4, 0)), statics());
  const RodActions actions = rodActions(sim.scene, *sim.elements, sim.state, 1, 1);
  double worst = 0;
  for (int v = 1; v < 100000; ++v)
    worst = std::max(worst, std::abs(actions.moment[v].z() / (3e-4 * (1 - 1e-5 * v)) - 1) * (1 - 1e-5 * v));
  EXPECT_LT(worst, 1e-6); // from rounded positions it is 1e-2
}

/// Held at both ends and moved in the middle, so light that no residual falls to its tolerance.
Scene lightThread() {
  Rod rod = straightRod(20, Measure::angle, 0.1);
  rod.material = homogeneousMaterial({SectionShape::circle, {2e-4, 2e-4}}, 7.5e8, 7.5e8 / 2.8, 3);
  Scene scene = clampedScene(rod);
  scene.supports.push_back(hold(scene, 0, 20, Support::Kind::clamp));
  scene.supports.push_back(hold(scene, 0, 10, Support::Kind::pin));
  scene.supports[2].motion.velocity = Vec3(0, 1e-4, 0);
  return scene;
}

TEST(Rounding, DoesNotStopALightThread) {
  const Outcome out = run(lightThread(), dynamics(1e-3, 0.3));
  ASSERT_TRUE(out.finished) << out.failure;
  EXPECT_EQ(out.rejected, 0);
  EXPECT_LE(out.iterations, 6 * 300);
  EXPECT_NEAR(out.state.position[10].y(), 3e-5, 1e-18);
}

/// What cannot be solved is refused, with the rod and its edges: nothing that an iteration could do is left after a
/// few. A wire of steel on one pin, drawn level: it swings down about an axis that nothing holds, and hangs. Nothing
/// holds its turns about itself either.
TEST(Rounding, LetsAWireOnOnePinHang) {
  constexpr double young = 2e11;
  for (const int edges : {10, 100, 1000})
    for (const double gravity : {9.81, 0.01})
      for (const bool mixed : {true, false}) {
        Rod rod = straightRod(edges);
        rod.material = homogeneousMaterial({SectionShape::circle, {5e-4, 5e-4}}, young, young / 2.6, 7800);
        Scene scene = clampedScene(rod);
        scene.supports = {{Support::Kind::pin, 0, 0, {}, {}}};
        scene.gravity = Vec3(0, -gravity, 0);
        LoopSettings settings = statics();
        settings.mixed = mixed;
        const Outcome out = run(scene, settings);
        ASSERT_TRUE(out.finished) << edges << " edges: " << out.failure;
        const double stretch = 7800 * gravity / (2 * young);
        EXPECT_LT((out.state.position.back() - Vec3(0, -1 - stretch, 0)).norm(), 1e-9)
            << edges; // 1e-6 of the weight across, over itself
        EXPECT_LE(out.iterations, 12) << edges << " edges, gravity "
                                      << gravity; // 4 to 10; creeping along wrong directions took 20
      }
}

/// Rods and rings that rest as they are drawn, on one pin, without loads: an answer as they are, though nothing holds
/// two or three of their turns.
TEST(Rounding, LeavesRodsOnAPinAtRest) {
  Random random(5);
  for (int k = 0; k < 40; ++k) {
    const int edges = std::array{5, 12, 40, 100}[k % 4];
    const Vec3 direction = random.direction();
    const bool closed = k % 8 < 4;
    Rod rod = inextensibleRod(
        (closed ? ringShape(Vec3::Zero(), direction, 0.3, edges) : lineShape(Vec3::Zero(), direction, edges)).points);
    rod.closed = closed;
    if (closed) setBishopDirectors(rod);
    if (k % 3 == 0)
      rod.material = homogeneousMaterial({SectionShape::rectangle, {0.02, 0.003}}, 1.8e7, 1.8e7 / 2.6, 1000);
    else
      rod.material = homogeneousMaterial({SectionShape::circle, {5e-4, 5e-4}}, 2e11, 2e11 / 2.6, 7800);
    Scene scene = clampedScene(rod);
    scene.supports = {{Support::Kind::pin, 0, k % edges, {}, {}}};
    for (const bool mixed : {true, false}) {
      LoopSettings settings = statics();
      settings.mixed = mixed;
      const Outcome out = run(scene, settings);
      ASSERT_TRUE(out.finished) << k << ": " << out.failure;
      for (int i = 0; i < scene.rods[0].vertices(); ++i)
        EXPECT_LT((out.state.position[i] - scene.rods[0].position[i]).norm(), 1e-9) << k;
    }
  }
}

/// A column of 30000 edges under 0.99998 of Euler's load, with a side load that bends it by 1e-3 or 1e-5: the softest
/// mode is 2e-5 of the stiffness. Values of the same column with 10000 edges, or turned in space, agree to 1e-4 (the
/// load is that near to the critical one).
TEST(Rounding, DoesNotHideASoftModeNearBuckling) {
  for (const auto &[side, tip] : {std::pair(1e-7, 1.549e-3), std::pair(1e-9, 1.6053e-5)}) {
    Scene scene = cantilever(even(30000), Vec3(-2.46735, side, 0));
    scene.rods[0].material.axial_stiffness = 1e7;
    scene.rods[0].measure = Measure::angle;
    const Outcome out = run(scene, statics());
    ASSERT_TRUE(out.finished) << out.failure;
    EXPECT_NEAR(out.state.position.back().y() / tip, 1, 2e-3);
    EXPECT_GT(out.rounding_error, 0);
  }
}

/// Loads on what is held, and loads that cancel, are no scale for what is free.
TEST(Rounding, DoesNotHideBehindLoadsThatMoveNothing) {
  Scene plain = cantilever(even(20), Vec3(0, 1, 0)), loaded = plain;
  for (const Vec3 &f : {Vec3(1e7, 0, 0), Vec3(-1e7, 0, 0)}) loaded.forces.push_back({0, 20, f});
  loaded.forces.push_back({0, 0, Vec3(0, 1e8, 0)});
  for (const LoopSettings &settings : {statics(), dynamics(1, 20), dynamics(0.01, 0.2)}) {
    const Outcome a = run(plain, settings), b = run(loaded, settings);
    ASSERT_TRUE(a.finished && b.finished) << a.failure << b.failure;
    EXPECT_GT(a.state.position.back().y(), 0.01);
    EXPECT_LT((a.state.position.back() - b.state.position.back()).norm(), 1e-8);
  }
}

/// A strip that is bent the stiff way by a load 1e7 times that in its soft direction: what steps leave there below the
/// tolerance must not add up.
TEST(Rounding, DoesNotLetSoftDirectionsDrift) {
  Scene scene = cantilever(even(20), Vec3(0, 1e-8, 0.1));
  scene.rods[0].material.flexural_stiffness = {1, 1e-8};
  scene.rods[0].material.linear_density = 1;
  std::array<double, 2> tip;
  for (const bool sharp : {false, true}) {
    if (sharp) EXPECT_EQ(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-12"), PetscErrorCode(0));
    const Outcome out = run(scene, dynamics(2, 2000));
    EXPECT_EQ(PetscOptionsClearValue(nullptr, "-snes_rtol"), PetscErrorCode(0));
    ASSERT_TRUE(out.finished) << out.failure;
    tip[sharp] = out.state.position.back().y();
  }
  EXPECT_GT(tip[1], 1e-5);
  EXPECT_NEAR(tip[0] / tip[1], 1, 1e-3); // drift was tenfold
}

TEST(Rounding, IsToldWhereItHidesTheAnswer) {
  LoopSettings settings = statics();
  settings.solve.rounding_tolerance = 1e-16; // no answer is so good
  Scene scene = cantilever(even(20000), Vec3(0, 0.3, 0));
  scene.rods[0].name = "wire";
  const Outcome out = run(scene, settings);
  EXPECT_FALSE(out.finished);
  for (const char *words : {"rod 'wire'", "rounding", "20000 edges", "fewer"})
    EXPECT_NE(out.failure.find(words), std::string::npos) << out.failure;
  EXPECT_EQ(out.failure.find("iteration limit"), std::string::npos) << out.failure; // seen to be hopeless before
  LoopSettings steps = dynamics(0.01, 0.1);
  steps.solve.rounding_tolerance = 1e-16;
  const Outcome falling = run(steelRod(100000, true), steps);
  EXPECT_FALSE(falling.finished);
  EXPECT_NE(falling.failure.find("lost in rounding"), std::string::npos) << falling.failure;
  EXPECT_EQ(falling.failure.find("iteration limit"), std::string::npos) << falling.failure;
}

/// A scene of random proportions, drawn with some edges or with more of them, here or elsewhere.
struct Draw {
  double length, turning, spread, ratio, force, offset;
  int edges;
  bool dynamic;
  Vec3 direction;
  Measure measure;
};

Draw draw(Random &random) {
  auto decades = [&](double low, double high) { return std::pow(10, 0.5 * ((low + high) + (high - low) * random())); };
  Draw d;
  d.length = decades(-2, 2);
  d.turning = random() > 0 ? 0 : 2;
  d.spread = decades(0, 5);
  d.ratio = decades(0, 8);
  d.force = decades(-10, 0);
  d.offset = random() > 0 ? 0 : decades(0, 6);
  d.edges = int(decades(1, 2));
  d.dynamic = random() > 0.4;
  d.direction = random.direction();
  d.measure = random() > 0 ? Measure::tan : Measure::angle;
  return d;
}

/// \param cut edges, each in so many parts
Scene build(const Draw &d, int cut, bool away) {
  // Edges grow and shrink by the spread along a line or an arc; coordinates are whole multiples of what their rounding
  // at a million metres is.
  std::vector<double> at{0};
  for (int i = 0; i < d.edges; ++i)
    for (int k = 0; k < cut; ++k) at.push_back(at.back() + std::pow(d.spread, -std::abs(2.0 * i / d.edges - 1)) / cut);
  std::vector<Vec3> points;
  for (const double s : at) {
    const double u = s / at.back(), angle = d.turning * u;
    Vec3 x = d.turning > 0 ? Vec3(std::sin(angle) / d.turning, (1 - std::cos(angle)) / d.turning, 0) : Vec3(u, 0, 0);
    x *= d.length;
    const double grain = std::ldexp(1, -33);
    for (double &c : x) c = std::round(c / grain) * grain;
    points.push_back(x + (away ? std::round(d.offset) : 0) * Vec3(1, -1, 1));
  }
  Rod rod = inextensibleRod(points, d.measure);
  const double bending = 1, l = d.length;
  rod.material = {1 / l, 0, 1e5 * bending / (l * l), 0.7 * bending, {d.ratio * bending, bending}, 0, 0};
  for (Vec3 &director : rod.director) director = Vec3(0, 0, 1); // the rods lie in a plane
  Scene scene = clampedScene(rod);
  scene.forces = {{0, rod.edges(), d.force * bending / (l * l) * d.direction}};
  return scene;
}

/// Root mean square distance of the vertices that two answers share, over the length.
double apart(const Draw &d, const Outcome &a, const Outcome &b, int cut_a, int cut_b, const Vec3 &offset) {
  double sum = 0;
  for (int i = 0; i <= d.edges; ++i)
    sum += (a.state.position[cut_a * i] - (b.state.position[cut_b * i] - offset)).squaredNorm();
  return std::sqrt(sum / (d.edges + 1)) / d.length;
}

/// Either a run is refused, or what two runs of the same scene disagree by is told: by the rounding errors they report
/// and the estimated error of their edges.
TEST(Rounding, IsNeverMoreThanToldInRandomScenes) {
  Random random(12);
  int refused = 0;
  constexpr int scenes = 300;
  for (int k = 0; k < scenes; ++k) {
    const Draw d = draw(random);
    const double period =
        d.length * d.length * std::sqrt(1 / d.length) / 3.516 * 2 * pi; // about that of the lowest vibration
    const LoopSettings settings = d.dynamic ? dynamics(period / 40, period / 8) : statics();
    const Outcome here = run(build(d, 1, false), settings), away = run(build(d, 1, true), settings);
    const Outcome half = run(build(d, 2, false), settings), quarter = run(build(d, 4, false), settings);
    for (const Outcome *o : {&here, &away, &half, &quarter}) {
      refused += !o->finished;
      EXPECT_TRUE(o->finished || o->failure.find("rounding") != std::string::npos) << k << ": " << o->failure;
    }
    double moved = 0;
    const Scene start = build(d, 1, false);
    for (int i = 0; i <= d.edges; ++i)
      moved = std::max(moved, (here.state.position[i] - start.rods[0].position[i]).norm() / d.length);
    // -snes_rtol is 1e-6 of the load; coordinates far away have as many digits.
    const double solved = 1e-5 * moved, digits = 1e-15 * (1 + d.offset / d.length);
    if (here.finished && away.finished)
      EXPECT_LT(apart(d, here, away, 1, 1, std::round(d.offset) * Vec3(1, -1, 1)),
                3 * (here.rounding_error + away.rounding_error) + solved + 3 * digits)
          << k;
    if (here.finished && half.finished && quarter.finished) {
      const double told = 3 * (here.rounding_error + half.rounding_error + quarter.rounding_error) + solved + digits;
      // Richardson's estimate, from once and twice the edges, covers what four times as many say: to leading order, of
      // ten edges and more.
      const double estimate = 4.0 / 3 * apart(d, here, half, 1, 2, Vec3::Zero());
      EXPECT_LT(apart(d, here, quarter, 1, 4, Vec3::Zero()), 1.3 * estimate + told) << k;
    }
    if (here.finished && d.force > 0) EXPECT_GT(moved, 1e-4 * d.force) << k << ": nothing was solved";
  }
  EXPECT_LE(refused, scenes / 20);
  RecordProperty("refused", std::to_string(refused));
}

} // namespace
} // namespace tendril::test
