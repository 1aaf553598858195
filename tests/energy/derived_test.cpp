/// Internal forces and moments against the loads they carry, and strains against shapes that are known. Balances hold
/// at any edge length, to the tolerance of the solver, which is asked for here as 1e-10 of the load.
#include "support/rods.hpp"

#include "tendril/energy/derived.hpp"
#include "tendril/energy/term.hpp"

namespace tendril::test {
namespace {

constexpr double exact =
    1e-8; // of loads of about 1: the solver's 1e-10 summed over edges, and the rounding of a stiff rod

/// A rod that bends, shears its tangents, twists and stretches by some per cent under loads of about 1.
Rod softRod(int edges, Measure measure) {
  Rod rod = straightRod(edges, measure);
  rod.material.axial_stiffness = 50;
  rod.material.flexural_stiffness = {1, 2};
  return rod;
}

void solve(Simulation &sim, Scene scene, int load_steps = 2, const char *tolerance = "1e-10") {
  EXPECT_PETSC(PetscOptionsSetValue(nullptr, "-snes_rtol", tolerance));
  runTo(sim, std::move(scene), statics(load_steps));
  EXPECT_PETSC(PetscOptionsClearValue(nullptr, "-snes_rtol"));
}

/// One step more after ten of a sharp tolerance, which ends with it.
void takeEleventhStep(Simulation &sim, double dt) {
  TimeLoop loop(sim.solver, dynamics(dt, 11 * dt));
  bool finished = false;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_PETSC(PetscOptionsClearValue(nullptr, "-snes_rtol"));
  ASSERT_TRUE(finished);
}

RodActions actionsOf(const Simulation &sim) {
  return rodActions(sim.scene, *sim.elements, sim.state, sim.state.time, 1);
}
RodStrains strainsOf(const Simulation &sim) {
  return rodStrains(sim.scene, *sim.elements, sim.state, sim.state.time, 1);
}

/// Cantilevers of both measures and energies under a load at the tip, coarse and fine: `check(sim, edges)`.
template <class Check> void eachCantilever(const Vec3 &load, Check check) {
  for (const Measure measure : {Measure::tan, Measure::angle})
    for (const Energy energy : {Energy::seed, Energy::classical})
      for (const int edges : {4, 32}) {
        Scene scene = clampedScene(softRod(edges, measure));
        scene.rods[0].energy = energy;
        scene.forces = {{0, edges, load}};
        Simulation sim;
        solve(sim, scene);
        check(sim, edges);
      }
}

TEST(InternalForce, OfACantileverIsItsTipLoadInEveryEdge) {
  const Vec3 load(0.3, -1.5, 0.7);
  eachCantilever(load, [&](const Simulation &sim, int) {
    for (const Vec3 &force : actionsOf(sim).force) EXPECT_LT((force - load).norm(), exact);
  });
}

/// Not only to second order: the discrete moments balance like the true ones.
TEST(InternalMoment, OfACantileverIsTheLeverArmAtEveryVertex) {
  const Vec3 load(0.3, -1.5, 0.7);
  eachCantilever(load, [&](const Simulation &sim, int edges) {
    const RodActions actions = actionsOf(sim);
    for (int v = 0; v <= edges; ++v)
      EXPECT_LT((actions.moment[v] - (sim.state.position[edges] - sim.state.position[v]).cross(load)).norm(), exact)
          << v;
    EXPECT_GT(actions.moment[0].norm(), 1);
  });
}

/// Clamped at its last vertex, the rod hands on what acts on its first: half cells of both kinds obey the same signs.
TEST(InternalMoment, OfARodClampedAtItsEndIsTheLeverArm) {
  const Vec3 load(0.3, -1.5, 0.7);
  const int edges = 8;
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {softRod(edges, Measure::tan)};
  scene.supports = {hold(scene, 0, edges, Support::Kind::clamp)};
  scene.forces = {{0, 0, load}};
  Simulation sim;
  solve(sim, scene);
  const RodActions actions = actionsOf(sim);
  for (const Vec3 &force : actions.force) EXPECT_LT((force + load).norm(), exact);
  for (int v = 0; v <= edges; ++v)
    EXPECT_LT((actions.moment[v] + (sim.state.position[0] - sim.state.position[v]).cross(load)).norm(), exact) << v;
}

TEST(InternalMoment, BesideAClampInsideARodIsThatOfTheHigherSide) {
  const int edges = 8;
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {softRod(edges, Measure::angle)};
  scene.supports = {hold(scene, 0, 4, Support::Kind::clamp)};
  const Vec3 first(0, 1, 0), last(0, 0, -2);
  scene.forces = {{0, 0, first}, {0, edges, last}};
  Simulation sim;
  solve(sim, scene);
  const RodActions actions = actionsOf(sim);
  for (int i = 0; i < edges; ++i) EXPECT_LT((actions.force[i] - (i < 4 ? Vec3(-first) : last)).norm(), exact);
  for (int v = 0; v <= edges; ++v) {
    const Vec3 expected = v < 4 ? Vec3((sim.state.position[v] - sim.state.position[0]).cross(first))
                                : Vec3((sim.state.position[edges] - sim.state.position[v]).cross(last));
    EXPECT_LT((actions.moment[v] - expected).norm(), exact) << v;
  }
}

/// The clamp turns and travels; what it carries are still the loads beyond it.
TEST(InternalMoment, AtAMovedClampIsTheLeverArm) {
  Scene scene = clampedScene(softRod(12, Measure::tan));
  scene.forces = {{0, 12, Vec3(0, -1, 0)}};
  scene.supports[0].motion.velocity = Vec3(0.1, 0.2, 0);
  scene.supports[0].motion.angular_velocity = Vec3(0.3, 0.5, -0.4);
  Simulation sim;
  solve(sim, scene, 4);
  EXPECT_LT((actionsOf(sim).moment[0] - (sim.state.position[12] - sim.state.position[0]).cross(Vec3(0, -1, 0))).norm(),
            exact);
}

TEST(InternalForce, OfAHangingRodIsTheWeightBelow) {
  const int edges = 10;
  Rod rod = softRod(edges, Measure::tan);
  rod.position = lineShape(Vec3::Zero(), Vec3(0, -1, 0), edges).points;
  rod.director.clear();
  setBishopDirectors(rod);
  Scene scene = clampedScene(rod);
  scene.gravity = Vec3(0, -3, 0); // stretched by 3 %
  Simulation sim;
  solve(sim, scene);
  const RodActions actions = actionsOf(sim);
  for (int i = 0; i < edges; ++i)
    EXPECT_LT((actions.force[i] - Vec3(0, -3.0 * (edges - i - 0.5) / edges, 0)).norm(), exact) << i;
  for (const Vec3 &moment : actions.moment) EXPECT_LT(moment.norm(), exact);
}

TEST(InternalMoment, OfASaggingRodIsThatOfTheWeightBeyond) {
  const int edges = 16;
  Scene scene = clampedScene(softRod(edges, Measure::angle));
  scene.gravity = Vec3(0, -8, 1);
  Simulation sim;
  solve(sim, scene);
  const RodActions actions = actionsOf(sim);
  for (int v = 0; v <= edges; ++v) {
    Vec3 expected = Vec3::Zero();
    for (int w = v; w <= edges; ++w)
      expected += sim.elements->mass()[sim.elements->vertex_slot[w]] *
                  (sim.state.position[w] - sim.state.position[v]).cross(scene.gravity);
    EXPECT_LT((actions.moment[v] - expected).norm(), 10 * exact) << v; // loads of 8
  }
}

/// A couple on the last edge: no force anywhere, that edge included, and the same moment in every vertex before it.
TEST(InternalActions, OfACoupleAreItsMomentAndNoForce) {
  const Vec3 couple(0.05, 0.1, 1);
  const int edges = 12;
  for (const Measure measure : {Measure::tan, Measure::angle}) {
    Scene scene = clampedScene(softRod(edges, measure));
    scene.moments = {{0, edges - 1, 0, couple}};
    Simulation sim;
    solve(sim, scene, 4, "1e-8"); // with couples Newton converges linearly
    const RodActions actions = actionsOf(sim);
    for (const Vec3 &force : actions.force) EXPECT_LT(force.norm(), 1e-6);
    for (int v = 0; v < edges; ++v) EXPECT_LT((actions.moment[v] - couple).norm(), 1e-6) << v;
    EXPECT_EQ(actions.moment[edges], Vec3::Zero());
  }
}

TEST(InternalActions, OfATorqueAreItsMomentAndAUniformTwist) {
  const int edges = 10;
  Scene scene = clampedScene(straightRod(edges, Measure::angle));
  scene.moments = {{0, edges - 1, 1.2, Vec3::Zero()}};
  Simulation sim;
  solve(sim, scene);
  const RodActions actions = actionsOf(sim);
  const RodStrains strains = strainsOf(sim);
  for (int v = 0; v < edges; ++v) {
    EXPECT_LT((actions.moment[v] - Vec3(1.2, 0, 0)).norm(), exact);
    EXPECT_NEAR(strains.twist[v], 1.2 / (2.0 / 3), exact);
    EXPECT_NEAR(strains.strain_energy_density[v], 0.5 * 1.2 * 1.2 / (2.0 / 3), exact);
  }
  EXPECT_EQ(strains.twist[edges], 0);
}

/// Between two held ends that do not bend: the twist is there, also beside a support that holds nothing but the twist.
TEST(Strains, BesideFixTwistAreThoseOfTheRod) {
  const int edges = 16;
  Scene scene = clampedScene(straightRod(edges, Measure::angle));
  for (const int v : {8, edges}) {
    scene.supports.push_back(hold(scene, 0, v, Support::Kind::pin));
    scene.supports.push_back(hold(scene, 0, v, Support::Kind::fix_twist));
    scene.supports.back().motion.angular_velocity = Vec3(v == 8 ? 0.5 : 1.0, 0, 0);
  }
  Simulation sim;
  solve(sim, scene, 1);
  const RodStrains strains = strainsOf(sim);
  const RodActions actions = actionsOf(sim);
  for (int v = 0; v <= edges; ++v) {
    EXPECT_NEAR(strains.twist[v], 1.0, 1e-7) << v; // residual relative to GJ/L^2
    EXPECT_LT(strains.curvature[v].norm(), 1e-7);
    EXPECT_LT((actions.moment[v] - Vec3(2.0 / 3, 0, 0)).norm(), 1e-7) << v;
  }
}

/// Newton's law at every free vertex over one step of backward Euler without dissipation.
TEST(InternalForce, AcceleratesTheVertices) {
  const int edges = 12;
  const double dt = 0.01;
  Rod rod = softRod(edges, Measure::tan);
  rod.material.linear_rotational_inertia = 1e-12; // a twist's inertia also pulls on the ends of its edge
  Scene scene = clampedScene(rod);
  scene.gravity = Vec3(0, -9.81, 2);
  EXPECT_PETSC(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-10"));
  Simulation sim;
  runTo(sim, scene, dynamics(dt, 10 * dt));
  const std::vector<Vec3> before = sim.state.velocity;
  takeEleventhStep(sim, dt);
  const RodActions actions = actionsOf(sim);
  for (int v = 1; v <= edges; ++v) {
    const Vec3 beyond = v < edges ? actions.force[v] : Vec3(Vec3::Zero());
    const Vec3 rate =
        sim.elements->mass()[sim.elements->vertex_slot[v]] * ((sim.state.velocity[v] - before[v]) / dt - scene.gravity);
    EXPECT_LT((beyond - actions.force[v - 1] - rate).norm(), 1e-7) << v; // differences of positions over dt^2
  }
}

/// All supports together hold the weight and the loads, those on held vertices too; `fix_twist` holds nothing.
TEST(Reaction, OfAllSupportsIsTheLoad) {
  Scene scene = clampedScene(softRod(12, Measure::angle));
  scene.supports.push_back(hold(scene, 0, 5, Support::Kind::fix_twist));
  scene.supports.push_back(hold(scene, 0, 8, Support::Kind::pin));
  scene.forces = {{0, 12, Vec3(0, -1, 0.5)}, {0, 8, Vec3(0, 0, 2)}, {0, 3, Vec3(0, 0.5, 0)}};
  scene.gravity = Vec3(0, -3, 0);
  Simulation sim;
  solve(sim, scene);
  const std::vector<Vec3> reaction = actionsOf(sim).reaction;
  ASSERT_EQ(reaction.size(), 3u);
  EXPECT_EQ(reaction[1], Vec3(Vec3::Zero()));
  EXPECT_LT((reaction[0] + reaction[2] + Vec3(0, -3 - 0.5, 2.5)).norm(), 10 * exact);
}

/// Springs, tendons and follower forces that end at held vertices count; a tendon within the rod takes nothing away.
TEST(Reaction, BearsWhatDrawsAtHeldVertices) {
  Scene scene = clampedScene(softRod(12, Measure::angle));
  scene.supports.push_back(hold(scene, 0, 8, Support::Kind::pin));
  scene.constraints = {pinTo(scene, 0, 0, Vec3(0.1, 0.2, 0), 5), pinTo(scene, 0, 10, Vec3(0, 0.1, 0.1), 3)};
  Constraint tie = constraintOn(0, 8, Constraint::Kind::pin, 2);
  tie.to_rod = 0;
  tie.to_vertex = 3;
  scene.constraints.push_back(tie);
  scene.followers = {{0, 8, Vec3(0.3, -0.2, 0.5)}};
  auto ofVertex = [](int vertex) {
    Waypoint p;
    p.rod = 0;
    p.setVertex(vertex, 12);
    return p;
  };
  Waypoint world;
  world.point = Vec3(-0.4, -1, 0.3);
  for (const bool inside : {false, true}) {
    Tendon t;
    t.name = inside ? "inside" : "outside";
    t.points = {inside ? ofVertex(12) : world, ofVertex(0)};
    t.segments = {{0, 1}};
    t.actuator.kind = Actuator::Kind::force;
    t.actuator.input = 0.7;
    scene.tendons.push_back(t);
  }
  Simulation sim;
  solve(sim, scene);
  const RodActions actions = actionsOf(sim);
  const Vec3 drawn = 0.7 * (world.point - sim.state.position[0]).normalized();
  const Frame before = configurationOf(sim.state, sim.scene, *sim.elements, 1).frameAt(sim.elements->rods[0].slot(7)),
              after = configurationOf(sim.state, sim.scene, *sim.elements, 1).frameAt(sim.elements->rods[0].slot(8));
  Vec3 sum =
      actions.reaction[0] + actions.reaction[1] + actions.constraint[0].force + actions.constraint[1].force + drawn;
  for (const PlacedFollower &f : sim.elements->followers({0, 1}))
    sum += f.along(f.edge == sim.elements->rods[0].slot(7) ? before : after);
  EXPECT_LT(sum.norm(), 10 * exact);
}

/// Force and moment of the whole rod: what supports do, loads on held vertices, weights and couples sum to nothing,
/// about the origin too.
TEST(ReactionMoment, BalancesTheWholeRod) {
  const int edges = 12;
  for (const Measure measure : {Measure::tan, Measure::angle})
    for (const Energy energy : {Energy::seed, Energy::classical})
      for (const bool couples : {false, true}) {
        Scene scene = clampedScene(softRod(edges, measure));
        scene.rods[0].energy = energy;
        scene.supports.push_back(hold(scene, 0, 4, Support::Kind::fix_twist));
        scene.supports.push_back(hold(scene, 0, 7, Support::Kind::clamp));
        scene.supports.push_back(hold(scene, 0, edges, Support::Kind::pin));
        scene.supports.push_back(hold(scene, 0, edges, Support::Kind::fix_twist));
        scene.supports[0].motion.angular_velocity = Vec3(0.3, 0.2, -0.4);
        scene.supports[1].motion.angular_velocity = Vec3(0.5, 0, 0);
        scene.supports[2].motion.velocity = Vec3(0.02, 0.1, 0.05);
        scene.forces = {{0, 3, Vec3(0, -1, 0.5)}, {0, 7, Vec3(0, 0, 2)}, {0, 10, Vec3(0, 0.5, 0)}};
        scene.gravity = Vec3(0, -3, 1);
        if (couples) scene.moments = {{0, 2, 0.3, Vec3(0.1, 0.2, 0)}, {0, 9, 0, Vec3(0, -0.2, 0.3)}};
        Simulation sim;
        solve(sim, scene, 4, couples ? "1e-8" : "1e-10");
        const RodActions actions = actionsOf(sim);
        Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
        auto add = [&](int v, const Vec3 &f) {
          force += f;
          moment += sim.state.position[v].cross(f);
        };
        for (int v = 0; v <= edges; ++v) add(v, sim.elements->mass()[sim.elements->vertex_slot[v]] * scene.gravity);
        for (const NodalForce &f : scene.forces) add(f.vertex, f.force);
        for (std::size_t s = 0; s < scene.supports.size(); ++s) {
          add(scene.supports[s].vertex, actions.reaction[s]);
          moment += actions.reaction_moment[s];
        }
        for (const EdgeMoment &m : scene.moments)
          moment += m.moment + m.torque * (sim.state.position[m.edge + 1] - sim.state.position[m.edge]).normalized();
        const double tolerance = couples ? 1e-5 : 10 * exact; // with couples Newton converges linearly; loads of 8
        EXPECT_LT(force.norm(), tolerance);
        EXPECT_LT(moment.norm(), tolerance);
        EXPECT_EQ(actions.reaction_moment[3], Vec3(Vec3::Zero()));
        for (const int s : {0, 1, 2, 4}) EXPECT_GT(actions.reaction_moment[s].norm(), 1e-2) << s;
      }
}

/// Beams of small deflections: F L; 11/16 P, 5/16 P and 3/16 P L of a propped cantilever under P in the middle.
TEST(ReactionMoment, OfBeamsIsThatOfTheory) {
  const double load = 1e-5;
  const int edges = 64;
  Rod rod = straightRod(edges, Measure::angle);
  rod.material.axial_stiffness = 1e4; // tension from deflections of 1e-7 is none
  Scene scene = clampedScene(rod);
  scene.forces = {{0, edges, Vec3(0, -load, 0)}};
  Simulation cantilever;
  solve(cantilever, scene, 1);
  EXPECT_LT((actionsOf(cantilever).reaction_moment[0] - Vec3(0, 0, load)).norm(), 1e-8 * load);
  EXPECT_LT((actionsOf(cantilever).reaction[0] - Vec3(0, load, 0)).norm(), 1e-8 * load);
  scene.supports.push_back(hold(scene, 0, edges, Support::Kind::pin));
  scene.forces = {{0, edges / 2, Vec3(0, -load, 0)}};
  Simulation propped;
  solve(propped, scene, 1);
  const RodActions actions = actionsOf(propped);
  const double cut = 2e-4 * load; // of 64 edges, 1/64^2 = 2.4e-4
  EXPECT_LT((actions.reaction[0] - Vec3(0, 11.0 / 16 * load, 0)).norm(), cut);
  EXPECT_LT((actions.reaction[1] - Vec3(0, 5.0 / 16 * load, 0)).norm(), cut);
  EXPECT_LT((actions.reaction_moment[0] - Vec3(0, 0, 3.0 / 16 * load)).norm(), cut);
  EXPECT_EQ(actions.reaction_moment[1], Vec3(Vec3::Zero()));
}

/// In motion: the change of momentum of all vertices, dissipation by mass included, over one step of backward Euler.
TEST(Reaction, OfAMovingPinPullsTheRodAlong) {
  const double dt = 0.01;
  Rod rod = softRod(12, Measure::tan);
  rod.material.linear_rotational_inertia = 1e-12;
  rod.material.mass_damping_coefficient = 0.7;
  Scene scene = clampedScene(rod);
  scene.supports[0].kind = Support::Kind::pin;
  scene.supports[0].motion.velocity = Vec3(-0.2, 0.3, 0.1);
  scene.gravity = Vec3(0, -9.81, 2);
  EXPECT_PETSC(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-10"));
  Simulation sim;
  runTo(sim, scene, dynamics(dt, 10 * dt));
  auto momentum = [&] {
    Vec3 sum = Vec3::Zero();
    for (int v = 0; v <= 12; ++v) sum += sim.elements->mass()[sim.elements->vertex_slot[v]] * sim.state.velocity[v];
    return sum;
  };
  const Vec3 before = momentum();
  takeEleventhStep(sim, dt);
  const Vec3 expected = (momentum() - before) / dt + 0.7 * momentum() - scene.gravity * rod.material.linear_density;
  EXPECT_LT((actionsOf(sim).reaction[0] - expected).norm(), 1e-6)
      << expected.norm(); // differences of positions over dt^2, of 13 vertices
}

TEST(Strains, OfARingAreItsCurvature) {
  const int edges = 24;
  for (const Measure measure : {Measure::tan, Measure::angle}) {
    Rod rod = inextensibleRod(ringShape(Vec3::Zero(), Vec3::UnitZ(), 0.5, edges).points, measure);
    rod.closed = true;
    rod.natural = Rod::Natural::given; // straight
    rod.director.clear();
    setBishopDirectors(rod);
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {rod};
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    const double turn = 2 * pi / edges, length = 2 * 0.5 * std::sin(turn / 2);
    const double curvature = (measure == Measure::tan ? 2 * std::tan(turn / 2) : turn) / length;
    const RodStrains strains = strainsOf(sim);
    const RodActions actions = actionsOf(sim);
    for (int v = 0; v < edges; ++v) {
      EXPECT_NEAR(strains.curvature[v].norm(), curvature, 1e-12);
      EXPECT_NEAR(strains.twist[v], 0, 1e-12);
      EXPECT_NEAR(strains.strain_energy_density[v], 0.5 * curvature * curvature, 1e-11);
      // Conjugate to the turning: the strain times its derivative by the angle, 1/cos^2 of half of it for `tan`.
      const double slope = measure == Measure::tan ? 1 / std::pow(std::cos(turn / 2), 2) : 1;
      EXPECT_LT((actions.moment[v] - Vec3(0, 0, curvature * slope)).norm(), 1e-12);
    }
  }
}

TEST(Strains, CountWholeTurns) {
  Rod rod = straightRod(4, Measure::angle);
  rod.initial_turns = 3; // 270 degrees in each cell
  Simulation sim;
  EXPECT_PETSC(sim.setUp(clampedScene(rod), dynamics(0.01, 1)));
  const RodStrains strains = strainsOf(sim);
  const RodActions actions = actionsOf(sim);
  for (int v = 1; v < 4; ++v) {
    EXPECT_NEAR(strains.twist[v], 6 * pi, 1e-12);
    EXPECT_LT((actions.moment[v] - Vec3(4 * pi, 0, 0)).norm(), 1e-11);
  }
}

/// A damped spring on its way beside a cable: over the vertices, the densities add up to the energies of the
/// diagnostics.
TEST(StrainEnergyDensity, AddsUpToTheEnergy) {
  Rod spring;
  spring.name = "spring";
  spring.position = helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 0.5, 0.1, 2, 0.1, 40}).points;
  spring.material = homogeneousMaterial({SectionShape::rectangle, {0.01, 0.006}}, 1e7, 4e6, 1000);
  spring.material.stiffness_damping_coefficient = 1e-3;
  setBishopDirectors(spring);
  Rod cable = straightRod(10);
  cable.name = "cable";
  cable.material.axial_stiffness = 1e3;
  cable.material.flexural_stiffness = {0, 0};
  Scene scene = clampedScene(spring);
  scene.rods.push_back(cable);
  scene.supports.push_back(hold(scene, 1, 0, Support::Kind::pin));
  scene.supports.push_back(hold(scene, 0, 20, Support::Kind::clamp));
  scene.gravity = Vec3(0, -9.81, 0);
  Simulation sim;
  runTo(sim, scene, dynamics(0.01, 0.1));
  const RodStrains strains = strainsOf(sim);
  std::vector<double> length(sim.state.position.size(), 0.0);
  for (std::size_t i = 0; i < sim.state.director.size(); ++i)
    for (const int v : {sim.elements->vertex0[i], sim.elements->vertex1[i]})
      length[v] += 0.5 * sim.elements->restLength()[sim.elements->edge_slot[i]];
  double sum = 0;
  for (std::size_t v = 0; v < length.size(); ++v) sum += strains.strain_energy_density[v] * length[v];
  const EnergyBudget budget = energyBudget(sim.scene, *sim.elements, sim.state, 1);
  EXPECT_GT(sum, 1e-3);
  EXPECT_NEAR(sum, budget.stretch + budget.bend + budget.twist, 1e-12 * sum);
}

} // namespace
} // namespace tendril::test
