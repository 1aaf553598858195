/// Statics that begin far from their answer: slack cables, unstable symmetric starts, a frame with a corner.
#include "support/option_set.hpp"
#include "support/rods.hpp"

namespace tendril::test {
namespace {

constexpr double gravity = 9.81;

/// A cable of linear density 1 through points, pinned at both ends, which move by as much while the weight comes on.
Scene cable(const std::vector<Vec3> &points, double axial_stiffness, const Vec3 &first_moves, const Vec3 &last_moves) {
  Scene scene;
  scene.gravity = Vec3(0, -gravity, 0);
  Rod rod;
  rod.name = "cable";
  rod.position = points;
  rod.material = {1, 0, axial_stiffness, 0, {0, 0}, 0, 0};
  setBishopDirectors(rod);
  scene.rods = {rod};
  auto pin = [&](int vertex, const Vec3 &moves) {
    Support support{Support::Kind::pin, 0, vertex, {}, {}};
    if (!moves.isZero(0)) support.motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, moves, Vec3::Zero()}};
    scene.supports.push_back(support);
  };
  pin(0, first_moves);
  pin(rod.edges(), last_moves);
  return scene;
}

std::vector<Vec3> line(int edges, const Vec3 &to = Vec3(1, 0, 0)) { return lineShape(Vec3::Zero(), to, edges).points; }

/// Tension at a stretch: EA (s^3 - s)/2.
double stretchUnder(double tension, double axial_stiffness) {
  double s = 1 + std::min(tension / axial_stiffness, std::cbrt(2 * tension / axial_stiffness));
  for (int k = 0; k < 50; ++k) s -= (0.5 * (s * s * s - s) - tension / axial_stiffness) / (0.5 * (3 * s * s - 1));
  return s;
}

/// Vertices of the chain that hangs from the first vertex of a rod when its first edge pulls with a force there:
/// horizontal and vertical equilibrium from vertex to vertex, without any energy or Newton. A chain whose edges all
/// pull has no other equilibrium between its ends.
std::vector<Vec3> chain(const Scene &scene, const Vec3 &start, Vec3 force) {
  const Rod &rod = scene.rods[0];
  std::vector<Vec3> x{start};
  for (int i = 0; i < rod.edges(); ++i) {
    x.push_back(x.back() +
                force.normalized() * rod.edge(i).norm() * stretchUnder(force.norm(), rod.material.axial_stiffness));
    if (i + 1 < rod.edges()) force += Vec3(0, 0.5 * gravity * (rod.edge(i).norm() + rod.edge(i + 1).norm()), 0);
  }
  return x;
}

/// Solves, and returns how far vertices are from the chain that ends where the rod does, over the length; the force in
/// the first edge makes up for it.
double chainError(const Scene &scene, const LoopSettings &settings, Simulation &sim, int *iterations = nullptr) {
  runTo(sim, scene, settings, iterations);
  const std::vector<Vec3> &x = sim.state.position;
  const double rest = scene.rods[0].edge(0).norm(), stretch = (x[1] - x[0]).norm() / rest;
  Vec3 force = (x[1] - x[0]) / rest * scene.rods[0].material.axial_stiffness * 0.5 * (stretch * stretch - 1);
  if (stretch <= 1) return HUGE_VAL;
  for (int k = 0; k < 20; ++k) { // the digits that the strain of a stiff edge does not have
    const Vec3 missed = x.back() - chain(scene, x[0], force).back();
    Eigen::Matrix3d change;
    for (int a = 0; a < 3; ++a) {
      const double step = 1e-6 * force.norm();
      change.col(a) = (chain(scene, x[0], force + step * Vec3::Unit(a)).back() -
                       chain(scene, x[0], force - step * Vec3::Unit(a)).back()) /
                      (2 * step);
    }
    force += change.fullPivLu().solve(missed);
  }
  const std::vector<Vec3> right = chain(scene, x[0], force);
  double error = 0, length = 0;
  for (std::size_t i = 0; i < x.size(); ++i) error = std::max(error, (x[i] - right[i]).norm());
  for (int i = 0; i < scene.rods[0].edges(); ++i) length += scene.rods[0].edge(i).norm();
  return error / length;
}

constexpr double chain_tolerance = 1e-5; // what -snes_rtol 1e-6 of the weight leaves where a sag is soft

TEST(SlackCable, StraightStartsSlackenAtAnyStiffnessAndLoadStep) {
  for (const int edges : {10, 40, 100})
    for (const double stiffness : {1e2, 1e4, 1e6, 1e8})
      for (const int steps : {1, 10, 100}) {
        SCOPED_TRACE(testing::Message() << edges << " edges, EA " << stiffness << ", " << steps << " load steps");
        Simulation sim;
        EXPECT_LT(chainError(cable(line(edges), stiffness, Vec3::Zero(), Vec3(-0.2, 0, 0)), statics(steps), sim),
                  chain_tolerance);
      }
}

TEST(SlackCable, StartsInAnyShapeAndMotionFindTheHangingChain) {
  const Vec3 none = Vec3::Zero();
  for (const int edges : {10, 100}) {
    std::vector<Vec3> arch, across, zigzag, sideways;
    for (int i = 0; i <= edges; ++i) {
      const double s = double(i) / edges, angle = pi * (1 - s), kink = i % 2 == 0 ? -1.0 : 1.0;
      arch.push_back(Vec3(0.5 * std::cos(angle), 0.5 * std::sin(angle), 0));
      across.push_back(Vec3(0.5 * std::cos(angle), 0, 0.5 * std::sin(angle)));
      zigzag.push_back(Vec3(0.8 * s, 0.3 / edges * kink, 0));
      sideways.push_back(Vec3(0.8 * s, 0, 1.0 / edges * kink));
    }
    const struct {
      const char *what;
      std::vector<Vec3> points;
      Vec3 first, last;
    } cases[] = {{"both pins move in", line(edges), Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0)},
                 {"one pin moves sideways", line(edges), none, Vec3(0, 0, 0.3)},
                 {"one pin moves in and sideways", line(edges), none, Vec3(-0.3, 0, 0.3)},
                 {"inclined", line(edges, Vec3(0.8, 0.6, 0)), none, Vec3(-0.16, -0.12, 0)},
                 {"standing arch", arch, none, none},
                 {"arch across gravity", across, none, none},
                 {"zigzag", zigzag, none, none},
                 {"zigzag across gravity", sideways, none, none}};
    for (const auto &c : cases)
      for (const double stiffness : {1e2, 1e5, 1e8})
        for (const bool mixed : {true, false}) {
          if (!mixed && stiffness > 1e6) continue; // forces of the primal form are rounded strains times EA
          SCOPED_TRACE(testing::Message()
                       << c.what << ", " << edges << " edges, EA " << stiffness << (mixed ? "" : ", primal"));
          LoopSettings settings = statics(3);
          settings.mixed = mixed;
          Simulation sim;
          EXPECT_LT(chainError(cable(c.points, stiffness, c.first, c.last), settings, sim), chain_tolerance);
        }
  }
}

/// The catenary of length 1 over a span of 0.8: a sinh(0.4/a) = 0.5, sag a (cosh(0.4/a) - 1).
TEST(SlackCable, SagIsThatOfTheCatenaryAtSecondOrder) {
  double low = 0.1, high = 10;
  for (int k = 0; k < 200; ++k)
    (std::sinh(0.4 / (0.5 * (low + high))) * 0.5 * (low + high) > 0.5 ? low : high) = 0.5 * (low + high);
  const double sag = low * (std::cosh(0.4 / low) - 1);
  EXPECT_NEAR(sag, 0.2654, 5e-5);
  std::array<double, 3> error{};
  for (int k = 0; k < 3; ++k) {
    Simulation sim;
    runTo(sim, cable(line(16 << k), 1e9, Vec3::Zero(), Vec3(-0.2, 0, 0)), statics()); // stretches by 1e-8
    error[k] = std::abs(-sim.state.position[8 << k].y() - sag);
  }
  EXPECT_NEAR(order(error[0], error[1]), 2, 0.1);
  EXPECT_NEAR(order(error[1], error[2]), 2, 0.1);
}

/// The tension that shifts an indefinite Hessian makes its waves alike on all meshes.
TEST(SlackCable, IterationsHardlyGrowWithTheEdges) {
  for (const int edges : {100, 1000, 10000}) {
    int iterations = 0;
    Simulation sim;
    runTo(sim, cable(line(edges), 1e4, Vec3::Zero(), Vec3(-0.2, 0, 0)), statics(), &iterations);
    EXPECT_LT(iterations, 60) << edges << " edges"; // measured 15 to 40, and 11 at 100 000 edges
    EXPECT_NEAR(sim.state.position[edges / 2].y(), -0.26577, 2e-4)
        << edges << " edges"; // 0.2654 and a stretch of about 4e-4
  }
}

/// A ring closed from a straight strip, drawn bent about its stiff axis, in the plane, where it is an unstable
/// equilibrium.
Scene stiffRing(int edges, const std::vector<double> &stiffness) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  for (const double k : stiffness) {
    const int r = int(scene.rods.size());
    Rod rod;
    rod.name = "ring" + std::to_string(r);
    const Polyline ring = ringShape(Vec3(2.0 * r, 0, 0), Vec3(0, 0, 1), 0.5, edges);
    rod.position = ring.points;
    rod.closed = true;
    rod.measure = Measure::angle;
    rod.natural = Rod::Natural::given;
    rod.material = {1, 0, 1e6, 0.7, {k, 1}, 0, 0};
    setBishopDirectors(rod);
    scene.rods.push_back(rod);
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::clamp));
  }
  return scene;
}

double bendingEnergy(const Simulation &sim, int r) {
  const EnergyBudget e =
      energyBudget(sim.scene, *sim.elements, sim.state, configurationOf(sim.state, sim.scene, *sim.elements, 1), 1, r);
  return e.stretch + e.bend + e.twist;
}

TEST(StiffRing, TurnsToItsSoftAxisFromEachUnstableStart) {
  for (const double ratio : {1.2, 2.0, 5.0, 50.0})
    for (const int steps : {1, 5}) {
      Simulation drawn, sim;
      EXPECT_PETSC(drawn.setUp(stiffRing(80, {ratio}), statics()));
      EXPECT_NEAR(energyBudget(drawn.scene, *drawn.elements, drawn.state, 1).bend, ratio * 2 * pi,
                  1e-3 * ratio * 2 * pi);
      runTo(sim, stiffRing(80, {ratio}), statics(steps));
      // pi EI2/R; 80 edges store 2.5e-4 more
      EXPECT_NEAR(bendingEnergy(sim, 0), 2 * pi, 4e-4 * 2 * pi)
          << "EI1/EI2 " << ratio << ", " << steps << " load steps";
    }
}

/// The stiffer, the longer the way down; some shapes on it are stable, too, but not the circle.
TEST(StiffRing, LeavesItsCircleHoweverStiff) {
  for (const Energy energy : {Energy::seed, Energy::classical})
    for (const double ratio : {60.0, 80.0, 100.0, 200.0, 400.0, 500.0}) {
      Simulation sim;
      Scene scene = stiffRing(60, {ratio});
      scene.rods[0].energy = energy;
      runTo(sim, scene, statics());
      EXPECT_LT(bendingEnergy(sim, 0), 3 * 2 * pi) << "EI1/EI2 " << ratio;
    }
}

TEST(StiffRing, RingsOfOneSceneLeaveEachByItself) {
  const std::vector<double> stiffness{2, 1, 5, 1.2, 3, 8, 1.5, 1, 2.5, 4, 6, 7, 1.1, 9};
  Simulation sim;
  runTo(sim, stiffRing(40, stiffness), statics());
  for (int r = 0; r < int(stiffness.size()); ++r)
    EXPECT_NEAR(bendingEnergy(sim, r), 2 * pi, 1.5e-3 * 2 * pi) << "EI1/EI2 " << stiffness[r]; // 4 x 2.5e-4
}

/// A couple on one rod says nothing of the stability of another.
TEST(Columns, BuckleBesideARodWithACouple) {
  Scene scene;
  scene.gravity.setZero();
  for (int r = 0; r < 2; ++r) {
    Rod rod = straightRod(20, Measure::angle);
    rod.material = {1, 0, 1e5, 1, {1, 1.3}, 0, 0};
    for (Vec3 &x : rod.position) x.y() += r;
    scene.rods.push_back(rod);
    scene.supports.push_back(hold(scene, r, 0, Support::Kind::clamp));
  }
  scene.forces = {{0, 20, Vec3(-4, 0, 0)}}; // Euler's load is pi^2/4
  scene.moments = {{1, 19, 0, Vec3(0, 0, 1)}};
  Simulation sim;
  runTo(sim, scene, statics(2));
  EXPECT_GT((sim.state.position[20] - scene.rods[0].position[20]).tail<2>().norm(), 0.3);
}

/// MUMPS counts the pivots of all rods together: which of them are unstable, the band tells, and the others are not
/// shifted.
TEST(StiffRing, RingsOfOneSceneLeaveEachByItselfWithMumps) {
  const std::vector<double> stiffness{2, 1, 5, 1};
  auto iterationsOf = [&](const char *type) {
    const OptionSet option("-pc_factor_mat_solver_type", type);
    Simulation sim;
    int iterations = 0;
    runTo(sim, stiffRing(40, stiffness), statics(), &iterations);
    for (int r = 0; r < int(stiffness.size()); ++r)
      EXPECT_NEAR(bendingEnergy(sim, r), 2 * pi, 1.5e-3 * 2 * pi) << type << ", EI1/EI2 " << stiffness[r];
    return iterations;
  };
  EXPECT_EQ(iterationsOf("mumps"), iterationsOf("banded"));
}

/// A straight rod of length 1, EI 1 and EA L^2/EI 1e6, whose last vertex moves in.
Scene pushed(int edges, Support::Kind kind, double by, double weight) {
  Scene scene;
  scene.gravity = Vec3(0, -weight, 0);
  Rod rod = straightRod(edges, Measure::angle);
  rod.material = {1, 0, 1e6, 0.7, {1, 1}, 0, 0};
  scene.rods = {rod};
  scene.supports = {hold(scene, 0, 0, kind), hold(scene, 0, edges, kind)};
  scene.supports[1].motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(-by, 0, 0), Vec3::Zero()}};
  return scene;
}

/// Between fine edges Newton begins where fewer end: without that, 65 to 875 iterations and rejected steps at 1000
/// edges, and no end at 10 000.
TEST(FineRods, PushedInTheyBendInOneStepAsCoarseOnesDo) {
  LoopSettings settings = statics();
  settings.bifurcation = Bifurcation::off; // bisections would be most of the time
  for (const Support::Kind kind : {Support::Kind::clamp, Support::Kind::pin})
    for (const double by : {0.1, 0.3})
      for (const double weight : {0.0, 9.81}) {
        double energy[2];
        int k = 0;
        for (const int edges : {100, 5000}) {
          SCOPED_TRACE(testing::Message() << edges << " edges, pushed in by " << by << ", weight " << weight);
          Simulation sim;
          int iterations = 0;
          runTo(sim, pushed(edges, kind, by, weight), settings, &iterations);
          EXPECT_EQ(sim.state.step, 1);
          EXPECT_LT(iterations, 45); // measured 9 to 36: up to 10 before fewer edges are tried, the rest where the
                                     // plane of bending is free to turn
          energy[k++] = bendingEnergy(sim, 0);
        }
        EXPECT_NEAR(energy[0] / energy[1], 1, 1e-3); // second order: 100 edges are off by (pi/100)^2/3 of it and less
      }
}

TEST(FineRods, RingsTurnToTheirSoftAxisAndHangOnPins) {
  LoopSettings settings = statics();
  settings.bifurcation = Bifurcation::off;
  for (const double ratio : {2.0, 5.0, 50.0}) {
    Simulation sim;
    int iterations = 0;
    runTo(sim, stiffRing(5000, {ratio}), settings, &iterations);
    EXPECT_NEAR(bendingEnergy(sim, 0), 2 * pi * (1 - 4e-6), 1e-6 * 2 * pi)
        << "EI1/EI2 " << ratio; // less EI/(EA R^2) for the stretch; edges: 1e-7
    EXPECT_LT(iterations, 30) << "EI1/EI2 " << ratio;
  }
  double sag[2];
  int k = 0;
  for (const int edges : {200, 5000}) {
    Scene scene = stiffRing(edges, {1});
    scene.gravity = Vec3(0, -gravity, 0);
    scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, edges / 2, Support::Kind::pin)};
    Simulation sim;
    int iterations = 0;
    runTo(sim, scene, settings, &iterations);
    EXPECT_LT(iterations, 30);
    sag[k++] = sim.state.position[edges / 4].y();
  }
  EXPECT_NEAR(sag[0] / sag[1], 1, 1e-3); // second order: 2.1e-3 at 100 edges
}

/// Where coarse edges cannot stand for fine ones the rod is solved as it is: every vertex is a corner.
TEST(FineRods, OfCornersStayAsTheyAre) {
  Scene scene;
  scene.gravity = Vec3(0, -gravity, 0);
  Rod rod;
  rod.name = "zigzag";
  for (int i = 0; i <= 400; ++i) rod.position.push_back(Vec3(i / 400.0, i % 2 == 0 ? 0.0 : 1 / 400.0, 0));
  rod.material = {0.1, 0, 1e6, 1, {1, 1}, 0, 0};
  setBishopDirectors(rod);
  scene.rods = {rod};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  Simulation sim;
  runTo(sim, scene, statics());
  EXPECT_LT(sim.state.position[400].y(), -0.05);
}

} // namespace
} // namespace tendril::test
