/// Statics in a rotating frame, against exact steady rotations (data/reference/rotating_exact.csv).
#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// A rod of unit length and density, EA 100, turning in its plane about the end that is pinned: r(1) = tan(b)/b with b
/// = Omega/sqrt(EA).
double tipRadius(int edges, double omega) {
  Rod rod = straightRod(edges);
  rod.material.axial_stiffness = 100;
  Scene scene = clampedScene(rod);
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  scene.rotation.angular_velocity = Vec3(0, 0, omega);
  Simulation sim;
  runTo(sim, scene, statics(4));
  return sim.state.position.back().x();
}

/// Lumped masses and the Green-Lagrange strain make the discrete rod tend to another law of stretching than the linear
/// one of the closed form: its fine limit, tan(b)/b + O(strain^2), is told from it by Richardson, the order by three
/// resolutions.
TEST(Rotation, OfARodAboutItsEndIsSecondOrder) {
  const double omega = 1, closed = std::tan(omega / 10) / (omega / 10);
  const double coarse = tipRadius(16, omega), middle = tipRadius(32, omega), fine = tipRadius(64, omega);
  EXPECT_NEAR(order(std::abs(coarse - middle), std::abs(middle - fine)), 2, 0.1);
  const double limit = fine + (fine - middle) / 3;
  EXPECT_NEAR(limit, closed,
              3 * (closed - 1) * (closed - 1)); // strains of 3e-3 to 5e-3: the laws differ by 3/2 of their square
}

/// A centrifugal force is that of its potential: turning about a far centre is a uniform gravity.
TEST(Rotation, AboutAFarCentreIsGravity) {
  Scene turning = clampedScene(straightRod(24)), heavy = turning;
  const double far = 1e6;
  turning.rotation.angular_velocity = Vec3(0, 0, std::sqrt(5 / far));
  turning.rotation.centre = Vec3(0, far, 0);
  heavy.gravity = Vec3(0, -5, 0);
  Simulation a, b;
  runTo(a, turning, statics());
  runTo(b, heavy, statics());
  for (std::size_t v = 0; v < a.state.position.size(); ++v)
    EXPECT_LT((a.state.position[v] - b.state.position[v]).norm(), 3e-6); // the field varies by 1e-6
}

/// The potential of the centrifugal force counts as gravity, -1/2 m |omega x (x - centre)|^2.
TEST(Rotation, HasItsPotentialInTheDiagnostics) {
  Scene scene = clampedScene(straightRod(10));
  scene.rods[0].material.linear_density = 2;
  scene.rotation.angular_velocity = Vec3(0, 0, 3);
  scene.rotation.centre = Vec3(-1, 0, 5);
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, statics()));
  // The integral of 2/2 9 (1 + s)^2 by the trapezoidal rule: h^2/12 (f'(1) - f'(0)) above 21.
  EXPECT_NEAR(energyBudget(sim.scene, *sim.elements, sim.state, 1).gravity, -(21 + 0.01 / 12 * 18), 1e-12);
  EXPECT_NEAR(energyBudget(sim.scene, *sim.elements, sim.state, 0.5).gravity, -0.5 * (21 + 0.01 / 12 * 18), 1e-12);
}

} // namespace
} // namespace tendril::test
