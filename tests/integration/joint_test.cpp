/// Joints between bodies against reference solutions and closed forms.
#include "support/beams.hpp"
#include "support/random_cell.hpp"
#include "tendril/energy/joint.hpp"
#include "tendril/geometry/rotation.hpp"

namespace tendril::test {
namespace {

Body bodyOf(const std::string &name, const MassProperties &own, const Vec3 &at, const Mat3 &turn = Mat3::Identity()) {
  Body body;
  body.name = name;
  body.own = own.moved(turn, at);
  body.position = at;
  body.rotation = turn;
  return body;
}

Joint jointOf(Joint::Type type, int child, int parent, const Vec3 &point, const Vec3 &axis = Vec3::UnitZ()) {
  Joint joint{};
  joint.name = "joint";
  joint.type = type;
  joint.child = child;
  joint.parent = parent;
  joint.point = point;
  const Vec3 across = axis.unitOrthogonal();
  joint.axes << across, axis.cross(across), axis;
  return joint;
}

/// A rod at rest, for every scene has one.
Scene besideARod(const Vec3 &gravity) {
  Scene scene;
  scene.gravity = gravity;
  scene.rods = {beam({0, 5, 0}, {1, 5, 0}, 2, "rest")};
  scene.rods[0].gravity = false;
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  return scene;
}

/// Of a thin uniform bar of some mass and length along a direction in the plane of x and y.
MassProperties barMass(double mass, double length, double angle) {
  MassProperties own{mass, Vec3::Zero(), Vec3(1e-9, 1, 1).asDiagonal() * (mass * length * length / 12)};
  own.inertia(0, 0) = 1e-4 * own.inertia(1, 1);
  own.inertia(2, 2) = own.inertia(1, 1); // in its plane no other counts
  return own.moved(Eigen::AngleAxisd(angle, Vec3::UnitZ()).toRotationMatrix(), Vec3::Zero());
}

LoopSettings dynamicsBy(const std::string &name, double dt, double end) {
  LoopSettings settings = dynamics(dt, end);
  settings.integrator.name = name;
  return settings;
}

/// How far an exact joint is off.
double missed(const Simulation &run) {
  const Configuration c = configurationOf(run.state, run.scene, *run.elements, run.state.time);
  double most = 0;
  for (int k = 0; k < int(run.scene.joints.size()); ++k) {
    const Joint &joint = run.scene.joints[std::size_t(k)];
    const JointPlace place = placeOf(joint, run.elements->pairOf(k), *run.elements, c);
    for (int row = 0; row < coordinate_row; ++row)
      if (holds(joint, row)) most = std::max(most, std::abs(jointRow(joint, place, row).value));
  }
  return most;
}

/// Lagrange's top and a spherical pendulum with inertia, by quadratures.
TEST(Joints, ATopOnABallConvergesAtTheOrderOfItsMethod) {
  for (const std::string which : {"bar", "top"}) {
    const bool top = which == "top";
    auto row = referenceRow("bodies_ball_" + which + ".csv", 0.5);
    const Mat3 turn = Eigen::AngleAxisd(top ? 0.4 : 1.0, Vec3::UnitX()).toRotationMatrix();
    // What counts is the inertia about the joint, and mass times centre: 0.04 and 0.6 kg m. With the reference's own
    // mass that inertia would be none of a body.
    const Vec3 centre(0, 0, top ? 0.05 : -0.1);
    const double mass = top ? 0.8 : 6, nearer = top ? 0.05 / 0.08 : 0.1 / 0.5;
    const Mat3 about_joint = (top ? Vec3(0.004, 0.004, 0.0025) : Vec3(0.1, 0.1, 0.0006)).asDiagonal();
    const Mat3 own = about_joint - mass * (centre.squaredNorm() * Mat3::Identity() - centre * centre.transpose());
    Scene scene = besideARod({0, 0, -9.81});
    scene.bodies = {bodyOf("top", {mass, centre, own}, Vec3::Zero(), turn)};
    scene.bodies[0].angular_velocity = turn * Vec3(0, top ? 0 : 1.5, top ? 60 : 0);
    scene.bodies[0].velocity = scene.bodies[0].angular_velocity.cross(turn * centre);
    scene.joints = {jointOf(Joint::Type::ball, 0, -1, Vec3::Zero())};
    const Vec3 expected = nearer * Vec3(row["cx"], row["cy"], row["cz"]);
    for (const std::string name : {"bdf2", "generalized_alpha"}) {
      double off[2];
      for (const int k : {0, 1}) {
        Simulation run;
        runTo(run, scene, dynamicsBy(name, (top ? 1e-3 : 5e-3) / (1 + k), 0.5));
        off[k] = (run.state.body_position[0] - expected).norm();
        EXPECT_LT(missed(run), 1e-9) << which << " " << name;
      }
      EXPECT_GT(order(off[0], off[1]), 1.8) << which << " " << name << ": " << off[0] << " " << off[1];
      EXPECT_LT(off[1], 5e-3 * centre.norm()) << which << " " << name;
    }
  }
}

/// Two bars in a chain.
TEST(Joints, ADoublePendulumSwingsAsItShould) {
  auto row = referenceRow("bodies_double_pendulum.csv", 1);
  const Vec3 elbow = 0.5 * Vec3(std::sin(row["a"]), -std::cos(row["a"]), 0),
             tip = elbow + 0.4 * Vec3(std::sin(row["b"]), -std::cos(row["b"]), 0);
  Scene scene = besideARod({0, -9.81, 0});
  scene.bodies = {bodyOf("upper", barMass(1, 0.5, 0), {0.25, 0, 0}),
                  bodyOf("lower", barMass(0.7, 0.4, 0), {0.7, 0, 0})};
  scene.joints = {jointOf(Joint::Type::hinge, 0, -1, {0, 0, 0}), jointOf(Joint::Type::hinge, 1, 0, {0.5, 0, 0})};
  double off[2];
  for (const int k : {0, 1}) {
    Simulation run;
    runTo(run, scene, dynamicsBy("bdf2", 5e-3 / (1 + k), 1));
    off[k] = (run.state.body_position[1] - 0.5 * (elbow + tip)).norm();
    EXPECT_LT(missed(run), 1e-9);
    EXPECT_NEAR(run.state.joints[0].coordinate, row["a"] - pi / 2, 100 * off[k]);
  }
  EXPECT_GT(order(off[0], off[1]), 1.8) << off[0] << " " << off[1];
  EXPECT_LT(off[1], 2e-3);
}

/// A closed loop of four hinges, in space: three of its equations say what others say already.
TEST(Joints, AFourBarStaysClosed) {
  for (const std::string which : {"0", "12"}) {
    auto row = referenceRow("bodies_four_bar_" + which + ".csv", 0.5);
    const double angle = which == "0" ? 1 : 0.5, rate = which == "0" ? 0 : 12;
    const Vec3 c(0.7, 0, 0), a = 0.2 * Vec3(std::cos(angle), std::sin(angle), 0);
    // B from A and C: left of the way from A to C.
    const Vec3 ac = c - a;
    const double d = ac.norm(), along = (0.36 - 0.16 + d * d) / (2 * d), up = std::sqrt(0.36 - along * along);
    const Vec3 b = a + along * ac / d + up * Vec3(-ac[1], ac[0], 0) / d;
    const Vec3 va = rate * Vec3(-a[1], a[0], 0);
    // Spins w of the coupler and of the rocker: va + w1 z x (b - a) = w2 z x (b - c).
    Eigen::Matrix2d m;
    m << -(b - a)[1], (b - c)[1], (b - a)[0], -(b - c)[0];
    const Eigen::Vector2d w = m.colPivHouseholderQr().solve(-va.head<2>());
    Scene scene = besideARod({0, -9.81, 0});
    auto bar = [&](const Vec3 &from, const Vec3 &to, double spin, const Vec3 &velocity) {
      const Vec3 e = to - from;
      Body body = bodyOf("bar" + std::to_string(scene.bodies.size()),
                         barMass(2 * e.norm(), e.norm(), std::atan2(e[1], e[0])), 0.5 * (from + to));
      body.angular_velocity = spin * Vec3::UnitZ();
      body.velocity = velocity + 0.5 * body.angular_velocity.cross(e);
      scene.bodies.push_back(body);
    };
    bar(Vec3::Zero(), a, rate, Vec3::Zero());
    bar(a, b, w[0], va);
    bar(c, b, w[1], Vec3::Zero());
    scene.joints = {jointOf(Joint::Type::hinge, 0, -1, {0, 0, 0}), jointOf(Joint::Type::hinge, 1, 0, a),
                    jointOf(Joint::Type::hinge, 2, 1, b), jointOf(Joint::Type::hinge, 2, -1, c)};
    double off[2];
    for (const int k : {0, 1}) {
      Simulation run;
      runTo(run, scene, dynamicsBy("bdf2", 2e-3 / (1 + k), 0.5));
      off[k] = (run.state.body_position[2] - 0.5 * (c + Vec3(row["Bx"], row["By"], 0))).norm();
      EXPECT_LT(missed(run), 1e-9) << which;
    }
    EXPECT_GT(order(off[0], off[1]), 1.7) << which << ": " << off[0] << " " << off[1];
    EXPECT_LT(off[1], 2e-3) << which;
  }
}

/// Springs in place of a hinge come to it as 1/k.
TEST(Joints, SpringsComeToTheExactJoint) {
  auto scene = [](double stiffness) {
    Scene scene = besideARod({0, -9.81, 0});
    scene.bodies = {bodyOf("bar", barMass(1, 0.5, 0), {0.25, 0, 0})};
    scene.joints = {jointOf(Joint::Type::hinge, 0, -1, {0, 0, 0})};
    scene.joints[0].driven = true;
    scene.joints[0].drive_stiffness = 20;
    if (stiffness > 0) scene.joints[0].stiffness = scene.joints[0].rotational_stiffness = stiffness;
    return scene;
  };
  Simulation exact;
  runTo(exact, scene(0), statics());
  // 20 q = 9.81/4 cos q
  const double q = exact.state.joints[0].coordinate;
  EXPECT_NEAR(20 * q + 9.81 / 4 * std::cos(q), 0, 1e-5);
  EXPECT_LT(missed(exact), 1e-9);
  double off[4];
  for (int k = 0; k < 4; ++k) {
    Simulation run;
    runTo(run, scene(std::pow(10, 3 + k)), statics());
    off[k] = (run.state.body_position[0] - exact.state.body_position[0]).norm();
    if (k > 0) EXPECT_NEAR(off[k - 1] / off[k], 10, 0.5) << k;
  }
  EXPECT_NEAR(off[0], 9.81 / 1e3, 1e-4);
}

/// A bar that falls stops at the end of its range, by a spring or exactly; and what holds it there is its weight.
TEST(Joints, RangesEnd) {
  for (const double stiffness : {-1.0, 1e4}) {
    Scene scene = besideARod({0, -9.81, 0});
    scene.bodies = {bodyOf("bar", barMass(1, 0.5, 0), {0.25, 0, 0})};
    scene.joints = {jointOf(Joint::Type::hinge, 0, -1, {0, 0, 0})};
    scene.joints[0].lower = -0.5;
    scene.joints[0].upper = 1;
    scene.joints[0].range_stiffness = stiffness;
    Simulation run;
    runTo(run, scene, dynamicsBy("euler", 5e-3, 4));
    const double moment = 9.81 / 4 * std::cos(0.5);
    EXPECT_NEAR(run.state.joints[0].coordinate, -0.5 - (stiffness > 0 ? moment / stiffness : 0), 2e-6) << stiffness;
    const JointReading of = readJoint(run.scene, *run.elements, 0, run.state,
                                      configurationOf(run.state, run.scene, *run.elements, run.state.time), true);
    EXPECT_NEAR(of.moment[2], 9.81 / 4 * std::cos(of.coordinate), 1e-4) << stiffness;
    EXPECT_NEAR(of.force[1], 9.81, 1e-3) << stiffness;
  }
}

/// A motor turns a bar exactly; its couple is what the weight and the inertia ask for, and its work theirs.
TEST(Joints, DrivesAreExact) {
  Scene scene = besideARod({0, -9.81, 0});
  scene.bodies = {bodyOf("bar", barMass(1, 0.5, 0), {0.25, 0, 0})};
  scene.joints = {jointOf(Joint::Type::hinge, 0, -1, {0, 0, 0})};
  scene.joints[0].driven = true;
  scene.joints[0].target_motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {2, Vec3(3 * pi, 0, 0), Vec3::Zero()}};
  Simulation run;
  runTo(run, scene, dynamicsBy("bdf2", 5e-3, 1));
  EXPECT_NEAR(run.state.joints[0].coordinate, 1.5 * pi, 1e-9);
  const JointReading of = readJoint(run.scene, *run.elements, 0, run.state,
                                    configurationOf(run.state, run.scene, *run.elements, run.state.time), true);
  EXPECT_NEAR(of.drive, 9.81 / 4 * std::cos(1.5 * pi), 1e-2); // steady after the jerk at the start
  EXPECT_NEAR((run.state.body_position[0] - Vec3(0, -0.25, 0)).norm(), 0, 1e-9);
  // A slide under its weight, up a slope by a motor: in statics the force is that of the weight along it.
  Scene slope = besideARod({0, -9.81, 0});
  slope.bodies = {bodyOf("box", boxMass({0.1, 0.1, 0.1}, 1000), {1, 0, 0})};
  slope.joints = {jointOf(Joint::Type::prismatic, 0, -1, {1, 0, 0}, Vec3(0.8, 0.6, 0))};
  slope.joints[0].driven = true;
  slope.joints[0].target_motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(0.5, 0, 0), Vec3::Zero()}};
  Simulation up;
  runTo(up, slope, statics(2));
  EXPECT_LT((up.state.body_position[0] - Vec3(1.4, 0.3, 0)).norm(), 1e-9);
  const JointReading push = readJoint(up.scene, *up.elements, 0, up.state,
                                      configurationOf(up.state, up.scene, *up.elements, up.state.time), false);
  EXPECT_NEAR(push.drive, 9.81 * 0.6, 1e-5);
  EXPECT_LT((push.force - Vec3(0, 9.81, 0)).norm(), 1e-5);
}

/// Bodies and rods in one assembly that nothing holds: joints make no force from outside.
TEST(Joints, AFreeAssemblyKeepsItsMomenta) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 8, "rod")};
  scene.bodies = {bodyOf("a", boxMass({0.1, 0.2, 0.3}, 100), {-0.05, 0.02, 0}),
                  bodyOf("b", boxMass({0.2, 0.1, 0.1}, 200), {-0.3, 0.1, 0.03}),
                  bodyOf("c", boxMass({0.2, 0.2, 0.1}, 100), {-0.6, 0, 0})};
  scene.bodies[0].angular_velocity = Vec3(0.5, -0.2, 1);
  scene.bodies[2].velocity = Vec3(0, 0.4, -0.1);
  scene.attachments = {{"tie", 0, 0, 0, true, frameAtVertex(scene.rods[0], 0)}};
  scene.joints = {jointOf(Joint::Type::hinge, 1, 0, {-0.15, 0, 0}, Vec3(0, 0.6, 0.8)),
                  jointOf(Joint::Type::ball, 2, 1, {-0.5, 0.1, 0})};
  scene.joints[1].name = "other";
  scene.joints[1].upper = 0.2;
  auto momenta = [](const Simulation &run) {
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    const Elements &e = *run.elements;
    for (int v = 0; v <= 8; ++v) {
      const Vec3 p = e.mass()[e.vertex_slot[std::size_t(v)]] * run.state.velocity[std::size_t(v)];
      linear += p;
      angular += run.state.position[std::size_t(v)].cross(p);
    }
    for (int b = 0; b < 3; ++b) {
      const Vec3 p = e.bodyMass(b).mass * run.state.body_rate[std::size_t(b)].translation;
      linear += p;
      angular += run.state.body_position[std::size_t(b)].cross(p) + run.state.body_rate[std::size_t(b)].momentum;
    }
    return std::array{linear, angular};
  };
  Simulation first, run;
  EXPECT_PETSC(first.setUp(scene, dynamicsBy("bdf2", 2e-3, 0.4)));
  runTo(run, scene, dynamicsBy("bdf2", 2e-3, 0.4));
  const auto before = momenta(first), after = momenta(run);
  EXPECT_LT(missed(run), 1e-9);
  EXPECT_GT((run.state.body_position[2] - first.state.body_position[2]).norm(), 0.02);
  EXPECT_LT((after[0] - before[0]).norm(), 1e-5 * before[0].norm());
  EXPECT_LT((after[1] - before[1]).norm(), 1e-2 * before[1].norm()); // of second order (Bodies)
}

} // namespace
} // namespace tendril::test
