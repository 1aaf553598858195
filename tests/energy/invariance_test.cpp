/// Rest states, rigid motions, rings, and the edge kernels.
#include "support/random_cell.hpp"
#include "support/rods.hpp"

#include "tendril/energy/edge.hpp"

namespace tendril::test {
namespace {

Rod randomRod(Random &random, bool closed, Measure measure) {
  Rod rod;
  rod.name = "random";
  rod.closed = closed;
  rod.measure = measure;
  const int n = 24;
  for (int i = 0; i < n; ++i) {
    const double a = 2 * pi * i / n;
    rod.position.push_back(Vec3(std::cos(a), std::sin(a), closed ? 0 : 0.2 * a) + 0.03 * random.vector());
  }
  rod.material = {1, 0.01, 50, 2, {1, 3}, 0, 0};
  setBishopDirectors(rod);
  return rod;
}

State disturbed(const State &state, const Elements &elements, Random &random) {
  State s = state;
  for (Vec3 &x : s.position) x += 0.02 * random.vector();
  for (std::size_t i = 0; i < s.director.size(); ++i) {
    const Vec3 t = (s.position[elements.vertex1[i]] - s.position[elements.vertex0[i]]).normalized();
    s.director[i] = rotateAbout<double>(orthonormalised(s.director[i], t), t, 0.5 * random());
  }
  return s;
}

double stored(const Simulation &sim, const State &s) {
  const EnergyBudget e = energyBudget(sim.scene, *sim.elements, s, 1);
  return e.stretch + e.bend + e.twist;
}

TEST(Energy, RestStateHasNoEnergyAndNoForce) {
  Random random(11);
  for (const bool closed : {false, true})
    for (const Measure measure : {Measure::tan, Measure::angle}) {
      Scene scene;
      scene.gravity = Vec3::Zero();
      scene.rods = {randomRod(random, closed, measure)};
      Simulation sim;
      EXPECT_PETSC(sim.setUp(scene, statics()));
      EXPECT_LT(stored(sim, sim.state), 1e-28); // rounding of strains, squared
      sim.solver.begin(sim.state, {});
      for (const double g : sim.potential->derivatives().gradient)
        EXPECT_LT(std::abs(g), 1e-11); // stiffness 50/0.25 times rounding
    }
}

TEST(Energy, IsInvariantUnderRigidMotion) {
  Random random(12);
  for (const bool closed : {false, true})
    for (const Measure measure : {Measure::tan, Measure::angle}) {
      Scene scene;
      scene.rods = {randomRod(random, closed, measure)};
      Simulation sim;
      EXPECT_PETSC(sim.setUp(scene, statics()));
      const State s = disturbed(sim.state, *sim.elements, random);
      const double energy = stored(sim, s);
      for (const double angle : {1.0, 90.0, 179.0, 540.0}) {
        const Mat3 r = Eigen::AngleAxisd(angle * pi / 180, random.direction()).toRotationMatrix();
        State turned = s;
        for (Vec3 &x : turned.position) x = r * x + random.vector();
        for (std::size_t i = 0; i < s.director.size(); ++i) turned.director[i] = r * s.director[i];
        const Vec3 shift = random.vector();
        for (std::size_t v = 0; v < s.position.size(); ++v) turned.position[v] = r * s.position[v] + shift;
        EXPECT_NEAR(stored(sim, turned), energy, 1e-13 * energy);
      }
    }
}

TEST(Energy, RingStartingElsewhereHasTheSameEnergyAndForces) {
  Random random(13);
  Rod rod = randomRod(random, true, Measure::tan);
  const int n = rod.vertices(), shift = 7;
  Rod rotated = rod;
  for (int i = 0; i < n; ++i) {
    rotated.position[i] = rod.position[(i + shift) % n];
    rotated.director[i] = rod.director[(i + shift) % n];
  }
  Scene a, b;
  a.rods = {rod};
  b.rods = {rotated};
  Simulation sa, sb;
  EXPECT_PETSC(sa.setUp(a, statics()));
  EXPECT_PETSC(sb.setUp(b, statics()));
  const State da = disturbed(sa.state, *sa.elements, random);
  State db = sb.state;
  for (int i = 0; i < n; ++i) {
    db.position[i] = da.position[(i + shift) % n];
    db.director[i] = da.director[(i + shift) % n];
  }
  EXPECT_NEAR(stored(sa, da), stored(sb, db), 1e-13 * stored(sa, da));
  OwnedVec fa, fb;
  EXPECT_PETSC(DMCreateGlobalVector(sa.dofs.dm(), fa.out()));
  EXPECT_PETSC(VecDuplicate(fa, fb.out()));
  sa.solver.begin(da, {});
  sb.solver.begin(db, {});
  EXPECT_PETSC(sa.dofs.gather(sa.potential->derivatives().gradient, sa.dofs.all(), fa));
  EXPECT_PETSC(sb.dofs.gather(sb.potential->derivatives().gradient, sb.dofs.all(), fb));
  const PetscScalar *pa, *pb;
  EXPECT_PETSC(VecGetArrayRead(fa, &pa));
  EXPECT_PETSC(VecGetArrayRead(fb, &pb));
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 4; ++k) EXPECT_NEAR(pa[4 * ((i + shift) % n) + k], pb[4 * i + k], 1e-11);
  EXPECT_PETSC(VecRestoreArrayRead(fa, &pa));
  EXPECT_PETSC(VecRestoreArrayRead(fb, &pb));
}

using D4 = Dual<4>;

FrameOf<D4> moved(const Frame &f, const std::array<D4, 4> &q) {
  const Vector3<D4> tangent = f.tangent.cast<D4>();
  const Vector3<D4> e = tangent * D4(f.length) + Vector3<D4>(q[0], q[1], q[2]);
  const D4 length = sqrt(e.squaredNorm());
  const Vector3<D4> t = e / length;
  return {t, rotateAbout<D4>(transport<D4>(f.director.cast<D4>(), tangent, t), t, q[3]), length};
}

FrameOf<D4> constant(const Frame &f) { return {f.tangent.cast<D4>(), f.director.cast<D4>(), D4(f.length)}; }

TEST(TwistInertia, DerivativesMatchAutomaticDifferentiation) {
  Random random(14);
  for (int repeat = 0; repeat < 30; ++repeat) {
    const RandomCell c = randomCell(random, 1.0);
    const double weight = 2.5, target = random();
    std::array<D4, 4> q;
    for (int k = 0; k < 4; ++k) q[k] = D4::variable(0, k);
    const D4 d = twistIncrement(constant(c.f0), moved(c.f1, q)) - D4(target), reference = D4(0.5 * weight) * d * d;
    const auto exact = twistInertia(c.f0, c.f1, weight, twistIncrement(c.f0, c.f1) - target);
    for (int r = 0, k = 0; r < 4; ++r) {
      EXPECT_NEAR(exact.gradient[r], reference.g[r], 1e-10 * reference.g.norm());
      for (int j = r; j < 4; ++j, ++k) EXPECT_NEAR(exact.hessian[k], reference.h(r, j), 1e-10 * reference.h.norm());
    }
  }
}

TEST(Stretch, DerivativesMatchAutomaticDifferentiation) {
  Random random(15);
  for (int repeat = 0; repeat < 60; ++repeat) {
    const Energy energy = repeat % 2 ? Energy::classical : Energy::seed;
    const RandomCell c = randomCell(random, 1.0);
    const double inverse = 1 / (1 + 0.3 * random()), stiffness = 3, rest = 0.1 * random();
    std::array<D4, 4> q;
    for (int k = 0; k < 4; ++k) q[k] = D4::variable(0, k);
    const D4 strain = axialStrain<D4>(energy, moved(c.f1, q).length, D4(inverse)) - D4(rest),
             reference = D4(0.5 * stiffness / inverse) * strain * strain;
    const double force = stiffness * (axialStrain(energy, c.f1.length, inverse) - rest),
                 slope = strainSlope(energy, c.f1.length, inverse);
    const Vec3 g = stretchGradient(c.f1, force, slope);
    const Mat3 h = stretchHessian(energy, c.f1, stiffness, force, inverse, slope);
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(g[r], reference.g[r], 1e-10 * reference.g.norm());
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(h(r, j), reference.h(r, j), 1e-10 * reference.h.norm());
    }
  }
}

/// The derivative J of the gradient along frames that move with the edges has the Hessian as its symmetric part, and
/// J - J' = (dE/dtheta / |e|^2) [t]x on each edge's own block.
TEST(BendTwist, AntisymmetricPartOfTheMovingGradientIsKnown) {
  Random random(16);
  for (int repeat = 0; repeat < 10; ++repeat) {
    RandomCell c = randomCell(random, 0.8);
    CellDerivatives<double> d;
    cellDerivatives<Measure::tan>(c.f0, c.f1, c.cell, d);
    const double step = 1e-6;
    Mat3 moving; // derivative of the gradient on x_{i+1} in x_{i+1}
    for (int j = 0; j < 3; ++j) {
      Vec3 g[2];
      for (const int side : {0, 1}) {
        const Vec3 e = c.f1.tangent * c.f1.length + (side ? step : -step) * Vec3::Unit(j);
        Frame f1{e.normalized(), c.f1.director, e.norm()};
        f1.director = orthonormalised(transport<double>(c.f1.director, c.f1.tangent, f1.tangent), f1.tangent);
        CellDerivatives<double> m;
        cellDerivatives<Measure::tan>(c.f0, f1, c.cell, m);
        g[side] = Vec3(m.gradient[8], m.gradient[9], m.gradient[10]);
      }
      moving.col(j) = (g[1] - g[0]) / (2 * step);
    }
    const Mat3 expected = crossMatrix<double>(c.f1.tangent) * (d.gradient[7] / (c.f1.length * c.f1.length));
    EXPECT_LT((moving - moving.transpose() - expected).norm(),
              1e-7 * moving.norm()); // central differences with step 1e-6
    Mat3 hessian;
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b) {
        const int r = 4 + a; // the second edge's vector
        hessian(a, b) = hessian(b, a) = d.hessian[r * cell_variables - r * (r - 1) / 2 + (b - a)];
      }
    EXPECT_LT((0.5 * (moving + moving.transpose()) - hessian).norm(), 1e-7 * moving.norm());
  }
}

} // namespace
} // namespace tendril::test
