/// Natural frequencies against closed forms: data/reference/frequencies.csv, bodies_spring_hung.csv and
/// bodies_closed_forms.csv. Masses are lumped and edges are chords, so that eigenvalues are off by the square of the
/// edge length and its even powers: two extrapolations from three resolutions leave the sixth power.
#include "support/beams.hpp"
#include "support/files.hpp"
#include "support/option_set.hpp"
#include "tendril/dynamics/modes.hpp"
#include "tendril/io/scene_reader.hpp"

namespace tendril::test {
namespace {

/// Value of an entry of data/reference/<file> with columns id;value;...
double reference(const std::string &id, const std::string &file = "frequencies.csv") {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/" + file);
  for (std::string line; std::getline(in, line);)
    if (line.rfind(id + ";", 0) == 0) return std::stod(line.substr(id.size() + 1));
  ADD_FAILURE() << file << " has no entry " << id;
  return NAN;
}

/// Modes about the equilibrium of a scene at full load.
Modes modesOf(const Scene &scene, int count, int load_steps = 1) {
  Simulation sim;
  if (load_steps == 0 || scene.supports.empty()) { // at rest as drawn
    EXPECT_EQ(sim.setUp(scene, statics()), 0);
    sim.state.time = 1;
  } else
    runTo(sim, scene, statics(load_steps));
  Modes modes;
  std::string failure;
  EXPECT_EQ(findModes(sim.solver, sim.state, TimeLoop::stepOf(statics(), sim.state, 1), count, &modes, &failure), 0);
  EXPECT_EQ(failure, "");
  EXPECT_EQ(modes.count(), count);
  modes.eigenvalue.resize(std::size_t(count), NAN);
  return modes;
}

/// Eigenvalues of a scene by its number of edges, extrapolated from n, 2n and 4n.
template <class MakeScene> std::vector<double> extrapolated(MakeScene make, int n, int count, int load_steps = 1) {
  const std::vector<double> a = modesOf(make(n), count, load_steps).eigenvalue,
                            b = modesOf(make(2 * n), count, load_steps).eigenvalue,
                            c = modesOf(make(4 * n), count, load_steps).eigenvalue;
  std::vector<double> limit;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double first = b[k] + (b[k] - a[k]) / 3, second = c[k] + (c[k] - b[k]) / 3;
    limit.push_back(second + (second - first) / 15);
  }
  return limit;
}

using Ends = std::array<const char *, 2>;

/// A straight rod along x of unit length, density and bending stiffness, with EA 1e10, GJ 2/3 and little rotational
/// inertia, held at its ends.
Scene straight(int edges, Ends ends, double gravity = 0) {
  Scene scene;
  scene.gravity = Vec3(gravity, 0, 0);
  scene.rods = {straightRod(edges)};
  for (const int k : {0, 1})
    if (std::string(ends[std::size_t(k)]) != "free")
      scene.supports.push_back(
          hold(scene, 0, k * edges,
               std::string(ends[std::size_t(k)]) == "clamp" ? Support::Kind::clamp : Support::Kind::pin));
  return scene;
}

/// The first bending frequencies of a straight rod, each of both planes, behind `free` motions that cost nothing.
void expectBending(Ends ends, int free, const std::string &id, int count) {
  const int n = 32, all = free + 2 * count;
  const std::vector<double> found = extrapolated([&](int edges) { return straight(edges, ends); }, n, all);
  const Modes fine = modesOf(straight(4 * n, ends), all), coarse = modesOf(straight(2 * n, ends), all);
  for (int k = 0; k < free; ++k) EXPECT_TRUE(fine.isFree(k)) << ends[0] << ' ' << ends[1] << ' ' << k;
  for (int k = 0; k < count; ++k) {
    const double exact = std::pow(reference(id + std::to_string(k + 1)), 4);
    for (const int plane : {0, 1}) {
      const auto at = std::size_t(free + 2 * k + plane);
      EXPECT_NEAR(found[at], exact, 1e-6 * exact) << ends[0] << ' ' << ends[1] << ' ' << at; // (beta h)^6 times a few
      EXPECT_NEAR(order(std::abs(coarse.eigenvalue[at] - exact), std::abs(fine.eigenvalue[at] - exact)), 2, 0.05);
    }
  }
}

TEST(Modes, OfACantilever) { expectBending({"clamp", "free"}, 0, "cantilever_betaL_", 3); }
TEST(Modes, OfAFreeRodBehindItsSixRigidOnes) { expectBending({"free", "free"}, 6, "freefree_betaL_", 3); }
TEST(Modes, OfARodClampedAtBothEnds) { expectBending({"clamp", "clamp"}, 0, "freefree_betaL_", 3); }
TEST(Modes, OfAClampedAndPinnedRod) { expectBending({"clamp", "pin"}, 0, "clampedpinned_betaL_", 2); }
TEST(Modes, OfAPinnedRodBehindItsTurnAboutItself) { expectBending({"pin", "pin"}, 1, "pinnedpinned_betaL_", 3); }

/// Torsion and axial vibration of a rod that is stiff to bending: the lowest of all.
TEST(Modes, OfTorsion) {
  auto make = [](int edges) {
    Scene scene = straight(edges, {"clamp", "free"});
    scene.rods[0].material.linear_rotational_inertia = 100;
    return scene;
  };
  const std::vector<double> found = extrapolated(make, 16, 2);
  for (const int k : {0, 1}) {
    const double exact = std::pow(reference("torsion_fixedfree_" + std::to_string(k + 1)), 2) * (2.0 / 3) / 100;
    EXPECT_NEAR(found[std::size_t(k)], exact, 1e-8 * exact);
  }
  const Rates shape = modesOf(make(16), 1).shape[0]; // a sine, of unit mass: sqrt(2/(r_L L)), at half edges
  EXPECT_NEAR(shape.edge.back(), std::sqrt(2.0 / 100) * std::sin(pi / 2 * 31 / 32), 1e-4);
  for (const Vec3 &v : shape.vertex) EXPECT_LT(v.norm(), 1e-9);
}

TEST(Modes, OfAxialVibration) {
  const std::vector<double> found = extrapolated(
      [](int edges) {
        Scene scene = straight(edges, {"clamp", "free"});
        scene.rods[0].material.axial_stiffness = 1;
        scene.rods[0].material.flexural_stiffness = {10, 10};
        return scene;
      },
      16, 1);
  EXPECT_NEAR(found[0], std::pow(reference("axial_fixedfree_1"), 2), 1e-8);
}

/// A free ring of unit radius, density and bending stiffness, stress-free as drawn, without rotational inertia: twists
/// have no mass, and the mass matrix is singular.
Scene ring(int edges, double axial, double torsional) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  Rod rod = inextensibleRod(ringShape(Vec3::Zero(), Vec3::UnitZ(), 1, edges).points, Measure::angle);
  rod.closed = true;
  rod.energy = Energy::classical;
  rod.material.axial_stiffness = axial;
  rod.material.torsional_stiffness = torsional;
  rod.material.linear_rotational_inertia = 0;
  setBishopDirectors(rod);
  scene.rods = {rod};
  return scene;
}

bool isInPlane(const Rates &shape) {
  double in = 0, out = 0;
  for (const Vec3 &v : shape.vertex) in += v.head<2>().squaredNorm(), out += v[2] * v[2];
  return in > out;
}

/// The eigenvalues behind six rigid motions that are in the plane of a ring, or those out of it, two of each.
std::vector<double> ofRing(double axial, double torsional, bool in_plane, int count, int all) {
  const int n = 32;
  std::array<std::vector<double>, 3> at;
  for (const int k : {0, 1, 2}) {
    const Modes modes = modesOf(ring(n << k, axial, torsional), all);
    for (int m = 0; m < 6; ++m) EXPECT_TRUE(modes.isFree(m)) << m << ' ' << modes.eigenvalue[std::size_t(m)];
    for (int m = 6; m < all; ++m)
      if (isInPlane(modes.shape[std::size_t(m)]) == in_plane)
        at[std::size_t(k)].push_back(modes.eigenvalue[std::size_t(m)]);
    EXPECT_GE(int(at[std::size_t(k)].size()), count);
  }
  std::vector<double> limit;
  for (std::size_t m = 0; m < std::size_t(count); ++m) {
    const double first = at[1][m] + (at[1][m] - at[0][m]) / 3, second = at[2][m] + (at[2][m] - at[1][m]) / 3;
    limit.push_back(second + (second - first) / 15);
  }
  return limit;
}

TEST(Modes, OfARingInItsPlane) {
  for (const auto &[axial, row] : {std::pair(1e2, "ext_n%_EAR2EI_100_om2"), std::pair(1e4, "ext_n%_EAR2EI_10000_om2"),
                                   std::pair(1e6, "ext_n%_EAR2EI_1e+06_om2"), std::pair(1e10, "inext_n%_om2")}) {
    const std::vector<double> found = ofRing(axial, 0.9, true, 4, 14);
    for (const int n : {2, 3})
      for (const int copy : {0, 1}) {
        std::string id = std::string("ring_inplane_") + row;
        id[id.find('%')] = char('0' + n);
        const double exact = reference(id);
        EXPECT_NEAR(found[std::size_t(2 * (n - 2) + copy)], exact, 1e-6 * exact) << id; // (n h)^6
      }
  }
}

TEST(Modes, OfARingOutOfItsPlane) {
  for (const auto &[torsional, row] : {std::pair(0.75, "0.75"), std::pair(1.0, "1.0")}) {
    const std::vector<double> found = ofRing(1e10, torsional, false, 4, 14);
    for (const int n : {2, 3})
      for (const int copy : {0, 1}) {
        const double exact = reference("ring_outplane_n" + std::to_string(n) + "_om2_CoverB_" + row);
        EXPECT_NEAR(found[std::size_t(2 * (n - 2) + copy)], exact, 1e-6 * exact) << n << ' ' << row;
      }
  }
}

/// The breathing of a ring that stretches easily, alone at its frequency: all vertices go outwards alike.
TEST(Modes, OfARingThatBreathes) {
  std::array<double, 2> breathing{};
  for (const int k : {0, 1}) {
    const Scene scene = ring(64 << k, 20, 0.9);
    const Modes modes = modesOf(scene, 15);
    for (std::size_t m = 6; m < 15; ++m) {
      double outwards = 0, all = 0;
      for (std::size_t v = 0; v < scene.rods[0].position.size(); ++v) {
        outwards += modes.shape[m].vertex[v].dot(scene.rods[0].position[v]);
        all += modes.shape[m].vertex[v].norm();
      }
      if (std::abs(outwards) > 0.999 * all) breathing[std::size_t(k)] = modes.eigenvalue[m];
    }
  }
  const double exact = 20 * reference("ring_breathing_om2");
  EXPECT_NEAR(breathing[1] + (breathing[1] - breathing[0]) / 3, exact, 1e-6 * exact); // h^4
}

/// A rod that its ends pull or press by a force, through their motion.
double firstUnderTension(const char *end, double force) {
  auto make = [&](int edges) {
    Scene scene = straight(edges, {end, end});
    scene.supports[1].motion.velocity = Vec3(force / scene.rods[0].material.axial_stiffness, 0, 0);
    return scene;
  };
  const int free = std::string(end) == "pin";
  return std::sqrt(extrapolated(make, 32, 1 + free)[std::size_t(free)]);
}

TEST(Modes, OfRodsUnderTension) {
  for (const auto &[end, name, force] :
       {std::tuple("pin", "pinned_tension_T10", 10.0), std::tuple("pin", "pinned_tension_T100", 100.0),
        std::tuple("pin", "pinned_tension_T-5", -5.0), std::tuple("clamp", "clamped_tension_T10", 10.0),
        std::tuple("clamp", "clamped_tension_T100", 100.0), std::tuple("clamp", "clamped_tension_T1000", 1000.0)}) {
    const double exact = reference(std::string(name) + "_om");
    // The layers beside clamps are sqrt(EI/T) long, at the largest force one edge of 32; and rounding of a strain of
    // 1e-10 by 1e-16.
    EXPECT_NEAR(firstUnderTension(end, force), exact, (force > 500 ? 1e-4 : 2e-6) * exact) << name;
  }
}

TEST(Modes, OfHeavyCantilevers) {
  for (const double g : {1.0, 10.0, 100.0, -2.0, -7.0}) { // hanging, standing
    const std::vector<double> found = extrapolated(
        [&](int edges) {
          return straight(edges, {"clamp", "free"}, g);
        },
        24, 4);
    for (const int k : {0, 1}) {
      std::ostringstream id;
      id << "heavy_cantilever_G" << g << "_om" << k + 1;
      const double exact = reference(id.str());
      EXPECT_NEAR(std::sqrt(found[std::size_t(2 * k)]), exact, 5e-6 * exact) << id.str();
    }
  }
}

/// A standing cantilever above its critical height falls, and a stable one does not.
TEST(Modes, TellAnUnstableEquilibriumByItsGrowth) {
  Simulation sim;
  EXPECT_PETSC(sim.setUp(straight(40, {"clamp", "free"}, -9), statics())); // beyond 7.837
  const Step step = TimeLoop::stepOf(statics(), sim.state, 1);
  NewtonReport report;
  EXPECT_PETSC(sim.solver.solve(sim.state, step, &report, Seek::equilibrium));
  sim.potential->commit(sim.state);
  Modes modes;
  std::string failure;
  EXPECT_PETSC(findModes(sim.solver, sim.state, step, 4, &modes, &failure));
  EXPECT_EQ(failure, "");
  EXPECT_TRUE(modes.isUnstable(0) && modes.isUnstable(1) && !modes.isUnstable(2));
  EXPECT_EQ(modes.frequency(0), 0);
  // To first order in g - g_c, omega^2 goes from that at -7 through zero at -7.837.
  const double at_7 = std::pow(reference("heavy_cantilever_G-7_om1"), 2);
  EXPECT_NEAR(modes.growthRate(0), std::sqrt(at_7 / 0.8373 * (9 - 7.8373)), 0.02);
}

/// The mass on its rod spring, hung along its axis: w1 to w6 of data/reference/bodies_spring_hung.csv, found by another
/// method. Two swings differ by 2e-4 of their frequency.
void expectHungSpring(bool clamp, const std::array<double, 6> &exact) {
  auto make = [&](int edges) {
    const SceneFile file = readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/mass_on_rod_spring.yaml");
    Scene scene = remesh(file.scene, file.drawings, {edges});
    scene.gravity = Vec3(9.8, 0, 0);
    if (!clamp) return scene;
    Support &top = scene.supports[0];
    top = hold(scene, 0, 0, Support::Kind::clamp);
    const Vec3 d = referenceFrame(scene.rods[0], 0).director;
    top.frame = {Vec3::UnitX(), (d - d.x() * Vec3::UnitX()).normalized(), 1};
    top.tangent_given = true;
    return scene;
  };
  const int free = !clamp;
  const std::vector<double> found = extrapolated(make, 128, 6 + free, 4);
  for (int k = 0; k < 6; ++k)
    EXPECT_NEAR(std::sqrt(found[std::size_t(k + free)]), exact[std::size_t(k)], 1e-5 * exact[std::size_t(k)]) << k;
}

TEST(Modes, OfAMassHungOnARodSpring) {
  expectHungSpring(true,
                   {2.451266261987, 2.451823899181, 3.855078551215, 5.360162571064, 15.44332106337, 15.44747866344});
  expectHungSpring(false,
                   {2.32837245629, 2.328380007684, 4.268842120544, 13.31798195711, 14.42362917497, 14.42899257843});
}

/// A cantilever with a body welded to its end: mass mu, centre c beyond the end, inertia j about it.
Scene withTipBody(int edges, double mu, double c, double j) {
  Scene scene = straight(edges, {"clamp", "free"});
  Body body;
  body.name = "tip";
  body.own.mass = mu;
  body.own.centre = body.position = Vec3(1 + c, 0, 0);
  body.own.inertia = Vec3(std::min(j, 1e-4) + 1e-6, j + 1e-9, j + 1e-9).asDiagonal(); // turns about x are far above
  scene.bodies = {body};
  Attachment weld{"weld", 0, edges, 0, true, frameAtVertex(scene.rods[0], edges)};
  scene.attachments = {weld};
  scene.hostBodies();
  return scene;
}

TEST(Modes, OfACantileverWithABodyAtItsEnd) {
  for (const auto &[mu, c, j, name] :
       {std::tuple(0.5, 0.0, 0.0, "0.5_c0_j0"), std::tuple(5.0, 0.0, 0.0, "5_c0_j0"),
        std::tuple(1.0, 0.1, 0.01, "1_c0.1_j0.01"), std::tuple(2.0, 0.2, 0.05, "2_c0.2_j0.05")}) {
    const std::vector<double> found =
        extrapolated([mu = mu, c = c, j = j](int edges) { return withTipBody(edges, mu, c, j); }, 24, 6);
    for (const int k : {0, 1, 2}) {
      const double exact = std::pow(
          reference("tipmass_mu" + std::string(name) + "_" + std::to_string(k + 1), "bodies_closed_forms.csv"), 4);
      EXPECT_NEAR(found[std::size_t(2 * k)], exact, 1e-6 * exact) << name << ' ' << k;
    }
  }
}

/// A body that turns with all of a scene keeps its frequencies: its inertia goes along.
TEST(Modes, OfABodyThatHasBeenTurned) {
  auto make = [](double angle) {
    Scene scene = withTipBody(16, 1, 0, 0);
    scene.rods[0].material.flexural_stiffness = {1, 3};
    scene.bodies[0].own.inertia = Vec3(0.1, 0.3, 0.38).asDiagonal();
    scene.supports[0].motion.angular_velocity = Vec3(angle, 0, 0);
    return scene;
  };
  const Modes drawn = modesOf(make(0), 6), turned = modesOf(make(0.7), 6, 4);
  for (std::size_t k = 0; k < 6; ++k)
    EXPECT_NEAR(turned.eigenvalue[k], drawn.eigenvalue[k], 1e-7 * drawn.eigenvalue[k]);
}

/// Two balls of 2 kg and 1 kg that hang below each other on hinges, 0.3 and 0.4 long, with their own inertia.
TEST(Modes, OfADoublePendulum) {
  const Folder folder;
  const Scene scene = readScene(folder.write("pendulum.yaml", R"(gravity: [0, -9.81, 0]
bodies:
  - {name: upper, mass: 2, inertia: [0.02, 0.03, 0.04], position: [0, -0.3, 0], centre: [0, 0, 0]}
  - {name: lower, mass: 1, inertia: [0.02, 0.03, 0.01], position: [0, -0.7, 0], centre: [0, 0, 0]}
joints:
  - {name: pivot, type: hinge, child: upper, point: [0, 0, 0], axis: [0, 0, 1]}
  - {name: elbow, type: hinge, child: lower, parent: upper, point: [0, -0.3, 0], axis: [0, 0, 1]}
)"))
                          .scene;
  const Modes modes = modesOf(scene, 2, 0);
  Eigen::Matrix2d mass, stiffness; // by both angles from the vertical
  mass << 3 * 0.09 + 0.04, 0.12, 0.12, 0.16 + 0.01;
  stiffness << 3 * 9.81 * 0.3, 0, 0, 9.81 * 0.4;
  const Eigen::Vector2d exact =
      Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix2d>(stiffness, mass).eigenvalues();
  // An exact joint gives way by 1e-6 of what else holds its bodies.
  for (const int k : {0, 1}) EXPECT_NEAR(modes.eigenvalue[std::size_t(k)], exact[k], 1e-5 * exact[k]);
}

/// A spin that nothing holds and that has no inertia has no frequency, and is none of the modes.
TEST(Modes, LeaveOutASpinWithoutInertia) {
  Scene scene = straight(32, {"pin", "pin"});
  scene.rods[0].material.linear_rotational_inertia = 0;
  const Modes modes = modesOf(scene, 4);
  for (const int k : {0, 1}) EXPECT_NEAR(modes.frequency(k), pi * pi, 1e-2) << k;     // (pi/32)^2/12 of it
  for (const int k : {2, 3}) EXPECT_NEAR(modes.frequency(k), 4 * pi * pi, 0.15) << k; // four times as much
}

/// Rods in a plane have those in it, whichever plane that is.
TEST(Modes, OfPlanarRodsInEachPlane) {
  for (int flat = 0; flat < 3; ++flat) {
    Vec3 end = Vec3::Zero();
    end[(flat + 1) % 3] = 1;
    Scene scene = clampedScene(inextensibleRod(lineShape(Vec3::Zero(), end, 32).points));
    scene.rods[0].model = RodModel::planar;
    scene.rods[0].flat = flat;
    const Modes modes = modesOf(scene, 2);
    EXPECT_NEAR(modes.frequency(0), 3.516015, 1e-2) << flat; // of (beta h)^2
    EXPECT_NEAR(modes.frequency(1), 22.03449, 1e-1) << flat;
  }
}

/// Modes are orthonormal by the masses, and rods that nothing joins have theirs each.
TEST(Modes, AreOrthonormalAndThoseOfEachRod) {
  Scene scene = straight(12, {"clamp", "free"});
  scene.rods.push_back(scene.rods[0]);
  for (Vec3 &x : scene.rods[1].position) x += Vec3(0, 3, 0);
  scene.supports.push_back(hold(scene, 1, 0, Support::Kind::clamp));
  const Modes modes = modesOf(scene, 8);
  for (int k = 0; k < 8; ++k) {
    EXPECT_NEAR(modes.eigenvalue[std::size_t(k)], modes.eigenvalue[std::size_t(k - k % 4)], 1e-9 * modes.eigenvalue[7]);
    for (int l = 0; l < 8; ++l) {
      double product = 0;
      for (int v = 0; v < 26; ++v)
        product +=
            (v % 13 == 0 || v % 13 == 12 ? 0.5 : 1.0) / 12 *
            modes.shape[std::size_t(k)].vertex[std::size_t(v)].dot(modes.shape[std::size_t(l)].vertex[std::size_t(v)]);
      EXPECT_NEAR(product, k == l, 1e-9);
    }
  }
}

/// What costs nothing is told by each rod's own stiffness: a stiff one beside a hair leaves its frequencies alone.
TEST(Modes, OfAHairAreNotThoseOfAStiffRodBesideIt) {
  Scene alone = straight(16, {"clamp", "free"});
  for (double *k : {&alone.rods[0].material.flexural_stiffness[0], &alone.rods[0].material.flexural_stiffness[1],
                    &alone.rods[0].material.torsional_stiffness, &alone.rods[0].material.axial_stiffness})
    *k *= 1e-8;
  Scene both = alone;
  both.rods.push_back(straight(16, {"clamp", "free"}).rods[0]);
  both.rods[1].name = "stiff";
  both.supports.push_back(hold(both, 1, 0, Support::Kind::clamp));
  const Modes hair = modesOf(alone, 4), all = modesOf(both, 4);
  for (int k = 0; k < 4; ++k) {
    EXPECT_FALSE(all.isFree(k)) << k;
    EXPECT_NEAR(all.frequency(k) / hair.frequency(k), 1, 1e-9) << k;
  }
}

/// Another factorisation, of the whole matrix by MUMPS, has the same eigenvalues; a net is one island of many rods.
TEST(Modes, OfANetDoNotDependOnTheFactorisation) {
  const Folder folder;
  const Scene scene = readScene(folder.write("net.yaml", R"(gravity: [0, 0, -9.81]
rods:
  - name: warp
    line: {from: [0, 0, 0], to: [0.3, 0, 0], edges: 12}
    copies: {count: 4, offset: [0, 0.1, 0]}
    measure: angle
    energy: classical
    material: &material {radius: 2.0e-3, young: 1.0e+8, poisson: 0.4, density: 1100}
  - {name: weft, line: {from: [0, 0, 0], to: [0, 0.3, 0], edges: 12}, copies: {count: 4, offset: [0.1, 0, 0]},
     measure: angle, energy: classical, material: *material}
supports:
  - {rod: "warp#0", vertex: 0, type: pin}
  - {rod: "warp#0", vertex: last, type: pin}
  - {rod: "warp#3", vertex: 0, type: pin}
  - {rod: "warp#3", vertex: last, type: pin}
junctions:
  - {type: rigid, shared: true}
)"))
                          .scene;
  const Modes own = modesOf(scene, 5);
  const OptionSet mumps("-pc_factor_mat_solver_type", "mumps");
  const Modes other = modesOf(scene, 5);
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_GT(own.eigenvalue[k], 0);
    EXPECT_NEAR(own.eigenvalue[k], other.eigenvalue[k], 1e-6 * own.eigenvalue[k]); // of vertex coordinates
  }
}

} // namespace
} // namespace tendril::test
