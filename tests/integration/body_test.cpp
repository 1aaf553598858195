/// Rigid bodies alone and on rods, against closed forms, reference solutions and the same thing built otherwise.
#include "support/beams.hpp"
#include "support/random_cell.hpp"
#include "tendril/energy/derived.hpp"
#include "tendril/geometry/rotation.hpp"

namespace tendril::test {
namespace {

const char *const every_integrator[] = {"euler",   "bdf2",     "bdf3",        "sdirk2",          "sdirk23",
                                        "sdirk33", "midpoint", "symplectic2", "energy_momentum", "generalized_alpha"};

Body bodyOf(MassProperties own, const Vec3 &at) {
  Body body;
  body.name = "body";
  body.own = own.moved(Mat3::Identity(), at);
  body.position = at;
  return body;
}

Attachment tie(const Scene &scene, int rod, int vertex, int body, bool weld) {
  return {"tie", rod, vertex, body, weld, frameAtVertex(scene.rods[rod], vertex)};
}

/// A body without loads beside a rod at rest.
Scene freeBody(const Vec3 &inertia, const Vec3 &spin) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {beam({0, 1, 0}, {1, 1, 0}, 4, "rest")};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  scene.bodies = {bodyOf({1, Vec3::Zero(), inertia.asDiagonal()}, {0, 0, 0})};
  scene.bodies[0].angular_velocity = spin;
  return scene;
}

Mat3 rotationOfBody(const Simulation &run, int body = 0) {
  return rotationOf(run.state, run.elements->body(body).group);
}

double turnError(const Simulation &run, const Mat3 &expected) { return (rotationOfBody(run) - expected).norm(); }

/// A spin about an axis near the middle one flips over, by Jacobi's functions.
TEST(Bodies, ATumblingBodyConvergesAtTheOrderOfItsMethod) {
  auto row = referenceRow("bodies_tumbling_1_2_3.csv", 4);
  const Mat3 expected = Eigen::Quaterniond(row["qw"], row["qx"], row["qy"], row["qz"]).toRotationMatrix();
  const Vec3 spin = expected * Vec3(row["w1"], row["w2"], row["w3"]);
  for (const std::string name : every_integrator) {
    double off[2], slow[2];
    for (const int k : {0, 1}) {
      LoopSettings settings = dynamics(k == 0 ? 0.04 : 0.02, 4);
      settings.integrator.name = name;
      Simulation run;
      runTo(run, freeBody({1, 2, 3}, {1, 0.001, 1}), settings);
      off[k] = turnError(run, expected);
      slow[k] = (run.state.body_rate[0].spin - spin).norm();
      // Newton stops at 1e-6 of the forces; to rounding: verify_dynamics.
      EXPECT_LT((run.state.body_rate[0].momentum - Vec3(1, 0.002, 3)).norm(), 1e-5) << name;
    }
    const double expected_order = name == "euler" ? 0.8 : 1.9; // methods of third order turn bodies at the second
    EXPECT_GT(order(off[0], off[1]), expected_order) << name << ": " << off[0] << " " << off[1];
    EXPECT_GT(order(slow[0], slow[1]), expected_order) << name << ": " << slow[0] << " " << slow[1];
    EXPECT_LT(off[1], name == "euler" ? 0.2 : 5e-3) << name;
  }
}

/// The centre of mass of a thrown body flies a parabola, which all methods of second order follow exactly.
TEST(Bodies, AThrownBodyFliesAParabola) {
  for (const std::string name : every_integrator) {
    if (name == "euler") continue;
    Scene scene = freeBody({1, 2, 3}, {1, 2, 0.5});
    scene.gravity = Vec3(0, 0, -10);
    scene.rods[0].gravity = false;
    scene.bodies[0].velocity = Vec3(1, 2, 3);
    LoopSettings settings = dynamics(0.02, 0.4);
    settings.integrator.name = name;
    Simulation run;
    runTo(run, scene, settings);
    const Vec3 expected(0.4, 0.8, 1.2 - 5 * 0.16);
    // bdf2 and bdf3 begin by steps of another method, whose positions are those of the parabola, too.
    EXPECT_LT((run.state.body_position[0] - expected).norm(), 1e-8) << name;
    EXPECT_LT((run.state.body_rate[0].translation - Vec3(1, 2, -1)).norm(), 1e-7) << name;
  }
}

/// What is fixed on a body that goes round moves on a circle.
TEST(Bodies, MotionsOfBodiesHaveArms) {
  Motion motion;
  motion.velocity = Vec3(1, 0, 0);
  motion.angular_velocity = Vec3(0, 0, 2);
  const Motion there = motion.at({0, 3, 0});
  EXPECT_LT((there.displacementAt(pi / 4) - Vec3(pi / 4 - 3, -3, 0)).norm(), 1e-14);
  const double h = 1e-6;
  EXPECT_LT(((there.displacementAt(0.3 + h) - there.displacementAt(0.3 - h)) / (2 * h) - there.velocityAt(0.3)).norm(),
            1e-8);
}

/// A weight whose centre is the end of a rod is a dead force there, once its mass is counted.
TEST(Bodies, AHungBodyIsADeadForce) {
  for (const bool weld : {false, true}) {
    Scene with, without;
    with.gravity = without.gravity = Vec3(0, 0, -1);
    with.rods = without.rods = {beam({0, 0, 0}, {1, 0, 0}, 16, "rod")};
    with.supports = without.supports = {hold(with, 0, 0, Support::Kind::clamp)};
    with.bodies = {bodyOf(sphereMass(0.1, 2000), {1, 0, 0})};
    with.attachments = {tie(with, 0, 16, 0, weld)};
    without.forces = {{0, 16, Vec3(0, 0, -with.bodies[0].own.mass)}};
    Simulation hung, pulled;
    runTo(hung, with, statics(4));
    runTo(pulled, without, statics(4));
    double off = 0, deflection = 0;
    for (int v = 0; v <= 16; ++v) {
      off = std::max(off, (hung.state.position[v] - pulled.state.position[v]).norm());
      deflection = std::max(deflection, std::abs(pulled.state.position[v][2]));
    }
    EXPECT_GT(deflection, 0.3);
    EXPECT_LT(off, 1e-6) << weld; // Newton's tolerance
  }
}

/// What a rod does to a body at rest bears the weight of the body, and its moment about the tie.
TEST(Bodies, TiesTellTheirForces) {
  for (const bool weld : {false, true}) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -1);
    scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 16, "rod")};
    scene.rods[0].gravity = false;
    scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
    const Vec3 at = weld ? Vec3(1.1, 0.2, 0.05) : Vec3(1, 0, -0.2);
    scene.bodies = {bodyOf(sphereMass(0.1, 100), at)};
    scene.attachments = {tie(scene, 0, 16, 0, weld)};
    Simulation run;
    runTo(run, scene, statics(4));
    const RodActions actions = rodActions(run.scene, *run.elements, run.state, 1, 1, false);
    const double weight = scene.bodies[0].own.mass; // that of the half edge is none: the rod has no weight
    const Vec3 arm = run.state.body_position[0] - run.state.position[16],
               moment = -arm.cross(Vec3(0, 0, -run.elements->bodyMass(0).mass));
    EXPECT_NEAR(actions.attachment[0][2], run.elements->bodyMass(0).mass, 1e-5 * weight);
    EXPECT_LT((actions.attachment_moment[0] - (weld ? moment : Vec3::Zero())).norm(), 1e-5 * weight) << weld;
  }
}

/// A point mass on a vertex is a body there that nothing turns.
TEST(Bodies, APointMassSwingsAsABodyOnAPin) {
  Scene body, mass;
  body.gravity = mass.gravity = Vec3(0, 0, -1);
  body.rods = mass.rods = {beam({0, 0, 0}, {1, 0, 0}, 8, "rod")};
  body.supports = mass.supports = {hold(mass, 0, 0, Support::Kind::pin)};
  mass.forces = {{0, 8, Vec3::Zero(), 0.5}};
  body.bodies = {bodyOf({0.5, Vec3::Zero(), 1e-3 * Mat3::Identity()}, {1, 0, 0})};
  body.attachments = {tie(body, 0, 8, 0, false)};
  for (const std::string name : {"euler", "bdf2"}) {
    LoopSettings settings = dynamics(0.01, 0.5);
    settings.integrator.name = name;
    Simulation a, b;
    runTo(a, body, settings);
    runTo(b, mass, settings);
    EXPECT_LT((a.state.position[8] - b.state.position[8]).norm(), 1e-6) << name; // Newton's tolerance over 50 steps
    EXPECT_GT((b.state.position[8] - Vec3(1, 0, 0)).norm(), 0.05) << name;
  }
}

/// A body of hardly any mass between two welded ends is a rigid junction, with its ends apart.
TEST(Bodies, AWeightlessBodyIsARigidJunction) {
  for (const bool dynamic : {false, true}) {
    Scene joint, body;
    joint.gravity = body.gravity = Vec3(0, 0, -0.5);
    auto rods = [](double gap) {
      return std::vector<Rod>{beam({0, 0, 0}, {0.5, 0, 0}, 10, "a", 1e5),
                              beam({0.5 + gap, 0, 0}, {0.5 + gap, 0.4, 0.2}, 10, "b", 1e5)};
    };
    joint.rods = rods(0);
    body.rods = rods(1e-9);
    joint.supports = {hold(joint, 0, 0, Support::Kind::clamp)};
    body.supports = {hold(body, 0, 0, Support::Kind::clamp)};
    joint.forces = body.forces = {{1, 10, Vec3(0, -0.3, 1)}};
    joint.junctions = {{"joint", {{0, 10, 0}, {1, 0, 0}}, 1}};
    body.bodies = {bodyOf({1e-9, Vec3::Zero(), 1e-9 * Mat3::Identity()}, {0.5, 0, 0})};
    body.attachments = {tie(body, 0, 10, 0, true), tie(body, 1, 0, 0, true)};
    for (Attachment &a : body.attachments) // junctions tie the frames of the edges themselves
      a.frame = {body.rods[a.rod].edge(a.rod == 0 ? 9 : 0).normalized(), body.rods[a.rod].director[a.rod == 0 ? 9 : 0],
                 1};
    LoopSettings settings = dynamic ? dynamics(0.01, 0.2) : statics(4);
    if (dynamic) settings.integrator.name = "bdf2";
    Simulation one, two;
    runTo(one, joint, settings);
    runTo(two, body, settings);
    double off = 0;
    for (int v = 0; v < 22; ++v) off = std::max(off, (one.state.position[v] - two.state.position[v]).norm());
    EXPECT_GT((one.state.position[21] - joint.rods[1].position[10]).norm(), 0.02);
    EXPECT_LT(off, 2e-6) << dynamic; // Newton's tolerance, and the mass of the body
  }
}

/// A body on a taut rod that swings: however stiff the rod, steps take about the same iterations (the straight way of
/// the body's end stretches it by squares).
TEST(Bodies, ATautRodTakesNoMoreIterations) {
  for (const bool weld : {true, false}) {
    int least = 1 << 30, most = 0;
    for (const double stiffness : {1e3, 1e5, 1e7, 1e9}) {
      Scene scene;
      scene.gravity = Vec3(0, 0, -9.81);
      scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 20, "rod", stiffness)};
      scene.rods[0].material.flexural_stiffness = {0.01, 0.01};
      scene.rods[0].material.linear_density = 0.05;
      scene.supports = {hold(scene, 0, 0, Support::Kind::pin)};
      scene.bodies = {bodyOf(boxMass({0.1, 0.1, 0.1}, 1000), {1.05, 0, 0})};
      scene.attachments = {tie(scene, 0, 20, 0, weld)};
      LoopSettings settings = dynamics(0.01, 1);
      settings.integrator.name = "bdf2";
      Simulation run;
      int iterations = 0;
      runTo(run, scene, settings, &iterations);
      least = std::min(least, iterations);
      most = std::max(most, iterations);
    }
    EXPECT_LT(most, 1.6 * least) << weld << " " << least; // 2.3 a step, and 3.1 where EA is 1e11 times EI/L^2
  }
}

/// A rod between two bodies, all free: linear and angular momentum stay.
TEST(Bodies, AFreeAssemblyKeepsItsMomenta) {
  for (const std::string name : every_integrator) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 8, "rod")};
    scene.rods[0].initial_velocity = Vec3(0.2, 0, 0.1);
    scene.bodies = {bodyOf(boxMass({0.1, 0.2, 0.3}, 100), {-0.05, 0.02, 0}),
                    bodyOf(boxMass({0.2, 0.1, 0.1}, 200), {1.1, 0, 0.03})};
    scene.bodies[0].angular_velocity = Vec3(0.5, -0.2, 1);
    scene.bodies[1].velocity = Vec3(0, 0.4, -0.1);
    scene.attachments = {tie(scene, 0, 0, 0, true), tie(scene, 0, 8, 1, false)};
    auto momenta = [](const Simulation &run) {
      Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
      const Elements &e = *run.elements;
      for (int v = 0; v <= 8; ++v) {
        const Vec3 p = e.mass()[e.vertex_slot[v]] * run.state.velocity[v];
        linear += p;
        angular += run.state.position[v].cross(p);
      }
      for (int b = 0; b < 2; ++b) {
        const Vec3 p = e.bodyMass(b).mass * run.state.body_rate[b].translation;
        linear += p;
        angular += run.state.body_position[b].cross(p) + run.state.body_rate[b].momentum;
      }
      return std::array{linear, angular};
    };
    LoopSettings settings = dynamics(0.005, 0.5);
    settings.integrator.name = name;
    Simulation first, run;
    EXPECT_PETSC(first.setUp(scene, settings));
    runTo(run, scene, settings);
    const auto before = momenta(first), after = momenta(run);
    EXPECT_GT((run.state.body_position[1] - first.state.body_position[1]).norm(), 0.05);
    EXPECT_LT((after[0] - before[0]).norm(), 2e-6) << name; // Newton's tolerance over 100 steps
    const bool keeps_angular = name == "midpoint" || name == "symplectic2" || name == "energy_momentum";
    // Twist inertia of the rod is a scalar about a moving tangent: of 1e-6 kg m it holds next to nothing. Others lose
    // angular momentum of the vertices, at their order.
    EXPECT_LT((after[1] - before[1]).norm(), keeps_angular ? 1e-5 : name == "euler" ? 5e-2 : 1e-2) << name;
  }
}

Constraint springTo(const Scene &scene, Constraint::Kind kind, int rod, int at, double stiffness) {
  Constraint c = constraintOn(rod, at, kind, stiffness);
  c.to_body = 0;
  if (c.isPin())
    c.point = scene.rods[rod].position[at];
  else
    c.frame = {scene.rods[rod].edge(at).normalized(), scene.rods[rod].director[at], 1};
  return c;
}

/// Springs in place of a weld come to it as 1/k, in steps of time in no more iterations.
TEST(Bodies, SpringsComeToTheWeldAsTheyStiffen) {
  auto scene = [](double factor) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -1);
    scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 16, "rod")};
    scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
    scene.bodies = {bodyOf(boxMass({0.2, 0.2, 0.2}, 300), {1.1, 0.05, 0})};
    if (factor == 0) {
      scene.attachments = {tie(scene, 0, 16, 0, true)};
      return scene;
    }
    scene.constraints = {springTo(scene, Constraint::Kind::pin, 0, 16, 1e3 * factor),
                         springTo(scene, Constraint::Kind::rotation, 0, 15, 10 * factor)};
    scene.constraints[0].name = "place";
    return scene;
  };
  for (const bool dynamic : {false, true}) {
    LoopSettings settings = dynamic ? dynamics(0.01, 0.3) : statics(4);
    if (dynamic) settings.integrator.name = "bdf2";
    settings.solve.rounding_tolerance = 1e-3;
    Simulation limit;
    runTo(limit, scene(1e7), settings); // what is left then is the difference between edge and vertex
    double off[4];
    int iterations[4] = {};
    for (int k = 0; k < 4; ++k) {
      Simulation run;
      runTo(run, scene(std::pow(10, k)), settings, &iterations[k]);
      off[k] = (run.state.body_position[0] - limit.state.body_position[0]).norm();
    }
    for (int k = 1; k < 4; ++k) {
      // By 1/k; curved at the soft end. Newton's tolerance of 1e-6 of the load is below.
      EXPECT_NEAR(off[k - 1] / off[k], 10, 2.5) << dynamic << " " << off[k - 1] << " " << off[k];
      // In statics a spring that is stiff beside the rod turns large trials away: by a factor of 1.5 for each of 10,
      // and one or two by what the dense kernels of a BLAS round otherwise (44 and 45 by two of them).
      EXPECT_LE(iterations[k], 2 + iterations[0] * (dynamic ? 1.5 : std::pow(1.5, k))) << dynamic;
    }
    Simulation weld;
    runTo(weld, scene(0), settings);
    const double moved = (weld.state.body_position[0] - Vec3(1.1, 0.05, 0)).norm();
    // The spring holds the edge, the weld the end beyond half an edge of 1/16.
    EXPECT_LT((weld.state.body_position[0] - limit.state.body_position[0]).norm(), 0.1 * moved) << dynamic;
    EXPECT_GT(moved, 0.01) << dynamic;
  }
}

/// A damper between a rod and a body keeps the momentum of both, and takes energy.
TEST(Bodies, SpringsActOnBothEnds) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 8, "rod")};
  scene.bodies = {bodyOf(boxMass({0.1, 0.2, 0.3}, 100), {1.2, 0.02, 0})};
  scene.bodies[0].velocity = Vec3(0.3, 0.1, 0);
  scene.bodies[0].angular_velocity = Vec3(1, 0, 0.5);
  scene.constraints = {springTo(scene, Constraint::Kind::pin, 0, 8, 50),
                       springTo(scene, Constraint::Kind::rotation, 0, 7, 2)};
  for (Constraint &c : scene.constraints) c.damping = 0.05;
  scene.constraints[0].name = "place";
  scene.constraints[0].saturation = 0.02;
  for (const std::string name : {"euler", "bdf2", "midpoint"}) {
    LoopSettings settings = dynamics(0.005, 0.5);
    settings.integrator.name = name;
    Simulation run;
    runTo(run, scene, settings);
    Vec3 linear = run.elements->bodyMass(0).mass * run.state.body_rate[0].translation;
    for (int v = 0; v <= 8; ++v) linear += run.elements->mass()[run.elements->vertex_slot[v]] * run.state.velocity[v];
    EXPECT_LT((linear - 0.6 * Vec3(0.3, 0.1, 0)).norm(), 2e-6) << name; // Newton's tolerance over 100 steps
    EXPECT_GT((run.state.position[8] - Vec3(1, 0, 0)).norm(), 0.02) << name;
  }
}

/// Exact derivatives: differences of the energy in statics, where all of it is a potential.
TEST(Bodies, DerivativesAreThoseOfTheEnergy) {
  Scene scene;
  scene.gravity = Vec3(0.3, -0.2, -1);
  scene.rods = {beam({0, 0, 0}, {1, 0, 0}, 5, "a", 100), beam({1.2, 0.1, 0}, {1.2, 1, 0.3}, 4, "b", 100)};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  scene.bodies = {bodyOf(boxMass({0.1, 0.2, 0.3}, 100), {1.1, 0.05, 0.1})};
  scene.bodies[0].force = Vec3(0.4, 1, -2);
  scene.attachments = {tie(scene, 0, 5, 0, true), tie(scene, 1, 2, 0, true)};
  scene.forces = {{1, 2, Vec3(1, 2, 3)}, {0, 5, Vec3(-1, 1, 0)}};
  Scene with_springs = scene;
  with_springs.attachments.clear();
  with_springs.constraints = {springTo(scene, Constraint::Kind::pin, 0, 5, 70),
                              springTo(scene, Constraint::Kind::rotation, 1, 2, 3),
                              springTo(scene, Constraint::Kind::pin, 1, 2, 40)};
  with_springs.constraints[0].point += Vec3(0.02, 0.01, -0.03);
  with_springs.constraints[2].saturation = 0.5; // its law has a kink there
  for (const std::string what : {"weld", "pin", "springs"}) {
    const bool weld = what == "weld";
    for (Attachment &a : scene.attachments) a.weld = weld;
    if (what == "springs") scene = with_springs;
    Simulation sim;
    LoopSettings settings = statics();
    settings.mixed = false;
    EXPECT_PETSC(sim.setUp(scene, settings));
    IncrementalPotential &p = *sim.potential;
    const RodSet all = sim.dofs.all();
    const Step step = TimeLoop::stepOf(settings, sim.state, 1);
    p.beginStep(sim.state, step);
    for (int r = 0; r < all.end; ++r) p.beginRod(sim.state, r);
    Random random(9);
    auto noise = [&](double size) {
      Planes d = sim.dofs.makePlanes();
      for (int s = 0; s < sim.dofs.slots(); ++s)
        for (int a = 0; a < slot_size; ++a)
          if (sim.dofs.unknown(s, a) >= 0) d[a][s] = size * random();
      sim.dofs.copyJoined(all, d);
      return d;
    };
    Configuration trial;
    ASSERT_TRUE(p.tryMove(noise(0.05), 1, all, RetractionKind::additive, trial));
    p.accept(trial);
    const Planes v = noise(1);
    const Derivatives &d = p.derivatives();
    const double slope = sim.dofs.dot(all, d.gradient, v);
    Planes kv = sim.dofs.makePlanes();
    for (int r = 0; r < all.end; ++r) d.blocks.multiply(sim.dofs.rods()[r], sim.dofs.joins(r), v, kv);
    sim.dofs.foldJoined(all, kv);
    const double curvature = sim.dofs.dot(all, kv, v), h = 2e-3;
    double e[5];
    for (int k = 0; k < 5; ++k) {
      ASSERT_TRUE(p.tryMove(v, (k - 2) * h, all, RetractionKind::additive, trial));
      e[k] = p.energy(trial, all);
    }
    EXPECT_NEAR((e[0] - 8 * e[1] + 8 * e[3] - e[4]) / (12 * h), slope, 1e-7 * std::abs(slope)) << what;
    EXPECT_NEAR((-e[0] + 16 * e[1] - 30 * e[2] + 16 * e[3] - e[4]) / (12 * h * h), curvature,
                1e-6 * std::abs(curvature))
        << what;
  }
}

} // namespace
} // namespace tendril::test
