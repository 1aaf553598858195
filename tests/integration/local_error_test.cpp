/// The error that an integrator tells of one step, against the true one.
#include "support/rods.hpp"

#include "tendril/energy/edge.hpp"

namespace tendril::test {
namespace {

/// A clamped rod that swings in space, twists and stretches; dissipation has smoothed it.
Scene smoothSwing() {
  Rod rod = straightRod(8, Measure::angle);
  rod.material.axial_stiffness = 1e2;
  rod.material.flexural_stiffness = {1, 2};
  rod.material.linear_density = 1;
  rod.material.linear_rotational_inertia = 1e-2;
  rod.material.stiffness_damping_coefficient = 0.02;
  return clampedScene(rod);
}

LoopSettings smoothly(const std::string &integrator, double dt, double t_end) {
  LoopSettings s = dynamics(dt, t_end);
  s.integrator.name = integrator;
  s.estimate_error = true;
  return s;
}

/// Runs on from a state; returns the sum of the estimates.
double runOn(Simulation &sim, const std::string &integrator, double dt, double t_end) {
  const LoopSettings settings = smoothly(integrator, dt, t_end);
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  double estimate = 0;
  EXPECT_EQ(loop.run(
                sim.state,
                [&](const State &, const Diagnostics &row) {
                  estimate = row.error_estimate;
                  return PetscErrorCode(0);
                },
                &finished),
            PetscErrorCode(0));
  EXPECT_TRUE(finished) << loop.failure();
  return estimate;
}

/// Distance of two states as the estimate has it: root mean square over vertices and edges, over the length of the rod.
double farApart(const State &a, const State &b) {
  const auto frame = [](const State &s, int e) {
    return Frame{(s.position[e + 1] - s.position[e]).normalized(), s.director[e], 1};
  };
  const int edges = int(a.director.size());
  double moved = 0, turned = 0;
  for (int v = 0; v <= edges; ++v) moved += (a.position[v] - b.position[v]).squaredNorm();
  for (int e = 0; e < edges; ++e) turned += std::pow(twistIncrement(frame(a, e), frame(b, e)), 2);
  return std::sqrt(moved / (edges + 1) + turned / edges);
}

/// Estimate over true error of a step of length h at a time, after many short steps and one of length h/growth of the
/// same method.
double ratio(const std::string &integrator, double time, double h, double growth) {
  Simulation sim;
  EXPECT_EQ(sim.setUp(smoothSwing(), smoothly(integrator, h, time)), PetscErrorCode(0));
  for (std::size_t v = 0; v < sim.state.position.size(); ++v) {
    const double s = sim.state.position[v][0], shape = s * s * (6 - 4 * s + s * s) / 3;
    sim.state.velocity[v] = Vec3(0, 2.5 * shape, 1.5 * shape);
  }
  for (std::size_t e = 0; e < sim.state.twist_rate.size(); ++e)
    sim.state.twist_rate[e] = 0.3 * std::sin((e + 0.5) * pi / 16);
  runOn(sim, integrator, h / 16, time - h / growth);
  runOn(sim, integrator, h / growth, time);
  const State start = sim.state;
  const double estimate = runOn(sim, integrator, h, time + h);
  const State end = sim.state;
  sim.state = start; // a method that needs no memory
  sim.state.memory.clear();
  sim.state.strains.clear();
  sim.state.last_dt = 0;
  runOn(sim, "sdirk33", h / 32, time + h);
  return estimate / farApart(end, sim.state);
}

/// The next order in h is some hundredths; that of bdf2 without growth a tenth, for the step before has left its own
/// error in the memory. sdirk33 is off by a third of its estimate where x'''' is that of turning, not of a linear
/// motion.
TEST(LocalError, IsThatOfTheEstimate) {
  EXPECT_EQ(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-11"), PetscErrorCode(0));
  for (const std::string &name : integratorNames())
    for (const double time : {0.1, 0.23})
      for (const double growth : {4.0, 1.0}) {
        const double r = ratio(name, time, 4e-3, growth);
        EXPECT_GT(r, 0.8) << name << " at " << time << ", grown by " << growth;
        EXPECT_LT(r, name == "sdirk33" ? 2.5 : 1.25) << name << " at " << time << ", grown by " << growth;
      }
  EXPECT_EQ(PetscOptionsClearValue(nullptr, "-snes_rtol"), PetscErrorCode(0));
}

} // namespace
} // namespace tendril::test
