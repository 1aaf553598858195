/// Buckling modes against closed forms, data/reference/buckling_loads.csv and lateral_buckling_critical.csv, and
/// against the critical loads that load steps and the arc length bisect.
#include "support/files.hpp"
#include "support/option_set.hpp"
#include "support/rods.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/dynamics/buckling.hpp"
#include "tendril/io/scene_reader.hpp"

namespace tendril::test {
namespace {

/// What a path from rest finds.
struct Buckled {
  BucklingModes modes;
  std::vector<State> critical;
  std::string ending;
};

Buckled buckle(const Scene &scene, int count, double step = 1, double last = 100, bool may_fail = false) {
  LoopSettings settings = statics();
  settings.dt = step;
  settings.t_end = last;
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, settings), 0);
  BucklingPath path(sim.solver, settings, count);
  Buckled found;
  path.on_critical = [&](const CriticalPoint &point) {
    found.critical.push_back(*point.state);
    return PetscErrorCode(0);
  };
  bool finished = false;
  EXPECT_EQ(path.run(sim.state, &finished), 0);
  EXPECT_TRUE(finished);
  if (!may_fail) EXPECT_EQ(path.failure(), "");
  found.modes = path.modes();
  found.ending = path.ending();
  return found;
}

std::vector<double> factorsOf(const Scene &scene, int count, double step = 1) {
  std::vector<double> factors = buckle(scene, count, step).modes.load_factor;
  EXPECT_EQ(int(factors.size()), count);
  factors.resize(std::size_t(count), NAN);
  return factors;
}

/// The first critical load factor that a run in load steps, or along the arc length, bisects.
double bisected(const Scene &scene, int load_steps, Continuation continuation = Continuation::load) {
  LoopSettings settings = statics(load_steps);
  settings.bifurcation = Bifurcation::stop;
  settings.continuation = continuation;
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, settings), 0);
  double found = NAN;
  auto critical = [&](const CriticalPoint &point) {
    found = point.load_factor;
    return PetscErrorCode(0);
  };
  auto observe = [](const State &, const Diagnostics &) { return PetscErrorCode(0); };
  bool finished;
  if (continuation == Continuation::load) {
    TimeLoop loop(sim.solver, settings);
    loop.on_critical = critical;
    EXPECT_EQ(loop.run(sim.state, observe, &finished), 0);
  } else {
    ArcLength loop(sim.solver, settings);
    loop.on_critical = critical;
    EXPECT_EQ(loop.run(sim.state, observe, &finished), 0);
  }
  return found;
}

/// Factors extrapolated from n, 2n and 4n edges: off by the square of the edge length and its even powers.
template <class MakeScene> std::vector<double> limitOf(MakeScene make, int n, int count, double step = 1) {
  const std::vector<double> a = factorsOf(make(n), count, step), b = factorsOf(make(2 * n), count, step),
                            c = factorsOf(make(4 * n), count, step);
  std::vector<double> limit;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double first = b[k] + (b[k] - a[k]) / 3, second = c[k] + (c[k] - b[k]) / 3;
    limit.push_back(second + (second - first) / 15);
  }
  return limit;
}

/// A column along x of unit length and bending stiffness that its ends press together: the load factor is the force.
Scene pressed(int edges, Support::Kind first, Support::Kind last) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {straightRod(edges, Measure::angle)};
  scene.rods[0].material.axial_stiffness = 1e8;
  scene.supports = {hold(scene, 0, 0, first), hold(scene, 0, edges, last)};
  scene.supports[1].motion.velocity = Vec3(-1e-8, 0, 0);
  return scene;
}

/// The same with a dead load on its free end, or its own weight.
Scene standing(int edges, double load, double weight) {
  Scene scene = pressed(edges, Support::Kind::clamp, Support::Kind::clamp);
  scene.supports.pop_back();
  if (load != 0) scene.forces = {{0, edges, Vec3(-load, 0, 0)}};
  scene.gravity = Vec3(-weight, 0, 0);
  return scene;
}

void turnDirectors(Scene &scene, const Vec3 &first) {
  setBishopDirectors(scene.rods[0], first);
  scene.supports[0] = hold(scene, 0, 0, Support::Kind::clamp);
}

Vec3 middleOf(const Rates &shape) { return shape.vertex[shape.vertex.size() / 2]; }

/// Round columns have each load twice, in two planes.
TEST(BucklingModes, OfEulerColumns) {
  using Kind = Support::Kind;
  const double tangent = 20.190728556426629975, second_tangent = 59.67951594410637; // x^2, tan x = x
  for (const auto &[first, last, exact] :
       {std::tuple(Kind::pin, Kind::pin, std::vector{pi * pi, 4 * pi * pi}),
        std::tuple(Kind::clamp, Kind::pin, std::vector{tangent, second_tangent}),
        std::tuple(Kind::clamp, Kind::clamp, std::vector{4 * pi * pi, 80.7629142257065})}) {
    const std::vector<double> found = limitOf([&, a = first, b = last](int n) { return pressed(n, a, b); }, 16, 4);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_NEAR(found[k], exact[k / 2], 3e-6 * exact[k / 2]) << k; // (beta h)^6, and the force over EA
    const Buckled fine = buckle(pressed(32, first, last), 4);
    for (const std::size_t k : {0, 2})
      EXPECT_NEAR(fine.modes.load_factor[k + 1], fine.modes.load_factor[k], 1e-9 * fine.modes.load_factor[k]);
    EXPECT_NEAR(middleOf(fine.modes.shape[0]).dot(middleOf(fine.modes.shape[1])), 0, 1e-6);
    EXPECT_EQ(fine.critical.size(), 2u);
  }
  const std::vector<double> found = limitOf([](int n) { return standing(n, 1, 0); }, 16, 4);
  for (std::size_t k = 0; k < 4; ++k) {
    const double exact = pi * pi / 4 * (k < 2 ? 1 : 9);
    EXPECT_NEAR(found[k], exact, 1e-6 * exact) << k;
  }
}

/// 1 - cos(pi x/2): the largest displacement is one, of the tip.
TEST(BucklingModes, AreScaledToALargestDisplacementOfOne) {
  const int n = 40;
  const Buckled found = buckle(standing(n, 1, 0), 2);
  for (const Rates &shape : found.modes.shape)
    for (int v = 0; v <= n; ++v)
      EXPECT_NEAR(shape.vertex[std::size_t(v)].norm(), 1 - std::cos(pi * v / (2 * n)), 1e-4); // h^2/8
  ASSERT_EQ(found.critical.size(), 1u);
  EXPECT_NEAR(found.critical[0].time, found.modes.load_factor[0], 1e-4 * found.modes.load_factor[0]);
}

/// Greenhill's column, and the second load of each plane: Bessel functions of order -1/3, (9/4) j^2.
TEST(BucklingModes, OfAColumnUnderItsOwnWeight) {
  const std::vector<double> found = limitOf([](int n) { return standing(n, 0, 1); }, 16, 4);
  for (const std::size_t k : {0, 1}) EXPECT_NEAR(found[k], 7.8373474389434838852, 1e-6 * 7.8);
  for (const std::size_t k : {2, 3}) EXPECT_NEAR(found[k], 55.977029681261165, 1e-5 * 56);
}

/// A strip that is stiff the way it is loaded, with what bends it before; twists have no inertia.
Scene strip(int edges, double load, double weight, double stiff) {
  Scene scene = standing(edges, 0, 0);
  Material &m = scene.rods[0].material;
  m.torsional_stiffness = 2 / 1.35;
  m.flexural_stiffness = {stiff, 1};
  turnDirectors(scene, Vec3::UnitY());
  if (load != 0) scene.forces = {{0, edges, Vec3(0, 0, -load)}};
  scene.gravity = Vec3(0, 0, -weight);
  return scene;
}

TEST(BucklingModes, OfStripsThatTurnOver) {
  for (const auto &[load, weight, stiff, exact] :
       {std::tuple(1.0, 0.0, 1e4, 4.88468959418445), std::tuple(1.0, 0.0, 25.0, 5.2080079362952),
        std::tuple(0.0, 1.0, 25.0, 16.7311896020218)}) {
    const double found = limitOf([l = load, w = weight, s = stiff](int n) { return strip(n, l, w, s); }, 16, 1)[0];
    EXPECT_NEAR(found, exact, 1e-4 * exact) << stiff;
  }
}

/// Where load steps find a loss of stability, to as much as they do; and whatever the first step.
TEST(BucklingModes, AreTheBisectedOnes) {
  const double load = 8;
  for (const Scene &scene :
       {standing(24, load / 2, 0), standing(24, 0, load * 1.5), strip(24, load, 0, 25), strip(24, 0, 3 * load, 100)}) {
    const double exact = bisected(scene, 4);
    for (const double step : {1.0, 0.15, 0.01}) EXPECT_NEAR(factorsOf(scene, 1, step)[0], exact, 1e-7 * exact) << step;
  }
}

/// Two columns that nothing joins, of other stiffness and mass, whose loads differ by little: branches of eigenvalues
/// cross between them.
TEST(BucklingModes, AreToldApartHoweverCloseTheyAre) {
  const Scene first = standing(16, 4, 0);
  const double alone = factorsOf(first, 1)[0];
  for (const double apart : {1e-2, 1e-3, 1e-4, 3e-5, 1e-5, 1e-6, 1e-8, 0.0}) {
    Scene scene = first;
    scene.rods.push_back(scene.rods[0]);
    Rod &other = scene.rods[1];
    other.name = "other";
    for (Vec3 &x : other.position) x += Vec3(0, 5, 0);
    other.material.linear_density *= 0.3;
    other.material.axial_stiffness *= 16;
    other.material.torsional_stiffness *= 16;
    for (double &k : other.material.flexural_stiffness) k *= 16;
    scene.supports.push_back(hold(scene, 1, 0, Support::Kind::clamp));
    scene.forces.push_back({1, 16, Vec3(-64 * (1 + apart), 0, 0)});
    const Buckled found = buckle(scene, 4);
    ASSERT_EQ(found.modes.count(), 4) << apart;
    for (std::size_t k = 0; k < 4; ++k) {
      const double exact = k < 2 ? alone / (1 + apart) : alone;
      EXPECT_NEAR(found.modes.load_factor[k], exact, 1e-8 * exact) << apart << ' ' << k;
      if (apart < 1e-7) continue; // any combination is as good
      const Rates &shape = found.modes.shape[k];
      EXPECT_LT(shape.vertex[k < 2 ? 16 : 33].norm(), 1e-3) << apart << ' ' << k;
      EXPECT_NEAR(shape.vertex[k < 2 ? 33 : 16].norm(), 1, 1e-6) << apart << ' ' << k;
    }
  }
}

/// A deep arch snaps (DaDeppo and Schmidt 1975): a limit point, beyond which the load cannot rise.
TEST(BucklingModes, EndAtALimitPoint) {
  const Scene scene = readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/deep_arch.yaml").scene;
  const Buckled found = buckle(scene, 3, 0.05);
  ASSERT_EQ(found.modes.count(), 1);
  EXPECT_TRUE(found.modes.limit[0]);
  EXPECT_NE(found.ending.find("limit point"), std::string::npos) << found.ending;
  const double exact = bisected(scene, 20, Continuation::arclength);
  EXPECT_NEAR(found.modes.load_factor[0], exact, 1e-7 * exact);
}

/// A portal of three equal rods, held in its plane, under a load on each column: tan x = -x/6, it sways. And another
/// factorisation of it, of the whole matrix by MUMPS.
TEST(BucklingModes, OfAPortalThatSways) {
  const Folder folder;
  auto make = [&](int edges) {
    const std::string n = std::to_string(edges);
    return readScene(folder.write("portal" + n + ".yaml", R"(gravity: [0, 0, 0]
rods:
  - name: left
    line: {from: [0, 0, 0], to: [0, 1, 0], edges: )" + n + R"(}
    director: [0, 0, 1]
    measure: angle
    energy: classical
    material: &stiff {linear_density: 1, axial_stiffness: 1e8, torsional_stiffness: 1e3, flexural_stiffness: [1, 1e3]}
  - {name: right, line: {from: [1, 0, 0], to: [1, 1, 0], edges: )" +
                                                              n + R"(}, director: [0, 0, 1], measure: angle,
     energy: classical, material: *stiff}
  - {name: beam, line: {from: [0, 1, 0], to: [1, 1, 0], edges: )" +
                                                              n + R"(}, director: [0, 0, 1], measure: angle,
     energy: classical, material: *stiff}
supports:
  - {rod: left, vertex: 0, type: clamp}
  - {rod: right, vertex: 0, type: clamp}
junctions:
  - {type: rigid, shared: true}
loads:
  - {rod: left, vertex: last, force: [0, -10, 0]}
  - {rod: right, vertex: last, force: [0, -10, 0]}
)"))
        .scene;
  };
  const double x = 2.7164597476861276, exact = x * x / 10;
  EXPECT_NEAR(limitOf(make, 8, 1)[0], exact, 1e-5 * exact);
  const double own = factorsOf(make(8), 1)[0], by_steps = bisected(make(8), 5);
  EXPECT_NEAR(own, by_steps, 1e-7 * own);
  const OptionSet mumps("-pc_factor_mat_solver_type", "mumps");
  EXPECT_NEAR(factorsOf(make(8), 1)[0], own, 1e-7 * own);
}

/// Of a flat grid on pins, joined by scissors, each rod turns about itself at no cost: more motions than modes.
TEST(BucklingModes, OfAGridWhoseRodsTurnFreely) {
  const Folder folder;
  const Scene scene = readScene(folder.write("grid.yaml", R"(gravity: [0, 0, 0]
rods:
  - name: x
    line: {from: [-0.125, 0, 0], to: [0.875, 0, 0], edges: 16}
    copies: {count: 4, offset: [0, 0.25, 0]}
    material: &material {radius: 3.0e-3, young: 4.0e+10, poisson: 0.3, density: 2000}
  - {name: y, line: {from: [0, -0.125, 0], to: [0, 0.875, 0], edges: 16}, copies: {count: 4, offset: [0.25, 0, 0]},
     material: *material}
supports:
  - {rod: x, vertex: 0, type: pin}
  - {rod: y, vertex: 0, type: pin}
  - {rod: x, vertex: last, type: pin, motion: {velocity: [-3.0e-5, 0, 0]}}
  - {rod: y, vertex: last, type: pin, motion: {velocity: [0, -3.0e-5, 0]}}
junctions:
  - {type: scissor, shared: true}
)"))
                          .scene;
  const std::vector<double> found = factorsOf(scene, 3);
  const double exact = bisected(scene, 4);
  EXPECT_NEAR(found[0], exact, 1e-7 * exact);
  EXPECT_NEAR(found[2], found[1], 1e-5 * found[1]); // alike but for the order of the rods at their joints
}

/// A model with fewer unknowns has the loads that its motions have in the full one.
TEST(BucklingModes, OfModelsAreThoseOfTheirMotions) {
  Scene full = standing(20, 1, 0);
  full.rods[0].material.flexural_stiffness = {2, 1};
  turnDirectors(full, Vec3::UnitZ());
  const std::vector<double> all = factorsOf(full, 4);
  Scene scene = standing(20, 1, 0);
  scene.rods[0].model = RodModel::torsion_free;
  const std::vector<double> round = factorsOf(scene, 4);
  EXPECT_NEAR(round[0], all[0], 1e-8 * all[0]);
  EXPECT_NEAR(round[1], all[0], 1e-8 * all[0]);
}

/// The path of a column with a side load bends away from the straight one and has no critical point. Newton's answers
/// for larger steps are on others, whose signs are no change of stability.
TEST(BucklingModes, AreNoneOfAnImperfectColumn) {
  for (const double aside : {0.01, 0.1})
    for (const double step : {1.0, 0.5, 0.25, 0.1}) {
      Scene scene = standing(20, 1, 0);
      scene.rods[0].material.axial_stiffness = 1e6;
      scene.rods[0].model = RodModel::planar;
      scene.rods[0].flat = 2;
      scene.forces[0].force[1] = aside;
      EXPECT_EQ(buckle(scene, 1, step, 10, true).modes.count(), 0) << aside << ' ' << step;
    }
}

/// Critical loads far below the first step, before which the path would begin, are the lowest ones all the same.
TEST(BucklingModes, AreFoundFarBelowTheFirstStep) {
  for (const double load : {3e3, 1e5, 1e6}) {
    const std::vector<double> factors = factorsOf(standing(20, load, 0), 3);
    EXPECT_NEAR(factors[0] * load, pi * pi / 4, 2e-3 * pi * pi / 4) << load; // (pi/2/20)^2/12 and the compression
    EXPECT_NEAR(factors[1] / factors[0], 1, 1e-6) << load;
  }
}

/// Where Newton gives up, that is no limit point.
TEST(BucklingModes, AreNoLimitPointsWhereNewtonGivesUp) {
  const OptionSet one("-snes_max_it", "1");
  const Buckled found = buckle(standing(20, 1, 0), 3, 1, 100, true);
  for (int k = 0; k < found.modes.count(); ++k) EXPECT_FALSE(found.modes.limit[std::size_t(k)]) << k;
  EXPECT_EQ(found.ending.find("limit point"), std::string::npos) << found.ending;
}

/// A low arch sways before its load cannot rise any more, whatever the steps.
TEST(BucklingModes, OfALowArchAreASwayAndALimitPoint) {
  std::vector<Vec3> points;
  for (int k = 0; k <= 24; ++k) points.push_back(Vec3(k / 24.0, 0.05 * std::sin(pi * k / 24.0), 0));
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {inextensibleRod(points, Measure::angle)};
  scene.rods[0].material.axial_stiffness = 1e4;
  scene.rods[0].material.linear_rotational_inertia = 0;
  scene.rods[0].model = RodModel::planar;
  scene.rods[0].flat = 2;
  scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, 24, Support::Kind::pin)};
  scene.forces = {{0, 12, Vec3(0, -10, 0)}};
  double first = 0, second = 0;
  for (const double step : {1.0, 0.2, 1.0 / 7, 0.05}) {
    const BucklingModes modes = buckle(scene, 2, step).modes;
    ASSERT_EQ(modes.count(), 2) << step;
    EXPECT_FALSE(modes.limit[0]) << step;
    EXPECT_TRUE(modes.limit[1]) << step;
    if (step == 1) {
      first = modes.load_factor[0];
      second = modes.load_factor[1];
      EXPECT_NEAR(second, bisected(scene, 10, Continuation::arclength), 0.02 * second); // that stops at the sway
    }
    EXPECT_NEAR(modes.load_factor[0], first, 1e-6 * first) << step;
    EXPECT_NEAR(modes.load_factor[1], second, 1e-6 * second) << step;
  }
}

/// What hangs and is pulled has none.
TEST(BucklingModes, AreNoneWhereNothingIsPressed) {
  const Buckled found = buckle(standing(12, -1, 0), 2, 1, 10);
  EXPECT_EQ(found.modes.count(), 0);
  EXPECT_NE(found.ending.find("load factor 10"), std::string::npos) << found.ending;
}

} // namespace
} // namespace tendril::test
