/// Tendons and actuators: reference values, derivatives of the whole term, momenta.
#include "tendril/energy/tendon.hpp"

#include "support/mechanisms.hpp"
#include "support/random_cell.hpp"
#include "tendril/coupling/couplings.hpp"

namespace tendril::test {
namespace {

std::vector<std::vector<std::string>> tableOf(const std::string &file) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/" + file);
  std::vector<std::vector<std::string>> rows;
  std::string line, cell;
  while (std::getline(in, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream cells(line);
    std::vector<std::string> row;
    while (std::getline(cells, cell, ',')) row.push_back(cell);
    rows.push_back(row);
  }
  rows.erase(rows.begin()); // names
  return rows;
}

TEST(Actuators, PullAsTheTableSays) {
  int rows = 0;
  for (const std::vector<std::string> &row : tableOf("bodies_actuators.csv")) {
    std::vector<double> v;
    for (std::size_t k = 1; k < row.size(); ++k) v.push_back(std::stod(row[k]));
    Actuator a;
    Pull pull;
    if (row[0] == "displacement") {
      a.kind = Actuator::Kind::displacement;
      a.stiffness = v[3];
      a.damping = v[4];
      a.compression = v[5] != 0;
      pull = pullOf(a, v[0], v[1], {1, v[0] - v[2]}); // of a step of one second
      if (v[7] > 0) {
        EXPECT_NEAR(pull.stiffness, v[7] + v[4], 1e-12 * v[7]);
      }
    } else {
      a.kind = Actuator::Kind::mckibben;
      a.minimum_pressure = v[2];
      a.braid_length = v[3];
      a.turns = v[4];
      a.damping = v[5];
      a.muscle_length = 0.2;
      pull = pullOf(a, v[0] - 0.2, v[1]);
      if (v[6] > 1e-9) {
        EXPECT_NEAR(pull.stiffness, v[7], 1e-12 * v[7]);
      }
    }
    EXPECT_NEAR(pull.tension, v[6], 1e-12 * std::abs(v[6]) + 1e-9) << row[0] << rows;
    EXPECT_GE(pull.tension, 0);
    ++rows;
  }
  EXPECT_EQ(rows, 12);
}

/// Tension is the slope of the potential and stiffness that of the tension, also across where it goes slack.
TEST(Actuators, HaveThePotentialOfTheirTension) {
  Actuator spring, force, muscle;
  spring.kind = Actuator::Kind::displacement;
  spring.stiffness = 300;
  spring.damping = 4;
  force.kind = Actuator::Kind::force;
  muscle.kind = Actuator::Kind::mckibben;
  muscle.braid_length = 0.25;
  muscle.turns = 1.5;
  muscle.damping = 30;
  muscle.muscle_length = 0.16;
  const TendonDamper damper{10, 0.004};
  for (const Actuator &a : {spring, force, muscle}) {
    const double input = a.kind == Actuator::Kind::displacement ? 0.002 : a.kind == Actuator::Kind::force ? 7 : 2e5;
    int slack = 0, taut = 0;
    for (double x = -0.05; x < 0.05; x += 0.003) {
      const double h = 1e-6;
      const Pull here = pullOf(a, x, input, damper), less = pullOf(a, x - h, input, damper),
                 more = pullOf(a, x + h, input, damper);
      EXPECT_NEAR((more.value - less.value) / (2 * h), here.tension, 1e-6 * (1 + here.tension));
      EXPECT_NEAR((more.tension - less.tension) / (2 * h), here.stiffness, 1e-6 * (1 + here.stiffness));
      EXPECT_GE(here.tension, 0);
      EXPECT_GE(here.value, a.kind == Actuator::Kind::force ? -1 : 0);
      (here.tension > 0 ? taut : slack)++;
    }
    EXPECT_GT(taut, 3);
    EXPECT_TRUE(a.kind == Actuator::Kind::force || slack > 3);
  }
  // One that may push is a spring both ways.
  spring.compression = true;
  EXPECT_NEAR(pullOf(spring, -0.01, 0.002).tension, -300 * 0.012, 1e-12);
  // Without pressure a muscle is a damper that only pulls.
  EXPECT_EQ(pullOf(muscle, 0, 0, {0, 0}).tension, 0);
  EXPECT_NEAR(pullOf(muscle, 0.01, 0, damper).tension, 30 * 10 * 0.006, 1e-12);
}

Tendon springThrough(const std::string &name, std::vector<Waypoint> points) {
  Tendon t;
  t.name = name;
  t.points = std::move(points);
  for (int k = 0; k + 1 < int(t.points.size()); ++k) t.segments.push_back({k, k + 1});
  t.actuator.kind = Actuator::Kind::displacement;
  t.actuator.stiffness = 500;
  t.actuator.input = -0.05;
  return t;
}
Waypoint ofEdge(int rod, int edge, const Vec3 &arm) {
  Waypoint p;
  p.rod = rod;
  p.edge = edge;
  p.at = 0.5;
  p.point = arm;
  return p;
}
Waypoint ofVertex(const Scene &scene, int rod, int vertex) {
  Waypoint p;
  p.rod = rod;
  p.setVertex(vertex, scene.rods[std::size_t(rod)].edges());
  return p;
}

/// Two rods, one of them a ring, and three bodies, a hinge between two of these.
Scene mechanism() {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {wire("a", {0, 0, 0}, {0.4, 0.05, 0}, 6), wire("ring", {0, 0, 0}, {0.1, 0, 0}, 4)};
  Rod &ring = scene.rods[1];
  ring.position = ringShape(Vec3(0, 0.5, 0.1), Vec3(0, 0.3, 1).normalized(), 0.1, 8).points;
  ring.closed = true;
  setBishopDirectors(ring);
  for (Rod &rod : scene.rods) rod.contact.on = false;
  scene.bodies = {shaped("box", {0.1, 0.08, 0.06}, {0.5, 0.3, 0.1}), shaped("sphere", {0.05, 0, 0}, {0.8, 0.1, -0.1}),
                  shaped("cylinder", {0.04, 0.1, 0}, {0.2, 0.3, 0.05})};
  for (Body &body : scene.bodies) body.contact.on = false;
  Joint hinge{};
  hinge.name = "hinge";
  hinge.type = Joint::Type::hinge;
  hinge.child = 1;
  hinge.parent = 0;
  hinge.point = {0.65, 0.2, 0};
  hinge.stiffness = hinge.rotational_stiffness = 1e3; // an exact one would lead the bodies
  hinge.axes = rotationBy({0.2, 0.4, -0.1});
  scene.joints = {hinge};
  return scene;
}

/// Through points of all kinds, with and without something to wind round, and a joint.
Scene tendonScene() {
  Scene scene = mechanism();
  Tendon mixed =
      springThrough("mixed", {ofWorld({-0.1, 0.1, 0}), ofVertex(scene, 0, 0), ofEdge(0, 2, {0.01, 0.02, -0.01}),
                              ofVertex(scene, 0, 6), ofBody(0, {0.48, 0.28, 0.1}), ofBody(1, {0.8, 0.14, -0.1}),
                              ofEdge(1, 7, {0, 0.01, 0.02}), ofEdge(1, 3, {0, -0.01, 0.01})});
  mixed.joints = {{0, 0.07}};
  Tendon wound = springThrough("wound", {ofBody(0, {0.45, 0.32, 0.08}), ofVertex(scene, 0, 1)});
  wound.wraps = {{2, false, 0.04, {0.2, 0.3, 0.05}, Vec3(0.3, 0.2, 1).normalized(), 1}};
  wound.segments[0].wrap = 0;
  Tendon fixed = springThrough("round the world", {ofBody(1, {0.8, 0.1, -0.05}), ofBody(0, {0.5, 0.26, 0.1})});
  fixed.wraps = {{-1, true, 0.07, {0.64, 0.17, 0.05}, Vec3::UnitZ(), 0}};
  fixed.segments[0].wrap = 0;
  Tendon own = springThrough("on its drum", {ofBody(2, {0.2, 0.35, 0.05}), ofBody(1, {0.8, 0.12, -0.1})});
  own.wraps = {{2, true, 0.045, {0.2, 0.3, 0.05}, Vec3::UnitZ(), 0}};
  own.segments[0].wrap = 0;
  scene.tendons = {mixed, wound, fixed, own};
  scene.hostBodies();
  return scene;
}

/// The term alone in a step of a scene.
struct InAStep {
  Simulation sim;
  std::unique_ptr<Term> term;
  std::vector<TouchingPair> pairs;
  RodSet all{0, 2};

  explicit InAStep(const Scene &scene, double stick = 0) { start(scene, stick); }
  void start(const Scene &scene, double stick) {
    EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
    std::fill(sim.state.tendon_memory.begin(), sim.state.tendon_memory.end(), stick);
    const Step step = TimeLoop::stepOf(dynamics(0.01, 1), sim.state, 0.01);
    EXPECT_PETSC(sim.solver.begin(sim.state, step));
    term = makeTendons(sim.scene, *sim.elements);
    term->findTouching(sim.state, sim.potential->start(), sim.dofs.makePlanes(), step, 1, pairs);
    for (int r = 0; r < 2; ++r) term->beginStep(sim.state, sim.potential->start(), step, r);
    sim.dofs.setTouching(pairs);
  }
  Derivatives derivatives(const Configuration &c, HessianKind kind = HessianKind::exact) {
    Derivatives d(sim.elements->slots, true);
    d.blocks.setTouching(pairs.size());
    term->addBetween(c, all, d, kind);
    return d;
  }
};

void expectDerivatives(const Scene &scene) {
  InAStep step(scene);
  Simulation &sim = step.sim;
  IncrementalPotential &potential = *sim.potential;
  for (int k = 0; k < 4; ++k) {
    const TendonPath path(sim.scene, *sim.elements, k);
    EXPECT_NEAR(path.displacement(potential.start()), 0, 1e-14) << k;
    if (k > 0) {
      EXPECT_GT(path.drawn(potential.start()).size(), 10u) << k;
    }
  }
  Random random(7);
  Planes away = sim.dofs.makePlanes(); // from where nothing is symmetric
  auto fill = [&](Planes &v, double size) {
    for (int s = 0; s < sim.dofs.slots(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (sim.dofs.unknown(s, a) >= 0) v[a][s] = (a == 3 ? 1 : 0.01) * size * random();
    for (const JoinedBody &b : sim.elements->bodies(step.all)) v.setVector(0, b.rotation, size * random.vector());
    const RodRange &ring = sim.elements->rods[1];
    v.setVector(0, ring.slot(ring.vertices), v.vector(0, ring.first_slot));
  };
  fill(away, 0.3);
  Configuration there;
  ASSERT_TRUE(potential.tryMove(away, 1, there));
  for (int r = 0; r < 2; ++r) potential.accept(there, r);
  Configuration here = potential.iterate();
  for (int r = 0; r < 2; ++r) { // tensions as the displacements have them
    step.term->setTrialForces(here, sim.dofs.makePlanes(), 1, r, here);
    step.term->moveIterate(here, r);
    step.term->renew(here, r);
  }
  Derivatives d = step.derivatives(here);
  for (int k = 0; k < 8; ++k) {
    Planes v = sim.dofs.makePlanes(), kv = v;
    fill(v, 1);
    for (int r = 0; r < 2; ++r) d.blocks.multiply(sim.elements->rods[std::size_t(r)], sim.dofs.joins(r), v, kv);
    double slope = 0, curvature = 0;
    for (int s = 0; s < sim.dofs.slots(); ++s)
      for (int a = 0; a < slot_size; ++a) {
        slope += (s == sim.elements->rods[1].slot(8) ? 0 : v[a][s]) * d.gradient[a][s];
        curvature += v[a][s] * kv[a][s];
      }
    auto energy = [&](double part) {
      Configuration trial;
      EXPECT_TRUE(potential.tryMove(v, part, trial));
      return step.term->energy(trial, 0) + step.term->energy(trial, 1);
    };
    constexpr double h = 3e-4;
    const double e[5] = {energy(-2 * h), energy(-h), energy(0), energy(h), energy(2 * h)};
    EXPECT_GT(e[2], 0);
    EXPECT_NEAR((e[0] - 8 * e[1] + 8 * e[3] - e[4]) / (12 * h), slope, 1e-8 * std::abs(slope) + 1e-9) << k;
    EXPECT_NEAR((-e[0] + 16 * e[1] - 30 * e[2] + 16 * e[3] - e[4]) / (12 * h * h), curvature,
                1e-6 * std::abs(curvature))
        << k;
  }
}

TEST(Tendons, HaveTheDerivativesOfTheirEnergy) { expectDerivatives(tendonScene()); }

/// Everywhere: over points of all kinds, round cylinders and spheres that bodies and the world carry.
Scene rubbing(Scene scene, double slip) {
  for (Tendon &t : scene.tendons) {
    t.slip_length = slip;
    for (Waypoint &p : t.points) p.friction = 0.3;
    for (Wrap &w : t.wraps) w.friction = 0.6;
  }
  return scene;
}
/// Once where it sticks, once where it slides.
TEST(Tendons, HaveTheDerivativesOfTheirEnergyWhereTheyRub) {
  for (const double slip : {2.0, 1e-4}) expectDerivatives(rubbing(tendonScene(), slip));
}

/// Tensions between what is free leave momenta alone: of all but the points of the world.
void expectMomentaAlone(Scene scene, double stick = 0) {
  scene.tendons = {scene.tendons[1], scene.tendons[3]};
  InAStep step(scene, stick);
  const Configuration &c = step.sim.potential->start();
  const Derivatives d = step.derivatives(c, HessianKind::none);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double size = 0;
  auto add = [&](const Vec3 &f, const Vec3 &x) {
    force += f;
    moment += x.cross(f);
    size += f.norm();
  };
  for (const RodRange &rod : step.sim.elements->rods)
    for (int i = 0; i < rod.vertices; ++i) add(d.gradient.vector(0, rod.slot(i)), c.positionAt(rod.slot(i)));
  for (const JoinedBody &b : step.sim.elements->bodies(step.all)) {
    add(d.gradient.vector(0, b.position), c.positionAt(b.position));
    moment += d.gradient.vector(0, b.rotation);
  }
  EXPECT_GT(size, 50);
  EXPECT_LT(force.norm(), 1e-14 * size);
  EXPECT_LT(moment.norm(), 1e-14 * size);
}
TEST(Tendons, LeaveMomentaAlone) { expectMomentaAlone(tendonScene()); }
/// At the start what is drawn is the stick: some, and all that friction takes.
TEST(Tendons, LeaveMomentaAloneWhereTheyRub) {
  for (const double stick : {0.3, -2.0}) {
    Scene scene = rubbing(tendonScene(), 1);
    expectMomentaAlone(scene, stick);
  }
}

/// The nine-link finger by the places of its bones, against the table: displacement, slopes, second derivatives.
TEST(Tendons, OfTheFingerAreThoseOfTheTable) {
  Scene scene;
  scene.rods = {wire("anchor", {0, 1, 0}, {0.1, 1, 0}, 2)};
  for (int k = 1; k < 4; ++k) {
    scene.bodies.push_back(shaped("capsule", {0.015, 0.17, 0}, {0.1 + 0.2 * k, 0, 0}));
    scene.bodies.back().contact.on = false;
    Joint hinge{};
    hinge.type = Joint::Type::hinge;
    hinge.name = "hinge" + std::to_string(k);
    hinge.child = k - 1;
    hinge.parent = k - 2;
    hinge.point = {0.2 * k, 0, 0};
    hinge.axes = Mat3::Identity();
    scene.joints.push_back(hinge);
  }
  std::vector<Waypoint> points{ofWorld({-0.1, 0.05, 0}), ofWorld({0.1, 0.05, 0})};
  for (int k = 1; k < 4; ++k) points.push_back(ofBody(k - 1, {0.1 + 0.2 * k, 0.05, 0}));
  Tendon spatial = springThrough("spatial", points), linear;
  spatial.points[0].motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(-1, 0, 0), Vec3::Zero()}};
  linear.name = "linear";
  linear.joints = {{0, -0.05}, {1, -0.05}, {2, -0.05}};
  scene.tendons = {spatial, linear};
  scene.hostBodies();
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, dynamics(0.01, 1)));
  int rows = 0;
  for (const std::vector<std::string> &row : tableOf("bodies_finger_tendons.csv")) {
    std::vector<double> v;
    for (const std::string &cell : row) v.push_back(std::stod(cell));
    auto at = [&](const std::array<double, 3> &t) { // the configuration with these angles
      State state = sim.state;
      Vec3 joint(0.2, 0, 0);
      double angle = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        angle += t[k];
        const Vec3 along(std::cos(angle), std::sin(angle), 0);
        state.body_position[k] = joint + 0.1 * along;
        state.junction_axes[std::size_t(sim.elements->groups) - 3 + k] = {along, Vec3(-along[1], along[0], 0)};
        state.joints[k].coordinate = t[k];
        joint += 0.2 * along;
      }
      return configurationOf(state, sim.scene, *sim.elements, v[0]);
    };
    const std::array<double, 3> t{v[1], v[2], v[3]};
    const Configuration c = at(t);
    const TendonPath path(sim.scene, *sim.elements, 0), sum(sim.scene, *sim.elements, 1);
    EXPECT_NEAR(path.displacement(c), v[4], 1e-15 + 2e-15) << rows;
    EXPECT_NEAR(sum.displacement(c) + v[0], v[12], 1e-15 + 2e-15) << rows;
    EXPECT_NEAR(-path.byTold(c)[0][0], v[5], 1e-14);
    const TendonPath::Derivatives d = path.derivatives(c, true);
    std::array<Eigen::VectorXd, 3> by; // motions of all bones by a hinge
    for (std::size_t k = 0; k < 3; ++k) {
      by[k] = Eigen::VectorXd::Zero(d.gradient.size());
      Vec3 joint(0.2, 0, 0);
      double angle = 0;
      for (std::size_t n = 0; n < k; ++n) {
        angle += t[n];
        joint += 0.2 * Vec3(std::cos(angle), std::sin(angle), 0);
      }
      for (std::size_t n = 0; n < path.carriers().size(); ++n) {
        const Carrier &bone = path.carriers()[n];
        if (bone.body() < int(k)) continue;
        const auto first = Eigen::Index(Carrier::variables * n);
        by[k].segment<3>(first) = Vec3::UnitZ().cross(c.positionAt(bone.slot[0]) - joint);
        by[k].segment<3>(first + 3) = Vec3::UnitZ();
      }
      EXPECT_NEAR(d.gradient.dot(by[k]), v[6 + k], 1e-13) << rows;
      // Along the hinge the bones go on circles: their second derivatives are centripetal.
      double second = by[k].dot(d.hessian * by[k]);
      for (std::size_t n = 0; n < path.carriers().size(); ++n) {
        const auto first = Eigen::Index(Carrier::variables * n);
        second += d.gradient.segment<3>(first).dot(Vec3::UnitZ().cross(Vec3(by[k].segment<3>(first))));
      }
      EXPECT_NEAR(second, v[9 + k], 1e-12) << rows;
    }
    ++rows;
  }
  EXPECT_EQ(rows, 6);
}

} // namespace
} // namespace tendril::test
