/// Friction of tendons: Euler's ratio round cylinders and over points, sticking, hysteresis of the finger, work,
/// restarts.
#include "support/mechanisms.hpp"
#include "support/option_set.hpp"
#include "tendril/energy/capstan.hpp"

namespace tendril::test {
namespace {

constexpr double mass = 2, weight = mass * earth;

/// A load on a rail, drawn along x from x = 0 by a tendon whose actuator is at another place; gravity is the load.
/// \param path from the actuator to what is next to the load
Scene hoist(std::vector<Waypoint> path, std::vector<Wrap> wraps = {}) {
  Scene scene;
  scene.gravity = {earth, 0, 0};
  Body load;
  load.name = "load";
  load.own = {mass, Vec3::Zero(), Vec3(0.01, 0.01, 0.01).asDiagonal()};
  scene.bodies = {load};
  Joint rail{};
  rail.name = "rail";
  rail.type = Joint::Type::prismatic;
  rail.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0; // along x
  rail.child = 0;
  rail.parent = -1;
  scene.joints = {rail};
  Tendon t;
  t.name = "cord";
  path.push_back(ofBody(0, Vec3::Zero()));
  t.points = std::move(path);
  for (int k = 0; k + 1 < int(t.points.size()); ++k) t.segments.push_back({k, k + 1});
  t.wraps = std::move(wraps);
  if (!t.wraps.empty()) t.segments.front().wrap = 0;
  t.actuator.kind = Actuator::Kind::displacement;
  t.actuator.stiffness = 1e5;
  t.slip_length = 1e-5;
  scene.tendons = {t};
  return carried(scene);
}
/// Load steps that do not grow past where inputs turn.
LoopSettings even(int steps) {
  LoopSettings settings = statics(steps);
  settings.output_interval = 1.0 / steps;
  return settings;
}
/// Pulls in, then lets out. \param by way at the times 1/2 and 1 [m]
void pull(Scene &scene, double half, double end) {
  scene.tendons[0].actuator.input_motion.table = {
      {0, Vec3::Zero(), Vec3::Zero()}, {0.5, Vec3(half, 0, 0), Vec3::Zero()}, {1, Vec3(end, 0, 0), Vec3::Zero()}};
}
constexpr double before = 0.03, behind = 0.25; ///< free parts of the cord round a cylinder, as drawn [m]
/// Drawn from a place about a cylinder of radius 0.1, whose lower side the cord leaves along x.
Scene roundCylinder(double angle, double friction, double climb = 0) {
  const Vec3 centre(-behind, 0.1, 0);
  const double turn = -0.5 * pi - angle; // clockwise from below, and on along the tangent
  const Vec3 leaves = centre + 0.1 * Vec3(std::cos(turn), std::sin(turn), 0),
             actuator = leaves + before * Vec3(std::sin(turn), -std::cos(turn), 0) + Vec3(0, 0, climb);
  Wrap wrap{-1, false, 0.1, centre, Vec3::UnitZ(), 1, friction};
  return hoist({ofWorld(actuator)}, {wrap});
}

TEST(Capstan, LawIsTheSlopeOfItsPotential) {
  const double slip = 0.01, exponent = 0.7, h = 1e-7;
  for (const double u : {-0.03, -0.0099, -0.004, -1e-5, 1e-5, 0.003, 0.0098, 0.02}) {
    const CapstanLaw here(u, exponent, slip), less(u - h, exponent, slip), more(u + h, exponent, slip);
    EXPECT_NEAR((more.value - less.value) / (2 * h), here.slope, 1e-7) << u;
    EXPECT_NEAR((more.slope - less.slope) / (2 * h), here.curvature, 1e-5) << u;
    EXPECT_GE(here.curvature, 0);
    if (std::abs(u) > slip) {
      EXPECT_NEAR(here.ratio(), std::exp(u > 0 ? exponent : -exponent), 1e-15) << u;
    }
  }
}

/// The load is the tension at one end, the reading that at the other: up by exp(mu theta) and down by its inverse,
/// where the cord has slid by far more than its slip length.
TEST(Capstan, RatioRoundACylinderIsEulers) {
  for (const double friction : {0.1, 0.3, 0.8})
    for (const double angle : {0.25 * pi, 0.5 * pi, 0.75 * pi, pi})
      for (const bool up : {true, false}) {
        Scene scene = roundCylinder(angle, friction);
        pull(scene, -0.05, up ? -0.1 : 0.02);
        Simulation run;
        int iterations = 0, steps = 0;
        runAndWatch(run, scene, even(20), [&](const Diagnostics &row) {
          iterations += row.newton_iterations;
          ++steps;
        });
        const TendonReading t = readingOf(run);
        const double ratio = std::exp((up ? 1 : -1) * friction * angle);
        EXPECT_NEAR(t.tension, weight * ratio, 1e-6 * weight * ratio) << friction << " " << angle << " " << up;
        EXPECT_NEAR(t.along.part[1], weight, 1e-6 * weight);
        EXPECT_LE(iterations, 22 * steps) << friction << " " << angle << " " << up;
      }
}

/// Along a helix the direction turns by less than the angle about the axis: by the cosine of its climb.
TEST(Capstan, RatioAlongAHelixIsThatOfItsCurvature) {
  Scene scene = roundCylinder(0.75 * pi, 0.4, 0.6);
  pull(scene, -0.05, -0.1);
  Simulation run;
  runTo(run, scene, even(20));
  const double h = before + 0.1 * 0.75 * pi + behind + run.state.body_position[0][0],
               turning = 0.75 * pi * h / std::hypot(h, 0.6), pulls = weight * std::hypot(h, 0.6) / h; // along the rail
  EXPECT_NEAR(readingOf(run).along.part[1], pulls, 1e-6 * pulls);
  EXPECT_NEAR(readingOf(run).tension, pulls * std::exp(0.4 * turning), 1e-5 * pulls);
}

/// Over points of the world: by the sum of the angles; a point without friction has none.
TEST(Capstan, RatioOverPointsIsThatOfTheSumOfAngles) {
  for (const bool up : {true, false}) {
    std::vector<Waypoint> path;
    double angle = 0;
    for (int k = 4; k >= 0; --k) { // turned by 0.3 k from one to the next
      const double to = 0.15 * k * (k + 1);
      Vec3 x = path.empty() ? Vec3(-3, 0.4, 0.2) : Vec3(path.back().point + 0.4 * Vec3(std::cos(to), -std::sin(to), 0));
      if (k == 0) x = {-0.5, 0, 0};
      path.push_back(ofWorld(x));
      path.back().friction = k == 4 ? 0 : k == 2 ? 0 : 0.25;
    }
    std::vector<Vec3> all;
    for (const Waypoint &p : path) all.push_back(p.point);
    all.push_back(Vec3::Zero());
    for (std::size_t k = 1; k + 1 < all.size(); ++k) {
      const Vec3 in = all[k] - all[k - 1], out = all[k + 1] - all[k];
      if (path[k].friction > 0) angle += std::atan2(in.cross(out).norm(), in.dot(out));
    }
    EXPECT_GT(angle, 1);
    Scene scene = hoist(path);
    pull(scene, -0.05, up ? -0.1 : 0.02);
    Simulation run;
    runTo(run, scene, even(20));
    const double ratio = std::exp((up ? 1 : -1) * 0.25 * angle);
    EXPECT_NEAR(readingOf(run).tension, weight * ratio, 1e-6 * weight * ratio) << up;
  }
}

/// Within the cone a given tension holds the load: it goes by no more than the slip length, and cycles of the tension
/// do not make it creep.
TEST(Capstan, SticksWithinItsCone) {
  Scene scene = roundCylinder(pi, 0.3); // holds between 0.39 and 2.57 of the weight
  scene.gravity.setZero();
  scene.bodies[0].force = {weight, 0, 0}; // that grows with the load factor, as the tension does
  Actuator &a = scene.tendons[0].actuator;
  a = {};
  a.kind = Actuator::Kind::force;
  a.input_motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {0.2, Vec3(0.2 * weight, 0, 0), Vec3::Zero()}};
  for (int k = 1; k <= 40; ++k) {
    const double t = 0.2 + 0.02 * k;
    a.input_motion.table.push_back({t,
                                    Vec3(t * weight *
                                             (k % 2 == 0   ? 1
                                              : k % 4 == 1 ? 2.2
                                                           : 0.5),
                                         0, 0),
                                    Vec3::Zero()});
  }
  std::vector<double> place;
  Simulation run;
  runAndWatch(run, scene, even(50), [&](const Diagnostics &) { place.push_back(run.state.body_position[0][0]); });
  double most = 0, last = 0;
  for (std::size_t k = 10; k < place.size(); ++k) most = std::max(most, std::abs(place[k]));
  for (std::size_t k = 14; k + 4 < place.size(); k += 4) last = std::max(last, std::abs(place[k + 4] - place[k]));
  EXPECT_LT(most, 1e-5);
  EXPECT_GT(most, 1e-6) << "it gives";
  EXPECT_LT(last, 1e-9) << "and comes back";
}

/// What a load loses that goes to and fro by s against a spring is friction: (exp(c) - 1) of the spring's force as it
/// is drawn out, (1 - exp(-c)) back, but for what the slip length holds, and the trapezoidal rule of work, which a step
/// misleads in which the cord turns back.
TEST(Capstan, DissipatesTheWorkOfItsFriction) {
  constexpr double c = 0.4 * 0.75 * pi, spring = 400;
  double off[2];
  for (const int finer : {1, 2}) {
    Scene scene = roundCylinder(0.75 * pi, 0.4);
    scene.gravity.setZero();
    scene.joints[0].driven = true;
    scene.joints[0].drive_stiffness = spring;
    scene.tendons[0].slip_length = 1e-6;
    pull(scene, -0.1, 0.05);
    double dissipated = 0, expected = 0, last = 0;
    Simulation run;
    runAndWatch(run, scene, even(200 * finer), [&](const Diagnostics &row) {
      if (row.time > 0) dissipated += row.dissipated;
      const double x = run.state.body_position[0][0];
      expected += (x < last ? std::exp(c) - 1 : 1 - std::exp(-c)) * 0.5 * spring * std::abs(x * x - last * last);
      last = x;
    });
    EXPECT_GT(expected, 4);
    off[finer - 1] = std::abs(dissipated - expected) / expected;
  }
  EXPECT_LT(off[1], 0.005);
  EXPECT_LT(off[1], 0.7 * off[0]) << off[0] << " " << off[1];
}

/// Each hinge of the finger balances its spring by the tension of the part that passes it, at the arm that this has;
/// along the tendon tensions fall by exp(mu angle) at every eyelet as it is pulled, and grow as it is let go.
TEST(Capstan, FingerHasTheHysteresisOfItsAngles) {
  constexpr double friction = 0.3, radius = 0.11180339887498949, phase = 0.4636476090008061;
  Scene scene = finger(true, 0, 0.1);
  scene.tendons[0].points[0].motion.table = {
      {0, Vec3::Zero(), Vec3::Zero()}, {0.5, Vec3(-0.1, 0, 0), Vec3::Zero()}, {1, Vec3(-0.05, 0, 0), Vec3::Zero()}};
  for (std::size_t k = 1; k < 4; ++k) scene.tendons[0].points[k].friction = friction;
  scene.tendons[0].slip_length = 1e-5;
  double pulled = 0, released = 0, sum = 0;
  Simulation run;
  runAndWatch(run, scene, even(40), [&](const Diagnostics &row) {
    const bool out = std::abs(row.time - 0.25) < 1e-9, back = std::abs(row.time - 1) < 1e-9;
    if (!out && !back) return;
    const TendonReading t = readingOf(run);
    double tension = t.tension, last = 0;
    for (int k = 0; k < 3; ++k) {
      const double angle = angleOf(run, k), turns = 0.5 * (last + angle);
      tension *= std::exp((out ? -1 : 1) * friction * turns);
      EXPECT_NEAR(0.5 * angle, tension * radius * std::sin(phase + 0.5 * angle), 1e-6) << k << " " << out;
      last = angle;
      sum += turns;
    }
    (out ? pulled : released) = t.tension;
  });
  // At one place of the slider. Only the last hinge is pulled past all of the angles.
  EXPECT_LT(pulled / released, std::exp(friction * sum)) << pulled << " " << released;
  EXPECT_GT(pulled / released, std::exp(0.5 * friction * sum));
}

/// The finger in time, by every actuator; a step that begins from a state goes to the same bits as one in a run.
TEST(Capstan, GoesOnFromItsState) {
  for (const Actuator::Kind kind : {Actuator::Kind::displacement, Actuator::Kind::force, Actuator::Kind::mckibben}) {
    Scene scene = finger(true, 0, kind == Actuator::Kind::displacement ? 0.06 : 0);
    for (std::size_t k = 1; k < 4; ++k) scene.tendons[0].points[k].friction = 0.3;
    scene.tendons[0].slip_length = 1e-4;
    Actuator &a = scene.tendons[0].actuator;
    a.kind = kind;
    a.braid_length = 0.9;
    a.turns = 2;
    a.muscle_length = 0.8;
    if (kind != Actuator::Kind::displacement)
      a.input_motion.table = {{0, Vec3::Zero(), Vec3::Zero()},
                              {0.5, Vec3(kind == Actuator::Kind::force ? 4 : 2e3, 0, 0), Vec3::Zero()},
                              {1, Vec3::Zero(), Vec3::Zero()}};
    Simulation whole, part;
    State middle;
    double most = 0;
    runAndWatch(whole, scene, dynamics(1.0 / 64, 1), [&](const Diagnostics &row) {
      if (row.time == 0.5) middle = whole.state;
      const TendonReading t = readingOf(whole);
      if (t.tension > 0.1) most = std::max(most, std::abs(std::log(t.along.part.back() / t.tension)));
    });
    EXPECT_GT(most, 0.1) << int(kind);
    EXPECT_PETSC(part.setUp(scene, dynamics(1.0 / 64, 1)));
    part.state = middle;
    TimeLoop loop(part.solver, dynamics(1.0 / 64, 1));
    bool finished = false;
    EXPECT_PETSC(loop.run(
        part.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_TRUE(finished);
    EXPECT_TRUE(part.state == whole.state) << int(kind);
  }
}

/// While the tendon slides one way a method keeps its order.
TEST(Capstan, KeepsTheOrderOfTheMethod) {
  const OptionSet fine("-snes_rtol", "1e-10");
  for (const std::string name : {"euler", "bdf2"}) {
    std::vector<double> end;
    for (const int n : {20, 40, 80, 160}) {
      Scene scene = finger(true, 0, 0);
      for (std::size_t k = 1; k < 4; ++k) scene.tendons[0].points[k].friction = 0.3;
      scene.tendons[0].slip_length = 1e-7;
      Actuator &a = scene.tendons[0].actuator;
      a.stiffness = 300;
      scene.tendons[0].points[0].motion.table = {};
      scene.tendons[0].points[0].motion.amplitude = {-0.15, 0, 0};
      scene.tendons[0].points[0].motion.period = 2;
      for (Joint &j : scene.joints) j.drive_damping = 0.02;
      Simulation run;
      LoopSettings settings = dynamics(0.4 / n, 0.4);
      settings.integrator.name = name;
      int its = 0;
      runTo(run, scene, settings, &its);
      end.push_back(angleOf(run, 0));
    }
    const double order = std::log2((end[1] - end[2]) / (end[2] - end[3]));
    EXPECT_NEAR(order, name == "euler" ? 1 : 2, 0.3) << name << " " << end[0] << " " << end[3];
  }
}

/// A drum that turns freely is drawn along by the cord over it, and one in a bearing that rubs less than the cord does
/// not let it slide: a belt.
TEST(Capstan, DrivesADrumAsABeltDoes) {
  Scene scene = roundCylinder(pi, 0.5);
  Body drum;
  drum.name = "drum";
  drum.own = {1, scene.tendons[0].wraps[0].centre, Vec3(0.01, 0.01, 0.01).asDiagonal()};
  drum.position = drum.own.centre;
  drum.gravity = false;
  scene.bodies.push_back(drum);
  scene.tendons[0].wraps[0].body = 1;
  Joint axle{};
  axle.name = "axle";
  axle.type = Joint::Type::hinge;
  axle.child = 1;
  axle.parent = -1;
  axle.point = drum.own.centre;
  axle.axes = Mat3::Identity();
  axle.driven = true;
  axle.drive_stiffness = 2; // [N m/rad]
  scene.joints.push_back(axle);
  scene.hostBodies();
  pull(scene, -0.02, -0.04);
  Simulation run;
  runTo(run, scene, even(40));
  const TendonReading t = readingOf(run);
  const double went = -run.state.body_position[0][0], angle = angleOf(run, 1);
  EXPECT_NEAR(0.1 * std::abs(angle), went, 2e-5) << "it goes with the cord";
  EXPECT_NEAR(t.tension - t.along.part[1], 2 * std::abs(angle) / 0.1, 1e-5 * t.tension);
  EXPECT_LT(t.tension, 0.9 * weight * std::exp(0.5 * pi));
}

/// A rigid tendon is the limit of stiff ones: what these leave falls as 1/k, and one extrapolates to it.
TEST(RigidTendon, IsTheLimitOfStiffOnes) {
  std::array<double, 3> first{}, second{}, limit{};
  auto rests = [](double stiffness, int *iterations, int *steps) {
    Scene scene = finger(true, 9.81, 0.1);
    Actuator &a = scene.tendons[0].actuator;
    a.rigid = stiffness == 0;
    a.stiffness = stiffness;
    Simulation run;
    runAndWatch(run, scene, statics(4), [&](const Diagnostics &row) {
      *iterations += row.newton_iterations;
      ++*steps;
    });
    const TendonReading t = readingOf(run);
    if (stiffness == 0) EXPECT_NEAR(t.displacement, 0, 1e-12);
    return std::array<double, 3>{angleOf(run, 0), angleOf(run, 2), t.tension};
  };
  int iterations = 0, steps = 0, other = 0;
  first = rests(1e5, &other, &other);
  second = rests(2e5, &other, &other);
  limit = rests(0, &iterations, &steps);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(limit[k], 2 * second[k] - first[k], 1e-6 * std::abs(limit[k])) << k; // of the second order
    EXPECT_GT(std::abs(limit[k] - second[k]), 1e-6) << k;
  }
  EXPECT_LE(iterations, 10 * steps);
}

/// Slack and taut again in time, with its tension nowhere negative, and never longer than its target; from a state in
/// the middle on to the same bits.
TEST(RigidTendon, GoesSlackAndTaut) {
  Scene scene = finger(true, 0, 0.05);
  scene.tendons[0].actuator.rigid = true;
  for (std::size_t k = 1; k < 4; ++k) scene.tendons[0].points[k].friction = 0.1;
  scene.tendons[0].slip_length = 1e-5;
  scene.tendons[0].points[0].motion.table = {
      {0, Vec3::Zero(), Vec3::Zero()}, {0.4, Vec3(-0.05, 0, 0), Vec3::Zero()}, {0.45, Vec3::Zero(), Vec3::Zero()}};
  for (Joint &j : scene.joints) j.drive_damping = 0.01;
  const LoopSettings settings = dynamics(1.0 / 64, 2);
  Simulation whole, part;
  State middle;
  int changes = 0;
  bool taut = false;
  runAndWatch(whole, scene, settings, [&](const Diagnostics &row) {
    const TendonReading t = readingOf(whole, true);
    EXPECT_GE(t.tension, 0);
    EXPECT_LT(t.displacement, 1e-9);
    if (t.tension > 0) EXPECT_NEAR(t.displacement, 0, 1e-9);
    if (row.time == 0.25) middle = whole.state;
    changes += (t.tension > 0) != taut;
    taut = t.tension > 0;
  });
  EXPECT_GE(changes, 2);
  EXPECT_GT(middle.tendon_memory.back(), 1);
  EXPECT_PETSC(part.setUp(scene, settings));
  part.state = middle;
  TimeLoop loop(part.solver, settings);
  bool finished = false;
  EXPECT_PETSC(loop.run(
      part.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_TRUE(finished && part.state == whole.state);
}

} // namespace
} // namespace tendril::test
