/// Follower forces, which turn with the rod: equilibria against a rod integrated from its free end, motions against
/// rigid ones and their own limit, and how a column under a tangential force begins to flutter.
#include "support/rods.hpp"

#include "tendril/dynamics/arc_length.hpp"
#include "tendril/dynamics/integrator.hpp"
#include "tendril/dynamics/modes.hpp"

#include <complex>

namespace tendril::test {
namespace {

constexpr double axial = 300;

/// Unit cantilever with unequal stiffnesses that stretches, by the classical law.
Scene cantilever(int edges) {
  Rod rod = straightRod(edges, Measure::angle);
  rod.energy = Energy::classical;
  rod.material.axial_stiffness = axial;
  rod.material.flexural_stiffness = {1, 1.7};
  rod.material.torsional_stiffness = 0.8;
  return clampedScene(std::move(rod));
}

/// Kirchhoff's equations of that rod from its free end on, in whose frame the force there is known, and with it all:
/// x' = (1 + n.t/EA) t, R' = [u]x R, m' = -x' x n; fourth order Runge and Kutta. A second force acts in the middle.
/// \return end of the rod in the frame of its clamp (first and second director, tangent)
Vec3 exactEnd(const Vec3 &at_end, const Vec3 &at_middle) {
  struct Place {
    Vec3 x = Vec3::Zero(), m = Vec3::Zero();
    Mat3 r = Mat3::Identity();
  };
  constexpr int steps = 2000;
  Vec3 n = at_end;
  auto slope = [&](const Place &p) {
    const Vec3 k(p.m.dot(p.r.col(0)) / 1, p.m.dot(p.r.col(1)) / 1.7, p.m.dot(p.r.col(2)) / 0.8), u = p.r * k;
    Place d;
    d.x = (1 + n.dot(p.r.col(2)) / axial) * p.r.col(2);
    d.m = -d.x.cross(n);
    d.r = crossMatrix<double>(u) * p.r;
    return d;
  };
  auto moved = [](const Place &p, double h, const Place &d) {
    Place q;
    q.x = p.x + h * d.x;
    q.m = p.m + h * d.m;
    q.r = p.r + h * d.r;
    return q;
  };
  Place p;
  for (int k = 0; k < steps; ++k) {
    if (2 * k == steps) n += p.r * at_middle;
    const double h = -1.0 / steps;
    const Place a = slope(p), b = slope(moved(p, h / 2, a)), c = slope(moved(p, h / 2, b)), d = slope(moved(p, h, c));
    p = moved(moved(moved(moved(p, h / 6, a), h / 3, b), h / 3, c), h / 6, d);
  }
  return p.r.transpose() * -p.x;
}

TEST(FollowerForces, BendAndTwistARodAsIntegratedFromItsEnd) {
  const Vec3 at_end(1.5, -2, -1), at_middle(-1, 3, 2);
  const Vec3 exact = exactEnd(at_end, at_middle);
  auto end = [&](int edges) -> Vec3 {
    Scene scene = cantilever(edges);
    scene.followers = {{0, edges, at_end}, {0, edges / 2, at_middle}};
    const Frame clamp = scene.supports[0].frame;
    Simulation sim;
    int iterations = 0;
    runTo(sim, scene, statics(4), &iterations);
    EXPECT_LE(iterations, 4 * 8);
    const Vec3 x = sim.state.position.back();
    return {x.dot(clamp.director), x.dot(clamp.secondDirector()), x.dot(clamp.tangent)};
  };
  const Vec3 coarse = end(40), fine = end(80);
  EXPECT_NEAR(order((coarse - exact).norm(), (fine - exact).norm()), 2, 0.1);
  EXPECT_LT(((4 * fine - coarse) / 3 - exact).norm(), 2e-5); // the fourth power of a turn of 0.1 an edge
}

/// Newton on the arc length has the whole derivative, too: few iterations, and the same end.
TEST(FollowerForces, AreFollowedAlongTheArcLength) {
  Scene scene = cantilever(20);
  scene.followers = {{0, 20, Vec3(1.5, -2, -1)}};
  Simulation along, steps;
  runTo(steps, scene, statics(4));
  LoopSettings settings = statics(10);
  settings.continuation = Continuation::arclength;
  EXPECT_PETSC(along.setUp(scene, settings));
  ArcLength path(along.solver, settings);
  bool finished = false;
  int iterations = 0, points = 0;
  EXPECT_PETSC(path.run(
      along.state,
      [&](const State &, const Diagnostics &row) {
        iterations += row.newton_iterations;
        ++points;
        return PetscErrorCode(0);
      },
      &finished));
  EXPECT_TRUE(finished) << path.failure();
  EXPECT_NEAR(along.state.time, 1, 1e-9);
  EXPECT_LE(iterations, 5 * points);
  EXPECT_LT((along.state.position.back() - steps.state.position.back()).norm(), 1e-5); // to -snes_rtol
}

/// A force that turns with a free stiff rod, square to it: turns as alpha t^2/2, and its centre goes by that force.
TEST(FollowerForces, DriveAFreeRodRoundAsARigidOne) {
  constexpr int edges = 4;
  constexpr double force = 0.5, time = 1;
  for (const char *name : {"bdf2", "midpoint", "generalized_alpha", "sdirk2", "energy_momentum"}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {straightRod(edges, Measure::angle)};
    scene.rods[0].material.flexural_stiffness = {1e5, 1e5};
    scene.rods[0].energy = Energy::classical;
    const Frame drawn = referenceFrame(scene.rods[0], 0);
    scene.followers = {{0, edges, Vec3(force, 0, 0)}};
    LoopSettings settings = dynamics(0.005, time);
    settings.integrator.name = name;
    Simulation sim;
    double work = 0, kinetic = 0;
    runAndWatch(sim, scene, settings, [&](const Diagnostics &row) {
      work += row.work.loads;
      kinetic = row.energy.kinetic;
    });
    // Lumped masses on a line: of its half edges.
    double inertia = 0;
    Vec3 centre = Vec3::Zero();
    for (int v = 0; v <= edges; ++v) {
      const double mass = (v == 0 || v == edges ? 0.5 : 1) / edges, x = double(v) / edges - 0.5;
      inertia += mass * x * x;
      centre += mass * sim.state.position[std::size_t(v)];
    }
    const double turned = 0.5 * force * 0.5 / inertia * time * time;
    constexpr int steps = 20000;
    Vec3 velocity = Vec3::Zero(), exact = Vec3(0.5, 0, 0);
    for (int k = 0; k < steps; ++k) { // midpoints
      const double t = (k + 0.5) * time / steps, angle = turned * t * t;
      const Vec3 push = force * (std::cos(angle) * drawn.director - std::sin(angle) * drawn.tangent);
      exact += (velocity + 0.5 * push * time / steps) * time / steps;
      velocity += push * time / steps;
    }
    const Vec3 along = sim.state.position.back() - sim.state.position.front();
    const double angle =
        std::remainder(std::atan2(along.dot(drawn.director), along.dot(drawn.tangent)) - turned, 2 * pi);
    EXPECT_NEAR(angle, 0, 5e-3) << name; // of 1.3 rad, by 200 steps of second order
    EXPECT_LT((centre - exact).norm(), 2e-3) << name;
    EXPECT_NEAR(work, kinetic, 2e-2 * kinetic) << name;
  }
}

/// Steps of second order keep it, and the work of the force is that of the energies to that order.
TEST(FollowerForces, KeepTheOrderOfSteps) {
  auto run = [](const char *name, int steps, double *missed) { // of few and slow waves
    Scene scene = cantilever(3);
    scene.rods[0].material.axial_stiffness = 30;
    scene.rods[0].material.linear_rotational_inertia = 0.1;
    scene.followers = {{0, 3, Vec3(1, -2, -1)}};
    LoopSettings settings = dynamics(0.5 / steps, 0.5);
    settings.integrator.name = name;
    Simulation sim;
    double work = 0, dissipated = 0;
    runAndWatch(sim, scene, settings, [&](const Diagnostics &row) {
      work += row.work.loads;
      dissipated += row.dissipated;
    });
    *missed = dissipated / work;
    return sim.state.position.back();
  };
  for (const char *name : {"midpoint", "energy_momentum"}) {
    double missed[3];
    const Vec3 a = run(name, 400, missed), b = run(name, 800, missed + 1), c = run(name, 1600, missed + 2);
    EXPECT_NEAR(order((a - b).norm(), (b - c).norm()), 2, 0.3) << name; // waves as fast as steps of 1 ms count less
    EXPECT_LT(std::abs(missed[2]), 1e-3) << name;
    EXPECT_NEAR(order(std::abs(missed[1]), std::abs(missed[2])), 2, 0.4) << name;
  }
}

/// Rods with fewer unknowns do as full ones under a tangential force.
TEST(FollowerForces, MoveReducedRodsAsFullOnes) {
  for (const RodModel model : {RodModel::torsion_free, RodModel::planar}) {
    auto end = [&](RodModel of) {
      Scene scene = cantilever(16);
      scene.rods[0].material.flexural_stiffness = {1, 1};
      scene.rods[0].material.linear_rotational_inertia = 0;
      scene.gravity = Vec3(0, -2, 0);
      scene.followers = {{0, 16, Vec3(0, 0, -3)}, {0, 8, Vec3(0, 0, 1)}};
      scene.rods[0].model = of;
      if (of == RodModel::planar) scene.rods[0].flat = 2;
      Simulation sim;
      runTo(sim, scene, dynamics(0.01, 0.3));
      return sim.state.position.back();
    };
    EXPECT_LT((end(model) - end(RodModel::full)).norm(), 1e-8) << int(model); // -snes_rtol over 30 steps
  }
}

/// Modes of a round unit cantilever under a follower force or a couple at its end.
Modes modesUnder(int edges, int count, double thrust, double torque = 0, const Vec3 &moment = Vec3::Zero()) {
  Scene scene = clampedScene(straightRod(edges, Measure::angle));
  if (thrust != 0) scene.followers = {{0, edges, Vec3(0, 0, -thrust)}};
  if (torque != 0 || !moment.isZero(0)) scene.moments = {{0, edges - 1, torque, moment}};
  Simulation sim;
  runTo(sim, scene, statics(1));
  Modes modes;
  std::string failure;
  EXPECT_EQ(findModes(sim.solver, sim.state, TimeLoop::stepOf(statics(), sim.state, 1), count, &modes, &failure), 0);
  EXPECT_EQ(failure, "");
  EXPECT_EQ(modes.count(), count);
  return modes;
}

using Complex = std::complex<double>;
Complex squareOf(const Modes &modes, int k) {
  return {modes.eigenvalue[std::size_t(k)], std::abs(modes.imaginary[std::size_t(k)])};
}

/// omega^2 against w'''' - i torque w''' + thrust w'' = omega^2 w with w(0) = w'(0) = 0 and w''(1) = w'''(1) = 0, whose
/// determinant was solved with 30 digits; moments fixed in space have the frequencies of torques that turn with the
/// end.
TEST(Flutter, HasTheFrequenciesOfBecksAndNicolaisColumns) {
  struct Row {
    double thrust, torque;
    std::vector<Complex> exact; // each twice, in both planes
  };
  for (const Row &row : {Row{10, 0, {26.788514985269}}, Row{19, 0, {78.866794209082, 177.56799524768}},
                         Row{25, 0, {{88.5648044861, 104.417766315}}}, Row{40, 0, {{-17.1430181792, 203.411123006}}},
                         Row{0, 1, {{12.0490356598, 3.80273437283}, {480.163617519, 45.653795821}}},
                         Row{0, 3, {{9.42508041222, 11.7766792711}, {436.318756151, 135.503953473}}}})
    for (const bool fixed : {false, true}) {
      if (fixed && row.torque == 0) continue;
      const int pairs = int(row.exact.size());
      // A complex one stands for a pair, which is there once for couples (of both planes) and twice for thrusts.
      const int count = row.torque != 0 ? 2 * pairs : row.exact[0].imag() != 0 ? 4 : 2 * pairs;
      auto of = [&](int edges) {
        return modesUnder(edges, count, row.thrust, fixed ? 0 : row.torque,
                          fixed ? Vec3(row.torque, 0, 0) : Vec3(Vec3::Zero()));
      };
      const Modes coarse = of(32), fine = of(64);
      for (int k = 0; k < pairs; ++k) {
        const Complex exact = row.exact[std::size_t(k)], a = squareOf(coarse, 2 * k), b = squareOf(fine, 2 * k);
        EXPECT_LT(std::abs((4.0 * b - a) / 3.0 - exact), 2e-4 * std::abs(exact)) // of h^4, near where both meet
            << row.thrust << ' ' << row.torque << ' ' << fixed << ' ' << k << ' ' << b;
        EXPECT_NEAR(order(std::abs(a - exact), std::abs(b - exact)), 2, 0.1) << row.thrust << ' ' << row.torque;
        EXPECT_EQ(fine.flutters(2 * k), exact.imag() != 0);
      }
    }
}

/// Beck 1952: 20.05 EI/L^2, where the two lowest frequencies meet at 11.02; the exact roots of his determinant.
TEST(Flutter, BeginsAtBecksLoad) {
  auto critical = [](int edges) {
    double stable = 19, unstable = 21;
    while (unstable - stable > 1e-9) {
      const double middle = 0.5 * (stable + unstable);
      (modesUnder(edges, 4, middle).flutters(0) ? unstable : stable) = middle;
    }
    return 0.5 * (stable + unstable);
  };
  constexpr double exact = 20.050953619;
  const double coarse = critical(16), fine = critical(32);
  EXPECT_NEAR((4 * fine - coarse) / 3, exact, 1e-4 * exact);
  EXPECT_NEAR(order(std::abs(coarse - exact), std::abs(fine - exact)), 2, 0.1);
  EXPECT_NEAR(modesUnder(32, 4, fine + 1e-3).frequency(0), 11.0155576409, 0.05); // off by the square of the edge length
}

/// What flutters grows as its mode says, in the plane of the mode.
TEST(Flutter, GrowsAsItsModeSays) {
  constexpr int edges = 12;
  constexpr double thrust = 30, dt = 2e-4, time = 0.1, small = 1e-7;
  const Modes modes = modesUnder(edges, 4, thrust);
  ASSERT_TRUE(modes.flutters(0));
  EXPECT_GT(modes.imaginary[0], 0);
  EXPECT_LT(modes.imaginary[1], 0);
  Scene scene = clampedScene(straightRod(edges, Measure::angle));
  scene.followers = {{0, edges, Vec3(0, 0, -thrust)}};
  LoopSettings settings = dynamics(dt, time);
  settings.integrator.name = "midpoint";
  EXPECT_PETSC(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-12"));
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, settings));
  EXPECT_PETSC(PetscOptionsClearValue(nullptr, "-snes_rtol"));
  const double rate = modes.growthRate(0), omega = modes.frequency(0);
  for (std::size_t v = 0; v <= edges; ++v) {
    sim.state.position[v] += small * modes.shape[0].vertex[v];
    sim.state.velocity[v] = small * (rate * modes.shape[0].vertex[v] + omega * modes.shape[1].vertex[v]);
  }
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_TRUE(finished) << loop.failure();
  const Vec3 expected =
      small * std::exp(rate * time) *
      (std::cos(omega * time) * modes.shape[0].vertex[edges] + std::sin(omega * time) * modes.shape[1].vertex[edges]);
  Vec3 moved = sim.state.position[edges] - Vec3(1, 0, 0);
  moved[0] = 0;                                                 // shortened by the thrust
  EXPECT_LT((moved - expected).norm(), 1e-3 * expected.norm()); // (omega dt)^2/12 a radian and rounding of 1e-7
}

} // namespace
} // namespace tendril::test
