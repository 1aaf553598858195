/// Constraints: their kernels against automatic differentiation, their motion against closed forms.
#include "tendril/coupling/couplings.hpp"

#include "support/dual.hpp"
#include "support/random_cell.hpp"
#include "support/rods.hpp"
#include "tendril/energy/constraint.hpp"
#include "tendril/energy/derived.hpp"
#include "tendril/model/remesh.hpp"

namespace tendril::test {
namespace {

using D4 = Dual<4>;

/// Columns of the frame of an edge whose vector and twist change.
Matrix3<D4> movedFrame(const Frame &f) {
  Vector3<D4> e, t, d;
  for (int a = 0; a < 3; ++a) {
    e[a] = D4::variable(f.tangent[a] * f.length, a);
    t[a] = f.tangent[a];
    d[a] = f.director[a];
  }
  const Vector3<D4> tangent = e / sqrt(e.squaredNorm());
  const Vector3<D4> director = rotateAbout<D4>(transport<D4>(d, t, tangent), tangent, D4::variable(0, 3));
  Matrix3<D4> m;
  m << tangent, director, tangent.cross(director);
  return m;
}

/// Angle of the rotation from one matrix to another, by its trace and its antisymmetric part.
D4 angleOf(const Mat3 &from, const Matrix3<D4> &to) {
  Matrix3<D4> q;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) q(i, j) = to(i, 0) * from(j, 0) + to(i, 1) * from(j, 1) + to(i, 2) * from(j, 2);
  const Vector3<D4> axial(q(2, 1) - q(1, 2), q(0, 2) - q(2, 0), q(1, 0) - q(0, 1));
  return atan2(sqrt(axial.squaredNorm()), q.trace() - 1.0);
}

Frame randomFrame(Random &random) {
  auto vector = [&] { return Vec3(random(), random(), random()); };
  const Vec3 t = vector().normalized();
  return {t, orthonormalised(vector(), t), 0.3 + std::abs(random())};
}

void expectSame(const D4 &oracle, const EdgeDerivatives &d, const std::string &what) {
  const double scale = oracle.g.norm() + oracle.h.norm();
  EXPECT_LT((oracle.g - d.gradient).norm(), 1e-12 * scale) << what;
  EXPECT_LT((oracle.h - d.hessian).norm(), 1e-11 * scale) << what; // digits go at angles near 0 and half a turn
}

TEST(ConstraintKernels, AgreeWithAutomaticDifferentiation) {
  Random random{3};
  int beyond = 0;
  for (int n = 0; n < 200; ++n) {
    const Frame edge = randomFrame(random), target = randomFrame(random);
    const Vec3 g = rotationBetween(target, edge);
    if (g.norm() > 3 || g.norm() < 0.1) continue;
    const D4 angle = angleOf(matrixOf(target), movedFrame(edge));
    EXPECT_NEAR(angle.v, g.norm(), 1e-12);
    Constraint c = constraintOn(0, 0, Constraint::Kind::rotation, 3);
    expectSame(D4(1.5) * angle * angle, overEdge(edge, rotationDerivatives(c, g), true), "angle");
    c.measure = Constraint::Measure::sine;
    expectSame(D4(3.0) - D4(3.0) * cos(angle), overEdge(edge, rotationDerivatives(c, g), true), "sine");
    c.measure = Constraint::Measure::angle;
    c.saturation = 1.5;
    const D4 below = D4(3.0) * angle * angle - angle * angle * angle * (3 / 4.5), above = angle * 4.5 - D4(2.25);
    beyond += angle.v > 1.5;
    expectSame(angle.v > 1.5 ? above : below, overEdge(edge, rotationDerivatives(c, g), true), "saturation");
    EXPECT_NEAR(radialLaw(c, angle.v).value, (angle.v > 1.5 ? above : below).v, 1e-12);
    Mat3 a;
    for (int k = 0; k < 9; ++k) a.data()[k] = random();
    const Matrix3<D4> r = movedFrame(edge);
    D4 chord(0.0);
    for (int k = 0; k < 9; ++k) chord += (r.data()[k] - a.data()[k]) * (r.data()[k] - a.data()[k]) * 0.5;
    expectSame(chord, overEdge(edge, chordDerivatives(2, matrixOf(edge), a), true), "damper");
  }
  EXPECT_GT(beyond, 20);
}

TEST(ConstraintKernels, OfSmallAnglesAndDistancesKeepTheirDigits) {
  Constraint c = constraintOn(0, 0, Constraint::Kind::rotation, 3);
  for (const double size : {0.0, 1e-200, 1e-9, 1e-3}) {
    const VectorDerivatives d = rotationDerivatives(c, Vec3(0, size, 0));
    EXPECT_DOUBLE_EQ(d.gradient[1], 3 * size);
    EXPECT_NEAR(d.hessian(0, 0), 3 * (1 - size * size / 12), 1e-14);
    EXPECT_DOUBLE_EQ(d.hessian(1, 1), 3);
  }
  c.kind = Constraint::Kind::pin;
  c.saturation = 0.5;
  const VectorDerivatives d = distanceDerivatives(c, Vec3(0.5, 0, 0)); // where it saturates
  EXPECT_DOUBLE_EQ(d.gradient[0], 1.5);
  EXPECT_NEAR(d.hessian(0, 0), 0, 1e-15);
  EXPECT_DOUBLE_EQ(d.hessian(1, 1), 3);
}

constexpr double mass = 0.8, stiffness = 20, damping = 1.5, speed = 0.7;

/// A mass on a spring and a damper whose other end moves: m x'' + d (x' - v) + k (x - v t) = 0 from rest. With y = x -
/// v t this is a damped oscillation from y = 0, y' = -v. \param tied whether the damper moves, too
struct Oscillator {
  double m, k, d, v;
  bool tied = true;
  double omega() const { return std::sqrt(k / m - d * d / (4 * m * m)); }
  double decay() const { return d / (2 * m); }
  /// Without that, the damper pulls by d v more, which moves the rest by d v/k.
  double shift() const { return tied ? 0 : -d * v / k; }
  double at(double t) const {
    const double y0 = -shift(), rate = (-v + decay() * y0) / omega();
    return shift() + v * t + std::exp(-decay() * t) * (y0 * std::cos(omega() * t) + rate * std::sin(omega() * t));
  }
};

/// One stiff edge, its ends on equal springs whose points move together: each end is an oscillator of its own.
Scene bouncer(bool tied) {
  Rod rod = straightRod(1);
  rod.material.linear_density = 2 * mass;
  rod.material.axial_stiffness = 1e3;
  Scene s = clampedScene(rod);
  s.supports.clear();
  for (const int v : {0, 1}) {
    Constraint &c = s.constraints.emplace_back(pinTo(s, 0, v, Vec3::Zero(), stiffness));
    c.damping = damping;
    c.motion.velocity = Vec3(0, 0.6 * speed, 0.8 * speed);
    c.damps_motion = tied;
  }
  return s;
}

/// One edge whose ends stand still: it turns about itself.
Scene spinner(bool tied) {
  Rod rod = straightRod(1);
  rod.material.linear_rotational_inertia = mass;
  Scene s = clampedScene(rod);
  s.supports = {hold(s, 0, 0, Support::Kind::pin), hold(s, 0, 1, Support::Kind::pin)};
  Constraint &c = s.constraints.emplace_back(turnTo(0, 0, referenceFrame(rod, 0), stiffness));
  c.frame.length = 1;
  c.damping = damping;
  c.motion.angular_velocity = Vec3(speed, 0, 0);
  c.damps_motion = tied;
  return s;
}

double turnOf(const Simulation &sim) {
  const Vec3 d = sim.state.director[0], d0 = sim.scene.rods[0].director[0];
  return std::atan2(d0.cross(d)[0], d0.dot(d));
}

/// Convergence of every integrator, and what is told of the energies.
TEST(Constraints, MoveAMassAsClosedFormsDo) {
  const double end = 1.2;
  for (const bool spins : {false, true})
    for (const bool tied : {true, false})
      for (const std::string &name : integratorNames()) {
        SCOPED_TRACE(name + (spins ? " spins" : " bounces") + (tied ? "" : ", damper stands"));
        const Oscillator exact{mass, stiffness, damping, speed, tied};
        std::vector<double> errors, work_errors, dissipation_errors;
        // by quadrature: the spring's force on the mass does the work of the point that moves
        double work = 0, dissipated = 0;
        constexpr int parts = 4000;
        for (int i = 0; i < parts; ++i) {
          const double t = (i + 0.5) * end / parts, h = 1e-5, x = exact.at(t),
                       rate = (exact.at(t + h) - exact.at(t - h)) / (2 * h), off = x - speed * t,
                       astray = rate - (tied ? speed : 0);
          work += end / parts * speed * -(stiffness * off + (tied ? damping * astray : 0));
          dissipated += end / parts * damping * astray * astray;
        }
        const double masses = spins ? 1 : 2;
        for (const int n : {40, 80, 160}) {
          LoopSettings settings = dynamics(end / n, end);
          settings.integrator.name = name;
          Simulation sim;
          EXPECT_PETSC(sim.setUp(spins ? spinner(tied) : bouncer(tied), settings));
          EXPECT_EQ(SNESSetTolerances(sim.solver.snes(), 0, 1e-12, 0, 60, PETSC_MAX_INT), PetscErrorCode(0));
          TimeLoop loop(sim.solver, settings);
          bool finished = false;
          double told_work = 0, told_dissipation = 0, wrong = 0;
          auto place = [&] {
            return spins ? turnOf(sim) : (sim.state.position[0] - sim.scene.rods[0].position[0]).dot(Vec3(0, 0.6, 0.8));
          };
          EXPECT_PETSC(loop.run(
              sim.state,
              [&](const State &, const Diagnostics &row) {
                told_work += row.work.supports;
                told_dissipation += row.dissipated;
                wrong = std::max(wrong, std::abs(place() - exact.at(row.time)));
                return PetscErrorCode(0);
              },
              &finished));
          ASSERT_TRUE(finished) << loop.failure();
          errors.push_back(wrong);
          work_errors.push_back(std::abs(told_work / masses - work));
          dissipation_errors.push_back(std::abs(told_dissipation / masses - dissipated));
        }
        const int order_of = makeIntegrator({name})->order();
        EXPECT_GT(order(errors[1], errors[2]), order_of - 0.25) << errors[1] << " " << errors[2];
        EXPECT_LT(errors[2], order_of == 1 ? 1e-2 : 4e-4);
        EXPECT_LT(work_errors[2], order_of == 1 ? 2e-2 : 2e-3) << work;
        EXPECT_LT(dissipation_errors[2], order_of == 1 ? 2e-2 : 2e-3) << dissipated;
      }
}

TEST(Constraints, ComeToTheSupportAsTheyGetStiffer) {
  auto tip = [](double k) {
    Rod rod = straightRod(16, Measure::angle);
    rod.material.axial_stiffness = 1e4;
    Scene s = clampedScene(rod);
    s.gravity = Vec3(0, -2, 0);
    if (k > 0) {
      s.constraints = {pinTo(s, 0, 16, Vec3::Zero(), k), pinTo(s, 0, 8, Vec3::Zero(), k)};
    } else
      s.supports.insert(s.supports.end(), {hold(s, 0, 16, Support::Kind::pin), hold(s, 0, 8, Support::Kind::pin)});
    Simulation sim;
    int iterations = 0;
    runTo(sim, s, statics(), &iterations);
    EXPECT_LE(iterations, 8) << k; // does not grow with the stiffness
    return sim.state.position[4][1];
  };
  const double exact = tip(0);
  std::vector<double> errors;
  for (const double k : {1e4, 1e5, 1e6, 1e7}) errors.push_back(std::abs(tip(k) - exact));
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(errors[k] / errors[k + 1], 10, 0.5) << k;
}

/// Rods of one shape are factored together, of which one has constraints enough for slots of its own: Newton keeps its
/// order, and finds what the rod finds alone.
TEST(Constraints, OfOneRodAmongItsEqualsDisturbNone) {
  auto run = [](int rods, int *iterations) {
    Scene s;
    s.gravity = Vec3(0, 0, -2);
    for (int r = 0; r < rods; ++r) {
      s.rods.push_back(straightRod(40, Measure::angle));
      s.supports.push_back(hold(s, r, 0, Support::Kind::clamp));
    }
    for (int v = 2; v < 40; v += 2) s.constraints.push_back(pinTo(s, 0, v, Vec3::Zero(), 5));
    Simulation sim;
    runTo(sim, s, dynamics(0.01, 0.2), iterations);
    return std::vector<Vec3>(sim.state.position.begin(), sim.state.position.begin() + 41);
  };
  int alone = 0, among = 0;
  const std::vector<Vec3> x = run(1, &alone), y = run(8, &among);
  EXPECT_LE(among, alone + 2); // the others may take one more now and then; it was twice as many
  for (int v = 0; v <= 40; ++v) EXPECT_LT((x[v] - y[v]).norm(), 1e-9) << v;
}

TEST(Constraints, HoldTheWeightOfWhatHangsOnThem) {
  for (const Energy energy : {Energy::seed, Energy::classical}) {
    Rod rod = straightRod(20, Measure::angle);
    rod.energy = energy;
    rod.material.axial_stiffness = 1e3;
    rod.material.linear_density = 0.5;
    Scene s = clampedScene(rod);
    s.supports.clear();
    s.gravity = Vec3(0, -3, 1);
    s.forces = {{0, 12, Vec3(0.2, 0.1, 0.4)}};
    s.constraints = {pinTo(s, 0, 0, Vec3::Zero(), 40), pinTo(s, 0, 15, Vec3(0, 0.1, 0), 30),
                     turnTo(0, 3, referenceFrame(rod, 3), 0.5)};
    Simulation sim;
    runTo(sim, s, statics());
    const RodActions a = rodActions(sim.scene, *sim.elements, sim.state, 1, 1);
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero(), load = Vec3(0.2, 0.1, 0.4),
         turning = sim.state.position[12].cross(Vec3(0.2, 0.1, 0.4));
    for (int v = 0; v <= 20; ++v) {
      const Vec3 weight = (*sim.elements).mass()[sim.elements->vertex_slot[v]] * s.gravity;
      load += weight;
      turning += sim.state.position[v].cross(weight);
    }
    for (std::size_t k = 0; k < s.constraints.size(); ++k) {
      force += a.constraint[k].force;
      moment += a.constraint[k].moment;
      if (s.constraints[k].isPin()) moment += sim.state.position[s.constraints[k].at].cross(a.constraint[k].force);
    }
    EXPECT_LT((force + load).norm(), 1e-8 * load.norm());
    EXPECT_LT((moment + turning).norm(), 1e-8 * turning.norm());
    // The balance of the docs holds across the constrained edge, too.
    for (int e = 0; e < 19; ++e) {
      Vec3 between = (*sim.elements).mass()[sim.elements->vertex_slot[e + 1]] * s.gravity;
      if (e + 1 == 12) between += Vec3(0.2, 0.1, 0.4);
      if (e + 1 == 15) between += a.constraint[1].force;
      EXPECT_LT((a.force[e] - a.force[e + 1] - between).norm(), 1e-8) << e;
    }
    EXPECT_NEAR(energyBudget(sim.scene, *sim.elements, sim.state, 1).constraint,
                0.5 * (a.constraint[0].distance.squaredNorm() * 40 + a.constraint[1].distance.squaredNorm() * 30 +
                       a.constraint[2].rotation.squaredNorm() * 0.5),
                1e-14);
  }
}

/// A cable on springs is no stiffer than it says: Newton's steps do not follow the stiffness of its edges.
TEST(Constraints, DoNotSlowNewtonOnStiffRods) {
  std::vector<int> counts;
  for (const double axial : {1e2, 1e4, 1e6, 1e8}) {
    Rod rod = straightRod(64, Measure::angle);
    rod.material.axial_stiffness = axial;
    rod.material.flexural_stiffness = {1e-3, 1e-3};
    rod.material.torsional_stiffness = 1e-3;
    Scene s = clampedScene(rod);
    s.supports.clear();
    s.gravity = Vec3(0, -10, 0);
    for (const int v : {0, 20, 44, 64}) s.constraints.push_back(pinTo(s, 0, v, Vec3(0.2 * (32 - v) / 32.0, 0, 0), 200));
    Simulation sim;
    int iterations = 0;
    runTo(sim, s, dynamics(0.02, 0.4), &iterations);
    counts.push_back(iterations);
  }
  EXPECT_LT(counts[3], 1.5 * counts[0]) << counts[0] << " " << counts[1] << " " << counts[2] << " " << counts[3];
}

/// A frame that turns on and on takes its edge along; one that turns further than half a turn in a step has shorter
/// ones.
TEST(Constraints, CountWholeTurns) {
  Rod rod = straightRod(10, Measure::angle);
  Scene s = clampedScene(rod);
  Constraint &c = s.constraints.emplace_back(turnTo(0, 9, referenceFrame(rod, 9), 1e4));
  c.motion.angular_velocity = Vec3(20, 0, 0); // statics: 20 rad at the end
  s.supports.push_back(hold(s, 0, 10, Support::Kind::pin));
  s.rods[0].material.flexural_stiffness = {40, 40}; // too stiff to writhe
  for (const int steps : {1, 3, 10}) {
    Simulation sim;
    runTo(sim, s, statics(steps));
    const RodActions a = rodActions(sim.scene, *sim.elements, sim.state, 1, 1);
    // GJ = 2/3 over 0.95 of the length, beside the spring
    EXPECT_NEAR(a.constraint[0].moment[0], 20 / (0.95 * 1.5 + 1e-4), 1e-6) << steps;
  }
}

/// A rotation keeps its place where the number of edges grows by odd factors; all else there is of second order.
TEST(Constraints, AreOfSecondOrderWithTheEdges) {
  Rod rod = straightRod(5, Measure::angle);
  rod.energy = Energy::classical;
  rod.material.axial_stiffness = 400;
  Scene written = clampedScene(rod);
  written.supports.clear();
  written.gravity = Vec3(0, -1.5, 0);
  Frame f = referenceFrame(rod, 1);
  const Mat3 turn = Eigen::AngleAxisd(0.4, Vec3(0.3, 0.2, 0.9).normalized()).toRotationMatrix();
  Constraint turned = turnTo(0, 1, {turn * f.tangent, turn * f.director, 1}, 3);
  turned.tangent_given = turned.director_given = true;
  written.constraints = {pinTo(written, 0, 0, Vec3::Zero(), 30), pinTo(written, 0, 5, Vec3::Zero(), 20), turned};
  std::vector<Vec3> ends;
  for (const int edges : {15, 45, 135, 405}) {
    Simulation sim;
    runTo(sim, remesh(written, {Drawing{}}, {edges}), statics());
    ends.push_back(sim.state.position.back());
  }
  for (int k = 0; k < 2; ++k) {
    const double ratio = (ends[k] - ends[k + 1]).norm() / (ends[k + 1] - ends[k + 2]).norm();
    EXPECT_NEAR(ratio, 9, 0.4) << k;
  }
  EXPECT_GT((ends[0] - ends[1]).norm(), 1e-6);
  EXPECT_THROW(remesh(written, {Drawing{}}, {10}), SceneError);
}

/// A soft clamp, of a pin and a rotation at the first edge, is no harder to solve than a clamp, however stiff.
TEST(Constraints, ClampSoftlyInAFewIterations) {
  for (const double k : {0.5, 1e3, 1e6, 1e9})
    for (const int edges : {20, 200}) {
      Rod rod = straightRod(edges, Measure::tan);
      rod.material.axial_stiffness = 4e4;
      Scene s = clampedScene(rod);
      s.supports.clear();
      s.gravity = Vec3(0, -0.3, 0);
      s.constraints = {pinTo(s, 0, 0, Vec3::Zero(), 2e3), turnTo(0, 0, referenceFrame(rod, 0), k)};
      s.constraints[1].frame.length = 1;
      Simulation sim;
      int iterations = 0;
      runTo(sim, s, statics(), &iterations);
      EXPECT_LE(iterations, 5) << k << " " << edges;
    }
}

/// Torques that turn an edge half a turn from its frame end the run, with every integrator: also with those whose steps
/// end beyond their stages.
TEST(Constraints, HaveABarrierAtHalfATurnWithEveryIntegrator) {
  for (const std::string &name : integratorNames()) {
    Rod rod = straightRod(4, Measure::angle);
    rod.material = {0.1, 1e-6, 100, 5e-4, {5e-4, 5e-4}, 0, 0};
    Scene s = clampedScene(rod);
    s.supports = {hold(s, 0, 0, Support::Kind::pin), hold(s, 0, 4, Support::Kind::pin)};
    s.constraints = {turnTo(0, 1, referenceFrame(rod, 1), 1e-4)};
    s.constraints[0].frame.length = 1;
    for (int e = 0; e < 4; ++e) s.moments.push_back({0, e, 2.5e-4, Vec3::Zero()});
    LoopSettings settings = dynamics(0.01, 0.5);
    settings.integrator.name = name;
    Simulation sim;
    EXPECT_PETSC(sim.setUp(s, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = true;
    EXPECT_PETSC(loop.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_FALSE(finished) << name;
  }
}

/// In statics dampers do nothing, and what is read says so.
TEST(Constraints, DampNothingInStatics) {
  Rod rod = straightRod(10, Measure::angle);
  Scene s = clampedScene(rod);
  s.supports.clear();
  s.gravity = Vec3(0, -1, 0);
  s.constraints = {pinTo(s, 0, 0, Vec3::Zero(), 2e3), turnTo(0, 0, referenceFrame(rod, 0), 50)};
  s.constraints[1].frame.length = 1;
  for (Constraint &c : s.constraints) c.damping = 5;
  s.constraints[0].motion.velocity = Vec3(0, 0.01, 0);
  s.constraints[1].motion.angular_velocity = Vec3(0, 0, 0.1);
  Simulation sim;
  runTo(sim, s, statics());
  const RodActions a = rodActions(sim.scene, *sim.elements, sim.state, 1, 1, false);
  EXPECT_NEAR(a.constraint[0].force[1], 1, 1e-8); // the weight
}

} // namespace
} // namespace tendril::test
