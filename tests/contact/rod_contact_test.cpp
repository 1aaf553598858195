/// Contact of rods with each other: distances, which edges may touch, derivatives, what crosses and what does not.
#include "support/differences.hpp"
#include "support/option_set.hpp"
#include "support/rods.hpp"
#include "support/touching.hpp"
#include "tendril/contact/contact.hpp"
#include "tendril/contact/neighbours.hpp"
#include "tendril/contact/segments.hpp"

namespace tendril::test {
namespace {

/// A string without bending stiffness, held at both ends.
Rod taut(const std::string &name, const Vec3 &from, const Vec3 &to, int edges, double radius, double stiffness) {
  Rod rod = wire(name, from, to, edges, radius);
  rod.material.flexural_stiffness = {0, 0};
  rod.material.torsional_stiffness = 0;
  rod.material.axial_stiffness = stiffness;
  rod.material.linear_density = 0.01;
  return rod;
}

void holdEnds(Scene &scene, int rod) {
  for (const int v : {0, scene.rods[std::size_t(rod)].vertices() - 1})
    scene.supports.push_back(hold(scene, rod, v, Support::Kind::pin));
}

Vec3 randomPlace(Random &random, double size) { return size * random.vector(); }

TEST(Segments, AreNearestWhereSamplesOfBothAre) {
  Random random(7);
  for (int k = 0; k < 200; ++k) {
    std::array<Vec3, 4> x;
    for (Vec3 &p : x) p = randomPlace(random, 1);
    if (k % 4 == 0) x[3] = x[2] + (k % 8 == 0 ? 1 : -0.3) * (x[1] - x[0]); // parallel
    const Closest near = closest(x[0], x[1], x[2], x[3]);
    double least = HUGE_VAL;
    constexpr int n = 100;
    for (int i = 0; i <= n; ++i)
      least = std::min(least, project(x[0] + double(i) / n * (x[1] - x[0]), x[2], x[3]).distance);
    EXPECT_LE(near.distance, least * (1 + 1e-12)) << k;
    EXPECT_GE(near.distance, least - 2.0 / n) << k;
    const Vec3 way = x[0] + near.part * (x[1] - x[0]) - x[2] - near.other_part * (x[3] - x[2]);
    EXPECT_LT((way - near.from).norm(), 1e-14) << k;
    EXPECT_NEAR(way.norm(), near.distance, 1e-14) << k;
  }
}

/// Two segments that come together head on meet after (apart - wall)/2 of their ways of 1; ways that part are free, and
/// those of both alike.
TEST(Segments, AreKeptFromPassingWalls) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  const std::array<Vec3, 4> crossed{-x, x, -y + z, y + z};
  const double free = freePart(crossed, {z, z, -z, -z}, 0.1, 0.01);
  EXPECT_LE(free, 0.45);
  EXPECT_GE(free, 0.44);
  EXPECT_EQ(freePart(crossed, {-z, -z, z, z}, 0.1, 0.01), 1);
  EXPECT_EQ(freePart(crossed, {100 * z, 100 * z, 100 * z, 100 * z}, 0.1, 0.01), 1);
  EXPECT_EQ(freePart(crossed, {x, x, x, x}, 0.1, 0.01), 1);
  // Far beyond each other in one step.
  EXPECT_LE(freePart(crossed, {1000 * z, 1000 * z, -1000 * z, -1000 * z}, 0.1, 0.01), 0.45e-3);
}

TEST(Neighbours, AreFoundByTheGridAsByLookingAtAll) {
  Random random(7);
  std::size_t found = 0;
  for (int k = 0; k < 30; ++k) {
    Scene scene;
    for (int r = 0; r < 12; ++r) {
      const Vec3 from = randomPlace(random, 0.1);
      scene.rods.push_back(
          wire("r" + std::to_string(r), from, from + randomPlace(random, 0.2), 5 + r % 7, 0.002 + 0.003 * (r % 3)));
      scene.rods.back().contact.rods = r % 2 ? ContactSettings::Rods::all : ContactSettings::Rods::others;
    }
    Simulation sim;
    sim.describe(scene, true);
    const Neighbours neighbours(sim.scene, *sim.elements);
    Room room(sim.elements->slots, 12);
    for (std::size_t r = 0; r < 12; ++r) {
      const RodRange &rod = sim.elements->rods[r];
      for (int i = 0; i < rod.vertices; ++i) {
        room.start.setVector(0, rod.slot(i), sim.state.position[std::size_t(rod.first_vertex + i)]);
        room.way.setVector(0, rod.slot(i), 0.01 * random.vector());
      }
      room.beyond[r] = 0.01 * std::abs(random());
      room.bend[r] = std::abs(random());
    }
    const std::vector<TouchingPair> grid = neighbours.find(room), all = neighbours.findByAll(room);
    ASSERT_EQ(grid.size(), all.size());
    found += grid.size();
    for (std::size_t n = 0; n < all.size(); ++n) {
      EXPECT_EQ(std::tie(grid[n].rod, grid[n].edge, grid[n].to_rod, grid[n].to_edge),
                std::tie(all[n].rod, all[n].edge, all[n].to_rod, all[n].to_edge));
      EXPECT_EQ(grid[n].slot, all[n].slot);
    }
  }
  EXPECT_GT(found, 200u);
}

/// Along one rod they touch from half a turn around its own surface on, pi r; on rings the shorter way round.
TEST(Neighbours, AlongARodDoNotTouch) {
  Scene scene;
  scene.rods = {wire("line", Vec3::Zero(), Vec3(1, 0, 0), 100, 0.011)}; // pi r is 3.5 edges
  scene.rods[0].contact.rods = ContactSettings::Rods::all;
  scene.rods.push_back(scene.rods[0]);
  scene.rods[1].name = "ring";
  scene.rods[1].closed = true;
  scene.rods[1].position = ringShape(Vec3(0, 0, 1), Vec3::UnitZ(), 1 / (2 * pi), 100).points;
  setBishopDirectors(scene.rods[1]);
  Simulation sim;
  sim.describe(scene, true);
  const Neighbours neighbours(sim.scene, *sim.elements);
  for (const int r : {0, 1}) {
    EXPECT_FALSE(neighbours.mayTouch(r, 50, r, 50));
    EXPECT_FALSE(neighbours.mayTouch(r, 50, r, 54)); // three edges between
    EXPECT_TRUE(neighbours.mayTouch(r, 50, r, 55));
    EXPECT_TRUE(neighbours.mayTouch(r, 55, r, 50));
    EXPECT_EQ(neighbours.mayTouch(r, 0, r, 97), r == 0);
  }
  EXPECT_TRUE(neighbours.mayTouch(0, 50, 1, 50));
}

/// Two rods that cross, one that lies along another, and one that meets itself, pressed together.
Scene touchingScene() {
  Scene scene;
  scene.gravity = Vec3::Zero();
  const double apart = 0.0101;
  scene.rods = {wire("a", Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), 12),
                wire("b", Vec3(0.011, -0.1, apart), Vec3(0.013, 0.1, apart), 10),
                wire("c", Vec3(-0.1, 0.0005, -apart), Vec3(0.07, 0, -apart), 7)};
  Rod loop = wire("d", Vec3(0, 0, 1), Vec3(1, 0, 1), 24);
  for (int i = 0; i < loop.vertices(); ++i) { // a loop of one and a half turns with a pitch just above two radii
    const double t = 3 * pi * i / 24;
    loop.position[std::size_t(i)] = Vec3(0.05 * std::cos(t), 0.05 * std::sin(t), 1 + apart * t / (2 * pi));
  }
  setBishopDirectors(loop);
  loop.contact.rods = ContactSettings::Rods::all;
  scene.rods.push_back(loop);
  for (Rod &rod : scene.rods) rod.contact.stiffness = 1e3;
  return scene;
}

/// What rods do to each other at a configuration: the gradient of the energy of their contact alone.
Planes pushesAmongRods(const Simulation &sim, const Configuration &c) {
  const std::unique_ptr<Term> contact = makeRodContact(sim.scene, *sim.elements);
  std::vector<TouchingPair> pairs;
  contact->findTouching(sim.state, c, sim.dofs.makePlanes(), {}, 1, pairs);
  Derivatives d(sim.elements->slots, true);
  d.blocks.setTouching(pairs.size());
  contact->addBetween(c, sim.dofs.all(), d, HessianKind::none);
  return d.gradient;
}

double dotAll(const Simulation &sim, const Planes &a, const Planes &b) {
  double sum = 0;
  for (const RodRange &rod : sim.elements->rods) sum += dot(rod, a, b);
  return sum;
}

/// By differences of fourth order. Where two rods cross, every sample is nearest between vertices, and what is left is
/// rounding; where samples pass from an edge to the next, second derivatives jump.
TEST(RodContact, HasTheDerivativesOfItsEnergy) {
  for (const bool crossed : {true, false}) {
    Scene scene = touchingScene();
    if (crossed) scene.rods.resize(2);
    const int rods = int(scene.rods.size());
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    EXPECT_PETSC(sim.solver.begin(sim.state, TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01)));
    IncrementalPotential &potential = *sim.potential;
    EXPECT_EQ(sim.dofs.islandOf(0).end, crossed ? 2 : 3);
    EXPECT_GT(sim.dofs.touching({0, rods}).size(), crossed ? 0u : 10u);
    Random random(3);
    const Derivatives &d = potential.derivatives();
    for (int k = 0; k < 4; ++k) {
      Planes v = sim.dofs.makePlanes(), kv = v;
      for (const RodRange &rod : sim.elements->rods)
        for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
          for (int a = 0; a < slot_size; ++a)
            if (sim.dofs.unknown(s, a) >= 0) v[a][s] = (a == 3 ? 1 : 0.01) * random();
      for (int r = 0; r < rods; ++r)
        potential.blocks().multiply(sim.elements->rods[std::size_t(r)], sim.dofs.joins(r), v, kv);
      auto energy = [&](double part) {
        Configuration trial;
        EXPECT_TRUE(potential.tryMove(v, part, trial));
        return potential.energy(trial, potential.all());
      };
      constexpr double h = 1e-4;
      const double e[5] = {energy(-2 * h), energy(-h), energy(0), energy(h), energy(2 * h)};
      const double slope = (e[0] - 8 * e[1] + 8 * e[3] - e[4]) / (12 * h),
                   curvature = (-e[0] + 16 * e[1] - 30 * e[2] + 16 * e[3] - e[4]) / (12 * h * h);
      const double size = std::sqrt(dotAll(sim, d.gradient, d.gradient) * dotAll(sim, v, v));
      EXPECT_NEAR(slope, dotAll(sim, d.gradient, v), 1e-7 * size) << k;
      EXPECT_NEAR(curvature, dotAll(sim, kv, v), (crossed ? 1e-5 : 5e-3) * std::abs(curvature)) << k;
    }
  }
}

/// What rods do to each other cancels: forces, and their moments about any place.
TEST(RodContact, LeavesMomentaAlone) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(touchingScene(), dynamics(0.01, 1)));
  EXPECT_PETSC(sim.solver.begin(sim.state, TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01)));
  const Configuration c = configurationOf(sim.state, sim.scene, *sim.elements, 0);
  const Planes pushes = pushesAmongRods(sim, c);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double size = 0, size_of_moment = 0;
  for (int v = 0; v < sim.elements->vertices(); ++v) {
    const int s = sim.elements->vertex_slot[std::size_t(v)];
    const Vec3 f = pushes.vector(0, s), m = c.positionAt(s).cross(f);
    force += f;
    moment += m;
    size += f.norm();
    size_of_moment += m.norm();
  }
  EXPECT_GT(size, 1);
  EXPECT_LT(force.norm(), 1e-12 * size);
  EXPECT_LT(moment.norm(), 1e-12 * size_of_moment);
}

/// Two parallel rods as point clouds, of radius 1 cm about their vertices.
Scene cloudScene(double apart, int edges, int gauss) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  const double half = 0.5;
  scene.rods = {wire("a", Vec3(-half, 0, 0), Vec3(half, 0, 0), edges, 0.01),
                wire("b", Vec3(-half, 0, apart), Vec3(half, 0, apart), edges, 0.01)};
  for (Rod &rod : scene.rods) {
    rod.contact.law = ContactSettings::Law::penalty;
    rod.contact.stiffness = 1e9;
    rod.contact.point_cloud = true;
    rod.contact.cloud = gauss;
  }
  return scene;
}

/// Fine clouds have the energy of lines: per length of the one, 2 k/L times the integral of h^2/2 along the other, for
/// both are felt by both.
TEST(PointCloud, OfFineEdgesIsALine) {
  const double apart = 0.008, radius = 0.01;
  const ContactSettings &settings = cloudScene(apart, 2, 0).rods[0].contact;
  const NormalLaw law(settings, 0);
  double along = 0;
  constexpr int n = 20000;
  for (int k = 0; k < n; ++k) {
    const double x = 0.05 * (k + 0.5) / n;
    along += 2 * 0.05 / n * law(std::hypot(x, apart) - radius).value;
  }
  for (const int gauss : {0, 1, 3}) {
    Simulation sim;
    EXPECT_PETSC(sim.setUp(cloudScene(apart, 400, gauss), dynamics(0.01, 1)));
    const std::unique_ptr<Term> contact = makeRodContact(sim.scene, *sim.elements);
    const Configuration c = configurationOf(sim.state, sim.scene, *sim.elements, 0);
    std::vector<TouchingPair> pairs;
    contact->findTouching(sim.state, c, sim.dofs.makePlanes(), {}, 1, pairs);
    const double energy = contact->energy(c, 0) + contact->energy(c, 1);
    EXPECT_NEAR(energy, 2 * along / radius, 0.03 * energy) << gauss; // 1 m less what is missing at its ends
  }
}

/// Points of one rod touch from 1.5 radii on, as drawn: a straight rod with points half a radius apart has no energy; a
/// loop whose arms are nearer to each other than a radius has.
TEST(PointCloud, LeavesOutNeighbours) {
  for (const bool folded : {false, true}) {
    Scene scene = cloudScene(1, 100, 0);
    scene.rods.resize(1);
    Rod &rod = scene.rods[0];
    rod.contact.rods = ContactSettings::Rods::all;
    rod.contact.radius = 0.02;
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    if (folded) // drawn straight, a hairpin now
      for (int i = 0; i < 101; ++i)
        sim.state.position[std::size_t(i)] = i <= 50 ? Vec3(0.01 * i, 0, 0) : Vec3(0.01 * (100 - i), 0.0105, 0);
    const std::unique_ptr<Term> contact = makeRodContact(sim.scene, *sim.elements);
    const Configuration c = configurationOf(sim.state, sim.scene, *sim.elements, 0);
    std::vector<TouchingPair> pairs;
    contact->findTouching(sim.state, c, sim.dofs.makePlanes(), {}, 1, pairs);
    EXPECT_EQ(contact->energy(c, 0) > 0, folded);
  }
}

/// Net couple of the forces of two crossed rods of which one is drawn along the other, over the force.
double coupleOfFriction(bool cloud) {
  const double radius = 0.01;
  Scene scene = cloudScene(0.95 * radius * (cloud ? 1 : 2), 40, 0);
  for (Vec3 &x : scene.rods[1].position) x = Vec3(0, x[0], x[2]);
  setBishopDirectors(scene.rods[1]);
  for (Rod &rod : scene.rods) {
    rod.contact.point_cloud = cloud;
    rod.contact.friction = 0.5;
  }
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, dynamics(0.01, 1)), PetscErrorCode(0));
  Step step;
  step.dt = step.time = 0.01;
  EXPECT_EQ(sim.solver.begin(sim.state, TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01)), PetscErrorCode(0));
  const std::unique_ptr<Term> contact = makeRodContact(sim.scene, *sim.elements);
  const Configuration &start = sim.potential->start();
  std::vector<TouchingPair> pairs;
  contact->findTouching(sim.state, start, sim.dofs.makePlanes(), step, 1, pairs);
  Planes v = sim.dofs.makePlanes();
  for (int i = 0; i < 41; ++i) v.setVector(0, sim.elements->rods[1].slot(i), Vec3(1e-5, 0, 0));
  Configuration c;
  EXPECT_TRUE(sim.potential->tryMove(v, 1, c));
  auto sums = [&](const Configuration &at) {
    Derivatives d(sim.elements->slots, true);
    d.blocks.setTouching(pairs.size());
    contact->addBetween(at, {0, 2}, d, HessianKind::none);
    Vec3 couple = Vec3::Zero(), on_b = Vec3::Zero();
    for (int n = 0; n < sim.elements->vertices(); ++n) {
      const int s = sim.elements->vertex_slot[std::size_t(n)];
      couple += at.positionAt(s).cross(d.gradient.vector(0, s));
      if (n >= 41) on_b += d.gradient.vector(0, s);
    }
    for (const int s : sim.elements->edge_slot) couple += d.gradient[3][s] * at.frameAt(s).tangent;
    return std::pair(couple, on_b);
  };
  const auto [couple, force] = sums(c);
  EXPECT_GT(std::abs(force[0]), 1e-3);
  return couple.norm() / std::abs(force[0]);
}

/// Friction between the middles of spheres turns nothing, and has a couple as large as they are apart; at surfaces it
/// has one of the way that they have slid.
TEST(PointCloud, MakesACoupleOfFriction) {
  EXPECT_NEAR(coupleOfFriction(true), 0.0095, 1e-3);
  EXPECT_LT(coupleOfFriction(false), 2e-5);
}

/// A tip before the middle vertex of a rod that is bent towards it, straight, or bent away: what pushes it goes along
/// the line between both, for all is the same on both sides.
TEST(RodContact, ATipFeelsASideEvenly) {
  for (const double bent : {-1e-3, -1e-5, 0.0, 1e-5, 1e-3}) {
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {wire("tip", Vec3(-0.06, 0, 0), Vec3::Zero(), 12),
                  wire("side", Vec3(0.0102, -0.03, 0), Vec3(0.0102, 0.03, 0), 12)};
    for (Vec3 &x : scene.rods[1].position) x[0] += bent * std::abs(x[1]) / 0.005;
    for (Rod &rod : scene.rods) rod.contact.stiffness = 1e3;
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    const Planes pushes = pushesAmongRods(sim, configurationOf(sim.state, sim.scene, *sim.elements, 0));
    Vec3 force = Vec3::Zero();
    for (int v = 0; v < 13; ++v) force += pushes.vector(0, sim.elements->vertex_slot[std::size_t(v)]);
    EXPECT_GT(force[0], 1e-3) << bent;
    EXPECT_LT(std::abs(force[1]), 1e-10 * force[0]) << bent;
  }
}

/// Crossed strings (data/reference/contact_crossed_strings.csv, third row): each has an edge that stays level at the
/// crossing, so that the discrete strings have the exact force at the distance that the law keeps, which is measured.
/// It is long enough not to tip: a short one has too little to hold it against the other string, which would slide off.
/// \param width of the barrier, over the radius \return by how much the force is off, of itself
double errorOfCrossedStrings(double width) {
  const double half = 1, c = 0.1, r = 0.01, prestretch = 1.01, level = 0.2, stiffness = 1e4, drawn = half / prestretch;
  std::vector<double> along{-0.5 * level, 0.5 * level};
  constexpr int beside = 20;
  for (int k = 1; k <= beside; ++k) {
    const double x = 0.5 * level + (drawn - 0.5 * level) * k / beside;
    along.insert(along.begin(), -x);
    along.push_back(x);
  }
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {taut("a", Vec3::Zero(), Vec3::UnitX(), 2 * beside + 1, r, stiffness),
                taut("b", Vec3::Zero(), Vec3::UnitY(), 2 * beside + 1, r, stiffness)};
  for (int k : {0, 1}) {
    Rod &rod = scene.rods[std::size_t(k)];
    rod.contact.stiffness = 4000;
    rod.contact.distance = width * r;
    for (std::size_t v = 0; v < along.size(); ++v)
      rod.position[v] = k == 0 ? Vec3(along[v], 0, -c) : Vec3(0, along[v], c);
    holdEnds(scene, k);
  }
  for (Support &s : scene.supports) { // outwards, and past each other
    const Vec3 out = (s.vertex == 0 ? -1 : 1) * (half - drawn) * (s.rod == 0 ? Vec3::UnitX() : Vec3::UnitY());
    s.motion.table = {{0, Vec3::Zero(), Vec3::Zero()},
                      {1, out + Vec3(0, 0, s.rod == 0 ? 2 * c : -2 * c), Vec3::Zero()}};
  }
  const OptionSet sharp("-snes_rtol", "1e-9");
  Simulation sim;
  runTo(sim, scene, statics(8));
  const std::vector<Vec3> &x = sim.state.position;
  const std::size_t middle = beside, of_b = along.size() + beside;
  const double apart = x[of_b][2] - x[middle][2];
  EXPECT_NEAR(apart, 2 * r, 0.5 * width * r);
  EXPECT_NEAR(x[middle + 1][2], x[middle][2], 1e-8);
  // Of the level edge and of those beside it the horizontal forces are equal.
  auto tension = [&](double stretch) { return 0.5 * stiffness * (stretch * stretch - 1) * stretch; };
  auto forceAt = [&](double moved, double flat) {
    double low = 1, high = 1.1, force = 0;
    for (int k = 0; k < 100; ++k) {
      const double stretch = 0.5 * (low + high), run = half - 0.5 * stretch * flat, slant = std::hypot(run, moved),
                   inclined = slant / (drawn - 0.5 * flat);
      force = 2 * tension(inclined) * moved / slant;
      (tension(inclined) * run / slant > tension(stretch) ? low : high) = stretch;
    }
    return force;
  };
  EXPECT_NEAR(forceAt(c + r, 0.02), 36.5510259800473, 2e-4 * 36.55); // the row, where all edges are stretched alike
  const double force = forceAt(c + 0.5 * apart, level);
  const Planes pushes = pushesAmongRods(sim, configurationOf(sim.state, sim.scene, *sim.elements, 1));
  double pressing = 0;
  for (std::size_t v = 0; v < along.size(); ++v) pressing += pushes.vector(0, sim.elements->vertex_slot[v])[2];
  return std::abs(pressing / force - 1);
}

/// Surfaces touch along a part of the edge, as long as the root of the width: what pushes beside the middle pulls the
/// edge by a part of the force that goes with the width.
TEST(RodContact, CrossedStringsBearTheExactForce) {
  const double wide = errorOfCrossedStrings(0.2), narrow = errorOfCrossedStrings(0.05);
  EXPECT_LT(wide, 2e-5);
  EXPECT_LT(narrow, 5e-6);
}

/// A wire falls on one that is held, and comes to rest on it.
TEST(RodContact, RodsRestOnEachOther) {
  Scene scene;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.rods = {wire("beam", Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), 16, 0.005, 1e9),
                wire("wire", Vec3(0.003, -0.1, 0.02), Vec3(0.003, 0.1, 0.02), 16)};
  for (const int v : {0, 16}) scene.supports.push_back(hold(scene, 0, v, Support::Kind::clamp));
  for (Rod &rod : scene.rods) rod.material.mass_damping_coefficient = 20;
  Simulation sim;
  int iterations = 0;
  runTo(sim, scene, dynamics(0.005, 0.5), &iterations);
  const std::vector<Vec3> &x = sim.state.position;
  EXPECT_NEAR(x[17 + 8][2] - x[8][2], 0.01, 0.0005);
  EXPECT_LT(iterations, 8 * 100);
}

/// Drawn touching, with the gap zero, a wire lies on the other from the first step on: it is not thrown off, as a
/// barrier of ten times its weight would.
TEST(RodContact, WhatIsDrawnTouchingIsNotThrownOff) {
  Scene scene;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.rods = {wire("beam", Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), 16, 0.005, 1e9),
                wire("wire", Vec3(-0.08, 0, 0.01), Vec3(0.08, 0, 0.01), 16)};
  for (const int v : {0, 16}) scene.supports.push_back(hold(scene, 0, v, Support::Kind::clamp));
  Simulation sim;
  runTo(sim, scene, dynamics(0.002, 0.1));
  const double weight = scene.rods[1].material.linear_density * 9.81 * 0.16;
  for (int v = 17; v < 34; ++v) EXPECT_NEAR(sim.state.position[std::size_t(v)][2], 0.01, 5e-4) << v;
  EXPECT_LT(0.5 * weight / 9.81 * sim.state.velocity[25].squaredNorm(), 1e-4 * weight * 0.001);
}

/// Supports that drive a rod through one that is held end the run, with both rods in the message.
TEST(RodContact, TellsOfRodsThatAreDrivenIntoEachOther) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {wire("low", Vec3(-0.02, 0, 0), Vec3(0.02, 0, 0), 4, 0.005, 1e9),
                wire("high", Vec3(0, -0.02, 0.012), Vec3(0, 0.02, 0.012), 4, 0.005, 1e9)};
  for (const int r : {0, 1})
    for (int v = 0; v <= 4; ++v) scene.supports.push_back(hold(scene, r, v, Support::Kind::pin));
  for (Support &s : scene.supports)
    if (s.rod == 1) s.motion.velocity = Vec3(0, 0, -0.5);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, dynamics(0.001, 0.02)));
  LoopSettings settings = dynamics(0.001, 0.02);
  TimeLoop loop(sim.solver, settings);
  bool finished = true;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_FALSE(finished);
  EXPECT_NE(loop.failure().find("rod 'high' at arc length"), std::string::npos) << loop.failure();
  EXPECT_NE(loop.failure().find("is pressed against rod 'low'"), std::string::npos) << loop.failure();
  EXPECT_GT(sim.state.position[7][2] - sim.state.position[2][2], 0.0094);
}

TEST(RodContact, FastRodsDoNotPassThroughEachOther) {
  for (const double speed : {1.0, 10.0, 100.0})
    for (const double angle : {90.0, 30.0}) {
      Scene scene;
      scene.gravity = Vec3::Zero();
      const double a = angle * pi / 180;
      const Vec3 along(0.15 * std::cos(a), 0.15 * std::sin(a), 0), up(0, 0, 0.03);
      scene.rods = {wire("low", Vec3(-0.15, 0, 0), Vec3(0.15, 0, 0), 20, 0.005, 1e9),
                    wire("high", -along + up, along + up, 20, 0.005, 1e9)};
      holdEnds(scene, 0);
      holdEnds(scene, 1);
      scene.rods[0].initial_velocity = Vec3(0, 0, 0.5 * speed);
      scene.rods[1].initial_velocity = Vec3(0, 0, -0.5 * speed);
      Simulation sim;
      runTo(sim, scene, dynamics(0.001, 0.02));
      const std::vector<Vec3> &x = sim.state.position;
      EXPECT_GT(x[21 + 10][2] - x[10][2], 0.0095) << speed << " " << angle;
    }
}

/// A rod slides along one that is held and stops after v^2/(2 mu g), less v dt/2 of backward Euler, and v of the
/// fall-off.
TEST(RodContact, FrictionStopsWhatSlides) {
  const double speed = 0.3, coefficient = 0.3, dt = 0.002;
  for (const bool at_surface : {true, false}) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.rods = {wire("beam", Vec3(-0.15, 0, 0), Vec3(0.15, 0, 0), 20, 0.005, 1e9),
                  wire("slider", Vec3(-0.1, 0, 0.01), Vec3(0, 0, 0.01), 20)};
    for (const int v : {0, 20}) scene.supports.push_back(hold(scene, 0, v, Support::Kind::clamp));
    for (Rod &rod : scene.rods) {
      rod.contact.friction = coefficient;
      rod.contact.friction_at_surface = at_surface;
      rod.contact.fall_off_velocity = 1e-3;
    }
    scene.rods[1].initial_velocity = Vec3(speed, 0, 0);
    Simulation sim;
    runTo(sim, scene, dynamics(dt, 0.12));
    const double moved = sim.state.position[21 + 10][0] + 0.05,
                 expected = speed * speed / (2 * coefficient * 9.81) - 0.5 * speed * dt;
    EXPECT_NEAR(moved, expected, 0.01 * expected);
    EXPECT_LT(sim.state.velocity[21 + 10].norm(), 1e-3);
  }
}

/// Two crossed rods of which one is drawn along itself over the other, and 1e-5 m off: what friction does to both has
/// no couple beyond its force times that change of the gap, where friction between centrelines would have twice the
/// radius.
TEST(RodContact, FrictionMakesNoCouple) {
  const double r = 0.01, off = 1e-5;
  Vec3 force = Vec3::Zero(), couple = Vec3::Zero();
  for (const double sign : {1.0, -1.0}) { // with friction less that without
    Scene scene;
    scene.gravity = Vec3::Zero();
    scene.rods = {wire("low", Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), 9, r, 1e8),
                  wire("high", Vec3(0.003, -0.1, 2 * r), Vec3(0.003, 0.1, 2 * r), 9, r, 1e8)};
    for (Rod &rod : scene.rods) {
      rod.contact.friction = sign > 0 ? 0.3 : 0;
      rod.contact.stiffness = 1e3;
    }
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    const std::unique_ptr<Term> contact = makeRodContact(sim.scene, *sim.elements);
    const Configuration start = configurationOf(sim.state, sim.scene, *sim.elements, 0);
    Step step;
    step.dt = step.time = 0.01;
    std::vector<TouchingPair> pairs;
    contact->findTouching(sim.state, start, sim.dofs.makePlanes(), step, 1, pairs);
    for (int v = 10; v < 20; ++v) sim.state.position[std::size_t(v)] += Vec3(0.002, 0.001, off);
    const Configuration end = configurationOf(sim.state, sim.scene, *sim.elements, 0);
    Derivatives d(sim.elements->slots, true);
    d.blocks.setTouching(pairs.size());
    contact->addBetween(end, {0, 2}, d, HessianKind::none);
    for (int v = 0; v < 20; ++v) {
      const int s = sim.elements->vertex_slot[std::size_t(v)];
      const Vec3 f = d.gradient.vector(0, s);
      couple += sign * end.positionAt(s).cross(f);
      if (v < 10) force += sign * f;
    }
    for (const int s : sim.elements->edge_slot) couple += sign * d.gradient[3][s] * end.frameAt(s).tangent;
  }
  EXPECT_GT(force.norm(), 0.1);
  EXPECT_LT(couple.norm() / force.norm(), 1.1 * off);
}

TEST(RodContact, OverlapsAreFound) {
  Scene scene;
  scene.rods = {wire("a", Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), 10),
                wire("b", Vec3(0, -0.1, 0.008), Vec3(0, 0.1, 0.008), 10)};
  Simulation sim;
  sim.describe(scene, true);
  const Configuration c = configurationOf(sim.state, sim.scene, *sim.elements, 0);
  const std::vector<Meeting> found = overlapsOfRods(sim.scene, *sim.elements, c);
  ASSERT_FALSE(found.empty());
  EXPECT_NEAR(found[0].gap, -0.002, 1e-12);
  EXPECT_NEAR(found[0].arc, 0.1, 1e-12);
  EXPECT_NEAR(found[0].to_arc, 0.1, 1e-12);
}

} // namespace
} // namespace tendril::test
