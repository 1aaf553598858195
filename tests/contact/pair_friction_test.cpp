/// Friction between rods that touch each other: in statics, anchored, and as results have it.
#include "support/option_set.hpp"
#include "support/touching.hpp"

#include "tendril/contact/pair_readings.hpp"
#include "tendril/coupling/couplings.hpp"
#include "tendril/io/scene_reader.hpp"

namespace tendril::test {
namespace {

struct Drawn {
  double moved = 0;                                    ///< of the ends, in the mean [m]
  Vec3 held = Vec3::Zero();                            ///< by both springs [N]
  Vec3 normal = Vec3::Zero(), friction = Vec3::Zero(); ///< on the bar [N]
};

constexpr double spring = 50, pressing = 2, drawing = 1; // [N/m], [N]

/// A bar across a beam that is held: loads press it on and draw it along the beam, against springs at both ends.
Drawn drawAlong(double coefficient) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {wire("beam", Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), 16, 0.005, 1e11),
                wire("bar", Vec3(0.001, -0.1, 0.01), Vec3(0.001, 0.1, 0.01), 16, 0.005, 1e11)};
  for (const int v : {0, 16}) {
    scene.supports.push_back(hold(scene, 0, v, Support::Kind::clamp));
    scene.constraints.push_back(pinTo(scene, 1, v, Vec3::Zero(), spring));
    scene.forces.push_back({1, v, Vec3(0.5 * drawing, 0, -0.5 * pressing)});
  }
  for (Rod &rod : scene.rods) {
    rod.contact.friction = coefficient;
    rod.contact.friction_at_surface = false; // or the bar would roll
    rod.contact.slip_length = 5e-6;
  }
  const OptionSet sharp("-snes_rtol", "1e-9");
  Simulation sim;
  runTo(sim, scene, statics(4));
  Drawn drawn;
  for (const int v : {0, 16}) {
    const Vec3 moved = sim.state.position[std::size_t(17 + v)] - sim.scene.rods[1].position[std::size_t(v)];
    drawn.moved += 0.5 * moved[0];
    drawn.held -= spring * moved;
  }
  for (const PairReading &reading : pairReadings(sim.scene, *sim.elements, sim.state,
                                                 configurationOf(sim.state, sim.scene, *sim.elements, 1), true)) {
    const double sign = reading.rod[0] == 1 ? 1 : -1;
    drawn.normal += sign * reading.force;
    drawn.friction += sign * reading.friction;
  }
  return drawn;
}

/// Friction holds what is drawn by less than its limit, within the slip length, and beyond has that limit; with the
/// springs it balances the loads to the tolerance of the solve.
TEST(PairFriction, HoldsInStaticsUpToItsLimit) {
  for (const double coefficient : {0.2, 0.8}) {
    const Drawn drawn = drawAlong(coefficient);
    const Vec3 loads(drawing, 0, -pressing);
    EXPECT_LT((loads + drawn.held + drawn.normal + drawn.friction).norm(), 1e-6) << coefficient;
    if (coefficient < drawing / pressing)
      EXPECT_NEAR(drawn.friction.norm(), coefficient * drawn.normal.norm(), 1e-3 * pressing);
    else
      EXPECT_LT(std::abs(drawn.moved), 2 * 5e-6);
  }
}

/// A bar lies across two beams that go down by 20 degrees. Creeping friction lets it down at a speed below the
/// fall-off's; anchored, it stays within the slip length.
TEST(PairFriction, AnchoredABarStays) {
  const double angle = 20 * pi / 180;
  for (const bool anchored : {false, true}) {
    Scene scene;
    scene.gravity = 9.81 * Vec3(std::sin(angle), 0, -std::cos(angle));
    scene.rods = {wire("left", Vec3(-0.05, -0.06, 0), Vec3(0.05, -0.06, 0), 10, 0.005, 1e11),
                  wire("right", Vec3(-0.05, 0.06, 0), Vec3(0.05, 0.06, 0), 10, 0.005, 1e11),
                  wire("bar", Vec3(0, -0.1, 0.01), Vec3(0, 0.1, 0.01), 20, 0.005, 1e9)};
    for (const int r : {0, 1})
      for (const int v : {0, 10}) scene.supports.push_back(hold(scene, r, v, Support::Kind::clamp));
    for (Rod &rod : scene.rods) {
      rod.contact.friction = 0.6;
      rod.contact.friction_at_surface = false;
      rod.contact.slip_length = 5e-6;
      rod.contact.fall_off_velocity = 0.01;
      rod.material.mass_damping_coefficient = 20;
      if (anchored) rod.contact.stick = ContactSettings::Stick::anchored;
    }
    Simulation sim;
    runTo(sim, scene, dynamics(0.005, 0.5));
    const double gone = sim.state.position[22 + 10][0];
    // tan 20 / 0.6 = 2 u - u^2 of the fall-off at u = 0.37, times the time
    if (anchored)
      EXPECT_LT(std::abs(gone), 10e-6);
    else
      EXPECT_NEAR(gone, 0.37 * 0.01 * 0.5, 0.1 * 0.37 * 0.01 * 0.5);
  }
}

/// Normal forces of results are those that the term has, vertex by vertex.
TEST(PairReadings, AreTheForcesOfTheTerm) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {wire("low", Vec3(-0.1, 0, 0), Vec3(0.1, 0.004, 0), 9, 0.01),
                wire("high", Vec3(-0.09, -0.02, 0.0193), Vec3(0.1, 0.03, 0.0196), 11, 0.01)};
  for (Rod &rod : scene.rods) rod.contact.stiffness = 1e3;
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
  const std::unique_ptr<Term> contact = makeRodContact(sim.scene, *sim.elements);
  const Configuration c = configurationOf(sim.state, sim.scene, *sim.elements, 0);
  Step step;
  step.dt = step.time = 0.01;
  std::vector<TouchingPair> pairs;
  contact->findTouching(sim.state, c, sim.dofs.makePlanes(), step, 1, pairs);
  Derivatives d(sim.elements->slots, true);
  d.blocks.setTouching(pairs.size());
  contact->addBetween(c, {0, 2}, d, HessianKind::none);
  std::vector<Vec3> force(std::size_t(sim.elements->vertices()), Vec3::Zero());
  for (const PairReading &reading : pairReadings(sim.scene, *sim.elements, sim.state, c, false))
    for (const std::size_t side : {0, 1}) {
      const RodRange &rod = sim.elements->rods[std::size_t(reading.rod[side])];
      const std::size_t v = std::size_t(rod.first_vertex + reading.edge[side]);
      const Vec3 on = (side == 0 ? 1 : -1) * reading.force;
      force[v] += (1 - reading.at[side]) * on;
      force[v + 1] += reading.at[side] * on;
    }
  double most = 0;
  for (std::size_t v = 0; v < force.size(); ++v) {
    const Vec3 exact = -d.gradient.vector(0, sim.elements->vertex_slot[v]);
    EXPECT_LT((force[v] - exact).norm(), 1e-12) << v;
    most = std::max(most, exact.norm());
  }
  EXPECT_GT(most, 0.1);
}

/// A rod thrown off a wall leaves the room in which it has been looked for others: the step is solved anew, with more
/// of it, and counts energies once (data/scenes/verify/touch_dyn_thrown.yaml).
TEST(RodContact, StepsSolvedAnewCountEnergiesOnce) {
  SceneFile file = readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/verify/touch_dyn_thrown.yaml", {});
  const LoopSettings settings = dynamics(0.002, 0.012);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(std::move(file.scene), settings));
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  int rows = 0;
  EXPECT_PETSC(loop.run(
      sim.state,
      [&](const State &state, const Diagnostics &row) {
        EnergyBudget once;
        const Configuration c = configurationOf(state, sim.scene, *sim.elements, state.time);
        once += sim.potential->energyBudget(state, c, 1, sim.potential->all());
        EXPECT_NEAR(row.energy.gravity, once.gravity, 1e-12 * std::abs(once.gravity)) << state.time;
        EXPECT_NEAR(row.energy.kinetic, once.kinetic, 1e-12 * once.kinetic) << state.time;
        ++rows;
        return PetscErrorCode(0);
      },
      &finished));
  EXPECT_TRUE(finished) << loop.failure();
  EXPECT_EQ(rows, 6);
}

} // namespace
} // namespace tendril::test
