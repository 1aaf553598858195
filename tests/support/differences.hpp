#pragma once
/// Derivatives of a potential against differences of its energy.
#include "support/random_cell.hpp"
#include "support/rods.hpp"
#include "tendril/solver/incremental_potential.hpp"

#include <gtest/gtest.h>

namespace tendril::test {

/// A random increment of the first rod: positions [m] and twists [rad] of about these sizes.
inline Planes randomIncrement(const IncrementalPotential &potential, Random &random, double positions, double twists) {
  const RodRange &rod = potential.elements().rods[0];
  Planes v = potential.dofs().makePlanes();
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
    for (int a = 0; a < slot_size; ++a) v[a][s] = (a == 3 ? twists : positions) * random();
  v[3][rod.vertexEnd() - 1] = 0;
  return v;
}

/// Gradient and Hessian of the first, open rod along v, by differences of fourth order over parts h of it.
inline void expectDerivatives(IncrementalPotential &potential, const Planes &v, double h, double slope_tolerance,
                              double curvature_tolerance, const std::string &what) {
  const RodRange &rod = potential.elements().rods[0];
  const double slope = dot(rod, potential.derivatives().gradient, v);
  Planes kv = potential.dofs().makePlanes();
  potential.blocks().multiply(rod, {}, v, kv);
  const double curvature = dot(rod, kv, v);
  auto energy = [&](double part) {
    Configuration trial;
    EXPECT_TRUE(potential.tryMove(v, part, 0, RetractionKind::additive, trial));
    return potential.rodEnergy(trial, 0).value;
  };
  const double e[5] = {energy(-2 * h), energy(-h), energy(0), energy(h), energy(2 * h)};
  EXPECT_NEAR((e[0] - 8 * e[1] + 8 * e[3] - e[4]) / (12 * h), slope, slope_tolerance * std::abs(slope)) << what;
  EXPECT_NEAR((-e[0] + 16 * e[1] - 30 * e[2] + 16 * e[3] - e[4]) / (12 * h * h), curvature,
              curvature_tolerance * curvature)
      << what;
}

/// The same in the step after a run: from a random place near its end, and along a random way.
inline void expectDerivativesAfter(const Scene &scene, double dt, double until, const std::string &what) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(scene, dynamics(dt, 1)));
  TimeLoop loop(sim.solver, dynamics(dt, until));
  bool finished;
  EXPECT_PETSC(loop.run(
      sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  EXPECT_TRUE(finished) << loop.failure();
  IncrementalPotential &potential = *sim.potential;
  Step step;
  step.dt = dt;
  step.time = sim.state.time + dt;
  step.mixed = false;
  sim.solver.begin(sim.state, step);
  Random random{5};
  Configuration moved;
  ASSERT_TRUE(
      potential.tryMove(randomIncrement(potential, random, 1e-4, 5e-2), 0.5, 0, RetractionKind::additive, moved));
  potential.accept(moved, 0);
  potential.resetAxialForces(0);
  expectDerivatives(potential, randomIncrement(potential, random, 1e-4, 5e-2), 1e-2, 1e-5, 1e-4, what);
}

} // namespace tendril::test
