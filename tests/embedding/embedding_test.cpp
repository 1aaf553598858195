/// Tubes by their closed forms, meshes that stay where they are drawn, and points that go with their edges.
#include "tendril/embedding/embedding.hpp"
#include "tendril/model/builders.hpp"

#include <gtest/gtest.h>
#include <map>

namespace tendril::test {
namespace {

Rod skinned(const Polyline &shape, const SkinRecipe &recipe) {
  Rod rod;
  rod.name = "rod";
  rod.position = shape.points;
  rod.closed = shape.closed;
  setBishopDirectors(rod);
  rod.skin = std::make_shared<SkinRecipe>(recipe);
  return rod;
}
Rod tube(const Polyline &shape, int sides, double radius, bool keeps_area = false) {
  SkinRecipe recipe;
  recipe.tube = {sides, {radius, radius}, false, keeps_area};
  return skinned(shape, recipe);
}
Polyline straight(double length, int edges) { return lineShape(Vec3::Zero(), Vec3(0, 0, length), edges); }

/// Vertices less edges plus triangles; every side of a triangle has its reverse in another one, once.
int characteristic(const Skin &skin) {
  std::map<std::pair<int, int>, int> sides;
  for (const auto &t : skin.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++sides[{t[k], t[(k + 1) % 3]}];
  for (const auto &[side, count] : sides) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(sides.count({side.second, side.first}), 1u);
  }
  return int(skin.points.size()) - int(sides.size()) / 2 + int(skin.triangles.size());
}

TEST(Tube, CountsAndIsClosed) {
  for (const int sides : {3, 8, 16})
    for (const int edges : {2, 3, 128}) {
      const Skin open = skinOf(tube(straight(1, edges), sides, 0.01));
      EXPECT_EQ(int(open.points.size()), sides * (edges + 2) + 2);
      EXPECT_EQ(int(open.triangles.size()), 2 * sides * (edges + 1) + 2 * sides);
      EXPECT_EQ(characteristic(open), 2);
      if (edges < 3) continue;
      const Skin closed = skinOf(tube(ringShape(Vec3::Zero(), Vec3::UnitX(), 0.2, edges), sides, 0.01));
      EXPECT_EQ(int(closed.points.size()), sides * edges);
      EXPECT_EQ(int(closed.triangles.size()), 2 * sides * edges);
      EXPECT_EQ(characteristic(closed), 0);
    }
}

TEST(Tube, HasTheAreaAndVolumeOfAPrism) {
  const double r = 0.05, length = 1.3;
  for (const int sides : {3, 8, 16, 32}) {
    const double s = sides, area = 2 * s * r * std::sin(pi / s) * length + s * r * r * std::sin(2 * pi / s),
                 volume = 0.5 * s * r * r * std::sin(2 * pi / s) * length;
    const Rod rod = tube(straight(length, 7), sides, r);
    const SkinMeasure found = measureOf(rod, skinOf(rod));
    EXPECT_NEAR(found.area, area, 1e-13);     // sums of a hundred triangles
    EXPECT_NEAR(found.volume, volume, 1e-14); //
    const Rod wider = tube(straight(length, 7), sides, r, true);
    EXPECT_NEAR(measureOf(wider, skinOf(wider)).volume, pi * r * r * length, 1e-14);
  }
}

TEST(Tube, OfARingHasThoseOfATorusToSecondOrder) {
  // Area and volume over those of the torus of the polygon's corners, as published with the tube generator's plan:
  // volume 0.98170, 0.99540, 0.99885, 0.99971 and area 0.98561, 0.99639, 0.99910, 0.99977, over the limit of a torus
  // with a section of 16 corners. Five digits are given.
  const double big = 0.2, r = 0.02, s = 16, step = 2 * pi / s;
  const double volume = 2 * pi * big * 0.5 * s * r * r * std::sin(step),
               area = 2 * pi * big * 2 * s * r * std::sin(pi / s);
  const std::map<int, std::pair<double, double>> table{
      {25, {0.98170, 0.98561}}, {50, {0.99540, 0.99639}}, {100, {0.99885, 0.99910}}, {200, {0.99971, 0.99977}}};
  for (const auto &[edges, over] : table) {
    const Rod rod = tube(ringShape(Vec3::Zero(), Vec3::UnitZ(), big, edges), int(s), r);
    const SkinMeasure found = measureOf(rod, skinOf(rod));
    EXPECT_NEAR(found.volume / volume, over.first, 6e-6) << edges;
    EXPECT_NEAR(found.area / area, over.second, 6e-6) << edges;
  }
}

/// The section of a strip goes with the directors of a rod that is twisted as drawn; one of a round tube does not.
TEST(Tube, OfAStripGoesWithDirectors) {
  const int edges = 12, sides = 8;
  SkinRecipe recipe;
  recipe.tube = {sides, {0.03, 0.01}, true, false};
  Rod rod = skinned(straight(1, edges), recipe);
  for (int e = 0; e < edges; ++e) rod.director[std::size_t(e)] = Vec3(std::cos(0.3 * e), std::sin(0.3 * e), 0);
  const Skin skin = skinOf(rod);
  for (int e = 0; e < edges; ++e) { // behind the ring at the first end
    const Vec3 middle(0, 0, (e + 0.5) / edges);
    const Vec3 along = placeOf(rod, skin.points[std::size_t((e + 1) * sides)]) - middle,
               across = placeOf(rod, skin.points[std::size_t((e + 1) * sides + sides / 4)]) - middle;
    EXPECT_LT((along - 0.03 * rod.director[std::size_t(e)]).norm(), 1e-15);
    EXPECT_LT((across - 0.01 * Vec3::UnitZ().cross(rod.director[std::size_t(e)])).norm(), 1e-15);
  }
  recipe.tube = {sides, {0.02, 0.02}, false, false};
  rod.skin = std::make_shared<SkinRecipe>(recipe);
  const Skin round = skinOf(rod);
  for (int e = 0; e < edges; ++e)
    EXPECT_LT((placeOf(rod, round.points[std::size_t((e + 1) * sides)]) - Vec3(0.02, 0, (e + 0.5) / edges)).norm(),
              1e-15);
}

/// A helix with two coils of a mesh about it: the corners of a tube.
TriangleMesh meshAbout(const Rod &rod, int sides, double radius) {
  SkinRecipe recipe;
  recipe.tube = {sides, {radius, radius}, false, false};
  const Skin skin = tubeAbout(rod, recipe.tube);
  TriangleMesh mesh;
  for (const SkinPoint &p : skin.points) mesh.vertices.push_back(placeOf(rod, p));
  mesh.triangles = skin.triangles;
  return mesh;
}

TEST(Embedding, LeavesTheMeshWhereItIsDrawn) {
  for (const bool closed : {false, true}) {
    const Polyline shape = closed ? ringShape(Vec3(1, 2, 3), Vec3(1, 2, -1).normalized(), 0.3, 17)
                                  : helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 1, 0.1, 3, 0, 60});
    const Rod rod = tube(shape, 6, 0.01);
    const TriangleMesh mesh = meshAbout(tube(shape, 7, 0.013), 7, 0.013);
    for (const int edges : {1, 2, 3}) {
      const Skin skin = embedded(rod, mesh, edges);
      EXPECT_EQ(skin.width(), edges);
      for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
        EXPECT_LT((placeOf(rod, skin.points[k]) - mesh.vertices[k]).norm(), 4e-15); // coordinates of up to 3
        double sum = 0;
        for (std::size_t j = 0; j < std::size_t(skin.points[k].edges); ++j) {
          sum += skin.points[k].weight[j];
          if (j > 0) {
            EXPECT_EQ(skin.points[k].edge[j], (skin.points[k].edge[j - 1] + 1) % rod.edges());
          }
        }
        EXPECT_NEAR(sum, 1, 3e-16);
      }
    }
  }
}

/// A point goes over from edge to edge without a jump where two carry it, and with one where one does.
TEST(Embedding, IsContinuousOverBends) {
  Polyline bent;
  bent.points = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1.9, 0.4, 0), Vec3(2.6, 1, 0), Vec3(3.1, 1.8, 0)};
  const Rod drawn = skinned(bent, {});
  Rod moved = drawn; // opened out
  for (int v = 0; v < 5; ++v) moved.position[std::size_t(v)] = Vec3(v, 0, 0);
  setBishopDirectors(moved, drawn.director[0]);
  for (const auto &[edges, side] : {std::pair(1, 0.2), {2, 0.2}, {3, 0.2}, {1, -0.2}, {2, -0.2}, {3, -0.2}}) {
    double widest = 0;
    Vec3 before = Vec3::Zero();
    for (int k = 0; k <= 20000; ++k) {
      const double x = 1e-6 + (2.6 - 2e-6) * k / 20000;
      TriangleMesh one;
      one.vertices = {Vec3(x, std::max(0.0, 0.6 * (x - 0.9)) + side, 0.05)};
      const Vec3 y = placeOf(moved, embedded(drawn, one, edges).points[0]);
      if (k > 0) widest = std::max(widest, (y - before).norm());
      before = y;
    }
    // Steps of the curve are 1.5e-4 long; one edge alone tears at a bend by the distance times its turn, 0.2 x 0.4.
    if (edges == 1)
      EXPECT_GT(widest, 0.02);
    else
      EXPECT_LT(widest, 6e-4) << edges << " " << side;
  }
}

TEST(Embedding, DoesNotReachOverToAnotherCoil) {
  const Rod rod = tube(helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 0.1, 0.1, 4, 0, 160}), 6, 0.01);
  for (const SkinPoint &p : embedded(rod, meshAbout(rod, 6, 0.01), 3).points)
    for (std::size_t k = 1; k < std::size_t(p.edges); ++k) EXPECT_EQ(p.edge[k], p.edge[k - 1] + 1);
}

TEST(SkinSamples, SumToTheAreaAndStayWhereTheyAreDrawn) {
  for (const bool closed : {false, true}) {
    const Rod rod = closed ? tube(ringShape(Vec3::Zero(), Vec3::UnitZ(), 0.3, 12), 8, 0.02)
                           : tube(helixShape({Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), 1, 0.1, 2, 0, 30}), 8, 0.02);
    const Skin skin = skinOf(rod);
    const SkinMeasure whole = measureOf(rod, skin);
    double of_corners = 0;
    for (const SkinSample &s : skinSamples(rod, skin, ContactSettings::corners, 2)) of_corners += s.area;
    EXPECT_NEAR(of_corners, whole.area, 1e-13);
    for (const int points : {1, 3, 6}) {
      double area = 0, volume = 0;
      int last = -1;
      const std::vector<SkinSample> samples = skinSamples(rod, skin, points, 2);
      EXPECT_EQ(samples.size(), std::size_t(points) * skin.triangles.size());
      for (const SkinSample &s : samples) {
        area += s.area;
        EXPECT_LE(s.point.edges, 2);
        EXPECT_GE(s.point.edge[0], last);
        last = s.point.edge[0];
      }
      EXPECT_NEAR(area, whole.area, 1e-13);
      // The integral of x.n/3: of each triangle by samples in its plane, which a rule of any degree has exactly.
      for (const auto &t : skin.triangles) {
        std::array<Vec3, 3> x;
        for (std::size_t k = 0; k < 3; ++k) x[k] = placeOf(rod, skin.points[std::size_t(t[k])]);
        Skin one;
        for (const int corner : t) one.points.push_back(skin.points[std::size_t(corner)]);
        one.triangles = {{0, 1, 2}};
        const Vec3 normal = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
        for (const SkinSample &s : skinSamples(rod, one, points, 2)) {
          EXPECT_NEAR(normal.dot(placeOf(rod, s.point) - x[0]), 0, 1e-15);
          volume += s.area * normal.dot(placeOf(rod, s.point)) / 3;
        }
      }
      EXPECT_NEAR(volume, whole.volume, 1e-14);
    }
  }
}

TEST(Skin, OfATubeAndAMeshIsBoth) {
  const Rod plain = tube(straight(1, 10), 6, 0.01);
  SkinRecipe recipe = *plain.skin;
  TriangleMesh plug;
  plug.vertices = {Vec3(0.02, 0, 0.9), Vec3(-0.01, 0.02, 0.9), Vec3(-0.01, -0.02, 0.9), Vec3(0, 0, 1.1)};
  plug.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  recipe.mesh = std::make_shared<TriangleMesh>(plug);
  const Rod rod = skinned(straight(1, 10), recipe);
  const Skin skin = skinOf(rod);
  EXPECT_EQ(skin.points.size(), skinOf(plain).points.size() + 4);
  EXPECT_LT((placeOf(rod, skin.points.back()) - Vec3(0, 0, 1.1)).norm(), 1e-15);
  EXPECT_EQ(skin.points.back().edges, 1); // beyond the end
  EXPECT_NO_THROW(checkClosed(rod, skin));
  recipe.mesh = std::make_shared<TriangleMesh>(TriangleMesh{plug.vertices, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}}});
  EXPECT_THROW(checkClosed(rod, skinOf(skinned(straight(1, 10), recipe))), std::invalid_argument);
}

} // namespace
} // namespace tendril::test
