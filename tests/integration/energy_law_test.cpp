/// The two laws of stretch and bending against closed forms: end couples, tension, compression, and the moment that
/// `seed` bears at most.
#include "support/rods.hpp"

#include "tendril/dynamics/bifurcation.hpp"
#include "tendril/energy/derived.hpp"

namespace tendril::test {
namespace {

constexpr double exact = 1e-9; ///< Newton's tolerance, 1e-10 of the loads, over the softest stiffness

/// EI = 1, clamped. \param axial EA L^2/EI
Scene barScene(Energy energy, int edges, double axial) {
  Rod rod = straightRod(edges, Measure::angle);
  rod.energy = energy;
  rod.material.axial_stiffness = axial;
  return clampedScene(rod);
}

/// Statics to its end, or what stopped it.
struct Solved {
  Simulation sim;
  bool finished = false;
  std::string failure;

  explicit Solved(Scene scene, int load_steps = 4, bool mixed = true) {
    LoopSettings settings = statics(load_steps);
    settings.mixed = mixed;
    EXPECT_EQ(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-10"), PetscErrorCode(0));
    EXPECT_EQ(sim.setUp(std::move(scene), settings), PetscErrorCode(0));
    EXPECT_EQ(PetscOptionsClearValue(nullptr, "-snes_rtol"), PetscErrorCode(0));
    TimeLoop loop(sim.solver, settings);
    EXPECT_EQ(loop.run(
                  sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished),
              PetscErrorCode(0));
    failure = loop.failure();
  }
  Vec3 edge(int i) const { return sim.state.position[i + 1] - sim.state.position[i]; }
  double turning(int v) const {
    return std::acos(std::clamp(edge(v - 1).normalized().dot(edge(v).normalized()), -1.0, 1.0));
  }
};

Scene coupleScene(Energy energy, int edges, double axial, double moment) {
  Scene scene = barScene(energy, edges, axial);
  scene.moments = {{0, edges - 1, 0, Vec3(0, 0, moment)}};
  return scene;
}

TEST(EndMoment, LeavesTheLengthOfAClassicalRod) {
  for (const bool mixed : {true, false}) {
    const int edges = 20;
    const double moment = 6;
    const Solved s(coupleScene(Energy::classical, edges, 100, moment), 4, mixed);
    ASSERT_TRUE(s.finished) << s.failure;
    for (int i = 0; i < edges; ++i) EXPECT_NEAR(s.edge(i).norm() * edges, 1, exact) << i;
    for (int v = 1; v < edges; ++v) EXPECT_NEAR(s.turning(v) * edges, moment, exact * moment) << v; // curvature M/B
    for (const double force : s.sim.state.axial_force) EXPECT_NEAR(force, 0, exact * moment);
  }
}

/// The stretch r and the turning kappa per reference length of `seed`: r^2 = 1 - 2 B kappa^2/EA and B r^2 kappa = M.
TEST(EndMoment, ShortensARodOfTheSeed) {
  const int edges = 20;
  const double axial = 100, moment = 2;
  double kappa = moment;
  for (int k = 0; k < 200; ++k) kappa = moment / (1 - 2 * kappa * kappa / axial);
  const double stretch = std::sqrt(1 - 2 * kappa * kappa / axial);
  const Solved s(coupleScene(Energy::seed, edges, axial, moment));
  ASSERT_TRUE(s.finished) << s.failure;
  for (int v = 1; v <= edges / 2;
       ++v) { // the last edge has no cell behind it; what that changes falls by 20 from edge to edge
    EXPECT_NEAR(s.edge(v - 1).norm() * edges, stretch, exact) << v;
    EXPECT_NEAR(s.turning(v) * edges, kappa, exact * kappa) << v;
  }
  EXPECT_LT(stretch, 0.96);
  // Along the tangent there is no force: S + B kappa^2 = 0, times the stretch.
  EXPECT_NEAR(s.sim.state.axial_force[3], -kappa * kappa, exact * axial);
  const RodActions actions = rodActions(s.sim.scene, *s.sim.elements, s.sim.state, 1, 1);
  for (int i = 0; i < edges; ++i) EXPECT_LT(actions.force[i].norm(), exact * axial) << i;
}

/// Far below the limit, whatever the load steps: no edge gives way that Newton has gone past. \param part of the
/// largest moment
TEST(EndMoment, OfPartOfTheLimitLeavesNoEdgeThatHasGivenWay) {
  struct {
    double axial, part;
    int edges;
  } cases[] = {{2e4, 0.5, 40}, {5e3, 0.25, 40}, {5e3, 0.5, 40}, {1e3, 0.5, 20}, {1e3, 0.25, 40}, {200, 0.5, 20}};
  for (const auto &c : cases)
    for (const int steps : {1, 2, 5, 10, 20, 40})
      for (const bool mixed : {true, false}) {
        const double moment = c.part * 2 / 3 * std::sqrt(c.axial / 6);
        double kappa = moment;
        for (int k = 0; k < 200; ++k) kappa = moment / (1 - 2 * kappa * kappa / c.axial);
        const Solved s(coupleScene(Energy::seed, c.edges, c.axial, moment), steps, mixed);
        SCOPED_TRACE(std::to_string(c.axial) + ", " + std::to_string(c.part) + ", " + std::to_string(steps) +
                     (mixed ? "" : ", primal"));
        EXPECT_TRUE(s.finished) << s.failure;
        for (int v = 0; v < c.edges && s.finished;
             ++v) // the end is softer by less than this; edges that give way are down to a half and less
          EXPECT_NEAR(s.edge(v).norm() * c.edges, std::sqrt(1 - 2 * kappa * kappa / c.axial), 0.05) << v;
      }
}

/// With EA L^2/EI = 1e3 the seed bears (2/3) sqrt(EA B/6) = 8.607, and the classical rod anything.
TEST(EndMoment, HasALimitUnderTheSeedAlone) {
  const double limit = 2.0 / 3 * std::sqrt(1e3 / 6);
  EXPECT_TRUE(Solved(coupleScene(Energy::seed, 20, 1e3, 0.99 * limit), 10).finished);
  const Solved over(coupleScene(Energy::seed, 20, 1e3, 9), 10);
  EXPECT_FALSE(over.finished);
  EXPECT_NEAR(over.sim.state.time * 9, limit,
              0.01 * limit); // load steps down to 1e-4; the last edge, half as bent, shortens less
  EXPECT_NE(over.failure.find("rod 'rod' bends under a moment of 8."), std::string::npos) << over.failure;
  EXPECT_NE(over.failure.find("= 8.607 N m"), std::string::npos) << over.failure;
  EXPECT_NE(over.failure.find("energy: classical"), std::string::npos) << over.failure;
  const Solved classical(coupleScene(Energy::classical, 20, 1e3, 18), 10);
  ASSERT_TRUE(classical.finished) << classical.failure;
  EXPECT_NEAR(classical.turning(7), 0.9, exact);
}

/// Tension and torque on a straight rod: l/L = 1 + F/EA, or EA r (r^2 - 1)/2 = F; twist T/GJ for both.
TEST(Tension, StretchesByItsLaw) {
  for (const bool mixed : {true, false})
    for (const Energy energy : {Energy::seed, Energy::classical}) {
      const int edges = 6;
      const double axial = 50, force = 20, torque = 0.3;
      Scene scene = barScene(energy, edges, axial);
      scene.forces = {{0, edges, Vec3(force, 0, 0)}};
      scene.moments = {{0, edges - 1, torque, Vec3::Zero()}};
      const Solved s(scene, 2, mixed);
      ASSERT_TRUE(s.finished) << s.failure;
      double stretch = 1 + force / axial;
      if (energy == Energy::seed)
        for (int k = 0; k < 100; ++k)
          stretch -=
              (axial * stretch * (stretch * stretch - 1) / 2 - force) / (axial * (3 * stretch * stretch - 1) / 2);
      const RodActions actions = rodActions(s.sim.scene, *s.sim.elements, s.sim.state, 1, 1);
      const RodStrains strains = rodStrains(s.sim.scene, *s.sim.elements, s.sim.state, 1, 1);
      for (int i = 0; i < edges; ++i) {
        EXPECT_NEAR(s.edge(i).norm() * edges, stretch, exact) << i;
        EXPECT_NEAR(actions.force[i][0], force, exact * axial) << i;
        EXPECT_NEAR(s.sim.state.axial_force[i] * (energy == Energy::seed ? stretch : 1), force, exact * axial)
            << i; // S r, or S
      }
      for (int v = 1; v < edges; ++v)
        EXPECT_NEAR(strains.twist[v], torque / s.sim.scene.rods[0].material.torsional_stiffness, exact) << v;
    }
}

/// A rod too stiff to buckle: `seed` gives way at r = 1/sqrt 3, EA/(3 sqrt 3) = 0.19245 EA; `classical` only where
/// nothing is left of it, at EA.
TEST(Compression, GivesWayByItsLaw) {
  auto compressed = [](Energy energy, double force) {
    Scene scene = barScene(energy, 2, 1e-3);
    scene.forces = {{0, 2, Vec3(-force * 1e-3, 0, 0)}};
    return Solved(scene, 20);
  };
  const Solved seed = compressed(Energy::seed, 0.192);
  ASSERT_TRUE(seed.finished) << seed.failure;
  const Solved beyond = compressed(Energy::seed, 0.193);
  EXPECT_FALSE(beyond.finished);
  EXPECT_NE(beyond.failure.find("0.192 EA"), std::string::npos) << beyond.failure;
  const Solved classical = compressed(Energy::classical, 0.9);
  ASSERT_TRUE(classical.finished) << classical.failure;
  EXPECT_NEAR(classical.edge(0).norm() * 2, 0.1, 1e-6);
  EXPECT_FALSE(compressed(Energy::classical, 1.01).finished);
}

/// A column clamped at its foot under a dead load P on its head, EA L^2/EI = 50: it buckles at P = r pi^2/4 with P = EA
/// r (1 - r^2)/2 (`seed`), or at P r = pi^2/4 with P = EA (1 - r).
TEST(Column, BucklesByItsLaw) {
  const double axial = 50, slender = pi * pi / 4;
  auto critical = [&](Energy energy, int edges) {
    Scene scene = barScene(energy, edges, axial);
    scene.rods[0].material.flexural_stiffness = {1, 2}; // one mode at a time
    scene.forces = {{0, edges, Vec3(-4, 0, 0)}};
    LoopSettings settings = statics(10);
    settings.bifurcation = Bifurcation::stop;
    Simulation sim;
    EXPECT_EQ(sim.setUp(scene, settings), PetscErrorCode(0));
    TimeLoop loop(sim.solver, settings);
    double found = 0;
    loop.on_critical = [&](const CriticalPoint &point) {
      found = 4 * point.load_factor;
      return PetscErrorCode(0);
    };
    bool finished = false;
    EXPECT_EQ(loop.run(
                  sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished),
              PetscErrorCode(0));
    EXPECT_TRUE(finished) << loop.failure();
    return found;
  };
  for (const Energy energy : {Energy::seed, Energy::classical}) {
    const double exact_load = energy == Energy::seed ? slender * std::sqrt(1 - 2 * slender / axial)
                                                     : axial / 2 * (1 - std::sqrt(1 - 4 * slender / axial));
    const double coarse = critical(energy, 16), fine = critical(energy, 32);
    EXPECT_NEAR(order(std::abs(coarse - exact_load), std::abs(fine - exact_load)), 2, 0.1);
    EXPECT_NEAR((4 * fine - coarse) / 3, exact_load, 1e-5 * exact_load); // terms of h^4
  }
}

/// Both laws are one in the limit of a rod that does not stretch: they differ by B kappa^2/EA, here 1e-9.
TEST(EnergyLaw, DoesNotMatterForARodThatDoesNotStretch) {
  std::array<Vec3, 2> tip;
  for (const Energy energy : {Energy::seed, Energy::classical}) {
    Scene scene = barScene(energy, 16, 1e10);
    scene.forces = {{0, 16, Vec3(0, -5, 1)}};
    const Solved s(scene);
    ASSERT_TRUE(s.finished) << s.failure;
    tip[energy == Energy::classical] = s.sim.state.position[16];
  }
  EXPECT_LT((tip[0] - tip[1]).norm(), 1e-7);
  EXPECT_GT((tip[0] - tip[1]).norm(), 0);
}

} // namespace
} // namespace tendril::test
