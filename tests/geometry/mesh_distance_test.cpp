/// Distances to meshes: exact ones against closed forms and solid angles, the grid against those.
#include "tendril/geometry/mesh_distance.hpp"

#include "support/random_cell.hpp"

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <stdexcept>

namespace tendril::test {
namespace {

/// An icosahedron on the unit sphere whose triangles are cut in four, `levels` times.
TriangleMesh ball(int levels) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  TriangleMesh m;
  for (const double a : {-1.0, 1.0})
    for (const double b : {-g, g})
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 v = Vec3::Zero();
        v[axis] = a;
        v[(axis + 1) % 3] = b;
        m.vertices.push_back(v.normalized());
      }
  const double side = 2 / std::sqrt(1 + g * g);
  auto joined = [&](int i, int j) { return std::abs((m.vertices[i] - m.vertices[j]).norm() - side) < 1e-9; };
  for (int i = 0; i < 12; ++i)
    for (int j = i + 1; j < 12; ++j)
      for (int k = j + 1; k < 12; ++k) {
        if (!joined(i, j) || !joined(j, k) || !joined(k, i)) continue;
        const bool outward = m.vertices[i].cross(m.vertices[j]).dot(m.vertices[k]) > 0;
        m.triangles.push_back(outward ? std::array{i, j, k} : std::array{i, k, j});
      }
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<int, int>, int> middles;
    auto middle = [&](int a, int b) {
      const auto [at, added] = middles.try_emplace(std::minmax(a, b), int(m.vertices.size()));
      if (added) m.vertices.push_back((m.vertices[a] + m.vertices[b]).normalized());
      return at->second;
    };
    std::vector<std::array<int, 3>> finer;
    for (const auto &[a, b, c] : m.triangles) {
      const int x = middle(a, b), y = middle(b, c), z = middle(c, a);
      finer.insert(finer.end(), {{a, x, z}, {x, b, y}, {z, y, c}, {x, y, z}});
    }
    m.triangles = finer;
  }
  return m;
}

/// The unit cubes at (i, j, k) of which `solid` is true, times `size`; each square of their surface in two triangles.
TriangleMesh cubes(int n, const Vec3 &size, const std::function<bool(int, int, int)> &solid) {
  TriangleMesh m;
  std::map<std::array<int, 3>, int> number;
  auto inside = [&](const std::array<int, 3> &c) {
    return std::all_of(c.begin(), c.end(), [&](int i) { return i >= 0 && i < n; }) && solid(c[0], c[1], c[2]);
  };
  for (int c = 0; c < n * n * n; ++c)
    for (int side = 0; side < 6; ++side) {
      const std::array<int, 3> cube{c / n / n, c / n % n, c % n};
      std::array<int, 3> next = cube;
      const int a = side / 2, up = side % 2;
      next[a] += up ? 1 : -1;
      if (!inside(cube) || inside(next)) continue;
      int corner[4];
      for (int k = 0; k < 4; ++k) { // anticlockwise about axis a
        std::array<int, 3> v = cube;
        v[a] += up;
        v[(a + 1) % 3] += k == 1 || k == 2;
        v[(a + 2) % 3] += k > 1;
        const auto [at, added] = number.try_emplace(v, int(m.vertices.size()));
        if (added) m.vertices.push_back(size.cwiseProduct(Vec3(v[0], v[1], v[2])));
        corner[up ? k : 3 - k] = at->second;
      }
      m.triangles.push_back({corner[0], corner[1], corner[2]});
      m.triangles.push_back({corner[0], corner[2], corner[3]});
    }
  return m;
}
TriangleMesh cubes(int n, const std::function<bool(int, int, int)> &solid) { return cubes(n, Vec3::Ones(), solid); }
bool all(int, int, int) { return true; }
bool plateWithHole(int i, int j, int k) { return k < 2 && (std::abs(i - 3) > 1 || std::abs(j - 3) > 1); } // of 7

/// A ring of radius 1 about z of a wire of radius 0.3.
TriangleMesh ring(int around, int across) {
  TriangleMesh m;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double u = 2 * pi * i / around, v = 2 * pi * j / across, r = 1 + 0.3 * std::cos(v);
      m.vertices.emplace_back(r * std::cos(u), r * std::sin(u), 0.3 * std::sin(v));
      const int a = i * across + j, b = (i + 1) % around * across + j;
      const int c = (i + 1) % around * across + (j + 1) % across, d = i * across + (j + 1) % across;
      m.triangles.push_back({a, b, c});
      m.triangles.push_back({a, c, d});
    }
  return m;
}
double ringDistance(const Vec3 &p) { return std::hypot(std::hypot(p[0], p[1]) - 1, p[2]) - 0.3; }

/// How often the surface goes around a point: 1 inside, 0 outside (solid angles: A. van Oosterom, J. Strackee, IEEE
/// Trans. Biomedical Engineering 30, 1983).
double winding(const TriangleMesh &m, const Vec3 &p) {
  double sum = 0;
  for (const auto &[i, j, k] : m.triangles) {
    const Vec3 a = m.vertices[i] - p, b = m.vertices[j] - p, c = m.vertices[k] - p;
    const double x = a.norm(), y = b.norm(), z = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
  }
  return sum / (4 * pi);
}

double valueOf(const Shape &shape, const Vec3 &p) {
  const double *const at[3] = {&p[0], &p[1], &p[2]};
  double d = NAN;
  shape.distances(at, 1, &d);
  return d;
}

TEST(MeshDistance, OfACubeIsThatOfTheBox) {
  TriangleMesh m = cubes(3, Vec3(0.5, 1, 0.25), all);
  const Vec3 size(1.5, 3, 0.75);
  for (Vec3 &v : m.vertices) v -= size / 2;
  const MeshDistance mesh(m);
  const auto box = makeBox(size);
  Random random(1);
  for (int i = 0; i < 3000; ++i) {
    const Vec3 p = (i % 2 ? 1 : 20) * random.vector();
    const MeshDistance::Nearest n = mesh.nearest(p, i % int(m.triangles.size()));
    ASSERT_NEAR(n.value, box->at(p).value, 1e-14 * (1 + p.norm())) << p.transpose(); // a few roundings of the point
    ASSERT_NEAR((p - n.point).norm(), std::abs(n.value), 1e-14 * (1 + p.norm()));
  }
  for (const Vec3 &v : m.vertices) EXPECT_EQ(mesh.nearest(v).value, 0);
}

TEST(MeshDistance, HasTheRightSignAtVerticesAndEdges) {
  TriangleMesh spiky = ball(2);
  Random random(5);
  for (Vec3 &v : spiky.vertices) v *= 1 + 0.45 * random(); // sharp edges and saddles of every kind
  for (const TriangleMesh &m : {spiky, cubes(7, plateWithHole), ring(7, 5)}) {
    const MeshDistance mesh(m);
    int inside = 0, outside = 0;
    auto check = [&](const Vec3 &p) {
      const double d = mesh.nearest(p).value, w = winding(m, p);
      if (std::abs(d) < 1e-9) return; // on the surface the angle has no value
      ASSERT_EQ(d<0, w> 0.5) << p.transpose() << " at " << d << ", surrounded " << w << " times";
      ++(d < 0 ? inside : outside);
    };
    for (int i = 0; i < 500; ++i) {
      const auto &[a, b, c] = m.triangles[i * 37 % m.triangles.size()];
      const Vec3 &x = m.vertices[a], &y = m.vertices[b];
      const double far = std::pow(10.0, 2 * random() - 2.5); // up to where other triangles are nearer
      check(x + far * random.direction());
      check(x + 0.5 * (1 + random()) * (y - x) + far * random.direction());
      check(1.5 * random.vector());
    }
    EXPECT_GT(inside, 100);
    EXPECT_GT(outside, 100);
  }
}

TEST(MeshDistance, HasTheRightSignAtATipOfUnevenTriangles) {
  // A spike along x, one of whose three sides is cut into many triangles: normals at its tip that do not count angles
  // would be that side's, and take what is in front of the tip, but below that side, for inside.
  const int pieces = 20;
  TriangleMesh m;
  m.vertices = {Vec3(3, 0, 0), Vec3(0, 0, -0.5)};
  for (int i = 0; i <= pieces; ++i) m.vertices.emplace_back(0, 1.0 * i / pieces - 0.5, 0.5);
  for (int i = 2; i < pieces + 2; ++i) {
    m.triangles.push_back({0, i + 1, i});
    m.triangles.push_back({1, i, i + 1});
  }
  m.triangles.push_back({0, 2, 1});
  m.triangles.push_back({0, 1, pieces + 2});
  const MeshDistance mesh(m);
  for (const double down : {-0.05, 0.0, 0.05})
    EXPECT_NEAR(mesh.nearest(Vec3(3.1, 0, -down)).value, std::hypot(0.1, down), 1e-14); // a few roundings of 3
}

TEST(MeshDistance, IsThatOfTheNearestOfAllTriangles) {
  const TriangleMesh m = ring(30, 12);
  const MeshDistance mesh(m);
  Random random(8);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p = 1.5 * random.vector();
    const MeshDistance::Nearest n = mesh.nearest(p, i);
    // Nothing of the surface is nearer: samples of every triangle.
    for (const auto &[a, b, c] : m.triangles)
      for (int s = 0; s <= 4; ++s)
        for (int t = 0; s + t <= 4; ++t) {
          const Vec3 q = (s * m.vertices[a] + t * m.vertices[b] + (4 - s - t) * m.vertices[c]) / 4;
          ASSERT_LE(std::abs(n.value), (p - q).norm() + 1e-14) << p.transpose(); // rounding of the points
        }
    ASSERT_NEAR(mesh.nearest(n.point).value, 0, 1e-14);
    // Facets are below the ring by their sagitta, r (1 - cos(pi/n)): 1.3 (pi/30)^2/2 + 0.3 (pi/12)^2/2 = 0.0174.
    ASSERT_NEAR(n.value, ringDistance(p), 0.0174) << p.transpose();
  }
  EXPECT_GT(mesh.nearest(Vec3::Zero()).value, 0.69) << "a hole is outside";
}

std::string messageOfMesh(const TriangleMesh &m, double cell = 0) {
  try {
    makeMesh(m, cell);
  } catch (const std::invalid_argument &error) {
    return error.what();
  }
  return "made";
}

TEST(MeshDistance, NamesWhatIsWrongWithAMesh) {
  const TriangleMesh good = cubes(1, all);
  TriangleMesh m = good;
  m.triangles.pop_back();
  EXPECT_NE(messageOfMesh(m).find("the surface is not closed"), std::string::npos) << messageOfMesh(m);
  m = good;
  std::swap(m.triangles[3][0], m.triangles[3][1]);
  EXPECT_NE(messageOfMesh(m).find("runs the same way in triangles"), std::string::npos) << messageOfMesh(m);
  m = good;
  for (auto &t : m.triangles) std::swap(t[0], t[1]);
  EXPECT_EQ(messageOfMesh(m), "the mesh is inside out at triangle 0: its piece has the volume -1 m^3");
  m = good;
  m.vertices[2][1] = NAN;
  EXPECT_EQ(messageOfMesh(m).find("vertex 2 of the mesh is at ("), 0u) << messageOfMesh(m);
  m = good;
  m.triangles[4][1] = 8;
  EXPECT_EQ(messageOfMesh(m), "triangle 4 of the mesh has vertex 8 of 8");
  m = good;
  m.triangles[4][1] = m.triangles[4][0];
  EXPECT_EQ(messageOfMesh(m).find("triangle 4 ("), 0u) << messageOfMesh(m);
  EXPECT_NE(messageOfMesh(m).find("has no area"), std::string::npos) << messageOfMesh(m);
  m = cubes(2, [](int i, int j, int k) { return i == j && j == k; });
  EXPECT_NE(messageOfMesh(m).find("joins sheets at triangles"), std::string::npos) << messageOfMesh(m);
  EXPECT_EQ(messageOfMesh(TriangleMesh{}), "the mesh has no triangles");
  EXPECT_EQ(messageOfMesh(good, -1), "the cell of a mesh is -1 m");
  EXPECT_EQ(messageOfMesh(good, 1e-4).find("a cell of 0.0001 m divides the mesh by 1.00"), 0u)
      << messageOfMesh(good, 1e-4);
}

TEST(MeshDistance, TakesPiecesAndHollows) {
  const TriangleMesh hollow = cubes(5, [](int i, int j, int k) { return i != 2 || j != 2 || k != 2; });
  EXPECT_GT(MeshDistance(hollow).nearest(Vec3(2.5, 2.5, 2.4)).value, 0.39);
  const TriangleMesh two = cubes(5, [](int i, int j, int k) { return i != 2 && j < 2 && k < 2; });
  EXPECT_NEAR(MeshDistance(two).nearest(Vec3(2.4, 1, 1)).value, 0.4, 1e-15); // to the left one, one rounding
  EXPECT_LT(MeshDistance(two).nearest(Vec3(4, 1, 1)).value, 0);
}

TEST(MeshShape, OfABallIsTheBallWithItsDerivatives) {
  const auto mesh = makeMesh(ball(4), 1.0 / 12);
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = (1 + 0.1 * random()) * random.direction(), n = p.normalized();
    const Distance d = mesh->at(p);
    ASSERT_NEAR(d.value, valueOf(*mesh, p), 1e-15); // the same sum in another order
    // Triangles of side 0.08 are 0.08^2/6 below the sphere; the spline is off by less.
    ASSERT_NEAR(d.value, p.norm() - 1, 0.08 * 0.08 / 6 + mesh->gridError());
    // Angles between facets are 0.05; the spline sees part of them.
    ASSERT_LT((d.gradient - n).norm(), 0.05);
    ASSERT_NEAR(d.gradient.norm(), 1, 0.02);
  }
  EXPECT_LT(mesh->gridError(), 1e-3);
  EXPECT_NEAR(mesh->curvatureRadius(), 1, 0.4); // facets are bent more than the sphere
}

TEST(MeshShape, DerivativesAreThoseOfTheValue) {
  const auto mesh = makeMesh(ring(40, 16), 0.06);
  Random random(4);
  const double step = 1e-4;
  for (int i = 0; i < 300; ++i) {
    const Vec3 p = (i % 2 ? 1.3 : 4.0) * random.vector(); // in the grid and around it
    const Distance d = mesh->at(p);
    for (int a = 0; a < 3; ++a) {
      const Vec3 e = step * Vec3::Unit(a);
      // Central differences: a sixth of the third derivative, up to 1/cell^2, times step^2.
      EXPECT_NEAR((valueOf(*mesh, p + e) - valueOf(*mesh, p - e)) / (2 * step), d.gradient[a], 2e-6) << p.transpose();
      // Of the gradient: where a cell begins the third derivative jumps by up to 4/cell^2, which leaves step/2 of it.
      const Vec3 second = (mesh->at(p + e).gradient - mesh->at(p - e).gradient) / (2 * step);
      EXPECT_LT((second - d.hessian.col(a)).norm(), 0.06) << p.transpose();
    }
  }
}

TEST(MeshShape, GetsBetterWithItsCell) {
  // A cube has edges, where the error is a part of the cell. Points 0.25 away from all ridges have what is left of half
  // a cell, by which the nearest nodes behind a ridge are off what goes on smoothly, after 0.27 for every cell on the
  // way; and of half a cell of the coarse grid, four cells away.
  TriangleMesh cube = cubes(1, Vec3(1, 1, 1), all);
  const auto box = makeBox(Vec3(1, 1, 1));
  for (Vec3 &v : cube.vertices) v -= Vec3(0.5, 0.5, 0.5);
  double before = 0;
  for (const double cell : {0.1, 0.05, 0.025}) {
    const auto mesh = makeMesh(cube, cell);
    if (before > 0) EXPECT_NEAR(mesh->gridError() / before, 0.5, 0.1);
    before = mesh->gridError();
    EXPECT_LT(mesh->gridError(), 0.2 * cell);
    Random random(6);
    for (int i = 0; i < 500; ++i) {
      Vec3 p = 0.15 * random.vector();
      p[i % 3] = 0.5 + 0.05 * random();
      ASSERT_NEAR(valueOf(*mesh, p), box->at(p).value, (0.5 * std::pow(0.27, 0.25 / cell) + 3e-3) * cell)
          << p.transpose();
    }
  }
  // A smooth surface, with more triangles than cells can see.
  const TriangleMesh smooth = ring(300, 120);
  double errors[2];
  for (int i = 0; i < 2; ++i) {
    const auto mesh = makeMesh(smooth, i ? 0.05 : 0.1);
    errors[i] = mesh->gridError();
  }
  EXPECT_GT(errors[0] / errors[1], 8); // the fourth power: 16, less what facets leave
}

TEST(MeshShape, IsALowerBoundFarAway) {
  const auto mesh = makeMesh(ring(60, 24), 0.06);
  const MeshDistance exact(ring(60, 24));
  Random random(9);
  Vec3 last = Vec3::Zero();
  for (int i = 0; i < 4000; ++i) {
    const Vec3 p = std::pow(10.0, 1 + random()) * random.vector();
    const double d = exact.nearest(p).value, found = valueOf(*mesh, p);
    // Splines overshoot in the middle between two sides, by a part of the coarse grid's four cells.
    ASSERT_LE(std::abs(found), std::abs(d) + 0.06) << p.transpose();
    if (std::abs(d) > 0.06) ASSERT_EQ(found > 0, d > 0) << p.transpose();
    ASSERT_GE(found, d - 2.6 - 0.06) << "short by the size of the grid at most: " << p.transpose();
    const Vec3 q = i % 2 ? last : Vec3(p + 0.01 * random.vector());
    // Nearly 1-Lipschitz: slopes of splines at kinks exceed 1 by a few a hundred.
    ASSERT_LE(std::abs(found - valueOf(*mesh, q)), 1.1 * (p - q).norm()) << p.transpose() << " and " << q.transpose();
    last = p;
  }
  // Up to the end of the grid, four cells from the ring, it is the distance, to what ridges between facets leave.
  for (const double away : {3.2, 3.5, 3.8}) {
    const Vec3 p(1.3 + 0.06 * away, 0.02, 0.03);
    EXPECT_NEAR(valueOf(*mesh, p), exact.nearest(p).value, 0.02 * 0.06) << away;
  }
  EXPECT_TRUE(std::isnan(valueOf(*mesh, Vec3(NAN, 0, 0))));
}

TEST(MeshShape, RefusesWhatIsThinnerThanTwoCells) {
  // A block of 0.8 with a fin of 0.1 on it.
  auto finned = [](int i, int j, int k) { return i < 8 && j < 8 && (k < 8 || j == 4); };
  const TriangleMesh m = cubes(16, Vec3(0.1, 0.1, 0.1), finned);
  EXPECT_EQ(messageOfMesh(m, 0.05), "made");
  const std::string message = messageOfMesh(m, 0.09);
  double thick = 0, x = 0, y = 0, z = 0, cell = 0;
  ASSERT_EQ(
      std::sscanf(message.c_str(),
                  "the mesh is %lf m thick near (%lf, %lf, %lf), less than two cells of 0.09 m: use a cell of %lf",
                  &thick, &x, &y, &z, &cell),
      5)
      << message;
  // The ball between the sides of the fin, found to 1e-6, printed with six digits.
  EXPECT_NEAR(thick, 0.1, 1e-5);
  EXPECT_NEAR(cell, 0.05, 1e-5);
  EXPECT_NEAR(y, 0.45, 0.0501); // on one of the sides
  EXPECT_GT(z, 0.8);
  EXPECT_EQ(messageOfMesh(m, cell), "made");
  EXPECT_NE(messageOfMesh(cubes(1, Vec3(1, 1, 0.001), all)), "made") << "a sheet that no node is in";
  EXPECT_EQ(messageOfMesh(cubes(7, plateWithHole), 0.5), "made");
}

TEST(MeshShape, HasHoles) {
  const auto mesh = makeMesh(cubes(7, plateWithHole));
  EXPECT_EQ(mesh->cell(), 7.0 / 64);
  // In the middle the spline of the coarse grid rounds off where four sides are equally near: an eighth of its cell of
  // 0.44. Close to a side it is exact but for what edges and ridges leave, some cells away.
  EXPECT_NEAR(valueOf(*mesh, Vec3(3.5, 3.5, 1)), 1.5, 0.06);
  EXPECT_NEAR(valueOf(*mesh, Vec3(2.2, 3.5, 1)), 0.2, 1e-3);
  EXPECT_NEAR(valueOf(*mesh, Vec3(1.8, 3.5, 1)), -0.2, 1e-3);
}

} // namespace
} // namespace tendril::test
