/// Time integrators: their orders, what they keep, exact solutions, adapted steps.
#include "support/rods.hpp"

namespace tendril::test {
namespace {

const std::vector<std::string> second_order{"bdf2", "sdirk2", "midpoint", "generalized_alpha"};

LoopSettings with(const std::string &integrator, double dt, double t_end) {
  LoopSettings s = dynamics(dt, t_end);
  s.integrator.name = integrator;
  return s;
}

/// Newton to rounding while it lives: differences between runs are what is measured.
struct Sharp {
  Sharp() { EXPECT_EQ(PetscOptionsSetValue(nullptr, "-snes_rtol", "1e-10"), PetscErrorCode(0)); }
  ~Sharp() { EXPECT_EQ(PetscOptionsClearValue(nullptr, "-snes_rtol"), PetscErrorCode(0)); }
};

/// A quarter of a circle, clamped, pulled out of its plane: bends, twists and stretches. \param axial EA L^2/EI
Scene arcScene(double axial, double stiffness_damping = 0) {
  std::vector<Vec3> points;
  const int edges = 10;
  for (int k = 0; k <= edges; ++k) points.emplace_back(std::sin(pi / 2 * k / edges) * 2 / pi, (1 - std::cos(pi / 2 * k / edges)) * 2 / pi, 0);
  Rod rod = inextensibleRod(points, Measure::angle);
  rod.material.axial_stiffness = axial;
  rod.material.linear_rotational_inertia = 1e-2;
  rod.material.stiffness_damping_coefficient = stiffness_damping;
  Scene scene = clampedScene(rod);
  scene.gravity = Vec3(0, -3, 5);
  return scene;
}

/// Largest distance between vertices, and between directors.
double apart(const State &a, const State &b) {
  double worst = 0;
  for (std::size_t v = 0; v < a.position.size(); ++v) worst = std::max(worst, (a.position[v] - b.position[v]).norm());
  for (std::size_t e = 0; e < a.director.size(); ++e) worst = std::max(worst, (a.director[e] - b.director[e]).norm());
  return worst;
}

/// Order from three runs with halved steps, without a reference: the differences of neighbours fall like the errors.
double observedOrder(const Scene &scene, const std::string &integrator, double dt, double t_end) {
  Simulation runs[3];
  for (int k = 0; k < 3; ++k) runTo(runs[k], scene, with(integrator, dt / (1 << k), t_end));
  return order(apart(runs[0].state, runs[1].state), apart(runs[1].state, runs[2].state));
}

/// Asymptotic up to terms of the next order, which at these steps (a hundredth of the first period) are a tenth of the error: 0.3 of the order.
TEST(Integrator, HasItsOrder) {
  const Sharp sharp;
  for (const double axial : {1e4, 1e8}) {
    EXPECT_NEAR(observedOrder(arcScene(axial), "euler", 2e-3, 0.4), 1, 0.15) << axial;
    for (const std::string &name : second_order) EXPECT_NEAR(observedOrder(arcScene(axial), name, 1e-2, 0.4), 2, 0.3) << name << " " << axial;
  }
}

TEST(Integrator, KeepsItsOrderWithDissipationByStiffness) {
  const Sharp sharp;
  for (const std::string &name : {"bdf2", "sdirk2", "generalized_alpha"}) EXPECT_NEAR(observedOrder(arcScene(1e4, 0.05), name, 1e-2, 0.4), 2, 0.3) << name;
  EXPECT_GT(observedOrder(arcScene(1e4, 0.05), "midpoint", 1e-2, 0.4), 0.8); // its strain rate is a difference from the start
}

TEST(Integrator, KeepsItsOrderWithDissipationByMass) {
  const Sharp sharp;
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {straightRod(8)};
  scene.rods[0].initial_velocity = Vec3(0.3, -1, 2);
  scene.rods[0].material.mass_damping_coefficient = 3;
  for (const std::string &name : second_order) {
    double errors[2];
    for (int k = 0; k < 2; ++k) {
      Simulation sim;
      runTo(sim, scene, with(name, 0.04 / (1 << k), 0.8));
      errors[k] = (sim.state.velocity[3] - scene.rods[0].initial_velocity * std::exp(-3 * 0.8)).norm();
    }
    EXPECT_NEAR(order(errors[0], errors[1]), 2, 0.15) << name; // next order: alpha h = 0.1
  }
}

/// Steps of a pattern of lengths, each through a loop of its own.
State patternOfSteps(const Scene &scene, const std::string &integrator, double dt, double t_end) {
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, with(integrator, dt, t_end)), PetscErrorCode(0));
  const double pattern[] = {1, 2, 1.5, 0.5, 1, 0.4, 0.6}; // sums to 7
  for (int k = 0; sim.state.time < t_end * (1 - 1e-9); ++k) {
    const double h = dt * pattern[k % 7];
    TimeLoop loop(sim.solver, with(integrator, h, sim.state.time + h));
    bool finished = false;
    EXPECT_EQ(loop.run(sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished), PetscErrorCode(0));
    EXPECT_TRUE(finished) << loop.failure();
  }
  return sim.state;
}

TEST(Integrator, KeepsItsOrderWithStepsThatVary) {
  const Sharp sharp;
  for (const std::string &name : second_order) {
    State s[3];
    for (int k = 0; k < 3; ++k) s[k] = patternOfSteps(arcScene(1e4), name, 8e-3 / (1 << k), 0.448); // 8, 16, 32 patterns
    EXPECT_NEAR(order(apart(s[0], s[1]), apart(s[1], s[2])), 2, 0.35) << name;
  }
}

/// A parabola is met by every method of second order, whatever the steps.
TEST(FreeFall, IsExactInSecondOrder) {
  const Sharp sharp;
  Scene scene;
  scene.gravity = Vec3(0, -9.81, 2);
  scene.rods = {straightRod(10)};
  scene.rods[0].initial_velocity = Vec3(1, 2, 0);
  for (const std::string &name : second_order) {
    const State s = patternOfSteps(scene, name, 0.01, 0.7);
    const Vec3 moved = scene.rods[0].initial_velocity * s.time + scene.gravity * (0.5 * s.time * s.time);
    for (int v = 0; v <= 10; ++v) EXPECT_LT((s.position[v] - scene.rods[0].position[v] - moved).norm(), 1e-9) << name; // 70 steps, each to 1e-10 of the weight
  }
}

struct Flight {
  double energy_least = HUGE_VAL, energy_most = 0, energy_end = 0; ///< relative to the start
  double momentum = 0, angular = 0;                                ///< largest change, relative
};

/// A free rod that spins about its middle and bends, in a plane.
Flight fly(const std::string &integrator, double dt, int steps) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {straightRod(16)};
  scene.rods[0].material.axial_stiffness = 1e4;
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, with(integrator, dt, dt * steps)), PetscErrorCode(0));
  const std::vector<Vec3> &x = sim.state.position;
  for (std::size_t v = 0; v < x.size(); ++v) {
    const double s = x[v][0] - 0.5;
    sim.state.velocity[v] = Vec3(1, 4 * s + 6 * (s * s - 1.0 / 12), 0);
  }
  auto momenta = [&](const State &state) {
    std::pair<Vec3, Vec3> p{Vec3::Zero(), Vec3::Zero()};
    for (std::size_t v = 0; v < state.position.size(); ++v) {
      const Vec3 mv = sim.elements->mass()[sim.elements->vertex_slot[v]] * state.velocity[v];
      p.first += mv;
      p.second += state.position[v].cross(mv);
    }
    return p;
  };
  const auto [p0, l0] = momenta(sim.state);
  const double e0 = energyBudget(sim.scene, *sim.elements, sim.state, 1).total();
  Flight flight;
  TimeLoop loop(sim.solver, with(integrator, dt, dt * steps));
  bool finished = false;
  EXPECT_EQ(loop.run(
                sim.state,
                [&](const State &state, const Diagnostics &row) {
                  flight.energy_end = row.energy.total() / e0;
                  flight.energy_least = std::min(flight.energy_least, flight.energy_end);
                  flight.energy_most = std::max(flight.energy_most, flight.energy_end);
                  const auto [p, l] = momenta(state);
                  flight.momentum = std::max(flight.momentum, (p - p0).norm() / p0.norm());
                  flight.angular = std::max(flight.angular, (l - l0).norm() / l0.norm());
                  return PetscErrorCode(0);
                },
                &finished),
            PetscErrorCode(0));
  EXPECT_TRUE(finished) << loop.failure();
  return flight;
}

/// A thousand steps, forty periods of the first bending mode, which a step cuts in 28.
TEST(FreeFlight, KeepsWhatEachMethodPromises) {
  const Sharp sharp;
  std::map<std::string, Flight> flights;
  for (const std::string &name : integratorNames()) {
    flights[name] = fly(name, 1e-2, 1000);
    EXPECT_LT(flights[name].momentum, 1e-9) << name; // forces add up to nothing
    EXPECT_LT(flights[name].energy_most, 1.05) << name;
  }
  EXPECT_GT(flights["midpoint"].energy_least, 0.95);
  EXPECT_LT(flights["midpoint"].angular, 1e-8); // quadratic; 1000 steps of Newton's 1e-10
  EXPECT_LT(flights["euler"].energy_end, 0.8);
  for (const char *name : {"bdf2", "sdirk2", "generalized_alpha"}) { // dissipation of third order: more than backward Euler keeps
    EXPECT_GT(flights[name].energy_end, flights["euler"].energy_end) << name;
    EXPECT_LT(flights[name].angular, flights["euler"].angular) << name;
  }
}

/// A clamp that travels and turns: held vertices are where and as fast as the support says, at the ends of steps.
TEST(Integrator, FollowsSupportsThatMove) {
  for (const std::string &name : second_order) {
    Scene scene = clampedScene(straightRod(12, Measure::angle));
    scene.rods[0].material.mass_damping_coefficient = 20;
    Motion &motion = scene.supports[0].motion;
    motion.velocity = Vec3(0.5, 1, 0);
    motion.angular_velocity = Vec3(3 * pi, 0, 0); // one and a half turns about the rod
    Simulation sim;
    runTo(sim, scene, with(name, 0.01, 1));
    EXPECT_LT((sim.state.position[0] - Vec3(0.5, 1, 0)).norm(), 1e-14) << name;
    EXPECT_LT((sim.state.velocity[0] - motion.velocity).norm(), 1e-14) << name;
    for (const double w : sim.state.twist_rate) EXPECT_NEAR(w, 3 * pi, 0.5) << name; // the rod turns along; it also swings
  }
}

TEST(TimeLoop, RestoresTheMemoryWhenAStepFails) {
  for (const std::string &name : integratorNames()) {
    Simulation sim;
    runTo(sim, arcScene(1e4), with(name, 0.01, 0.05));
    const State before = sim.state;
    EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-12, 0, 1, PETSC_MAX_INT)); // one iteration is never enough
    LoopSettings settings = with(name, 0.05, 1);
    settings.dt_min = 0.02;
    TimeLoop loop(sim.solver, settings);
    bool finished = true;
    EXPECT_PETSC(loop.run(sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_FALSE(finished);
    EXPECT_TRUE(sim.state == before) << name;
  }
}

struct Adapted {
  State state;
  int steps = 0, rejected = 0;
  double estimate = 0;
  std::vector<double> times;
};
Adapted adapt(const Scene &scene, LoopSettings settings, double rtol) {
  settings.adapt = Adaptation::error;
  settings.dt_rtol = rtol;
  settings.dt_atol = 1e-3 * rtol;
  Simulation sim;
  EXPECT_EQ(sim.setUp(scene, settings), PetscErrorCode(0));
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  Adapted result;
  EXPECT_EQ(loop.run(
                sim.state,
                [&](const State &state, const Diagnostics &row) {
                  ++result.steps;
                  result.rejected += row.rejected_steps;
                  result.estimate = row.error_estimate;
                  result.times.push_back(state.time);
                  return PetscErrorCode(0);
                },
                &finished),
            PetscErrorCode(0));
  EXPECT_TRUE(finished) << loop.failure();
  result.state = sim.state;
  return result;
}

/// The sum of the local errors is that of the end up to a factor: errors of an oscillation turn and grow with its phase. The first step is far too long.
TEST(Adaptation, MeetsItsTolerance) {
  const Sharp sharp;
  const Scene scene = arcScene(1e4);
  Simulation fine;
  runTo(fine, scene, with("sdirk2", 5e-4, 0.8));
  for (const std::string &name : integratorNames()) {
    const double rtol = name == "euler" ? 1e-2 : 1e-3;
    const Adapted loose = adapt(scene, with(name, 0.1, 0.8), rtol), tight = adapt(scene, with(name, 0.1, 0.8), rtol / 8);
    double errors[2] = {0, 0};
    for (std::size_t v = 0; v < fine.state.position.size(); ++v)
      for (int k = 0; k < 2; ++k) errors[k] = std::max(errors[k], ((k ? tight : loose).state.position[v] - fine.state.position[v]).norm());
    EXPECT_LT(errors[0], 5 * loose.estimate) << name;
    EXPECT_LT(errors[1], 5 * tight.estimate) << name;
    EXPECT_LT(errors[1], 0.5 * errors[0]) << name;
    EXPECT_GT(tight.steps, loose.steps) << name;
    if (name != "midpoint") EXPECT_GT(tight.rejected, 0) << name; // its first step has nothing to compare with
  }
}

TEST(Adaptation, LandsOnTheTimesOfFrames) {
  LoopSettings settings = with("bdf2", 0.01, 0.35);
  settings.output_interval = 0.1;
  settings.dt_max = 0.03;
  const Adapted run = adapt(arcScene(1e4), settings, 1e-2);
  double last = 0;
  for (const double t : run.times) {
    EXPECT_LE(t - last, 0.03 * (1 + 1e-9));
    last = t;
  }
  for (const double t : {0.1, 0.2, 0.3, 0.35})
    EXPECT_TRUE(std::any_of(run.times.begin(), run.times.end(), [&](double a) { return std::abs(a - t) < 1e-15; })) << t;
}

/// On a stiff rod Newton takes about as many iterations as on a soft one.
TEST(Integrator, IterationsDoNotGrowWithTheAxialStiffness) {
  for (const std::string &name : integratorNames()) {
    int soft = 0, stiff = 0;
    Simulation a, b;
    runTo(a, arcScene(1e4), with(name, 0.02, 1), &soft);
    runTo(b, arcScene(1e12), with(name, 0.02, 1), &stiff);
    EXPECT_LE(stiff, 1.5 * soft) << name;
  }
}

} // namespace
} // namespace tendril::test
