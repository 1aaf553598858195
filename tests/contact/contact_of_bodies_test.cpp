/// Contact of bodies with rods and with each other: derivatives, momenta, rest, what goes through and what does not.
#include "support/beams.hpp"
#include "support/option_set.hpp"
#include "support/random_cell.hpp"
#include "support/touching.hpp"
#include "tendril/contact/touching_bodies.hpp"
#include "tendril/coupling/couplings.hpp"
#include "tendril/geometry/rotation.hpp"

namespace tendril::test {
namespace {

Body touching(const std::string &name, const std::string &shape, const Vec3 &size, const Vec3 &at,
              const Vec3 &turn = Vec3::Zero()) {
  Body body = shaped(shape, size, at, rotationBy(turn));
  body.name = name;
  body.contact.bodies = true;
  return body;
}

Rod touchingWire(const std::string &name, const Vec3 &from, const Vec3 &to, int edges, double radius = 0.005,
                 double young = 1e7) {
  Rod rod = wire(name, from, to, edges, radius, young);
  rod.contact.rods = ContactSettings::Rods::none;
  rod.contact.bodies = true;
  return rod;
}

/// A rod that lies within the barrier of a body of every shape, some of them beside another rod, and two bodies that
/// touch each other; and a ring that a ball touches where it closes. \param on_skin whether rods touch by tubes
Scene pressedScene(bool on_skin = false) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  const double r = 0.005;
  scene.rods = {touchingWire("a", Vec3(-0.1, 0, 0), Vec3(0.1, 0.01, 0), 9, r),
                touchingWire("b", Vec3(-0.1, 1, 0), Vec3(0.1, 1, 0.02), 7, r),
                touchingWire("ring", Vec3(-0.1, 2, 0), Vec3(0.1, 2, 0.02), 7, r)};
  Rod &ring = scene.rods[2];
  ring.position = ringShape(Vec3(0, 0.3, 0), Vec3(0, 0.1, 1).normalized(), 0.06, 14).points;
  ring.closed = true;
  setBishopDirectors(ring);
  scene.bodies = {touching("ball", "sphere", {0.03, 0, 0}, {0.012, 0.003, 0.0351}),
                  touching("crate", "box", {0.05, 0.04, 0.03}, {-0.05, 0.01, -0.0201}, {0.01, 0, 0.4}),
                  touching("bar", "capsule", {0.01, 0.1, 0}, {0.05, 0.005, -0.0149}, {1.5, 0.2, 0}),
                  touching("drum", "cylinder", {0.03, 0.05, 0}, {0.02, 1, -0.0241}, {0.1, 0.1, 0.1}),
                  touching("one", "box", {0.05, 0.05, 0.05}, {3, 0, 0}),
                  touching("other", "box", {0.05, 0.05, 0.05}, {3.02, 0.01, 0.0502}, {0, 0, 0.3}),
                  touching("below", "sphere", {0.03, 0, 0},
                           0.5 * (ring.position.front() + ring.position.back()) - Vec3(0.003, 0.004, 0.0344))};
  for (Rod &rod : scene.rods) {
    rod.contact.distance = r;
    rod.contact.stiffness = 100;
    rod.contact.friction = 0.3;
    if (!on_skin) continue;
    SkinRecipe recipe;
    recipe.tube = {7, {r, r}, false, false};
    rod.skin = std::make_shared<SkinRecipe>(recipe);
    rod.contact.on_surface = true;
    rod.contact.quadrature = 3;
  }
  for (Body &body : scene.bodies) {
    body.contact.stiffness = 10;
    body.contact.friction = 0.2;
    body.rod = body.name == "drum" || body.name == "crate" ? 1 : body.name == "below" ? 2 : 0;
  }
  return scene;
}

/// Derivatives of the term alone, whose energy is a potential. With friction the points slide by a part of the
/// fall-off.
TEST(ContactOfBodies, HasTheDerivativesOfItsEnergy) {
  for (const auto &[slides, on_skin] : {std::pair(false, false), {true, false}, {false, true}, {true, true}}) {
    Scene scene = pressedScene(on_skin);
    for (Rod &rod : scene.rods) rod.contact.friction = slides ? 0.3 : 0;
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    EXPECT_PETSC(sim.solver.begin(sim.state, TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01)));
    const std::unique_ptr<Term> contact = makeContactOfBodies(sim.scene, *sim.elements);
    IncrementalPotential &potential = *sim.potential;
    const Configuration &start = potential.start();
    Step step;
    step.dt = step.time = 0.01;
    std::vector<TouchingPair> pairs;
    contact->findTouching(sim.state, start, sim.dofs.makePlanes(), step, 1, pairs);
    std::size_t with_two_bodies = 0;
    for (const TouchingPair &p : pairs) with_two_bodies += p.isOfBodies();
    EXPECT_GE(with_two_bodies, 1u);
    EXPECT_GE(pairs.size() - with_two_bodies, 5u);
    Derivatives d(sim.elements->slots, true);
    d.blocks.setTouching(pairs.size());
    contact->addBetween(start, {0, 3}, d, HessianKind::exact);
    sim.dofs.setTouching(pairs);
    Random random(5);
    for (int k = 0; k < 6; ++k) {
      Planes v = sim.dofs.makePlanes(), kv = v;
      for (int s = 0; s < sim.dofs.slots(); ++s)
        for (int a = 0; a < slot_size; ++a)
          if (sim.dofs.unknown(s, a) >= 0) v[a][s] = (a == 3 ? 1 : 0.01) * random();
      for (const JoinedBody &b : sim.elements->bodies({0, 3})) v.setVector(0, b.rotation, random.vector());
      Planes closed = v;
      const RodRange &ring = sim.elements->rods[2];
      closed.setVector(0, ring.slot(ring.vertices), v.vector(0, ring.first_slot));
      for (int r = 0; r < 3; ++r) d.blocks.multiply(sim.elements->rods[std::size_t(r)], sim.dofs.joins(r), closed, kv);
      double slope = 0, curvature = 0, size = 0, moved = 0;
      for (int s = 0; s < sim.dofs.slots(); ++s)
        for (int a = 0; a < slot_size; ++a) {
          slope += v[a][s] * d.gradient[a][s];
          curvature += closed[a][s] * kv[a][s];
          size += d.gradient[a][s] * d.gradient[a][s];
          moved += v[a][s] * v[a][s];
        }
      auto energy = [&](double part) {
        Configuration trial;
        EXPECT_TRUE(potential.tryMove(closed, part, trial));
        return contact->energy(trial, 0) + contact->energy(trial, 1) + contact->energy(trial, 2);
      };
      constexpr double h = 1e-6; // the third derivative of friction jumps where nothing slides
      const double e[5] = {energy(-2 * h), energy(-h), energy(0), energy(h), energy(2 * h)};
      EXPECT_GT(e[2], 0);
      EXPECT_NEAR((e[0] - 8 * e[1] + 8 * e[3] - e[4]) / (12 * h), slope, 1e-7 * std::sqrt(size * moved)) << k;
      EXPECT_NEAR((-e[0] + 16 * e[1] - 30 * e[2] + 16 * e[3] - e[4]) / (12 * h * h), curvature,
                  2e-4 * std::abs(curvature))
          << k << " " << slides << " " << on_skin;
    }
  }
}

/// What bodies and rods do to each other cancels: forces, and moments about any place. Where they have slid since the
/// step began, the points where friction acts on both are so far apart, and no more.
TEST(ContactOfBodies, LeavesMomentaAlone) {
  for (const auto &[slid, on_skin] : {std::pair(false, false), {true, false}, {false, true}, {true, true}}) {
    Simulation sim;
    EXPECT_PETSC(sim.setUp(pressedScene(on_skin), dynamics(0.01, 1)));
    EXPECT_PETSC(sim.solver.begin(sim.state, TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01)));
    const std::unique_ptr<Term> contact = makeContactOfBodies(sim.scene, *sim.elements);
    const Configuration &start = sim.potential->start();
    Step step;
    step.dt = step.time = 0.01;
    std::vector<TouchingPair> pairs;
    contact->findTouching(sim.state, start, sim.dofs.makePlanes(), step, 1, pairs);
    constexpr double way = 5e-5; // half of what friction needs to act in full
    Planes v = sim.dofs.makePlanes();
    for (const JoinedBody &b : sim.elements->bodies({0, 3})) v.setVector(0, b.position, way * Vec3(1, 0.4, 0));
    Configuration c;
    ASSERT_TRUE(sim.potential->tryMove(v, slid ? 1 : 0, c));
    Derivatives d(sim.elements->slots, true);
    d.blocks.setTouching(pairs.size());
    contact->addBetween(c, {0, 3}, d, HessianKind::none);
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    double size = 0, size_of_moment = 0;
    auto add = [&](const Vec3 &x, const Vec3 &f, const Vec3 &couple) {
      force += f;
      moment += x.cross(f) + couple;
      size += f.norm();
      size_of_moment += x.cross(f).norm() + couple.norm();
    };
    for (int n = 0; n < sim.elements->vertices(); ++n) {
      const int s = sim.elements->vertex_slot[std::size_t(n)];
      add(c.positionAt(s), d.gradient.vector(0, s), Vec3::Zero());
    }
    for (int n = 0; n < sim.elements->edges(); ++n) // twists turn edges about themselves
      moment += d.gradient[3][sim.elements->edge_slot[std::size_t(n)]] *
                c.frameAt(sim.elements->edge_slot[std::size_t(n)]).tangent;
    for (const JoinedBody &b : sim.elements->bodies({0, 3}))
      add(c.positionAt(b.position), d.gradient.vector(0, b.position), d.gradient.vector(0, b.rotation));
    EXPECT_GT(size, 1);
    EXPECT_LT(force.norm(), 1e-12 * size);
    EXPECT_LT(moment.norm(), 1e-12 * size_of_moment + (slid ? 1.2 * way * size : 0)) << on_skin;
  }
}

/// Scenes need a rod; this one takes no part.
Scene bodiesAlone(const std::vector<Body> &bodies, const Vec3 &gravity) {
  Scene scene;
  scene.gravity = gravity;
  scene.rods = {beam({0, 5, 5}, {1, 5, 5}, 2, "rest")};
  scene.rods[0].gravity = scene.rods[0].contact.on = false;
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  scene.bodies = bodies;
  return scene;
}

/// Two balls that meet beside their centres keep the momentum of both, part again or stay, and lose energy.
TEST(ContactOfBodies, BallsThatMeetKeepTheirMomentum) {
  std::vector<Body> balls{touching("a", "sphere", {0.05, 0, 0}, {-0.08, 0, 0}),
                          touching("b", "sphere", {0.04, 0, 0}, {0.08, 0.03, 0})};
  balls[0].velocity = Vec3(1, 0, 0.1);
  balls[1].velocity = Vec3(-2, 0, 0);
  for (Body &ball : balls) ball.contact.friction = 0.4;
  const OptionSet sharp("-snes_rtol", "1e-10");
  Simulation sim;
  runTo(sim, bodiesAlone(balls, Vec3::Zero()), dynamics(1e-3, 0.1));
  Vec3 before = Vec3::Zero(), after = Vec3::Zero();
  double size = 0, energy = 0, start = 0;
  for (std::size_t b : {0u, 1u}) {
    const double mass = balls[b].own.mass;
    before += mass * balls[b].velocity;
    after += mass * sim.state.body_rate[b].translation;
    size += mass * balls[b].velocity.norm();
    start += 0.5 * mass * balls[b].velocity.squaredNorm();
    energy += 0.5 * mass * sim.state.body_rate[b].translation.squaredNorm();
  }
  EXPECT_LT((after - before).norm(), 1e-11 * size);
  EXPECT_LT(energy, 0.9 * start);
  const Vec3 apart = sim.state.body_position[1] - sim.state.body_position[0],
             parting = sim.state.body_rate[1].translation - sim.state.body_rate[0].translation;
  EXPECT_GT(apart.norm(), 0.09 - balls[0].contact.distance);
  EXPECT_GT(apart.dot(parting), 0);
  EXPECT_GT(std::abs(sim.state.body_rate[0].spin[2]), 1); // friction turns them
}

/// Boxes stand on each other: each carries those above.
TEST(ContactOfBodies, BoxesStandOnEachOther) {
  std::vector<Body> boxes;
  for (int k = 0; k < 3; ++k) {
    boxes.push_back(touching("box" + std::to_string(k), "box", Vec3::Constant(0.1),
                             Vec3(0.01 * k, -0.008 * k, 0.055 + 0.105 * k), Vec3(0, 0, 0.3 * k)));
    boxes.back().contact.friction = 0.4;
  }
  Scene scene = bodiesAlone(boxes, Vec3(0, 0, -earth));
  Collider floor;
  floor.name = "floor";
  floor.kind = "plane";
  floor.shape = makeHalfSpace();
  scene.colliders = {floor};
  Simulation sim;
  runTo(sim, scene, dynamics(4e-3, 1.2));
  const double width = boxes[0].contact.distance;
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(sim.state.body_position[std::size_t(k)][2], 0.05 + 0.1 * k, 0.5 * (k + 1) * width) << k;
    EXPECT_LT(sim.state.body_rate[std::size_t(k)].translation.norm(), 1e-3) << k;
    EXPECT_LT((sim.state.body_position[std::size_t(k)] - boxes[std::size_t(k)].position).head(2).norm(), 2e-3) << k;
  }
}

/// A ball rests between two stiff rods, where their distance says, and they carry it.
TEST(ContactOfBodies, ABallRestsOnTwoRods) {
  const double r = 0.005, ball = 0.05, half = 0.03;
  Scene scene;
  scene.gravity = Vec3(0, 0, -earth);
  for (const double y : {-half, half}) {
    scene.rods.push_back(touchingWire(y < 0 ? "left" : "right", Vec3(-0.2, y, 0), Vec3(0.2, y, 0), 16, r, 1e11));
    const int rod = int(scene.rods.size()) - 1;
    for (const int v : {0, 16}) scene.supports.push_back(hold(scene, rod, v, Support::Kind::clamp));
  }
  scene.bodies = {touching("ball", "sphere", {ball, 0, 0}, {0.01, 0, 0.06})};
  Simulation sim;
  runTo(sim, scene, dynamics(2e-3, 0.4));
  const double width = scene.rods[0].contact.distance;
  EXPECT_NEAR(sim.state.body_position[0][2], std::sqrt((ball + r) * (ball + r) - half * half), 0.7 * width);
  EXPECT_NEAR(sim.state.body_position[0][1], 0, 1e-9);
  EXPECT_LT(sim.state.body_rate[0].translation.norm(), 0.02);
}

/// A wire and a ball come at a plate of a centimetre with 100 m/s, in steps that would take them through it and a metre
/// beyond: they stay on their side of it, though it flies and turns.
TEST(ContactOfBodies, NothingPassesThrough) {
  for (const double dt : {1e-2, 1e-3}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {touchingWire("wire", Vec3(-0.2, 0.1, 0.1), Vec3(0.1, 0.12, 0.12), 12, 0.003, 1e9)};
    scene.bodies = {touching("plate", "box", {2, 2, 0.01}, {0, 0, 0}),
                    touching("ball", "sphere", {0.04, 0, 0}, {0.1, -0.1, 0.2})};
    scene.bodies[1].velocity = Vec3(5, 0, -100);
    scene.rods[0].initial_velocity = Vec3(0, 0, -100);
    Simulation sim;
    runTo(sim, scene, dynamics(dt, 5 * dt));
    const Mat3 turned = rotationOf(sim.state, sim.elements->body(0).group);
    auto height = [&](const Vec3 &x) { return (turned.transpose() * (x - sim.state.body_position[0]))[2]; };
    for (const Vec3 &x : sim.state.position) EXPECT_GT(height(x), 0.005) << dt;
    EXPECT_GT(height(sim.state.body_position[1]), 0.04) << dt;
    EXPECT_LT(sim.state.body_rate[0].translation[2], -0.1) << dt; // it has been hit
  }
}

/// Of what is tied to it a body does not feel the part that begins in it; a rod that comes back, it does.
TEST(ContactOfBodies, WhatIsTiedToItIsNotFelt) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  Rod loop = touchingWire("loop", Vec3::Zero(), Vec3(1, 0, 0), 40);
  for (int i = 0; i <= 40; ++i) { // out of a box and round to its far side
    const double t = 1.5 * pi * i / 40;
    loop.position[std::size_t(i)] = Vec3(0.2 * (1 - std::cos(t)), 0.2 * std::sin(t), 0);
  }
  setBishopDirectors(loop);
  scene.rods = {loop};
  scene.bodies = {touching("box", "box", {0.1, 0.1, 0.1}, Vec3(0, 0, 0)),
                  touching("far", "box", {0.1, 0.1, 0.1}, Vec3(0.2, -0.255, 0))};
  scene.attachments.push_back({"weld", 0, 0, 0, false, {}});
  scene.hostBodies();
  Simulation sim;
  sim.describe(scene, true);
  const Configuration c = configurationOf(sim.state, sim.scene, *sim.elements, 0);
  TouchingBodies bodies(sim.scene, *sim.elements);
  bodies.cover(c, 0);
  for (const TouchingPair &p : bodies.pairs().items) {
    const int edge = std::max(p.edge, p.to_edge), body = p.isBody(0) ? p.body(0) : p.body(1);
    EXPECT_TRUE(body == 1 ? edge > 35 : edge > 3) << edge;
  }
  const std::vector<BodyMeeting> near = tightestAmongBodies(sim.scene, *sim.elements, c);
  ASSERT_EQ(near.size(), 1u);
  EXPECT_EQ(near[0].body, 1);
  EXPECT_NEAR(near[0].gap, 0, 1e-3);
  EXPECT_NEAR(near[0].arc, 1.5 * pi * 0.2, 0.01);
}

} // namespace
} // namespace tendril::test
