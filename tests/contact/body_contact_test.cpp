/// Rigid bodies against obstacles: rest, slide, tip, roll, and nothing passes through.
#include "support/beams.hpp"
#include "support/random_cell.hpp"
#include "support/touching.hpp"
#include "tendril/contact/body_samples.hpp"
#include "tendril/contact/contact.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/geometry/shape.hpp"

namespace tendril::test {
namespace {

Collider floor() {
  Collider floor;
  floor.name = "floor";
  floor.kind = "plane";
  floor.shape = makeHalfSpace();
  return floor;
}

/// Over the plane z = 0, with gravity leaning by an angle towards x; and a rod at rest, for every scene has one.
Scene slope(double angle, const Body &body) {
  Scene scene;
  scene.gravity = earth * Vec3(std::sin(angle), 0, -std::cos(angle));
  scene.rods = {beam({0, 5, 5}, {1, 5, 5}, 2, "rest")};
  scene.rods[0].gravity = scene.rods[0].contact.on = false;
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  scene.bodies = {body};
  scene.colliders = {floor()};
  return scene;
}

LoopSettings by(const std::string &name, double dt, double end) {
  LoopSettings settings = dynamics(dt, end);
  settings.integrator.name = name;
  return settings;
}

/// A box that falls by its own height comes to rest, within the barrier, on the plane.
TEST(BodyContact, ABoxFallsAndRests) {
  const double side = 0.2;
  Simulation run;
  runTo(run,
        slope(0, shaped("box", Vec3::Constant(side), {0, 0, 0.3},
                        Eigen::AngleAxisd(0.3, Vec3(1, 2, 0).normalized()).toRotationMatrix())),
        by("euler", 5e-3, 4));
  const double width = run.scene.bodies[0].contact.distance;
  EXPECT_NEAR(run.state.body_position[0][2], 0.5 * side, 0.5 * width);
  EXPECT_LT(run.state.body_rate[0].spin.norm(), 1e-3);
  EXPECT_LT(run.state.body_rate[0].translation.norm(), 1e-3);
  const Mat3 turned = rotationOf(run.state, run.elements->body(0).group) * run.scene.bodies[0].rotation;
  EXPECT_NEAR(turned.row(2).cwiseAbs().maxCoeff(), 1, 1e-4); // one face is down
}

/// It slides where friction is too small, by the acceleration of a block, and stays where it is not.
TEST(BodyContact, ABoxSlidesOrStays) {
  const double angle = 0.4;
  for (const double friction : {0.0, 0.2, 0.6}) {
    Body box = shaped("box", {0.3, 0.2, 0.1}, {0, 0, 0.05});
    box.contact.friction = friction;
    box.contact.fall_off_velocity = 1e-3;
    Simulation run;
    runTo(run, slope(angle, box), by("bdf2", 5e-3, 0.5));
    const double acceleration = std::max(0.0, earth * (std::sin(angle) - friction * std::cos(angle)));
    EXPECT_NEAR(run.state.body_rate[0].translation[0], 0.5 * acceleration, 0.02 * earth * 0.5) << friction;
    if (friction == 0.6) EXPECT_LT(run.state.body_position[0][0], 2e-3) << friction; // creeps below the fall-off
    EXPECT_NEAR(run.state.body_rate[0].spin.norm(), 0, 0.05) << friction;
  }
}

/// A tall box on a rough slope tips where its weight points beyond its foot.
TEST(BodyContact, ATallBoxTips) {
  for (const double angle : {0.15, 0.35}) { // atan(0.1/0.4) = 0.245
    Body box = shaped("box", {0.1, 0.1, 0.4}, {0, 0, 0.2});
    box.contact.friction = 2;
    Simulation run;
    runTo(run, slope(angle, box), by("euler", 5e-3, 1));
    const Mat3 turned = rotationOf(run.state, run.elements->body(0).group);
    if (angle < 0.245)
      EXPECT_GT(turned(2, 2), 0.999);
    else
      EXPECT_LT(turned(2, 2), 0.2);
  }
}

/// A ball rolls down by 5/7 of the slope, a cylinder across it by 2/3, and without friction they slide.
TEST(BodyContact, BallsAndCylindersRoll) {
  const double angle = 0.2, pull = earth * std::sin(angle);
  for (const std::string shape : {"sphere", "capsule", "cylinder"})
    for (const double friction : {0.0, 0.6}) {
      const Mat3 across = Eigen::AngleAxisd(pi / 2, Vec3::UnitX()).toRotationMatrix(); // its axis along y
      const double radius = 0.1;
      Body body = shaped(shape, {radius, 0.3, 0}, {0, 0, radius}, across);
      body.contact.friction = friction;
      const double about = body.own.inertia(1, 1) / (body.own.mass * radius * radius);
      Simulation run;
      runTo(run, slope(angle, body), by("bdf2", 2e-3, 0.5));
      const double expected = friction > 0 ? pull / (1 + about) : pull;
      // A cylinder is one of 48 sides, which lift it by 0.2 % of its radius.
      EXPECT_NEAR(run.state.body_rate[0].translation[0], 0.5 * expected, 0.03 * expected) << shape << " " << friction;
      EXPECT_NEAR(run.state.body_rate[0].spin[1], friction > 0 ? 0.5 * expected / radius : 0, 0.05 * expected / radius)
          << shape << " " << friction;
    }
}

/// A shot does not pass a thin plate.
TEST(BodyContact, NothingPassesThrough) {
  for (const std::string shape : {"sphere", "box"}) {
    Body shot = shaped(shape, Vec3::Constant(0.05), {0, 0, 0.5});
    shot.velocity = Vec3(3, 0, -100);
    shot.angular_velocity = Vec3(5, 20, 0);
    Scene scene = slope(0, shot);
    scene.colliders[0].kind = "box";
    scene.colliders[0].shape = makeBox({4, 4, 2e-3});
    Simulation run;
    runTo(run, scene, by("euler", 1e-2, 0.1));
    EXPECT_GT(run.state.body_position[0][2], 0) << shape;
    EXPECT_LT(run.state.body_position[0][2], 1) << shape;
  }
}

/// Exact derivatives, by differences of the energy in statics.
TEST(BodyContact, DerivativesAreThoseOfTheEnergy) {
  Body box = shaped("box", {0.2, 0.3, 0.1}, {0.1, 0, 0.0501},
                    Eigen::AngleAxisd(0.002, Vec3(1, 0.5, 0.2).normalized()).toRotationMatrix());
  box.contact.distance = 0.01;
  Scene scene = slope(0.3, box);
  Collider ball = floor();
  ball.name = ball.kind = "sphere";
  ball.shape = makeSphere(0.3);
  ball.position = Vec3(0.1, 0.1, 0.402);
  scene.colliders.push_back(ball);
  Simulation sim;
  LoopSettings settings = statics();
  EXPECT_PETSC(sim.setUp(scene, settings));
  IncrementalPotential &p = *sim.potential;
  const RodSet all = sim.dofs.all();
  p.beginStep(sim.state, TimeLoop::stepOf(settings, sim.state, 1));
  p.beginRod(sim.state, 0);
  Random random(4);
  Planes v = sim.dofs.makePlanes();
  const JoinedBody &b = sim.elements->body(0);
  v.setVector(0, b.position, 1e-3 * random.vector());
  v.setVector(0, b.rotation, 1e-3 * random.vector());
  sim.dofs.copyJoined(all, v);
  const Derivatives &d = p.derivatives();
  const double slope = sim.dofs.dot(all, d.gradient, v);
  Planes kv = sim.dofs.makePlanes();
  d.blocks.multiply(sim.dofs.rods()[0], sim.dofs.joins(0), v, kv);
  sim.dofs.foldJoined(all, kv);
  const double curvature = sim.dofs.dot(all, kv, v), h = 0.02;
  EXPECT_GT(std::abs(slope), 0);
  double e[5];
  Configuration trial;
  for (int k = 0; k < 5; ++k) {
    ASSERT_TRUE(p.tryMove(v, (k - 2) * h, all, RetractionKind::additive, trial));
    e[k] = p.energy(trial, all);
  }
  EXPECT_NEAR((e[0] - 8 * e[1] + 8 * e[3] - e[4]) / (12 * h), slope, 1e-6 * std::abs(slope));
  EXPECT_NEAR((-e[0] + 16 * e[1] - 30 * e[2] + 16 * e[3] - e[4]) / (12 * h * h), curvature, 1e-4 * std::abs(curvature));
}

/// All samples are on the surface, and those of a box have its corners.
TEST(BodyContact, SamplesLieOnTheSurface) {
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const Vec3 at(1, -2, 0.5), centre(0.9, -2, 0.4);
  for (const auto &[kind, size, shape] : {std::tuple("box", Vec3(0.2, 0.5, 0.1), makeBox({0.2, 0.5, 0.1})),
                                          std::tuple("sphere", Vec3(0.3, 0, 0), makeSphere(0.3)),
                                          std::tuple("capsule", Vec3(0.1, 0.4, 0), makeCapsule(0.1, 0.4)),
                                          std::tuple("cylinder", Vec3(0.1, 0.4, 0), makeCylinder(0.1, 0.4))}) {
    Body body;
    body.shape = kind;
    body.size = size;
    body.position = at;
    body.rotation = turn;
    const std::vector<BodySample> samples = surfaceSamples(body, centre);
    EXPECT_GT(samples.size(), 0u);
    for (const BodySample &s : samples)
      EXPECT_NEAR(shape->at(turn.transpose() * (s.arm + centre - at)).value, -s.radius, 1e-12) << kind;
  }
}

} // namespace
} // namespace tendril::test
