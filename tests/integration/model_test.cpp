/// Rods with fewer unknowns (RodModel) against full ones.
#include "support/rods.hpp"

#include "tendril/dynamics/integrator.hpp"

#include <functional>

namespace tendril::test {
namespace {

using Change = std::function<void(Scene &)>;

/// Cantilever of 24 edges along x under gravity along -y, soft enough to sag by a third of its length.
Scene cantilever() {
  Rod rod = straightRod(24, Measure::angle);
  rod.material.axial_stiffness = 1e6;
  Scene scene = clampedScene(std::move(rod));
  scene.gravity = Vec3(0, -4, 0);
  return scene;
}

/// From the world through two points beside the axis of the cantilever, which it shortens its way along.
Tendon tendonAlong(const Vec3 &arm) {
  Tendon t;
  t.name = "tendon";
  Waypoint far, on;
  far.point = Vec3(-0.2, 0.05, 0);
  on.rod = 0;
  on.at = 0.5;
  on.edge = 7;
  on.point = arm;
  Waypoint along = on;
  along.edge = 20;
  t.points = {far, on, along};
  t.segments = {{0, 1}, {1, 2}};
  t.actuator.kind = Actuator::Kind::displacement;
  t.actuator.stiffness = 50;
  t.actuator.input = -0.1;
  return t;
}

/// Half space below a height, whose outer normal is about y.
Collider floorAt(double height, const Vec3 &normal) {
  Collider floor;
  floor.name = "floor";
  floor.kind = "plane";
  floor.shape = makeHalfSpace();
  floor.rotation = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), normal).toRotationMatrix();
  floor.position = Vec3(0, height, 0);
  return floor;
}

void layOn(Scene &scene, Collider floor) {
  scene.colliders = {std::move(floor)};
  for (Rod &rod : scene.rods) {
    rod.contact.on = true;
    rod.contact.radius = 0.01;
    rod.contact.distance = 0.004;
  }
}

State endOf(Scene scene, RodModel model, const LoopSettings &settings) {
  for (Rod &rod : scene.rods) rod.model = model;
  std::vector<std::string> notes;
  settleModels(scene, settings.dynamic, true, &notes);
  Simulation sim;
  runTo(sim, std::move(scene), settings);
  return sim.state;
}

LoopSettings sharp(LoopSettings settings) {
  settings.solve.rounding_tolerance = 1e-12;
  return settings;
}

/// Positions and directors are those of `full`.
void expectSame(const Scene &scene, RodModel model, const LoopSettings &settings, double tolerance = 1e-10) {
  const State full = endOf(scene, RodModel::full, settings), reduced = endOf(scene, model, settings);
  double moved = 0, apart = 0, turned = 0;
  for (std::size_t v = 0; v < full.position.size(); ++v) {
    moved = std::max(moved, (full.position[v] - scene.rods[0].position[v]).norm());
    apart = std::max(apart, (full.position[v] - reduced.position[v]).norm());
  }
  for (std::size_t e = 0; e < full.director.size(); ++e)
    turned = std::max(turned, (full.director[e] - reduced.director[e]).norm());
  EXPECT_GT(moved, 0.01); // it did bend
  EXPECT_LT(apart, tolerance);
  if (settings.integrator.name != "midpoint") // extrapolates twists without mass beyond their equilibrium
    EXPECT_LT(turned, 10 * tolerance);
}

/// Statics of a rod that nothing turns out of its plane: at rest where the full rod is.
TEST(Models, PlanarStaticsAreThoseOfTheFullRod) {
  const Change changes[] = {
      [](Scene &) {},
      [](Scene &s) { s.rods[0].measure = Measure::tan; },
      [](Scene &s) { s.rods[0].energy = Energy::classical; },
      [](Scene &s) { // strips, on edge and flat
        s.rods[0].material.flexural_stiffness = {1, 30};
      },
      [](Scene &s) {
        s.rods[0].material.flexural_stiffness = {30, 1};
      },
      [](Scene &s) { // curved at rest
        s.rods[0].natural = Rod::Natural::given;
        const Vec3 d = s.rods[0].director[0];
        s.rods[0].natural_strain = Vec3(d.z(), Vec3::UnitX().cross(d).z(), 0) * 1.3;
      },
      [](Scene &s) {
        s.moments = {{0, 23, 0, Vec3(0, 0, 1.5)}};
      },
      [](Scene &s) {
        s.forces = {{0, 24, Vec3(1, -2, 0)}};
      },
      [](Scene &s) { // held at both ends, the far one turned
        s.supports.push_back(hold(s, 0, 24, Support::Kind::clamp));
        s.supports[1].motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(-0.2, 0, 0), Vec3(0, 0, 0.8)}};
      },
      [](Scene &s) { s.supports.push_back(hold(s, 0, 12, Support::Kind::pin)); },
      [](Scene &s) { s.supports.push_back(hold(s, 0, 12, Support::Kind::clamp)); },
  };
  for (const Change &change : changes) {
    SCOPED_TRACE(&change - changes);
    Scene scene = cantilever();
    change(scene);
    expectSame(scene, RodModel::planar, sharp(statics(4)),
               &change - changes == 9 || &change - changes == 10 ? 1e-9 : 1e-10);
  }
}

/// Springs and tendons to the world and floors that keep a rod in its plane.
TEST(Models, PlanarRodsAreDrawnAndTouchInTheirPlane) {
  const Change changes[] = {
      [](Scene &s) { s.constraints = {pinTo(s, 0, 20, Vec3(0, 0.1, 0), 50)}; },
      [](Scene &s) {
        const Frame f{s.rods[0].edge(0).normalized(), s.rods[0].director[0], 1};
        s.tendons = {tendonAlong(Vec3(0, 0.02 * f.director.y(), 0.02 * f.secondDirector().y()))};
        s.hostBodies();
      },
      [](Scene &s) { layOn(s, floorAt(-0.15, Vec3(0.2, 1, 0))); },
  };
  for (const Change &change : changes) {
    SCOPED_TRACE(&change - changes);
    Scene scene = cantilever();
    change(scene);
    LoopSettings settings = sharp(dynamics(0.02, 0.3));
    settings.integrator.name = "bdf2";
    expectSame(scene, RodModel::planar, settings, 1e-9);
    expectSame(scene, RodModel::planar, sharp(statics(4)), 1e-9);
  }
}

/// The same in planes normal to each axis, and of a ring.
TEST(Models, PlanesOfAllCoordinatesAreAlike) {
  for (int flat = 0; flat < 3; ++flat) {
    const Vec3 along = Vec3::Unit((flat + 1) % 3), across = Vec3::Unit((flat + 2) % 3);
    Scene scene = clampedScene(inextensibleRod(lineShape(Vec3::Zero(), along, 24).points));
    scene.rods[0].material.axial_stiffness = 1e6;
    scene.gravity = -4 * across;
    expectSame(scene, RodModel::planar, sharp(statics(4)));
    Scene ring = clampedScene(inextensibleRod(ringShape(Vec3::Zero(), Vec3::Unit(flat), 0.2, 24).points));
    ring.rods[0].closed = true;
    ring.rods[0].material.axial_stiffness = 1e6;
    setBishopDirectors(ring.rods[0]);
    ring.supports = {hold(ring, 0, 0, Support::Kind::clamp)};
    ring.forces = {{0, 12, 4 * Vec3(along + across)}};
    ring.gravity = Vec3::Zero();
    expectSame(ring, RodModel::planar, sharp(statics(4)));
  }
}

/// Dynamics: every integrator, with dissipation of both kinds. Tolerance: what Newton leaves in 30 steps.
TEST(Models, PlanarDynamicsAreThoseOfTheFullRod) {
  for (const char *name : {"euler", "bdf2", "bdf3", "sdirk2", "sdirk33", "midpoint", "symplectic2", "energy_momentum",
                           "generalized_alpha"}) {
    SCOPED_TRACE(name);
    Scene scene = cantilever();
    scene.rods[0].material.mass_damping_coefficient = 0.3;
    scene.rods[0].material.stiffness_damping_coefficient = 1e-3;
    LoopSettings settings = dynamics(0.02, 0.6);
    settings.integrator.name = name;
    settings.solve.rounding_tolerance = 1e-12;
    expectSame(scene, RodModel::planar, settings, 1e-9);
  }
}

/// A round rod that nothing twists, in space: statics, and dynamics without rotational inertia.
TEST(Models, TorsionFreeRodsAreFullRodsThatNothingTwists) {
  for (const Measure measure : {Measure::tan, Measure::angle})
    for (const Energy energy : {Energy::seed, Energy::classical}) {
      Scene scene = cantilever();
      scene.rods[0].measure = measure;
      scene.rods[0].energy = energy;
      scene.rods[0].material.linear_rotational_inertia = 0;
      scene.forces = {{0, 24, Vec3(0, 0, 3)}, {0, 10, Vec3(0, 2, -4)}};
      expectSame(scene, RodModel::torsion_free, sharp(statics(4)));
      for (const char *name : {"euler", "bdf2", "midpoint"}) {
        LoopSettings settings = sharp(dynamics(0.02, 0.4));
        settings.integrator.name = name;
        expectSame(scene, RodModel::torsion_free, settings, 1e-9);
      }
    }
}

/// A clamp that turns a round rod about itself does nothing to it: no energy, no work, whatever the integrator.
TEST(Models, TurningATorsionFreeRodAboutItselfCostsNothing) {
  for (const char *name : {"euler", "midpoint", "energy_momentum"}) {
    SCOPED_TRACE(name);
    Scene scene = cantilever();
    scene.gravity = Vec3(0, -1, 0.3);
    scene.rods[0].material.linear_rotational_inertia = 0;
    scene.rods[0].model = RodModel::torsion_free;
    LoopSettings settings = sharp(dynamics(0.01, 0.3));
    settings.integrator.name = name;
    auto energies = [&](double turn) {
      Scene turned = scene;
      turned.supports[0].motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {0.3, Vec3::Zero(), Vec3(turn, 0, 0)}};
      std::vector<double> all;
      Simulation sim;
      runAndWatch(sim, turned, settings, [&](const Diagnostics &row) {
        all.insert(all.end(), {row.energy.bend, row.energy.twist, row.energy.kinetic, row.work.supports});
      });
      return all;
    };
    const std::vector<double> still = energies(0), turning = energies(9);
    ASSERT_EQ(still.size(), turning.size());
    for (std::size_t k = 0; k < still.size(); ++k) EXPECT_NEAR(turning[k], still[k], 1e-9) << k;
  }
}

/// Loads that point out of a plane by rounding do not move a planar rod out of it.
TEST(Models, PlanarRodsDoNotDriftOutOfTheirPlane) {
  for (const char *name : {"midpoint", "energy_momentum", "generalized_alpha", "bdf2"}) {
    SCOPED_TRACE(name);
    Scene scene = cantilever();
    scene.gravity = Vec3(0, -4, -4e-16);
    LoopSettings settings = dynamics(0.02, 8);
    settings.integrator.name = name;
    const State end = endOf(scene, RodModel::planar, settings);
    for (std::size_t v = 0; v < end.position.size(); ++v) {
      EXPECT_EQ(end.position[v].z(), 0);
      EXPECT_EQ(end.velocity[v].z(), 0);
    }
  }
}

/// With the clamp at the other end, directors begin there.
TEST(Models, DirectorsOfTorsionFreeRodsBeginWhereTheyAreHeld) {
  Scene scene = cantilever();
  scene.supports = {hold(scene, 0, 24, Support::Kind::clamp)};
  scene.forces = {{0, 0, Vec3(0, 0, 3)}, {0, 10, Vec3(0, 2, -4)}};
  expectSame(scene, RodModel::torsion_free, sharp(statics(4)));
}

/// A cantilever across the middle of another, in a plane that gravity leaves.
Scene crossed() {
  Scene scene = cantilever();
  Rod other = straightRod(24, Measure::angle);
  other.name = "other";
  other.material.axial_stiffness = 1e6;
  for (Vec3 &x : other.position) x = Vec3(0.5, 0, x.x() - 0.5);
  setBishopDirectors(other);
  scene.rods.push_back(std::move(other));
  scene.supports.push_back(hold(scene, 1, 0, Support::Kind::clamp));
  scene.gravity = Vec3(0.3, -2, 0.5);
  for (Rod &rod : scene.rods) rod.material.linear_rotational_inertia = 0;
  return scene;
}

/// Rods that join, hang, are pulled and touch where nothing of that turns them. Tolerance of dynamics: what Newton
/// leaves in 15 steps.
TEST(Models, TorsionFreeRodsJoinWhereNothingTurnsThem) {
  const Change joins = [](Scene &s) { s.junctions = {{"crossing", {{0, 12, -1}, {1, 12, -1}}, 0}}; };
  const Change changes[] = {
      joins,
      [](Scene &s) { // ends of both
        s.junctions = {{"tip", {{0, 24, -1}, {1, 12, -1}}, 0}};
      },
      [](Scene &s) { s.constraints = {pinTo(s, 0, 20, Vec3(0, 0.1, 0), 50)}; },
      [](Scene &s) {
        s.constraints = {pinTo(s, 0, 20, Vec3::Zero(), 50)};
        s.constraints[0].to_rod = 1;
        s.constraints[0].to_vertex = 24;
      },
      [&](Scene &s) { // with a weight at the crossing and one at a tip
        Body body;
        body.own = {0.2, Vec3(0.5, 0, 0), 1e-3 * Mat3::Identity()};
        body.position = body.own.centre;
        s.bodies = {body};
        s.attachments = {{"a", 0, 12, 0, false, frameAtVertex(s.rods[0], 12)},
                         {"b", 1, 12, 0, false, frameAtVertex(s.rods[1], 12)}};
        s.hostBodies();
      },
      [&](Scene &s) {
        joins(s);
        s.tendons = {tendonAlong(Vec3(0.01, 0, 0))};
        s.tendons[0].points[0].point = Vec3(-0.2, 1, 0.3);
        s.hostBodies();
      },
      [](Scene &s) { // onto a floor, and onto each other
        s.gravity = Vec3(0, -4, 0);
        for (Vec3 &x : s.rods[1].position) x.y() -= 0.1;
        s.supports[1] = hold(s, 1, 0, Support::Kind::clamp);
        layOn(s, floorAt(-0.2, Vec3::UnitY()));
        for (Rod &rod : s.rods) rod.contact.rods = ContactSettings::Rods::others;
      },
  };
  for (const Change &change : changes) {
    SCOPED_TRACE(&change - changes);
    Scene scene = crossed();
    change(scene);
    LoopSettings settings = sharp(dynamics(0.02, 0.3));
    settings.integrator.name = "bdf2";
    expectSame(scene, RodModel::torsion_free, settings, 1e-9);
    expectSame(scene, RodModel::torsion_free, sharp(statics(4)), 1e-9);
  }
}

/// What a model leaves out is refused by name.
TEST(Models, AreRefusedByName) {
  struct Row {
    RodModel model;
    Change change;
    const char *word;
  };
  const Row rows[] = {
      {RodModel::planar, [](Scene &s) { s.gravity.z() = 1; }, "gravity"},
      {RodModel::planar, [](Scene &s) { s.rods[0].initial_velocity.z() = 1; }, "velocity"},
      {RodModel::planar,
       [](Scene &s) {
         s.forces = {{0, 5, Vec3(0, 1, 1)}};
       },
       "force"},
      {RodModel::planar,
       [](Scene &s) {
         s.moments = {{0, 5, 0, Vec3(0, 1, 0)}};
       },
       "moment"},
      {RodModel::planar,
       [](Scene &s) {
         s.moments = {{0, 5, 1, Vec3::Zero()}};
       },
       "torque"},
      {RodModel::planar, [](Scene &s) { s.supports[0].motion.angular_velocity = Vec3(1, 0, 0); }, "clamp"},
      {RodModel::planar, [](Scene &s) { s.rods[0].initial_turns = 1; }, "twisted"},
      {RodModel::planar,
       [](Scene &s) {
         s.rods[0].material.flexural_stiffness = {1, 2};
         for (Vec3 &d : s.rods[0].director) d = Vec3(0, 0.6, 0.8);
         s.supports = {hold(s, 0, 0, Support::Kind::clamp)};
       },
       "principal axis"},
      {RodModel::planar, [](Scene &s) { s.rods[0].position[3] += Vec3(0, 1e-3, 1e-3); }, "agree in no coordinate"},
      {RodModel::planar, [](Scene &s) { s.constraints = {pinTo(s, 0, 24, Vec3(0, 0, 0.1), 1)}; }, "constraint"},
      {RodModel::planar, [](Scene &s) { s.tendons = {tendonAlong(Vec3(0, 0.01, 0.01))}; }, "tendon"},
      {RodModel::planar, [](Scene &s) { layOn(s, floorAt(-0.2, Vec3(0, 1, 0.1))); }, "collider 'floor'"},
      {RodModel::planar,
       [](Scene &s) {
         layOn(s, floorAt(-0.2, Vec3(0, 1, 0)));
         s.rods[0].contact.friction = 0.3;
       },
       "friction"},
      {RodModel::torsion_free,
       [](Scene &s) {
         s.supports[0].frame.tangent = Vec3(0.8, 0.6, 0);
         s.supports[0].frame.director = Vec3(0, 0, 1);
       },
       "a clamp points aside"},
      {RodModel::torsion_free,
       [](Scene &s) {
         for (int i = 0; i < 24; ++i)
           s.rods[0].director[std::size_t(i)] = Vec3(0, std::cos(0.1 * i), std::sin(0.1 * i));
         s.supports = {hold(s, 0, 0, Support::Kind::clamp)};
       },
       "directors turn"},
      {RodModel::torsion_free,
       [](Scene &s) {
         s.rods[0].material.flexural_stiffness = {1, 2};
       },
       "differ"},
      {RodModel::torsion_free,
       [](Scene &s) {
         s.moments = {{0, 5, 0, Vec3(0, 1, 0)}};
       },
       "moment"},
      {RodModel::torsion_free, [](Scene &s) { s.rods[0].position[3].y() += 1e-3; }, "curved"},
      {RodModel::torsion_free, [](Scene &s) { s.supports.push_back(hold(s, 0, 24, Support::Kind::clamp)); },
       "both ends"},
      {RodModel::torsion_free, [](Scene &) {}, "rotational inertia"},
      {RodModel::torsion_free, [](Scene &s) { s.constraints = {turnTo(0, 3, frameAtVertex(s.rods[0], 3), 1)}; },
       "constraint 'constraint' draws at it, and turns it"},
      {RodModel::torsion_free,
       [](Scene &s) {
         s.rods.push_back(s.rods[0]);
         s.rods[1].model = RodModel::full;
         s.junctions = {{"knot", {{0, 24, 0}, {1, 24, 0}}, 1}};
       },
       "junction 'knot'"},
      {RodModel::torsion_free,
       [](Scene &s) {
         s.colliders.emplace_back();
         s.rods[0].contact.on = true;
         s.rods[0].contact.friction = 0.2;
       },
       "friction"},
  };
  for (const Row &row : rows) {
    SCOPED_TRACE(row.word);
    Scene scene = cantilever();
    row.change(scene);
    scene.rods[0].model = row.model;
    std::vector<std::string> notes;
    try {
      settleModels(scene, true, true, &notes);
      FAIL();
    } catch (const SceneError &e) {
      EXPECT_NE(std::string(e.what()).find(row.word), std::string::npos) << e.what();
    }
  }
}

/// `auto` takes the fewest unknowns of what is proven, and says so.
TEST(Models, AutoTakesTheFewestUnknowns) {
  auto chosen = [](const Change &change, bool dynamic) {
    Scene scene = cantilever();
    change(scene);
    scene.rods[0].chooses_model = true;
    std::vector<std::string> notes;
    settleModels(scene, dynamic, true, &notes);
    EXPECT_EQ(notes.size(), 1u);
    EXPECT_NE(notes[0].find(nameOf(scene.rods[0].model)), std::string::npos) << notes[0];
    return scene.rods[0].model;
  };
  const Change sideways = [](Scene &s) { s.gravity.z() = 1; };
  EXPECT_EQ(chosen([](Scene &) {}, true), RodModel::planar);
  EXPECT_EQ(chosen(sideways, false), RodModel::torsion_free);
  EXPECT_EQ(chosen(sideways, true), RodModel::full); // it has rotational inertia
  EXPECT_EQ(chosen([](Scene &s) { s.rods[0].material.flexural_stiffness = {0, 0}; }, true), RodModel::cable);
}

} // namespace
} // namespace tendril::test
