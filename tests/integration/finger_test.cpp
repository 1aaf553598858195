/// Mechanisms with tendons: the nine-link finger against its equilibria, slack and taut, work, trees that hold.
#include "support/beams.hpp"
#include "support/mechanisms.hpp"
#include "support/option_set.hpp"
#include "tendril/energy/joint.hpp"
#include "tendril/energy/tendon.hpp"
#include "tendril/geometry/rotation.hpp"

namespace tendril::test {
namespace {

TEST(Finger, EquilibriaAreThoseOfTheTable) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/bodies_finger_equilibria.csv");
  std::string line, kind, cell;
  int rows = 0;
  while (std::getline(in, line)) {
    if (line.empty() || line[0] == '#' || line.rfind("kind", 0) == 0) continue;
    std::istringstream cells(line);
    std::getline(cells, kind, ',');
    std::vector<double> v;
    while (std::getline(cells, cell, ',')) v.push_back(std::stod(cell));
    const double gravity = v[3], pulled = v[4];
    Simulation run;
    LoopSettings settings = statics(4);
    int steps = 0, iterations = 0;
    runAndWatch(run, finger(kind == "spatial", gravity, pulled), settings, [&](const Diagnostics &row) {
      iterations += row.newton_iterations;
      ++steps;
    });
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(angleOf(run, k), v[std::size_t(5 + k)], 1e-6) << line;
    EXPECT_NEAR(readingOf(run).tension, v[8], 1e-6 * v[8]) << line;
    EXPECT_LE(iterations, 12 * steps) << line;
    ++rows;
  }
  EXPECT_EQ(rows, 14);
}

/// The slider goes back, the tendon gets slack while the finger swings, and taut again: tension is nowhere negative,
/// and each step takes few iterations.
TEST(Finger, GoesSlackAndTautInFewIterations) {
  Scene scene = finger(true, 0, 0.05);
  scene.tendons[0].points[0].motion.table = {
      {0, Vec3::Zero(), Vec3::Zero()}, {0.4, Vec3(-0.05, 0, 0), Vec3::Zero()}, {0.45, Vec3::Zero(), Vec3::Zero()}};
  Simulation run;
  const LoopSettings settings = dynamics(1.0 / 60, 2);
  int most = 0, changes = 0;
  bool taut = false;
  runAndWatch(run, scene, settings, [&](const Diagnostics &row) {
    const TendonReading t = readingOf(run, true);
    EXPECT_GE(t.tension, 0);
    most = std::max(most, row.newton_iterations);
    changes += (t.tension > 0) != taut;
    taut = t.tension > 0;
  });
  EXPECT_GE(changes, 3);
  EXPECT_LE(most, 6);
}

/// With energy and momentum kept, energies change by the work of the slider alone.
TEST(Finger, TakesTheWorkOfItsSlider) {
  for (const bool spatial : {true, false}) {
    Scene scene = finger(spatial, 0, 0.02);
    scene.tendons[0].actuator.stiffness = 200; // swings that the steps resolve
    scene.tendons[0].points[0].motion.table[1].time = 0.5;
    double before[2] = {0, 0}, off[2] = {0, 0};
    for (const int finer : {1, 2}) {
      Simulation run;
      LoopSettings settings = dynamics(0.004 / finer, 0.5);
      settings.integrator.name = "bdf2";
      double work = 0, energy = 0;
      runAndWatch(run, scene, settings, [&](const Diagnostics &row) {
        work += row.work.total();
        energy = row.energy.total();
      });
      before[finer - 1] = energy;
      off[finer - 1] = std::abs(work - energy);
    }
    EXPECT_GT(before[1], 1e-3);
    EXPECT_LT(off[1], 0.03 * before[1]) << spatial; // what the method dissipates, and less of it with finer steps
    EXPECT_LT(off[1], 0.6 * off[0]) << spatial;
  }
}

/// What draws the coordinate of a joint whose parent turns as it is told does work by that turn, and reads its rate.
TEST(Finger, FollowsAParentThatIsTold) {
  Scene scene = finger(false, 0, 0);
  scene.bodies.resize(1);
  scene.joints.resize(1);
  scene.joints[0].driven = false;
  scene.joints[0].drive_stiffness = -1;
  scene.joints[0].motion.angular_velocity = {0, 0, 1};
  scene.tendons[0].points.clear();
  scene.tendons[0].segments.clear();
  scene.tendons[0].joints = {{0, 1.0}};
  scene.tendons[0].actuator.stiffness = 0.5;
  scene.tendons[0].actuator.compression = true;
  scene.hostBodies();
  Simulation run;
  LoopSettings settings = dynamics(0.002, 0.5);
  settings.integrator.name = "bdf2";
  double work = 0, energy = 0, before = 0, rate = 0, most = 0, last_rate = 0;
  runAndWatch(run, scene, settings, [&](const Diagnostics &row) {
    work += row.work.total();
    energy = row.energy.total();
    const TendonReading t = readingOf(run, true);
    rate = (t.displacement - before) / 0.002;
    before = t.displacement;
    most = std::max(most, std::abs(before));
    last_rate = t.rate;
  });
  EXPECT_GT(energy, 1e-3);
  EXPECT_LT(std::abs(work - energy), 0.02 * energy); // of steps of second order
  EXPECT_GT(most, 0.05);
  EXPECT_NEAR(last_rate, rate, 0.02 + 0.02 * std::abs(rate));
}

/// A tendon with a damper at its end, in methods of second order: no damping but its own.
TEST(Finger, ConvergesAtTheOrderOfItsMethodWithADamper) {
  const OptionSet fine("-snes_rtol", "1e-10");
  for (const std::string name : {"euler", "bdf2"}) {
    std::vector<double> end;
    for (const int n : {50, 100, 200, 400}) {
      Scene scene = finger(true, 0, 0.04);
      scene.tendons[0].actuator.stiffness = 300;
      scene.tendons[0].actuator.damping = 8;
      scene.tendons[0].points[0].motion.table = {};
      scene.tendons[0].points[0].motion.amplitude = {-0.03, 0, 0};
      scene.tendons[0].points[0].motion.period = 1;
      Simulation run;
      LoopSettings settings = dynamics(0.4 / n, 0.4);
      settings.integrator.name = name;
      runTo(run, scene, settings);
      end.push_back(angleOf(run, 0));
    }
    const double order = std::log2((end[1] - end[2]) / (end[2] - end[3]));
    EXPECT_NEAR(order, name == "euler" ? 1 : 2, 0.25) << name << " " << end[0] << " " << end[3];
  }
}

/// A backbone with one tendon beside it, from a held point to a disc at its tip: its moment is the same everywhere, and
/// so is its curvature, N r/EI (Rucker and Webster 2011), where it is hardly compressed.
TEST(SoftArm, BendsToAConstantCurvature) {
  const double length = 0.24, offset = 0.012, tension = 3;
  std::vector<double> turn;
  double exact = 0;
  for (const int edges : {12, 24, 48}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    Rod rod = wire("backbone", {0, 0, 0}, {length, 0, 0}, edges, 0.002, 1e9);
    rod.contact.on = rod.gravity = false;
    rod.measure = Measure::angle;
    rod.material.axial_stiffness = 1e9;
    setBishopDirectors(rod, Vec3::UnitY());
    scene.rods = {rod};
    scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
    Body disc = shaped("sphere", {0.01, 0, 0}, {length, 0, 0});
    disc.name = "disc";
    disc.contact.on = disc.gravity = false;
    scene.bodies = {disc};
    Attachment weld{};
    weld.name = "tip";
    weld.rod = weld.body = 0;
    weld.vertex = edges;
    weld.weld = true;
    weld.frame = frameAtVertex(rod, edges);
    scene.attachments = {weld};
    Tendon t;
    t.name = "tendon";
    Waypoint p;
    p.point = {0, offset, 0};
    t.points = {p};
    for (int e = 0; e < edges; ++e) {
      p = {};
      p.rod = 0;
      p.edge = e;
      p.at = 0.5;
      p.point = {0, offset, 0};
      t.points.push_back(p);
    }
    p = {};
    p.body = 0;
    p.point = {length, offset, 0};
    t.points.push_back(p);
    for (int k = 0; k + 1 < int(t.points.size()); ++k) t.segments.push_back({k, k + 1});
    t.actuator.kind = Actuator::Kind::force;
    t.actuator.input_motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(tension, 0, 0), Vec3::Zero()}};
    scene.tendons = {t};
    scene.hostBodies();
    exact = tension * offset / rod.material.flexural_stiffness[0] * length;
    Simulation run;
    runTo(run, scene, statics(4));
    const Vec3 tip = rotationOf(run.state, run.elements->groups - 1).col(0);
    turn.push_back(std::atan2(tip[1], tip[0]) - exact);
    if (edges < 48) continue;
    const double radius = length / exact;
    EXPECT_NEAR(run.state.position.back()[0], radius * std::sin(exact), 2e-3 * length);
    EXPECT_NEAR(run.state.position.back()[1], radius * (1 - std::cos(exact)), 2e-3 * length);
  }
  EXPECT_GT(exact, 0.6);
  EXPECT_LT(std::abs(turn[2]), 2e-3 * exact) << turn[0] << " " << turn[1] << " " << turn[2];
  EXPECT_GT(turn[1] / turn[2], 3) << "second order";
}

/// A cable that a tendon holds by its last vertex, as a support does, in its two solvers; and one over three of its own
/// vertices, which draws them together.
TEST(TendonsOnARod, HoldItWhereTheyPull) {
  Scene scene;
  scene.gravity = {0, -9.81, 0};
  Rod rod = wire("rod", {0, 0, 0}, {1, 0, 0}, 10, 0.01, 1e9);
  rod.contact.on = false;
  scene.rods = {rod};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  Waypoint end, top;
  end.rod = 0;
  end.setVertex(10, 10);
  top.point = {1, 1, 0};
  Tendon stay;
  stay.name = "stay";
  stay.points = {end, top};
  stay.segments = {{0, 1}};
  stay.actuator.kind = Actuator::Kind::displacement;
  stay.actuator.stiffness = 1e5;
  scene.tendons = {stay};
  scene.hostBodies();
  auto rested = [](const Scene &what) {
    Simulation run;
    runTo(run, what, statics(2));
    const Configuration c = configurationOf(run.state, run.scene, *run.elements, 1);
    return std::pair(run.state, what.tendons.empty() ? TendonReading()
                                                     : readTendon(run.scene, *run.elements, 0, run.state, c, false));
  };
  const auto [held, reading] = rested(scene);
  Scene pinned = scene; // a spring of the same stiffness along y, to which the tendon is one for a small sag
  pinned.tendons.clear();
  pinned.constraints = {pinTo(pinned, 0, 10, Vec3::Zero(), 1e5)};
  const auto [sprung, none] = rested(pinned);
  EXPECT_NEAR(reading.tension, 3.0 / 8 * rod.material.linear_density * 9.81, 0.02); // of ten edges
  EXPECT_NEAR(held.position.back()[1], -reading.displacement, 1e-6);
  EXPECT_NEAR(held.position.back()[1], sprung.position.back()[1], 5e-6);
  Tendon own = stay;
  own.points = {};
  for (const int v : {0, 5, 10}) {
    Waypoint p;
    p.rod = 0;
    p.setVertex(v, 10);
    own.points.push_back(p);
  }
  own.segments = {{0, 1}, {1, 2}};
  own.actuator.kind = Actuator::Kind::force;
  own.actuator.input = 10;
  scene.gravity.setZero();
  scene.tendons = {own};
  const auto [shortened, pull] = rested(scene);
  EXPECT_EQ(pull.tension, 10);
  EXPECT_NEAR(pull.displacement, -10 / rod.material.axial_stiffness, 0.05 * 10 / rod.material.axial_stiffness);
}

/// A drum of radius R that a motor turns draws a load up by R times its turn, through three turns.
TEST(Winch, DrawsUpByItsRadius) {
  Scene scene = finger(true, 9.81, 0);
  scene.bodies.resize(2);
  scene.joints.resize(2);
  for (int k = 0; k < 2; ++k) {
    scene.bodies[std::size_t(k)].own = sphereMass(0.05, 1000).moved(Mat3::Identity(), {0.5 * k, -0.4 * k, 0});
    scene.bodies[std::size_t(k)].position = {0.5 * k, -0.4 * k, 0};
    scene.joints[std::size_t(k)].parent = -1;
    scene.joints[std::size_t(k)].child = k;
    scene.joints[std::size_t(k)].point = scene.bodies[std::size_t(k)].position;
  }
  Joint &drum = scene.joints[0], &guide = scene.joints[1];
  drum.drive_stiffness = -1; // a motor
  drum.target_motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(6 * pi, 0, 0), Vec3::Zero()}};
  guide.type = Joint::Type::prismatic;
  guide.driven = false;
  guide.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  guide.axes = rotationBy({-0.5 * pi, 0, 0}); // along y
  Tendon t;
  t.name = "hoist";
  Waypoint top, load;
  top.point = {0.5, 1, 0};
  load.body = 1;
  load.point = scene.bodies[1].position;
  t.points = {top, load};
  t.segments = {{0, 1}};
  t.joints = {{0, 0.03}};
  t.actuator.kind = Actuator::Kind::displacement;
  t.actuator.stiffness = 1e5;
  scene.tendons = {t};
  scene.hostBodies();
  Simulation run;
  LoopSettings settings = dynamics(0.01, 1);
  runTo(run, scene, settings);
  EXPECT_NEAR(angleOf(run, 0), 6 * pi, 1e-9);
  const double weight = run.scene.bodies[1].own.mass * 9.81;
  EXPECT_NEAR(run.state.body_position[1][1] + 0.4, 0.03 * 6 * pi - weight / 1e5, 1e-4);
}

/// A tree in a spin far from small, with a joint of each kind: its joints hold to rounding, whatever Newton's path.
TEST(Trees, HoldToRounding) {
  Scene scene = finger(true, 9.81, 0);
  scene.tendons.clear();
  scene.joints[1].type = Joint::Type::ball;
  scene.joints[1].driven = false;
  scene.joints[2].type = Joint::Type::cylindrical;
  scene.joints[2].driven = false;
  for (Joint &j : scene.joints) j.drive_stiffness = j.driven ? 0.5 : -1;
  scene.bodies[2].velocity = {0, 0, 1};
  scene.bodies[2].angular_velocity = Vec3::Zero();
  Simulation run;
  const LoopSettings settings = dynamics(0.02, 2);
  double most = 0, farthest = 0;
  runAndWatch(run, scene, settings, [&](const Diagnostics &) {
    const Configuration c = configurationOf(run.state, run.scene, *run.elements, run.state.time);
    for (int k = 0; k < 3; ++k) {
      const Joint &joint = run.scene.joints[std::size_t(k)];
      const JointPlace place = placeOf(joint, run.elements->pairOf(k), *run.elements, c);
      for (int row = 0; row < coordinate_row; ++row)
        if (holds(joint, row)) most = std::max(most, std::abs(jointRow(joint, place, row).value));
    }
    farthest = std::max(farthest, std::abs(angleOf(run, 0)));
  });
  EXPECT_GT(farthest, 0.9);
  EXPECT_LT(most, 1e-14);
}

} // namespace
} // namespace tendril::test
