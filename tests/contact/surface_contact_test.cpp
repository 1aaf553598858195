/// Contact at the skin of a rod: points that edges carry, their derivatives, and tubes that rest, roll and sag.
#include "tendril/contact/contact.hpp"

#include "support/differences.hpp"
#include "support/touching.hpp"
#include "tendril/embedding/embedding.hpp"

namespace tendril::test {
namespace {

constexpr double radius = 0.005, g = 9.81;

/// Positions of three vertices, then the twists of both edges between.
constexpr int variables = 11;
using D = Dual<variables>;
using Vec3D = Vector3<D>;

/// Random edges, of 1/2 to 2 times their length at rest, that turn by up to 170 degrees.
struct TwoEdges {
  std::array<Vec3, 3> x;
  std::array<Frame, 2> frame;
  std::array<double, 2> rest;
};
TwoEdges randomEdges(Random &random) {
  TwoEdges t;
  t.x[0] = random.vector();
  const Vec3 first = random.direction(), axis = anyNormal(first);
  const double turn = 0.5 * (1 + random()) * 170 * pi / 180;
  for (std::size_t k = 0; k < 2; ++k) {
    const Vec3 tangent = k == 0 ? first : rotateAbout<double>(first, axis, turn);
    t.rest[k] = 0.5 + 0.2 * random();
    const double length = t.rest[k] * std::exp2(random());
    t.frame[k] = {tangent, orthonormalised(random.direction(), tangent), length};
    t.x[k + 1] = t.x[k] + length * tangent;
  }
  return t;
}
EdgePoint randomPoint(Random &random, int edges, int first) {
  EdgePoint p;
  p.edges = edges;
  const double weight = 0.5 + 0.4 * random();
  for (std::size_t k = 0; k < std::size_t(edges); ++k)
    p.by[k] = {first + int(k),
               first + int(k) + 1,
               edges == 1 ? 1.0
               : k == 0   ? weight
                          : 1 - weight,
               {0.5 + random(), {0, 0.3 * random(), 0.3 * random()}}};
  return p;
}

/// The place after an increment: minimal rotations, then twists, as the retraction does.
template <class T>
Vector3<T> placeAfter(const TwoEdges &t, const EdgePoint &p, const Eigen::Matrix<T, variables, 1> &d) {
  Vector3<T> y = Vector3<T>::Zero();
  for (std::size_t k = 0; k < std::size_t(p.edges); ++k) {
    const std::size_t e = std::size_t(p.by[k].slot);
    const Vector3<T> from = t.x[e].cast<T>() + d.template segment<3>(3 * int(e)),
                     to = t.x[e + 1].cast<T>() + d.template segment<3>(3 * int(e) + 3), edge = to - from;
    using std::sqrt;
    const Vector3<T> tangent = edge / sqrt(edge.squaredNorm());
    const Vector3<T> carried = transport<T>(t.frame[e].director.cast<T>(), t.frame[e].tangent.cast<T>(), tangent);
    const Vector3<T> director = rotateAbout<T>(carried, tangent, d[9 + int(e)]);
    const Vec3 &arm = p.by[k].point.arm;
    y += T(p.by[k].weight) *
         (from + edge * T(p.by[k].point.at) + director * T(arm[1]) + Vector3<T>(tangent.cross(director)) * T(arm[2]));
  }
  return y;
}

/// A rod of two edges with these frames.
struct OnRod {
  RodRange rod{0, 3, 0, 2, 0, 3 + RodRange::behind + lanes, true, false};
  Configuration c{3 + RodRange::behind + 2 * lanes};
  explicit OnRod(const TwoEdges &t) {
    for (std::size_t v = 0; v < 3; ++v) c.setPosition(int(v), t.x[v], Vec3::Zero());
    for (std::size_t e = 0; e < 2; ++e) c.setFrame(int(e), t.frame[e]);
  }
  Planes planes() const { return {slot_size, rod.slots + lanes}; }
};

TEST(EdgePoint, HasTheDerivativesOfAutomaticDifferentiation) {
  Random random{3};
  for (int n = 0; n < 200; ++n) {
    const TwoEdges t = randomEdges(random);
    OnRod on(t);
    const EdgePoint p = randomPoint(random, 1 + n % 2, n % 4 == 0 ? 1 : 0);
    Eigen::Matrix<D, variables, 1> d;
    for (int k = 0; k < variables; ++k) d[k] = D::variable(0, k);
    const Vec3D y = placeAfter<D>(t, p, d);
    // An energy with this gradient and Hessian by the place.
    const Vec3 slope = random.vector();
    Mat3 stiffness;
    for (int k = 0; k < 3; ++k) stiffness.col(k) = random.vector();
    stiffness = Mat3(stiffness + stiffness.transpose());
    Eigen::Matrix<double, variables, 1> gradient = Eigen::Matrix<double, variables, 1>::Zero();
    Eigen::Matrix<double, variables, variables> hessian = decltype(hessian)::Zero();
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(y[a].v, placeOf(p, on.c)[a], 4e-15);
      gradient += slope[a] * y[a].g;
      hessian += slope[a] * y[a].h;
      for (int b = 0; b < 3; ++b) hessian += stiffness(a, b) * y[a].g * y[b].g.transpose();
    }
    Derivatives out(on.rod.slots, true);
    const BlockPlanes blocks(out.blocks, on.rod);
    addAt(p, slope, stiffness, true, on.c, &blocks, out);
    auto of = [&](const Planes &x, int k) { return k < 9 ? x[k % 3][k / 3] : x[3][k - 9]; };
    for (int k = 0; k < variables; ++k) {
      // Terms of the size of arms over lengths, up to 0.4/0.15, squared.
      EXPECT_NEAR(of(out.equilibrium, k), gradient[k], 1e-13);
      Planes x = on.planes(), column = on.planes();
      (k < 9 ? x[k % 3][k / 3] : x[3][k - 9]) = 1;
      out.blocks.multiply(on.rod, {}, x, column);
      for (int j = 0; j < variables; ++j) EXPECT_NEAR(of(column, j), hessian(j, k), 1e-12 * hessian.norm());
    }
  }
}

TEST(EdgePoint, DoesTheWorkOfItsForces) {
  Random random{4};
  for (int n = 0; n < 200; ++n) {
    const TwoEdges t = randomEdges(random);
    OnRod on(t);
    const EdgePoint p = randomPoint(random, 1 + n % 2, 0);
    const Vec3 force = random.vector();
    Planes increment = on.planes(), forces = on.planes();
    for (int a = 0; a < 4; ++a)
      for (int s = 0; s < 3; ++s) increment[a][s] = random();
    spread(p, force, on.c, forces);
    double work = 0;
    Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();
    for (int s = 0; s < 3; ++s) {
      for (int a = 0; a < 4; ++a) work += forces[a][s] * increment[a][s];
      sum += forces.vector(0, s);
      moment += t.x[std::size_t(s)].cross(forces.vector(0, s));
      if (s < 2) moment += forces[3][s] * t.frame[std::size_t(s)].tangent;
    }
    EXPECT_NEAR(force.dot(motionOf(p, on.c, increment)), work, 1e-13);
    EXPECT_LT((sum - force).norm(), 1e-14);
    EXPECT_LT((moment - placeOf(p, on.c).cross(force)).norm(), 1e-14 * 10);
    // A rigid motion takes it along.
    const Mat3 turn = Eigen::AngleAxisd(2 * random(), random.direction()).toRotationMatrix();
    const Vec3 shift = random.vector();
    TwoEdges moved = t;
    for (Vec3 &x : moved.x) x = turn * x + shift;
    for (Frame &f : moved.frame) f = {turn * f.tangent, turn * f.director, f.length};
    EXPECT_LT((placeOf(p, OnRod(moved).c) - turn * placeOf(p, on.c) - shift).norm(), 1e-14);
  }
}

/// Gives a rod a tube that touches, with samples of so many points a triangle.
void putTube(Rod &rod, int sides, double of_radius, int points = 3, bool keeps_area = false) {
  SkinRecipe recipe;
  recipe.tube = {sides, {of_radius, of_radius}, false, keeps_area};
  rod.skin = std::make_shared<SkinRecipe>(recipe);
  rod.contact.on_surface = true;
  rod.contact.quadrature = points;
}

/// A round rod that lies along x on the plane z = 0, inclined by an angle along y.
Scene onPlane(int sides, double coefficient, double angle, int edges = 6) {
  Rod rod;
  rod.name = "rod";
  rod.position = lineShape(Vec3(0, 0, radius), Vec3(0.3, 0, radius), edges).points;
  rod.material = homogeneousMaterial({SectionShape::circle, {radius, 0}}, 1e7, 4e6, 1000);
  rod.contact.radius = radius;
  rod.contact.distance = 0.2 * radius;
  rod.contact.friction = coefficient;
  rod.contact.slip_length = 1e-3 * radius;
  setBishopDirectors(rod);
  if (sides > 0) putTube(rod, sides, radius);
  Scene scene;
  scene.gravity = g * Vec3(0, std::sin(angle), -std::cos(angle));
  scene.rods = {rod};
  scene.colliders = {solid(makeHalfSpace())};
  return scene;
}

std::array<Vec3, 2> actionOf(const Scene &scene, const Simulation &sim) {
  std::vector<Vec3> force, moment;
  const auto readings = contactReadings(scene, *sim.elements, sim.state,
                                        configurationOf(sim.state, scene, *sim.elements, sim.state.time));
  colliderActions(scene, readings, sim.state.time, &force, &moment);
  return {force[0], moment[0]};
}

TEST(SurfaceContact, DerivativesAreThoseOfTheEnergy) {
  for (const int points : {1, 3, 6, ContactSettings::corners}) {
    Scene scene = onPlane(8, 0.5, 0.3, 8);
    scene.rods[0].contact.quadrature = points;
    scene.colliders.push_back(solid(makeSphere(0.02), Vec3(0.12, 0.0252, 0.004)));
    expectDerivativesAfter(scene, 1e-2, 0.1, std::to_string(points));
  }
}

TEST(SurfaceContact, ATubeAtRestPressesWithItsWeight) {
  for (const bool is_penalty : {false, true}) {
    Scene scene = onPlane(8, 0.3, 0, 6);
    if (is_penalty) {
      scene.rods[0].contact.law = ContactSettings::Law::penalty;
      scene.rods[0].contact.stiffness = 1e6;
      scene.rods[0].contact.threshold = 1e-3;
      scene.rods[0].contact.smoothing = 5e-4;
    }
    Simulation sim;
    runTo(sim, scene, statics());
    const double weight = scene.rods[0].material.linear_density * 0.3 * g;
    const auto [force, moment] = actionOf(scene, sim);
    EXPECT_NEAR(force[2], weight, 1e-8 * weight);
    EXPECT_LT(force.head<2>().norm(), 1e-8 * weight);
    EXPECT_NEAR(moment[1], -0.15 * weight, 1e-8 * weight); // about the first vertex, the lever is half of the rod
  }
}

/// All of a thin tube in the range in which a penalty is linear presses as its axis does, with the stiffness per length
/// that per area times the perimeter is: corners and samples of a regular section have their mean on the axis.
TEST(SurfaceContact, PressesAsTheCentrelineWithTheSameStiffnessPerLength) {
  for (const int points : {1, 3, 6}) {
    double pressed[2];
    for (const bool at_surface : {false, true}) {
      Scene scene = onPlane(0, 0, 0, 7);
      Rod &rod = scene.rods[0];
      for (Vec3 &x : rod.position) x = Vec3(0.7 * x[0], 0.4 * x[0], -4e-3 + 5e-3 * x[0]);
      setBishopDirectors(rod);
      rod.contact.law = ContactSettings::Law::penalty;
      rod.contact.stiffness = 1e7;
      rod.contact.threshold = 1e-3;
      rod.contact.smoothing = 1e-4;
      rod.contact.radius = 0;
      rod.contact.quadrature = 3;
      if (at_surface) {
        // Without the caps, whose area a centreline has not.
        putTube(rod, 8, 1e-3, points);
        auto own = std::make_shared<SkinRecipe>(*rod.skin);
        Skin open = tubeAbout(rod, own->tube);
        open.triangles.resize(open.triangles.size() - 2 * 8);
        auto mesh = std::make_shared<TriangleMesh>();
        for (const SkinPoint &p : open.points) mesh->vertices.push_back(placeOf(rod, p));
        mesh->triangles = open.triangles;
        own->tube.sides = 0;
        own->mesh = mesh;
        own->given = std::make_shared<Skin>(open);
        own->given_edges = rod.edges();
        rod.skin = own;
      }
      Simulation sim;
      EXPECT_PETSC(sim.setUp(scene, dynamics(1e-3, 1)));
      pressed[at_surface] = actionOf(scene, sim)[0][2];
    }
    EXPECT_GT(pressed[0], 1);
    EXPECT_NEAR(pressed[1], pressed[0], 1e-12 * pressed[0]) << points;
  }
}

/// A tube of many sides lies as deep as the centreline does that keeps its radius away; of S sides, a section of
/// corners on the circle is short of it by r (1 - cos(pi/S)), which goes with 1/S^2.
TEST(SurfaceContact, SagsAsTheCentrelineToSecondOrderInSides) {
  auto height = [](int sides) {
    Scene scene = onPlane(sides, 0, 0, 4);
    Rod &rod = scene.rods[0];
    rod.contact.law = ContactSettings::Law::penalty;
    rod.contact.stiffness = 1e6;
    rod.contact.threshold = 1e-3;
    rod.contact.smoothing = 5e-4;
    // A flat side below: corners at half a step.
    const double half = pi / sides;
    const Vec3 d = rod.director[0], t = Vec3::UnitX();
    const double down = std::atan2(t.cross(d).dot(-Vec3::UnitZ()), d.dot(-Vec3::UnitZ()));
    for (Vec3 &x : rod.director) x = rotateAbout<double>(d, t, down + half);
    Simulation sim;
    runTo(sim, scene, statics());
    return sim.state.position[2][2];
  };
  const double exact = height(256);
  const double coarse = std::abs(height(8) - exact), fine = std::abs(height(16) - exact),
               finer = std::abs(height(32) - exact);
  EXPECT_NEAR(order(coarse, fine), 2, 0.3);
  EXPECT_NEAR(order(fine, finer), 2, 0.3);
  EXPECT_LT(fine, radius * (1 - std::cos(pi / 16)));
}

/// A tube rolls down an incline without sliding: it goes as far as its surface turns. A polygon's way of a turn is its
/// perimeter.
TEST(SurfaceContact, ATubeRolls) {
  const double angle = 0.2;
  constexpr int sides = 64;
  Scene scene = onPlane(sides, 0.6, angle, 2);
  scene.rods[0].contact.distance = 0.01 * radius; // of a thick barrier, samples far from the lowest turn it, too
  scene.rods[0].contact.fall_off_velocity = 1e-3;
  Simulation sim;
  runTo(sim, scene, dynamics(5e-4, 0.25));
  const double rolls = sides * 2 * radius * std::sin(pi / sides) / (2 * pi), slides = g * std::sin(angle) * 0.25;
  for (const Vec3 &v : sim.state.velocity) EXPECT_NEAR(v[1], 2.0 / 3 * slides, 0.02 * slides);
  double spin = 0, way = 0;
  for (const double rate : sim.state.twist_rate) spin += rate / double(sim.state.twist_rate.size());
  for (const Vec3 &v : sim.state.velocity) way += v[1] / double(sim.state.velocity.size());
  EXPECT_NEAR(std::abs(spin) * rolls, way, 1e-3 * way);
}

/// Forces of 3 and 6 points a triangle on a tube pressed onto a ball differ by the square of the size of triangles.
TEST(SurfaceContact, PointsOfATriangleAgreeToSecondOrder) {
  std::vector<double> apart;
  for (const int fine : {1, 2, 4}) {
    double pressed[2];
    for (const int points : {3, 6}) {
      Scene scene = onPlane(0, 0, 0, 6 * fine);
      Rod &rod = scene.rods[0];
      rod.contact.law = ContactSettings::Law::penalty;
      rod.contact.stiffness = 1e6;
      rod.contact.threshold = 1e-3;
      rod.contact.smoothing = 3e-3;
      putTube(rod, 16 * fine, radius, points);
      scene.colliders = {solid(makeSphere(0.2), Vec3(0.147, 0.0007, -0.197))};
      Simulation sim;
      EXPECT_PETSC(sim.setUp(scene, dynamics(1e-3, 1)));
      pressed[points == 6] = actionOf(scene, sim)[0][2];
    }
    apart.push_back(std::abs(pressed[1] - pressed[0]) / pressed[1]);
  }
  EXPECT_LT(apart[0], 0.2);
  EXPECT_GT(order(apart[0], apart[1]), 1.6);
  EXPECT_GT(order(apart[1], apart[2]), 1.6);
}

/// A soft column as wide as three of its edges are long falls over, on a soft floor: forces beside the axis turn edges,
/// and without the second derivatives of their points Newton's method creeps.
TEST(SurfaceContact, NewtonIsQuadraticWithTheExactHessian) {
  std::map<HessianKind, int> most;
  for (const HessianKind kind : {HessianKind::exact, HessianKind::gauss_newton}) {
    Scene scene = onPlane(0, 0, 0);
    Rod &rod = scene.rods[0];
    rod.position = lineShape(Vec3(0, 0, 0.02), Vec3(0.03, 0, 0.3), 28).points;
    setBishopDirectors(rod);
    SkinRecipe recipe;
    recipe.tube = {16, {0.03, 0.03}, false, false};
    rod.skin = std::make_shared<SkinRecipe>(recipe);
    rod.contact.on_surface = true;
    rod.contact.quadrature = 3;
    rod.contact.radius = 0.03;
    rod.contact.law = ContactSettings::Law::penalty;
    rod.contact.stiffness = 2e4;
    rod.contact.threshold = 5e-3;
    rod.contact.smoothing = 5e-3;
    rod.material.mass_damping_coefficient = 20;
    scene.forces = {{0, 28, Vec3(0.02, 0, -0.1)}};
    LoopSettings settings = dynamics(0.05, 1.5);
    settings.hessian = kind;
    Simulation sim;
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = false;
    EXPECT_PETSC(loop.run(
        sim.state,
        [&](const State &, const Diagnostics &row) {
          most[kind] = std::max(most[kind], row.newton_iterations);
          return PetscErrorCode(0);
        },
        &finished));
    EXPECT_TRUE(finished) << loop.failure();
  }
  EXPECT_LE(most[HessianKind::exact], 6);
  EXPECT_GT(most[HessianKind::gauss_newton], 12);
}

/// A cube of twelve triangles about a short rod falls on its lowest corner: no corner passes the barrier where they are
/// what touches; points within triangles are as much as a sixth of two sides away from them.
TEST(SurfaceContact, CornersDoNotSink) {
  for (const int points : {3, ContactSettings::corners}) {
    Scene scene = onPlane(0, 0, 0);
    Rod &rod = scene.rods[0];
    rod.position = lineShape(Vec3(-0.004, 0, 0.03), Vec3(0.004, 0.001, 0.031), 2).points;
    setBishopDirectors(rod);
    auto mesh = std::make_shared<TriangleMesh>();
    const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 0.5).normalized()).toRotationMatrix();
    for (int k = 0; k < 8; ++k)
      mesh->vertices.push_back(turn * (0.01 * Vec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1)) +
                               Vec3(0, 0, 0.0305));
    mesh->triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    SkinRecipe recipe;
    recipe.mesh = mesh;
    rod.skin = std::make_shared<SkinRecipe>(recipe);
    rod.contact.on_surface = true;
    rod.contact.quadrature = points;
    rod.contact.friction = 0.5;
    Simulation sim;
    double lowest = 1;
    const LoopSettings settings = dynamics(1e-3, 0.4);
    EXPECT_PETSC(sim.setUp(scene, settings));
    TimeLoop loop(sim.solver, settings);
    bool finished = false;
    EXPECT_PETSC(loop.run(
        sim.state,
        [&](const State &state, const Diagnostics &) {
          Rod now = scene.rods[0];
          now.position = state.position;
          now.director = state.director;
          for (const SkinPoint &p : skinOf(scene.rods[0]).points) lowest = std::min(lowest, placeOf(now, p)[2]);
          return PetscErrorCode(0);
        },
        &finished));
    EXPECT_TRUE(finished) << loop.failure();
    if (points == ContactSettings::corners)
      EXPECT_GT(lowest, -0.5 * rod.contact.distance);
    else
      EXPECT_LT(lowest, -1e-3);
  }
}

/// The same ring, with its vertices counted from another one: what carries samples over the end is as all others.
TEST(SurfaceContact, OfARingDoesNotKnowWhereItBegins) {
  std::vector<State> ends;
  constexpr int edges = 24;
  for (const int from : {0, 7}) {
    Scene scene = onPlane(0, 0, 0);
    Rod &rod = scene.rods[0];
    const Polyline ring = ringShape(Vec3(0, 0, 0.012), Vec3(0.1, 0, 1).normalized(), 0.05, edges);
    rod.closed = true;
    for (int v = 0; v < edges; ++v) rod.position[std::size_t(v) % rod.position.size()] = Vec3::Zero();
    rod.position.clear();
    for (int v = 0; v < edges; ++v) rod.position.push_back(ring.points[std::size_t((v + from) % edges)]);
    rod.director.clear();
    for (int e = 0; e < edges; ++e) rod.director.push_back(orthonormalised(Vec3(0.1, 0, 1), rod.edge(e).normalized()));
    rod.contact.friction = 0.3;
    putTube(rod, 8, radius);
    auto own = std::make_shared<SkinRecipe>(*rod.skin);
    own->tube.follows_directors = true;
    rod.skin = own;
    scene.colliders.push_back(solid(makeSphere(0.02), Vec3(0, 0.06, -0.012)));
    Simulation sim;
    runTo(sim, scene, dynamics(2e-3, 0.1));
    ends.push_back(sim.state);
  }
  for (int v = 0; v < edges; ++v)
    EXPECT_LT((ends[0].position[std::size_t((v + 7) % edges)] - ends[1].position[std::size_t(v)]).norm(), 1e-9) << v;
}

} // namespace
} // namespace tendril::test
