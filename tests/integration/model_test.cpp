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

/// With the clamp at the other end, directors begin there.
TEST(Models, DirectorsOfTorsionFreeRodsBeginWhereTheyAreHeld) {
  Scene scene = cantilever();
  scene.supports = {hold(scene, 0, 24, Support::Kind::clamp)};
  scene.forces = {{0, 0, Vec3(0, 0, 3)}, {0, 10, Vec3(0, 2, -4)}};
  expectSame(scene, RodModel::torsion_free, sharp(statics(4)));
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
      {RodModel::planar, [](Scene &s) { s.constraints = {pinTo(s, 0, 24, Vec3::Zero(), 1)}; }, "constraint"},
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
