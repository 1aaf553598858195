/// Every term of the incremental potential as the solver meets it: slopes of the energy, the derivative of the forces,
/// and the order of Newton.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include "tendril/solver/circulatory.hpp"

namespace tendril::test {
namespace {

/// A scene in which one term tells; the others are there, as a rod needs them.
struct Case {
  std::string name;
  bool dynamic;
  Scene scene;
  double dt = 0.1;
};

/// A bent and twisted rod of unit length, soft enough that stretch, bending and twist are of one size.
Rod softRod(Measure measure) {
  Rod rod =
      inextensibleRod(helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 0.8, 0.1, 1, 0, 10}).points, measure);
  rod.material.axial_stiffness = 60;
  rod.material.flexural_stiffness = {1, 1.6};
  rod.material.linear_density = 1;
  rod.material.linear_rotational_inertia = 0;
  return rod;
}

std::vector<Case> cases() {
  std::vector<Case> all;
  auto add = [&](const std::string &name, bool dynamic, auto change, Measure measure = Measure::angle) {
    Scene scene = clampedScene(softRod(measure));
    change(scene);
    all.push_back({name, dynamic, scene});
    for (Rod &rod : scene.rods) rod.energy = Energy::classical;
    all.push_back({name + ", classical", dynamic, std::move(scene)});
  };
  const Vec3 tip(2, -3, 1);
  auto pull = [&](Scene &s) { s.forces = {{0, 10, tip}}; };
  add("stretch", false, [](Scene &s) { s.forces = {{0, 10, Vec3(30, 5, 0)}}; });
  add("bend and twist, tan", false, pull, Measure::tan);
  add("bend and twist, angle", false, pull);
  add("gravity", false, [](Scene &s) { s.gravity = Vec3(1, -6, 2); });
  add("nodal forces", false, [](Scene &s) { s.forces = {{0, 4, Vec3(0, 5, 5)}, {0, 7, Vec3(3, -9, 0)}}; });
  add("couples", false, [](Scene &s) {
    s.rods[0].material.axial_stiffness = 1e3;
    s.forces = {{0, 10, Vec3(0.5, -1, 0.7)}};
    s.moments = {{0, 9, 0.4, Vec3(0.3, 0.2, 0.6)}, {0, 4, 0.3, Vec3(-0.2, 0.4, 0.1)}};
  });
  add("rotation", false, [](Scene &s) {
    s.rotation.angular_velocity = Vec3(0.5, 1, 1.5);
    s.rotation.centre = Vec3(0.3, -0.5, 0.2);
  });
  add("two clamps and whole turns", false, [](Scene &s) {
    Rod bar = straightRod(10, Measure::angle); // at rest without curvature, which would turn with the directors
    bar.material = s.rods[0].material;
    bar.material.axial_stiffness = 1e3;
    bar.material.flexural_stiffness = {40, 60}; // too stiff to writhe
    s = clampedScene(bar);
    s.supports.push_back(hold(s, 0, 10, Support::Kind::clamp));
    s.supports[1].motion.angular_velocity = Vec3(40, 0, 0); // 4 rad a cell
    s.forces = {{0, 6, Vec3(2, 9, 3)}};
  });
  auto moving = [](Scene &s) { s.rods[0].initial_velocity = Vec3(1, -2, 3); };
  add("inertia", true, moving);
  add("inertia of twist", true, [&](Scene &s) {
    moving(s);
    s.rods[0].material.linear_rotational_inertia = 0.05;
  });
  add("couples in dynamics", true, [](Scene &s) { s.moments = {{0, 9, 0.8, Vec3(0.5, 0.3, 1)}}; });
  add("follower forces", false, [](Scene &s) {
    s.followers = {{0, 10, Vec3(0.3, 0.5, -0.4)}, {0, 6, Vec3(-0.4, 0.2, 0.6)}};
  });
  add("follower forces in dynamics", true, [](Scene &s) { s.followers = {{0, 10, Vec3(2, 3, -4)}}; });
  add("dissipation by mass", true, [&](Scene &s) {
    moving(s);
    s.rods[0].material.mass_damping_coefficient = 30;
    s.rods[0].material.linear_rotational_inertia = 0.05;
  });
  for (const Measure measure : {Measure::tan, Measure::angle})
    add(
        "dissipation by stiffness", true,
        [&](Scene &s) {
          moving(s);
          s.rods[0].material.stiffness_damping_coefficient = 0.2;
        },
        measure);
  add("a ring with turns", true, [](Scene &s) {
    Rod ring = softRod(Measure::angle);
    const Polyline shape = ringShape(Vec3::Zero(), Vec3::UnitZ(), 0.2, 11);
    ring.position = shape.points;
    ring.closed = shape.closed;
    ring.initial_turns = 6;
    ring.natural = Rod::Natural::given; // straight, as above
    ring.material.flexural_stiffness = {4, 4.5};
    ring.material.axial_stiffness = 1e4;
    setBishopDirectors(ring);
    s.rods = {ring};
    s.supports = {hold(s, 0, 3, Support::Kind::pin)};
    s.gravity = Vec3(0, 3, -9);
    s.rods[0].material.linear_rotational_inertia = 0.02;
  });
  auto constrained = [](Scene &s, Constraint::Measure measure) {
    const Frame f = referenceFrame(s.rods[0], 6);
    const Vec3 axis = Vec3(0.3, -0.5, 0.4);
    const Mat3 turn = Eigen::AngleAxisd(1.1, axis.normalized()).toRotationMatrix();
    s.constraints = {pinTo(s, 0, 4, Vec3(0.05, 0.1, -0.1), 30), pinTo(s, 0, 10, Vec3(0.2, -0.1, 0.1), 20),
                     pinTo(s, 0, 10, Vec3(0.1, 0.2, 0.1), 20),
                     turnTo(0, 6, {turn * f.tangent, turn * f.director, 1}, 2)};
    s.constraints[1].saturation = 0.05; // beyond
    s.constraints[2].saturation = 5;    // below
    s.constraints[3].measure = measure;
    if (measure == Constraint::Measure::angle) s.constraints[3].saturation = 2;
  };
  add("constraints", false, [&](Scene &s) { constrained(s, Constraint::Measure::angle); });
  add("constraints by the sine", false, [&](Scene &s) { constrained(s, Constraint::Measure::sine); });
  add("constraints that dissipate and move", true, [&](Scene &s) {
    moving(s);
    constrained(s, Constraint::Measure::angle);
    for (Constraint &c : s.constraints) c.damping = 2;
    s.constraints[0].motion.velocity = Vec3(1, 0, -1);
    s.constraints[1].damps_motion = s.constraints[3].damps_motion = false;
    s.constraints[1].motion.velocity = Vec3(0, 1, 0);
    s.constraints[3].motion.angular_velocity = Vec3(2, 1, -1);
  });
  add("ties", true, [](Scene &s) { // within one rod: one beyond its saturation, one below
    for (const auto &[from, to] : {std::pair(3, 8), std::pair(10, 5)}) {
      Constraint &c = s.constraints.emplace_back(constraintOn(0, from, Constraint::Kind::pin, 10));
      c.to_rod = 0;
      c.to_vertex = to;
      c.saturation = from == 3 ? 0.05 : 5;
      c.damping = 2;
    }
    s.rods[0].initial_velocity = Vec3(0.5, -1, 1.5);
  });
  add("a cable", true, [](Scene &s) {
    s.rods[0].material.flexural_stiffness = {0, 0};
    s.supports = {hold(s, 0, 0, Support::Kind::pin)};
    s.gravity = Vec3(0, 3, -9);
  });
  return all;
}

/// A case made ready, and what its tests do with it.
struct Bench {
  Simulation sim;
  LoopSettings settings;
  Step step;
  Random random{11};

  explicit Bench(const Case &c, bool mixed) {
    settings = c.dynamic ? dynamics(c.dt, 1) : statics();
    settings.mixed = mixed;
    EXPECT_EQ(sim.setUp(c.scene, settings), PetscErrorCode(0));
    EXPECT_EQ(SNESSetTolerances(sim.solver.snes(), 0, 1e-10, 0, 60, PETSC_MAX_INT), PetscErrorCode(0));
    step = TimeLoop::stepOf(settings, sim.state, c.dynamic ? c.dt : 1);
  }
  IncrementalPotential &potential() { return *sim.potential; }
  const RodRange &rod() const { return sim.dofs.rods()[0]; }
  /// Random numbers for all unknowns, others zero.
  Planes noise(double size, double twist) {
    Planes d = sim.dofs.makePlanes();
    for (int s = rod().first_slot; s < rod().vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (sim.dofs.unknown(s, a) >= 0) d[a][s] = random() * (a < 3 ? size : twist);
    sim.dofs.copyBehindRing(rod(), d);
    sim.dofs.copyJoined(sim.dofs.all(), d);
    return d;
  }
  double dot(const Planes &a, const Planes &b) const {
    double sum = 0;
    for (int s = rod().first_slot; s < rod().vertexEnd(); ++s)
      for (int k = 0; k < slot_size; ++k)
        if (sim.dofs.unknown(s, k) >= 0) sum += a[k][s] * b[k][s];
    return sum;
  }
  void moveBy(const Planes &d, double scale) {
    Configuration trial = potential().iterate();
    ASSERT_TRUE(potential().tryMove(d, scale, 0, RetractionKind::additive, trial));
    potential().accept(trial, 0);
  }
  /// Forces, at the iterate moved along a direction; the iterate stays.
  Planes gradientAt(const Planes &d, double scale) {
    const Configuration here = potential().iterate();
    moveBy(d, scale);
    Planes g = potential().gradient(0).gradient;
    potential().accept(here, 0);
    return g;
  }
  double energyAt(const Planes &d, double scale) {
    Configuration trial = potential().iterate();
    EXPECT_TRUE(potential().tryMove(d, scale, 0, RetractionKind::additive, trial));
    return potential().rodEnergy(trial, 0).value;
  }
  NewtonReport solve(const Guess *guess = nullptr) {
    NewtonReport report;
    EXPECT_EQ(sim.solver.solve(sim.state, step, &report, Seek::minimum, guess), PetscErrorCode(0));
    EXPECT_TRUE(report.converged) << report.reason;
    return report;
  }
};

/// Away from the start and from equilibrium, to fourth order: rounding of the energies leaves 1e-12 of the forces.
TEST(EveryTerm, HasTheSlopeOfItsEnergy) {
  for (const Case &c : cases())
    for (const bool mixed : {false, true}) {
      SCOPED_TRACE(c.name + (mixed ? ", mixed" : ""));
      Bench bench(c, mixed);
      bench.sim.solver.begin(bench.sim.state, bench.step);
      Planes increment = bench.sim.dofs.makePlanes();
      bench.potential().remainingMotion(bench.potential().all(), increment);
      bench.moveBy(increment, 1);
      bench.moveBy(bench.noise(0.02, 0.5), 1);
      for (int k = 0; k < 3; ++k) {
        const Planes d = bench.noise(1, k == 0 ? 5 : 1);
        constexpr double small = 1e-4;
        // To fourth order.
        auto slope = [&](double h) { return (bench.energyAt(d, h) - bench.energyAt(d, -h)) / (2 * h); };
        const double expected = (4 * slope(small) - slope(2 * small)) / 3;
        const Planes g = bench.potential().gradient(0).gradient;
        EXPECT_NEAR(bench.dot(g, d), expected, 1e-7 * std::sqrt(bench.dot(g, g) * bench.dot(d, d)));
      }
    }
}

/// At an equilibrium the derivative of the forces does not depend on coordinates: the solver's answer to a right-hand
/// side changes the forces by that.
TEST(EveryTerm, HasTheDerivativeOfItsForces) {
  for (const Case &c : cases())
    for (const bool mixed : {false, true}) {
      SCOPED_TRACE(c.name + (mixed ? ", mixed" : ""));
      Bench bench(c, mixed);
      bench.solve();
      int negative;
      EXPECT_PETSC(bench.sim.solver.inertiaAtIterate(&negative));
      EXPECT_EQ(negative, 0);
      NewtonSolver &solver = bench.sim.solver.front();
      Circulatory circulatory(bench.potential(), {bench.potential().all()}, bench.potential().all());
      if (!circulatory.isNone()) {
        EXPECT_PETSC(circulatory.update([&](const Planes &r, Planes &x) { return solver.solveLinear(r, x); }));
      }
      for (int k = 0; k < 3; ++k) {
        const Planes right = bench.noise(1, 0.1);
        Planes d = bench.sim.dofs.makePlanes();
        EXPECT_PETSC(solver.solveLinear(right, d));
        if (!circulatory.isNone()) {
          EXPECT_TRUE(circulatory.correct(d));
        }
        bench.sim.dofs.copyBehindRing(bench.rod(), d);
        const double small = 1e-4 / std::sqrt(bench.dot(d, d));
        auto difference = [&](double h) {
          const Planes up = bench.gradientAt(d, h), down = bench.gradientAt(d, -h);
          Planes change = bench.sim.dofs.makePlanes();
          for (int a = 0; a < slot_size; ++a)
            for (int s = bench.rod().first_slot; s < bench.rod().vertexEnd(); ++s)
              change[a][s] = (up[a][s] - down[a][s]) / (2 * h);
          return change;
        };
        const Planes fine = difference(small), coarse = difference(2 * small);
        Planes wrong = right;
        for (int a = 0; a < slot_size; ++a)
          for (int s = bench.rod().first_slot; s < bench.rod().vertexEnd(); ++s)
            wrong[a][s] -= (4 * fine[a][s] - coarse[a][s]) / 3;
        EXPECT_LT(std::sqrt(bench.dot(wrong, wrong) / bench.dot(right, right)), 1e-6);
      }
    }
}

/// The axial force as an unknown moves by what the linearised strain asks for: what is left, strain - S/k, falls with
/// the square of the increment.
TEST(MixedStretch, MovesItsForceWithTheStrain) {
  for (const Case &c : cases()) {
    if (c.dynamic) continue;
    SCOPED_TRACE(c.name);
    Bench bench(c, true);
    bench.sim.solver.begin(bench.sim.state, bench.step);
    bench.moveBy(bench.noise(0.02, 0.1), 1);
    bench.potential().resetAxialForces(0);
    const Planes d = bench.noise(1e-4, 1e-4);
    Configuration trial = bench.potential().iterate();
    auto left = [&](double scale) {
      EXPECT_TRUE(bench.potential().tryMove(d, scale, 0, RetractionKind::additive, trial));
      double sum = 0;
      for (int s = bench.rod().first_slot; s < bench.rod().edgeEnd(); ++s)
        sum += std::abs(trial[Configuration::strain][s] -
                        trial[Configuration::axial_force][s] / bench.sim.elements->axialStiffness()[s]);
      return sum;
    };
    const double whole = left(1), half = left(0.5);
    EXPECT_NEAR(std::log2(whole / half), 2, 0.01); // of the cubic term, 1e-3 of the square one
  }
}

/// From a disturbed answer. The order over three residuals above rounding, the better of the last two: 1 where a
/// Hessian lacks something, 2 near enough to the answer; the very last may be half rounding.
TEST(EveryTerm, LetsNewtonConvergeQuadratically) {
  for (const Case &c : cases())
    for (const bool mixed : {false, true}) {
      SCOPED_TRACE(c.name + (mixed ? ", mixed" : ""));
      Bench bench(c, mixed);
      bench.solve();
      Guess guess{bench.noise(3e-3, 3e-2), {}};
      Planes answer = bench.sim.dofs.makePlanes();
      bench.potential().coordinates(answer);
      for (int a = 0; a < slot_size; ++a)
        for (int s = bench.rod().first_slot; s < bench.rod().vertexEnd(); ++s) guess.unknowns[a][s] += answer[a][s];
      const NewtonReport report = bench.solve(&guess);
      const std::vector<double> &r = report.history;
      std::string told;
      double order = 0, before = 0;
      for (std::size_t k = 0; k < r.size(); ++k) {
        char word[32];
        std::snprintf(word, sizeof word, " %.2g", r[k]);
        told += word;
        if (k >= 2 && r[k] > 10 * report.residual.force_floor) {
          before = order;
          order = std::log(r[k] / r[k - 1]) / std::log(r[k - 1] / r[k - 2]);
        }
      }
      EXPECT_GT(std::max(order, before), 1.3) << told;
    }
}

} // namespace
} // namespace tendril::test
