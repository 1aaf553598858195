/// Contact with obstacles: its laws, samples and derivatives, and what never passes through.
#include "tendril/contact/contact.hpp"

#include "support/differences.hpp"
#include "support/rods.hpp"
#include "tendril/energy/derived.hpp"

namespace tendril::test {
namespace {

std::vector<std::vector<double>> rowsOf(const std::string &file) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/" + file);
  EXPECT_TRUE(in) << file;
  std::vector<std::vector<double>> rows;
  bool named = false;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    if (!named) {
      named = true;
      continue;
    }
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  return rows;
}

Collider floorAt(double height) {
  Collider c;
  c.name = "floor";
  c.shape = makeHalfSpace();
  c.position = Vec3(0, 0, height);
  return c;
}

Collider obstacle(std::shared_ptr<const Shape> shape, const Vec3 &position) {
  Collider c;
  c.name = "obstacle";
  c.shape = std::move(shape);
  c.position = position;
  return c;
}

ContactSettings barrier(double radius) {
  ContactSettings s;
  s.radius = radius;
  s.distance = 0.2 * radius;
  return s;
}

/// A round rod of rubber of radius 5 mm along x, its axis at a height.
Rod rubber(int edges, double height, double length = 0.3) {
  Rod rod;
  rod.name = "rod";
  rod.position = lineShape(Vec3(0, 0, height), Vec3(length, 0, height), edges).points;
  rod.material = homogeneousMaterial({SectionShape::circle, {0.005, 0}}, 1e6, 4e5, 1000);
  rod.contact = barrier(0.005);
  setBishopDirectors(rod);
  return rod;
}

TEST(ContactLaws, PenaltyIsThatOfTheTable) {
  for (const auto &row : rowsOf("contact_penalty_law.csv")) {
    ContactSettings s;
    s.law = ContactSettings::Law::penalty;
    s.stiffness = row[0];
    s.smoothing = row[1];
    s.threshold = row[2];
    const GapLaw law = NormalLaw(s, 0)(row[4]);
    EXPECT_NEAR(law.value, row[5], 1e-13 * row[5]) << row[4];
    EXPECT_NEAR(-law.slope, row[6], 1e-12 * row[6]) << row[4]; // the table's last digits
    EXPECT_NEAR(law.curvature, row[7], 1e-12 * row[7]) << row[4];
  }
}

TEST(ContactLaws, DerivativesAreThoseOfTheValue) {
  ContactSettings s = barrier(0.005);
  for (const bool is_barrier : {true, false}) {
    s.law = is_barrier ? ContactSettings::Law::barrier : ContactSettings::Law::penalty;
    s.stiffness = 1e7;
    const NormalLaw law(s, 30);
    for (double t = 0.01; t < 1; t += 0.03) {
      const double g = is_barrier ? (t - 0.5) * s.distance : s.threshold - 3 * t * s.smoothing;
      const double h = 1e-5 * (is_barrier ? t * s.distance : s.smoothing);
      const GapLaw here = law(g), ahead = law(g + h), behind = law(g - h);
      // Of second order in h = 1e-5 t, over which the barrier's derivatives grow by 1/t: 1e-8.
      EXPECT_NEAR((ahead.value - behind.value) / (2 * h), here.slope, 1e-7 * std::abs(here.slope) + 1e-9) << g;
      EXPECT_NEAR((ahead.slope - behind.slope) / (2 * h), here.curvature, 1e-8 * here.curvature + 1e-3) << g;
      EXPECT_GE(here.curvature, 0);
      EXPECT_LE(here.slope, 0);
    }
  }
}

/// Line force over stiffness at which the gap is this part of the width (Li et al. 2020): from the formula, worked out
/// by hand for three of them.
TEST(ContactLaws, BarrierGrowsWithoutBound) {
  const ContactSettings s = barrier(1);
  const NormalLaw law(s, 1);
  auto force = [&](double part) { return -law((part - 0.5) * s.distance).slope; };
  EXPECT_NEAR(force(0.5), 0.25 / 0.5 + 2 * 0.5 * std::log(2.0), 1e-14);
  EXPECT_NEAR(force(1e-4) * 1e-4, 1, 3e-3); // 1/t, and 2 ln t beside it
  EXPECT_EQ(force(1.0), 0);
  EXPECT_EQ(law(-0.5 * s.distance).value, std::numeric_limits<double>::infinity());
}

TEST(ContactSamples, IntegrateStraightLinesExactly) {
  for (int quadrature = 0; quadrature <= 3; ++quadrature)
    for (const double spacing : {10.0, 0.4, 0.11}) {
      double sum = 0, moment = 0;
      for (const SamplePoint &p : samplePoints(quadrature, 1, spacing)) {
        sum += p.weight;
        moment += p.weight * p.at;
      }
      EXPECT_NEAR(sum, 1, 1e-15);
      EXPECT_NEAR(moment, 0.5, 1e-15);
    }
}

/// A rod in the gap between a ball, a box's corner and a cylinder that it touches, with random turns and places.
Scene cornerScene(bool penalty) {
  Scene scene;
  scene.gravity = Vec3(0, 0, -9.81);
  Rod rod = rubber(12, 0.02);
  if (penalty) {
    rod.contact.law = ContactSettings::Law::penalty;
    rod.contact.stiffness = 1e7;
  }
  scene.rods = {rod};
  const Vec3 turn(0.3, 0.5, -0.2);
  const Mat3 turned = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  auto touch = [&](std::shared_ptr<const Shape> shape, const Vec3 &position, const Mat3 &rotation) {
    Collider c = obstacle(std::move(shape), position);
    c.rotation = rotation;
    Distance least{HUGE_VAL, Vec3::Zero(), Mat3::Zero()};
    for (double x = 0; x <= 0.3; x += 1e-4)
      if (const Distance d = c.shape->at(c.poseAt(0).toLocal(Vec3(x, 0, 0.02))); d.value < least.value) least = d;
    c.position += (least.value - 0.00505) * (rotation * least.gradient); // the surface 0.05 mm from that of the rod
    scene.colliders.push_back(c);
  };
  touch(makeSphere(0.05), Vec3(0.05, 0.01, -0.05), Mat3::Identity());
  touch(makeBox(Vec3(0.1, 0.1, 0.1)), Vec3(0.17, 0.07, 0.02), turned);
  touch(makeCylinder(0.02, 0.1), Vec3(0.27, -0.05, 0.03), turned.transpose());
  return scene;
}

TEST(Contact, DerivativesAreThoseOfTheEnergy) {
  for (const bool penalty : {false, true}) {
    Simulation sim;
    EXPECT_PETSC(sim.setUp(cornerScene(penalty), dynamics(1e-3, 1)));
    IncrementalPotential &potential = *sim.potential;
    Step step;
    step.dt = 1e-3;
    step.time = 1e-3;
    step.mixed = false;
    sim.solver.begin(sim.state, step);
    ASSERT_GT(potential.energyBudget(sim.state, potential.iterate(), 1, potential.all()).contact, penalty ? 1e-9 : -1);
    Random random{5};
    // 30 h^4 over the barrier's width, and rounding over h^2.
    expectDerivatives(potential, randomIncrement(potential, random, 1e-3, 1e-3), 2e-3, 1e-7, 1e-5,
                      penalty ? "penalty" : "barrier");
  }
}

/// A rod at rest on a plane lies where force per length and weight balance, whatever its edges
/// (contact_rest_depth.csv).
TEST(Contact, RestsAtTheDepthOfItsLaw) {
  for (const auto &row : rowsOf("contact_rest_depth.csv"))
    for (const int edges : {1, 7}) {
      Scene scene;
      scene.gravity = Vec3(0, 0, -9.81);
      Rod rod = rubber(edges, 0.9e-3);
      rod.material = homogeneousMaterial({SectionShape::circle, {row[0], 0}}, 1e7, 4e6, row[1]);
      rod.contact.law = ContactSettings::Law::penalty;
      rod.contact.radius = 0;
      rod.contact.stiffness = row[2];
      rod.contact.smoothing = row[3];
      rod.contact.threshold = row[4];
      scene.rods = {rod};
      scene.colliders = {floorAt(0)};
      Simulation sim;
      runTo(sim, scene, dynamics(0.1, 3));
      for (const Vec3 &x : sim.state.position) EXPECT_NEAR(x[2], row[6], 1e-9) << row[0] << " " << edges;
    }
}

/// contact_bounce.csv: a rod that falls flat on the penalty of the defaults. It comes back as high as it fell from.
TEST(Contact, BouncesAsItsLawSays) {
  for (const auto &row : rowsOf("contact_bounce.csv")) {
    const double radius = row[0], height = row[1], deepest = row[3], duration = row[5], onset = 1e-3;
    if (height < 0.01) continue; // a tenth of its fall is in the law
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    Rod rod = rubber(2, onset + height);
    rod.material = homogeneousMaterial({SectionShape::circle, {radius, 0}}, 1e6, 4e5, 1000);
    rod.contact = {};
    rod.contact.law = ContactSettings::Law::penalty;
    rod.contact.stiffness = 1e9;
    scene.rods = {rod};
    scene.colliders = {floorAt(0)};
    std::vector<double> wrong;
    for (const double parts : {50, 100}) {
      LoopSettings settings = dynamics(duration / parts, 2 * std::sqrt(2 * height / 9.81) + duration);
      settings.integrator.name = "midpoint";
      Simulation sim;
      EXPECT_PETSC(sim.setUp(scene, settings));
      TimeLoop loop(sim.solver, settings);
      bool finished = false;
      double lowest = HUGE_VAL, touching = 0;
      EXPECT_PETSC(loop.run(
          sim.state,
          [&](const State &state, const Diagnostics &step) {
            lowest = std::min(lowest, state.position[1][2]);
            if (step.contact_gap_min < onset) touching += step.dt;
            return PetscErrorCode(0);
          },
          &finished));
      ASSERT_TRUE(finished) << loop.failure();
      EXPECT_NEAR(sim.state.position[1][2] - onset, height, 0.01 * height) << radius << " " << height;
      EXPECT_NEAR(touching, duration, 2.5 * duration / parts);
      wrong.push_back(lowest - deepest);
    }
    const double depth = onset - deepest;
    EXPECT_NEAR(wrong[0], 0, 3e-3 * depth); // falls with the square of the step, as where the steps lie
    EXPECT_NEAR(wrong[1], 0, 1e-3 * depth);
  }
}

/// The moment at the clamp is the root of 2 B w H, whatever the height (contact_lowering.csv), with H to where the rod
/// comes to lie.
TEST(Contact, LoweredOntoAPlaneBearsTheMomentOfItsHeight) {
  for (const double height : {0.35, 1.0, 3.0}) {
    const double length = 3 + 3 * std::sqrt(height);
    std::vector<double> errors;
    for (const int edges : {120, 240}) {
      Rod rod = inextensibleRod(lineShape(Vec3(0, 0, height + 0.01), Vec3(length, 0, height + 0.01), edges).points);
      rod.material = {1, 1e-6, 1e6, 1, {1, 1}, 0, 0};
      rod.contact = barrier(0.01);
      Scene scene = clampedScene(rod);
      scene.gravity = Vec3(0, 0, -1);
      scene.colliders = {floorAt(0)};
      Simulation sim;
      runTo(sim, scene, statics());
      double lowest = HUGE_VAL;
      for (const Vec3 &x : sim.state.position) lowest = std::min(lowest, x[2]);
      EXPECT_GT(lowest, 0.01 - 0.001); // half of the barrier's width
      double rest = 0;                 // of the last part, which lies
      for (int i = edges; i > edges - 5; --i) rest += sim.state.position[i][2] / 5;
      const RodActions actions = rodActions(sim.scene, *sim.elements, sim.state, 1, 1);
      const double moment = actions.reaction_moment[0].norm(), exact = std::sqrt(2 * (height + 0.01 - rest));
      errors.push_back(std::abs(moment / exact - 1));
      // What is left of the vertical balance is at the clamp.
      double contact = 0;
      for (const Vec3 &f :
           contactForces(*sim.elements, contactReadings(sim.scene, *sim.elements, sim.state,
                                                        configurationOf(sim.state, sim.scene, *sim.elements, 1))))
        contact += f[2];
      EXPECT_NEAR(contact + actions.reaction[0][2], length, 1e-5 * length);
    }
    EXPECT_LT(errors[1], 1e-3) << height;
    EXPECT_GT(order(errors[0], errors[1]), 1.5) << height << ": " << errors[0] << " " << errors[1];
  }
}

/// Thrown at a plate of 1 mm, flat, slanting and with the tip first: nothing is ever behind it.
TEST(Contact, NothingPassesAThinPlate) {
  for (const double speed : {1.0, 10.0, 100.0, 1000.0})
    for (const double dt : {1e-2, 1e-3})
      for (const double slope : {0.0, 0.15, 1.5707}) {
        if (slope > 1 && speed > 100) continue; // faster than the sound in the rod, 1000 m/s
        Rod rod = rubber(30, 0.05);
        rod.material = homogeneousMaterial({SectionShape::circle, {0.005, 0}}, 1e9, 4e8, 1000);
        rod.energy = Energy::classical;
        for (Vec3 &x : rod.position) x = Vec3(x[0] * std::cos(slope), 0, x[2] + x[0] * std::sin(slope));
        setBishopDirectors(rod, Vec3(0, 1, 0));
        rod.initial_velocity = Vec3(0, 0, -speed);
        Scene scene;
        scene.gravity = Vec3(0, 0, -9.81);
        scene.rods = {rod};
        scene.colliders = {obstacle(makeBox(Vec3(2, 2, 1e-3)), Vec3(0, 0, -0.5e-3))};
        Simulation sim;
        const LoopSettings settings = dynamics(dt, 20 * dt);
        EXPECT_PETSC(sim.setUp(scene, settings));
        TimeLoop loop(sim.solver, settings);
        bool finished = false;
        EXPECT_PETSC(loop.run(
            sim.state,
            [&](const State &state, const Diagnostics &row) {
              for (const Vec3 &x : state.position)
                if (x.head<2>().norm() < 0.9) EXPECT_GT(x[2], 0.0045) << speed << " " << dt << " " << slope;
              if (row.time > 0) EXPECT_GT(row.contact_gap_min, -0.0005);
              EXPECT_LE(row.newton_iterations, 100);
              return PetscErrorCode(0);
            },
            &finished));
        EXPECT_TRUE(finished) << loop.failure() << speed << " " << dt << " " << slope;
      }
}

TEST(Contact, ThatIsFarAwayChangesNoBit) {
  Scene scene = clampedScene(rubber(40, 0));
  scene.gravity = Vec3(0, 0, -9.81);
  for (const bool dynamic : {false, true}) {
    Simulation without, with;
    const LoopSettings settings = dynamic ? dynamics(1e-2, 0.2) : statics();
    scene.colliders.clear();
    runTo(without, scene, settings);
    scene.colliders = {floorAt(-1), obstacle(makeSphere(0.1), Vec3(0, 1, 0))};
    runTo(with, scene, settings);
    EXPECT_EQ(without.state.position, with.state.position);
    EXPECT_EQ(without.state.velocity, with.state.velocity);
  }
}

/// A table that rises lifts the rod on it; a ram that moves sideways into a held rod stops it.
TEST(Contact, ObstaclesThatMoveTakeRodsAlong) {
  Scene scene;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.rods = {rubber(20, 0.0055)};
  scene.colliders = {floorAt(0)};
  scene.colliders[0].motion.velocity = Vec3(0.1, 0, 0.2);
  Simulation sim;
  runTo(sim, scene, dynamics(0.02, 1));
  for (const Vec3 &x : sim.state.position) EXPECT_NEAR(x[2], 0.2 + 0.005, 0.0005);
  for (const Vec3 &v : sim.state.velocity) EXPECT_NEAR(v[2], 0.2, 1e-3); // backward Euler damps the first jolt
}

/// At best, a plate that does not give way throws a rod off twice as fast as it comes. No step may have energy of its
/// own to add, however stiff the barrier would have to be for the rod's own velocity.
TEST(Contact, AMovingPlateThrowsARodAtMostTwiceAsFast) {
  for (const double dt : {1e-2, 2e-3, 1e-3, 1e-4}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {rubber(20, 0.02)};
    Collider plate = floorAt(0.0145);
    const double speed = 0.5;
    plate.motion.velocity = Vec3(0, 0, speed);
    scene.colliders = {plate};
    const LoopSettings settings = dynamics(dt, 0.05);
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = false;
    double work = 0;
    EXPECT_PETSC(loop.run(
        sim.state,
        [&](const State &, const Diagnostics &row) {
          work += row.work.obstacles;
          return PetscErrorCode(0);
        },
        &finished));
    ASSERT_TRUE(finished) << loop.failure();
    const State &end = sim.state;
    double momentum = 0, mass = 0;
    for (int i = 0; i <= 20; ++i) {
      const double part = i == 0 || i == 20 ? 0.5 : 1;
      momentum += part * end.velocity[i][2];
      mass += part;
    }
    EXPECT_GE(momentum / mass, 0.98 * speed) << dt;
    EXPECT_LE(momentum / mass, 2 * speed) << dt;
    // What it does is its speed times the momentum that the rod has got.
    momentum *= scene.rods[0].material.linear_density * 0.3 / 20;
    EXPECT_NEAR(work, speed * momentum, 1e-6 * work) << dt; // where Newton ends
  }
}

/// A ram that has come down by 0.06 m after a fiftieth of the load step, on a rod held at both ends.
TEST(Contact, ObstaclesThatMoveUnevenlyWithinAStepDoNotPass) {
  for (const double corner : {0.02, 0.3}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {rubber(30, 0.5)};
    scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, 30, Support::Kind::pin)};
    Collider ram = obstacle(makeCylinder(0.01, 0.3), Vec3(0.15, 0, 0.52));
    ram.rotation = Eigen::AngleAxisd(pi / 2, Vec3::UnitX()).toRotationMatrix();
    ram.motion.table = {{0, Vec3::Zero(), Vec3::Zero()},
                        {corner, Vec3(0, 0, -0.06), Vec3::Zero()},
                        {1, Vec3(0, 0, -0.06), Vec3::Zero()}};
    scene.colliders = {ram};
    Simulation sim;
    const LoopSettings settings = statics();
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = false;
    EXPECT_PETSC(loop.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    // It is taken along, to below the ram at 0.46 less both radii.
    EXPECT_TRUE(finished) << loop.failure();
    EXPECT_NEAR(sim.state.position[15][2], 0.46 - 0.015, 0.0005) << corner;
  }
}

/// An arm that goes round meets a hanging rod on its way, be it by a quarter or by a whole turn in a step.
TEST(Contact, ObstaclesThatTurnWithinAStepDoNotPass) {
  for (const double turns : {0.25, 0.5, 1.0, 1.5}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    Rod rod = rubber(20, 0.0);
    for (int i = 0; i <= 20; ++i) rod.position[i] = Vec3(0.1, 0.05, -0.15 + 0.015 * i);
    rod.director.clear();
    setBishopDirectors(rod);
    scene.rods = {rod};
    Collider arm = obstacle(makeBox(Vec3(0.4, 0.01, 0.01)), Vec3(0.05, 0, 0)); // from -0.15 to 0.25 along x
    const double dt = 0.01;
    arm.motion.angular_velocity = Vec3(0, 0, 2 * pi * turns / dt);
    scene.colliders = {arm};
    Simulation sim;
    const LoopSettings settings = dynamics(dt, dt);
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = false;
    EXPECT_PETSC(loop.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    if (!finished) continue; // it said so
    EXPECT_GT((sim.state.position[10] - rod.position[10]).norm(), 0.01) << turns;
  }
}

TEST(Contact, APenaltyTooSoftIsTold) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {rubber(10, 0.05)};
  scene.rods[0].initial_velocity = Vec3(0, 0, -20);
  scene.rods[0].contact.law = ContactSettings::Law::penalty;
  scene.rods[0].contact.stiffness = 1e5;
  scene.colliders = {floorAt(0)};
  const LoopSettings settings = dynamics(1e-3, 0.02);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, settings));
  TimeLoop loop(sim.solver, settings);
  bool finished = true;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_FALSE(finished);
  EXPECT_NE(loop.failure().find("stiffness of its penalty, 1e+05 N/m^2, is too small"), std::string::npos)
      << loop.failure();
  for (const Vec3 &x : sim.state.position) EXPECT_GT(x[2], 0);
}

TEST(Contact, ObstaclesThatARodPassesAreNotThere) {
  Scene scene;
  scene.gravity = Vec3(0, 0, -10);
  scene.rods = {rubber(10, 0.02), rubber(10, 0.02)};
  scene.colliders = {floorAt(-0.05), floorAt(0)};
  scene.rods[1].contact.passes = {1};
  scene.rods[1].name = "other";
  Simulation sim;
  runTo(sim, scene, dynamics(0.01, 1));
  for (int i = 0; i <= 10; ++i) {
    EXPECT_NEAR(sim.state.position[i][2], 0.005, 0.0005);
    EXPECT_NEAR(sim.state.position[11 + i][2], -0.045, 0.0005);
  }
}

/// A rod that lies on its floor within the barrier as drawn is borne as drawn.
TEST(Contact, WhatIsDrawnTouchingStays) {
  for (const double gap : {0.0, 0.25e-3, -0.4e-3}) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.rods = {rubber(20, 0.005 + gap)};
    scene.colliders = {floorAt(0)};
    const LoopSettings settings = dynamics(1e-3, 0.02);
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, settings));
    EXPECT_PETSC(sim.solver.rehearse(sim.state, TimeLoop::stepOf(settings, sim.state, settings.dt)));
    TimeLoop loop(sim.solver, settings);
    const double small = 1e-6 * 0.3 * scene.rods[0].material.linear_density * 9.81 * scene.rods[0].contact.distance;
    bool finished = false;
    EXPECT_PETSC(loop.run(
        sim.state,
        [&](const State &, const Diagnostics &row) {
          EXPECT_LT(row.energy.kinetic, small);
          EXPECT_LT(std::abs(row.dissipated), small);
          return PetscErrorCode(0);
        },
        &finished));
    ASSERT_TRUE(finished) << loop.failure();
    EXPECT_NEAR(sim.state.position[7][2], 0.005 + gap, 1e-12);
  }
}

/// So is one that slides along: only what comes at an obstacle has to be stopped by it. And one on two posts, whose
/// forces act on short pieces.
TEST(Contact, WhatIsDrawnTouchingIsNotThrownOff) {
  Scene slides;
  slides.gravity = Vec3(0, 0, -9.81);
  slides.rods = {rubber(20, 0.005)};
  slides.rods[0].initial_velocity = Vec3(2, 0, 0);
  slides.colliders = {floorAt(0)};
  Scene lies = slides;
  lies.rods = {rubber(30, 0.005)};
  lies.rods[0].material = homogeneousMaterial({SectionShape::circle, {0.005, 0}}, 1e9, 4e8, 1000); // sags by 0.02 mm
  lies.colliders = {obstacle(makeBox(Vec3(0.01, 0.1, 0.1)), Vec3(0.1, 0, -0.05)),
                    obstacle(makeBox(Vec3(0.01, 0.1, 0.1)), Vec3(0.2, 0, -0.05))};
  for (const char *method : {"euler", "bdf2", "midpoint"})
    for (const Scene *scene : {&slides, &lies}) {
      LoopSettings settings = dynamics(1e-3, 0.1);
      settings.integrator.name = method;
      Simulation sim;
      runTo(sim, *scene, settings);
      EXPECT_NEAR(sim.state.position[10][2], 0.005, 0.001) << method << (scene == &lies);
    }
}

/// Methods that go on beyond their middle take obstacles with them to the end of the step.
TEST(Contact, StepsEndWithObstaclesAtTheirEnd) {
  for (const char *method : {"euler", "midpoint", "energy_momentum"}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {rubber(20, 0.0056)};
    scene.colliders = {floorAt(0)};
    scene.colliders[0].motion.velocity = Vec3(0, 0, 0.2);
    LoopSettings settings = dynamics(1e-3, 0.03);
    settings.integrator.name = method;
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = false;
    double least = HUGE_VAL;
    EXPECT_PETSC(loop.run(
        sim.state,
        [&](const State &state, const Diagnostics &row) {
          double lowest = HUGE_VAL;
          for (const Vec3 &x : state.position) lowest = std::min(lowest, x[2]);
          EXPECT_NEAR(row.contact_gap_min, lowest - 0.005 - 0.2 * state.time, 1e-9) << method;
          least = std::min(least, row.contact_gap_min);
          return PetscErrorCode(0);
        },
        &finished));
    ASSERT_TRUE(finished) << loop.failure();
    EXPECT_LT(least, 0.0005) << method; // they touch
    EXPECT_GT(least, -0.0005) << method;
  }
}

TEST(Contact, TellsWhereItIsTightest) {
  Scene scene;
  scene.rods = {rubber(20, 0.004)};
  scene.colliders = {floorAt(0)};
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, dynamics(1e-2, 1)));
  const std::vector<Touch> found =
      tightest(sim.scene, *sim.elements, configurationOf(sim.state, sim.scene, *sim.elements, 0));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].rod, 0);
  EXPECT_EQ(found[0].collider, 0);
  EXPECT_NEAR(found[0].gap, -0.001, 1e-15);
}

} // namespace
} // namespace tendril::test
