/// Pins between two vertices, against junctions and balances.
#include "support/beams.hpp"

#include "tendril/energy/derived.hpp"

namespace tendril::test {
namespace {

Constraint tie(int rod, int vertex, int to_rod, int to_vertex, double stiffness) {
  Constraint c = constraintOn(rod, vertex, Constraint::Kind::pin, stiffness);
  c.to_rod = to_rod;
  c.to_vertex = to_vertex;
  return c;
}

/// Two beams of different lengths that cross in the middle, one of them under a load.
Scene cross() {
  Scene s;
  s.gravity = Vec3::Zero();
  s.rods = {beam({-0.5, 0, 0}, {0.5, 0, 0}, 20, "a"), beam({0, -0.3, 0}, {0, 0.3, 0}, 12, "b")};
  for (int r = 0; r < 2; ++r)
    for (const bool last : {false, true})
      s.supports.push_back(hold(s, r, last ? s.rods[r].edges() : 0, last ? Support::Kind::clamp : Support::Kind::pin));
  s.forces = {{0, 10, Vec3(0, 0, 8)}};
  return s;
}

/// Errors fall as 1/k, and Newton takes no more iterations than with the exact junction.
TEST(Ties, ComeToTheBallJointAsTheyGetStiffer) {
  for (const bool dynamic : {false, true}) {
    auto middle = [&](double k, int *iterations) {
      Scene s = cross();
      if (k > 0)
        s.constraints = {tie(1, 6, 0, 10, k)};
      else
        s.junctions = {{"ball", {{0, 10, -1}, {1, 6, -1}}, 0}};
      LoopSettings settings = dynamic ? dynamics(0.01, 0.2) : statics(2);
      if (dynamic) settings.integrator.name = "bdf2";
      Simulation sim;
      runTo(sim, s, settings, iterations);
      return sim.state.position;
    };
    int exact_iterations = 0;
    const std::vector<Vec3> exact = middle(0, &exact_iterations);
    EXPECT_GT(std::abs(exact[10][2]), 0.003);
    std::vector<double> errors;
    for (const double k : {1e5, 1e6, 1e7, 1e8}) {
      int iterations = 0;
      const std::vector<Vec3> x = middle(k, &iterations);
      EXPECT_LE(iterations, exact_iterations + (dynamic ? 2 : 1)) << k;
      double error = 0;
      for (std::size_t v = 0; v < x.size(); ++v) error = std::max(error, (x[v] - exact[v]).norm());
      errors.push_back(error);
    }
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(errors[k] / errors[k + 1], 10, 0.5) << dynamic << k;
  }
}

/// A beam that only ties hold: it has no equilibrium without them, and its factorisation pivots of zero. Both ends of
/// every tie pull with one force, and what hangs is what the supports of the other beam bear.
TEST(Ties, HoldARodThatNothingElseHolds) {
  for (const double k : {10.0, 1e4, 1e8}) {
    Scene s;
    s.gravity = Vec3(0, 0, -1);
    s.rods = {beam({-0.5, 0, 0}, {0.5, 0, 0}, 20, "a"), beam({-0.4, 0.1, 0}, {0.4, 0.1, 0}, 16, "b")};
    for (Rod &rod : s.rods) rod.material.linear_density = 0.5;
    s.supports = {hold(s, 0, 0, Support::Kind::clamp), hold(s, 0, 20, Support::Kind::clamp)};
    s.constraints = {tie(1, 0, 0, 2, k), tie(0, 18, 1, 16, k), tie(1, 8, 0, 10, 0.1 * k)};
    Simulation sim;
    runTo(sim, s, statics());
    const RodActions a = rodActions(sim.scene, *sim.elements, sim.state, 1, 1);
    Vec3 bears = a.constraint[0].force - a.constraint[1].force + a.constraint[2].force;
    // The residual that Newton leaves is 1e-6 of the load.
    EXPECT_LT((bears - Vec3(0, 0, 0.5 * 0.8)).norm(), 1e-5) << k;
    EXPECT_LT((a.reaction[0] + a.reaction[1] - Vec3(0, 0, 0.5 * 1.8)).norm(), 1e-5) << k;
    const Vec3 off = sim.state.position[21] - sim.state.position[2];
    EXPECT_LT((a.constraint[0].force + k * off).norm(), 1e-6 + 1e-9 * k) << k;
  }
}

/// Forces between two free rods come in pairs along their line: momentum and angular momentum stay, and the energy as
/// the method keeps it; a damper takes energy away.
TEST(Ties, KeepMomenta) {
  for (const double damping : {0.0, 0.5}) {
    Scene s;
    s.gravity = Vec3::Zero();
    s.rods = {beam({0, 0, 0}, {1, 0, 0}, 10, "a"), beam({0, 0.2, 0}, {0, 1.2, 0.3}, 8, "b")};
    for (Rod &rod : s.rods) {
      rod.material.linear_density = 1;
      rod.material.linear_rotational_inertia = 1e-6; // its momentum is left out below
    }
    s.rods[0].initial_velocity = Vec3(0.3, -0.2, 0.5);
    s.constraints = {tie(0, 3, 1, 0, 40), tie(1, 8, 0, 10, 5)};
    for (Constraint &c : s.constraints) c.damping = damping;
    LoopSettings settings = dynamics(0.01, 1);
    settings.integrator.name = "midpoint";
    Simulation sim;
    ASSERT_EQ(sim.setUp(s, settings), PetscErrorCode(0));
    auto momenta = [&] {
      std::array<Vec3, 2> sum{Vec3::Zero(), Vec3::Zero()};
      for (int v = 0; v < sim.elements->vertices(); ++v) {
        const Vec3 p = sim.elements->mass()[sim.elements->vertex_slot[v]] * sim.state.velocity[v];
        sum[0] += p;
        sum[1] += sim.state.position[v].cross(p);
      }
      return sum;
    };
    const auto before = momenta();
    const double energy = energyBudget(sim.scene, *sim.elements, sim.state, 1).total();
    Simulation end;
    runTo(end, s, settings);
    std::swap(sim.state, end.state);
    const auto after = momenta();
    EXPECT_LT((after[0] - before[0]).norm(), 1e-7 * before[0].norm());
    const double now = energyBudget(sim.scene, *sim.elements, sim.state, 1).total();
    EXPECT_GT(energyBudget(sim.scene, *sim.elements, sim.state, 1).constraint, 0);
    if (damping == 0) {
      EXPECT_LT((after[1] - before[1]).norm(), 1e-5 * before[1].norm());
      EXPECT_NEAR(now, energy, 0.02 * energy);
    } else // not along the line between both, so that a damper takes angular momentum, too, while they are apart
      EXPECT_LT(now, 0.8 * energy);
  }
}

/// Many ties, the solver chosen for them and MUMPS: the same steps, iterations and negative pivots.
TEST(Ties, OtherSolversFindTheSame) {
  auto run = [&](const char *solver, int *iterations) {
    Scene s;
    s.gravity = Vec3(0, 0, -9.81);
    for (int r = 0; r < 6; ++r)
      s.rods.push_back(beam({0, 0.05 * r, 0}, {1, 0.05 * r, 0}, 20 + r, "r" + std::to_string(r)));
    for (int r = 0; r < 6; ++r) s.rods[r].material.linear_density = 0.1;
    for (int r = 0; r < 6; r += 5) s.supports.push_back(hold(s, r, 0, Support::Kind::clamp));
    for (int r = 0; r + 1 < 6; ++r)
      for (const int v : {1, 10, 18}) s.constraints.push_back(tie(r, v, r + 1, v, 100 * (r + 1)));
    s.constraints[4].saturation = 0.01;
    if (*solver) EXPECT_EQ(PetscOptionsSetValue(nullptr, "-pc_factor_mat_solver_type", solver), PetscErrorCode(0));
    Simulation sim;
    runTo(sim, s, dynamics(0.02, 0.4), iterations);
    EXPECT_EQ(PetscOptionsClearValue(nullptr, "-pc_factor_mat_solver_type"), PetscErrorCode(0));
    return sim.state.position;
  };
  int own = 0, mumps = 0;
  const std::vector<Vec3> x = run("", &own), y = run("mumps", &mumps);
  EXPECT_EQ(own, mumps);
  double off = 0;
  for (std::size_t v = 0; v < x.size(); ++v) off = std::max(off, (x[v] - y[v]).norm());
  EXPECT_LT(off, 1e-7); // Newton stops at 1e-6 of the load
  EXPECT_GT((x[20] - Vec3(1, 0, 0)).norm(), 0.05);
}

} // namespace
} // namespace tendril::test
