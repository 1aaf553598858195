/// Friction with obstacles: its potential, sliding, sticking, stopping, rolling, and ropes round drums.
#include "tendril/contact/friction.hpp"

#include "support/differences.hpp"
#include "support/touching.hpp"

namespace tendril::test {
namespace {

constexpr double radius = 0.005, g = 9.81;

/// A round rod on the plane z = 0, which is inclined by an angle along a direction.
Scene onIncline(double coefficient, double angle, const Vec3 &along, bool at_surface, int edges = 6) {
  Rod rod;
  rod.name = "rod";
  rod.position = lineShape(Vec3(0, 0, radius), Vec3(0.3, 0, radius), edges).points;
  rod.material = homogeneousMaterial({SectionShape::circle, {radius, 0}}, 1e7, 4e6, 1000);
  rod.contact.radius = radius;
  rod.contact.distance = 0.2 * radius;
  rod.contact.stiffness = 64;
  rod.contact.friction = coefficient;
  rod.contact.friction_at_surface = at_surface;
  rod.contact.slip_length = 1e-3 * radius;
  setBishopDirectors(rod);
  Scene scene;
  scene.gravity = g * (std::sin(angle) * along - std::cos(angle) * Vec3::UnitZ());
  scene.rods = {rod};
  scene.colliders = {solid(makeHalfSpace())};
  return scene;
}

TEST(Friction, ForceIsTheSlopeOfItsPotential) {
  SlidingPoint point{};
  point.pressing = 3;
  point.coefficient = 0.4;
  point.normal = Vec3(1, 2, -2).normalized();
  ContactSettings settings;
  settings.tangential_damping = 0.1;
  settings.normal_damping = 0.2;
  const Sliding sliding{1e-3, 0.01};
  Random random{2};
  for (int n = 0; n < 200; ++n) {
    const Vec3 way = 1.5e-3 * Vec3(random(), random(), random());
    const SlidingForce here = slidingForce(point, settings, sliding, way);
    constexpr double h = 1e-8;
    for (int k = 0; k < 3; ++k) {
      const SlidingForce ahead = slidingForce(point, settings, sliding, way + h * Vec3::Unit(k)),
                         behind = slidingForce(point, settings, sliding, way - h * Vec3::Unit(k));
      // Of second order in h over the fall-off, 1e-10; rounding 1e-16/1e-8 of the value.
      EXPECT_NEAR((ahead.value - behind.value) / (2 * h), here.gradient[k], 1e-6);
      EXPECT_LT(((ahead.gradient - behind.gradient) / (2 * h) - here.hessian.col(k)).norm(),
                1e-4 * here.hessian.norm());
    }
    EXPECT_GE(here.hessian.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), -1e-9);
    EXPECT_LE(slidingForce(point, {}, {1e-3, 0}, way).gradient.norm(), 1.2 * (1 + 1e-14)); // Coulomb's limit
  }
}

TEST(Friction, DerivativesAreThoseOfTheEnergy) {
  for (const bool at_surface : {false, true})
    expectDerivativesAfter(onIncline(0.5, 0.3, Vec3(1, 1, 0).normalized(), at_surface, 8), 1e-2, 0.2,
                           at_surface ? "at the surface" : "at the centreline");
}

/// contact_incline.csv: mu = 0.5. Lying across it would roll; along it, nothing turns.
TEST(Friction, OnAnInclineARodCreepsOrSlides) {
  constexpr double degree = pi / 180;
  for (const bool at_surface : {false, true}) {
    Simulation creeping;
    runTo(creeping, onIncline(0.5, 26 * degree, Vec3::UnitX(), at_surface), dynamics(0.02, 2));
    for (const Vec3 &v : creeping.state.velocity) EXPECT_NEAR(v[0], 8.43364044e-3, 1e-6 * 8.4e-3);
    for (const auto &[angle, acceleration] : {std::pair{27.0, 0.0832598013}, {30.0, 0.657145394}}) {
      Simulation early, late;
      runTo(early, onIncline(0.5, angle * degree, Vec3::UnitX(), at_surface), dynamics(0.02, 1));
      runTo(late, onIncline(0.5, angle * degree, Vec3::UnitX(), at_surface), dynamics(0.02, 2));
      for (std::size_t i = 0; i < late.state.velocity.size(); ++i)
        EXPECT_NEAR(late.state.velocity[i][0] - early.state.velocity[i][0], acceleration, 1e-6) << angle;
    }
  }
}

/// contact_stop.csv: v0 = 1, mu = 0.5, fall-off 0.01. Backward Euler stops early by v0 dt/2, which extrapolates.
TEST(Friction, StopsASlidingRod) {
  std::vector<double> way;
  for (const double dt : {2e-3, 1e-3}) {
    Scene scene = onIncline(0.5, 0, Vec3::UnitX(), false);
    scene.rods[0].initial_velocity = Vec3(1, 0, 0);
    // At rest from the start: where the barrier bears the weight, W' = w.
    const double weight = scene.rods[0].material.linear_density * g;
    double low = -0.49 * scene.rods[0].contact.distance, high = -low;
    for (int k = 0; k < 100; ++k) {
      const double middle = 0.5 * (low + high);
      (-NormalLaw(scene.rods[0].contact, 64)(middle).slope > weight ? low : high) = middle;
    }
    for (Vec3 &x : scene.rods[0].position) x[2] = radius + low;
    Simulation sim;
    runTo(sim, scene, dynamics(dt, 0.6));
    way.push_back(sim.state.position[0][0]);
  }
  EXPECT_NEAR(2 * way[1] - way[0], 0.101940737, 2e-4 * 0.1); // 1e-4 is dt^2 of what is left after the extrapolation
  EXPECT_GT(way[1], way[0] - 1e-6 + 0);
}

/// A cylinder rolls down with 2/3 of what it would slide with: its moment of inertia is m r^2/2. In a step it turns by
/// 0.13 rad, and the way of its surface point is the sine of that.
TEST(Friction, AtTheSurfaceARodRolls) {
  const double angle = 0.2;
  Simulation sim;
  runTo(sim, onIncline(0.6, angle, Vec3::UnitY(), true, 4), dynamics(5e-4, 1));
  const double slides = g * std::sin(angle);
  for (std::size_t i = 0; i < sim.state.velocity.size(); ++i)
    EXPECT_NEAR(sim.state.velocity[i][1], 2.0 / 3 * slides, 0.02 * slides);
  for (const double rate : sim.state.twist_rate) EXPECT_NEAR(std::abs(rate) * radius, 2.0 / 3 * slides, 0.02 * slides);
  Simulation sliding;
  runTo(sliding, onIncline(0.6, angle, Vec3::UnitY(), false, 4), dynamics(5e-3, 1));
  for (const Vec3 &v : sliding.state.velocity) EXPECT_LT(v[1], 0.01); // at the centreline it sticks
}

/// What sticks by an anchor comes to rest; in steps in load, it lies the same however many these are.
TEST(Friction, AnchoredARodStays) {
  const double angle = 24 * pi / 180; // of 26.6
  for (const bool at_surface : {false, true}) {
    Scene scene = onIncline(0.5, angle, Vec3::UnitX(), at_surface);
    scene.rods[0].contact.stick = ContactSettings::Stick::anchored;
    Simulation early, late;
    runTo(early, scene, dynamics(0.02, 1));
    runTo(late, scene, dynamics(0.02, 3));
    for (std::size_t i = 0; i < late.state.position.size(); ++i)
      EXPECT_NEAR(late.state.position[i][0], early.state.position[i][0], 1e-9); // 17 mm of creeping, else
  }
  std::vector<double> at;
  for (const int load_steps : {1, 4, 16}) {
    Simulation sim;
    runTo(sim, onIncline(0.5, angle, Vec3::UnitX(), false), statics(load_steps));
    at.push_back(sim.state.position[0][0]);
  }
  EXPECT_NEAR(at[1], at[0], 1e-8);
  EXPECT_NEAR(at[2], at[0], 1e-8);
  EXPECT_LT(at[0], 1e-3 * radius); // the slip length
}

/// The readings of a rod that lies still add up to its weight, and as many newtons hold it back.
TEST(Friction, ReadingsAddUpToTheWeight) {
  const double angle = 20 * pi / 180;
  for (const bool at_surface : {false, true}) {
    Scene scene = onIncline(0.5, angle, Vec3::UnitX(), at_surface);
    scene.rods[0].contact.stick = ContactSettings::Stick::anchored;
    Simulation sim;
    runTo(sim, scene, dynamics(0.02, 3));
    const auto readings = contactReadings(scene, *sim.elements, sim.state,
                                          configurationOf(sim.state, scene, *sim.elements, sim.state.time));
    std::vector<Vec3> force, moment;
    colliderActions(scene, readings, sim.state.time, &force, &moment);
    const double weight = scene.rods[0].material.linear_density * 0.3 * g;
    EXPECT_NEAR(force[0][0], -weight * std::sin(angle), 1e-5 * weight);
    EXPECT_NEAR(force[0][2], weight * std::cos(angle), 1e-5 * weight);
    // About the origin, the weight at its centre of mass is balanced.
    const Vec3 centre(sim.state.position[3][0], 0, sim.state.position[3][2]);
    const Vec3 of_weight = centre.cross(scene.gravity * weight / g);
    EXPECT_LT((moment[0] + of_weight).norm(), 2e-5 * weight * 0.3) << at_surface;
    const std::vector<Vec3> shared = contactForces(*sim.elements, readings);
    Vec3 sum = Vec3::Zero();
    for (const Vec3 &f : shared) sum += f;
    EXPECT_LT((sum - force[0]).norm(), 1e-12 * weight);
  }
}

/// A cord over a drum: tensions at both ends are as exp(coefficient x angle) when it slides. Friction at the surface
/// has the rod's radius r for a lever, which leaves 1 - r/rho of it: T' = coefficient p (1 - r/rho) of balance of
/// moments.
class Capstan : public ::testing::TestWithParam<bool> {};
TEST_P(Capstan, ARopeHoldsAsEulerSays) {
  constexpr double drum = 0.1;
  const bool at_surface = GetParam();
  const double rho = drum + radius, coefficient = 0.3;
  constexpr int edges = 120;
  Rod rod;
  rod.name = "rope";
  const double straight = 0.1, length = pi * rho + 2 * straight;
  for (int i = 0; i <= edges; ++i) {
    const double s = length * i / edges - straight;
    const double angle = std::clamp(s / rho, 0.0, pi), beyond = s < 0 ? s : s > pi * rho ? s - pi * rho : 0;
    rod.position.push_back(Vec3(-rho * std::cos(angle), 0, rho * std::sin(angle)) * 1.002 +
                           Vec3(0, 0, s < 0 ? beyond : -beyond));
  }
  rod.material = {0.1, 1e-6, 1e5, 0, {0, 0}, 0, 0};
  if (at_surface) rod.material = {0.1, 1e-6, 1e5, 1e-6, {1e-6, 1e-6}, 0, 0}; // 1e-5 of the tension times rho^2
  rod.gravity = false;
  rod.contact.radius = radius;
  rod.contact.distance = 0.2 * radius;
  rod.contact.friction = coefficient;
  rod.contact.friction_at_surface = at_surface;
  rod.contact.slip_length = 1e-6;
  setBishopDirectors(rod);
  Scene scene;
  scene.rods = {rod};
  scene.supports = {hold(scene, 0, edges, Support::Kind::pin)};
  scene.supports[0].motion.velocity = Vec3(0, 0, -0.02);
  scene.forces = {{0, 0, Vec3(0, 0, -10)}};
  scene.colliders = {solid(makeCylinder(drum, HUGE_VAL))};
  const Vec3 turn = pi / 2 * Vec3::UnitX();
  scene.colliders[0].rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  Simulation sim;
  runTo(sim, scene, statics(10));
  const double ratio = sim.state.axial_force[edges - 1] / sim.state.axial_force[0];
  const double lever = at_surface ? 1 - radius / rho : 1;
  EXPECT_NEAR(ratio, std::exp(coefficient * pi * lever), 0.005 * ratio); // lag 1e-3, and edges of 5 mm
}
INSTANTIATE_TEST_SUITE_P(Friction, Capstan, ::testing::Bool(),
                         [](const auto &at) { return at.param ? "AtTheSurface" : "AtTheCentreline"; });

} // namespace
} // namespace tendril::test
