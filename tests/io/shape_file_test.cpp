/// Shape files: what is written is read again to the last bit, from HDF5 and from JSON, and mistakes name the table and
/// the row.
#include "tendril/embedding/embedding.hpp"
#include "tendril/io/hdf5.hpp"
#include "tendril/io/scene_reader.hpp"
#include "tendril/io/shape_file.hpp"

#include "support/files.hpp"

#include <cmath>
#include <cstring>
#include <map>
#include <sstream>

namespace tendril::test {
namespace {

const char *const shape_kinds[] = {"shapes.h5", "shapes.json"};

std::string shapeBytes(const std::string &path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The corners of a tube about a rod, as an .obj file.
std::string shapeMeshAbout(const Rod &rod, int sides, double radius) {
  const Skin skin = tubeAbout(rod, {sides, {radius, radius}, false, false});
  std::ostringstream text;
  text.precision(17);
  for (const SkinPoint &p : skin.points) text << "v " << placeOf(rod, p).transpose() << "\n";
  for (const std::array<int, 3> &t : skin.triangles)
    text << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
  return text.str();
}

const std::string shape_material = "material: {radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}";

/// An open rod with a tube, a ring with a mesh whose points three edges carry, and a rod without a skin.
Scene threeRods(const Folder &folder) {
  const std::string ring = "ring: {center: [0.1, 2, 0.3], normal: [1, 2, 3], radius: 0.3, edges: 13}";
  const Scene alone = readScene(folder.write("alone.yaml", "rods: [{" + ring + ", " + shape_material + "}]")).scene;
  folder.write("mesh.obj", shapeMeshAbout(alone.rods[0], 5, 0.013));
  return readScene(folder.write("scene.yaml",
                                "rods:\n"
                                "  - {name: open, helix: {axis: [0, 0, 1], radius: 0.1, length: 0.09, turns: 1.3, "
                                "edges: 20}, " +
                                    shape_material + ", skin: {tube: {sides: 7}}}\n  - {name: closed, " + ring + ", " +
                                    shape_material +
                                    ", skin: {mesh: {file: mesh.obj, edges: 3}}}\n  - {name: bare, line: "
                                    "{from: [0.1, 0, 0], to: [1, 0.7, -0.2], edges: 3}, " +
                                    shape_material + "}\n"))
      .scene;
}

bool sameBits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }
bool sameBits(const Vec3 &a, const Vec3 &b) {
  return sameBits(a[0], b[0]) && sameBits(a[1], b[1]) && sameBits(a[2], b[2]);
}

void expectSameSkin(const Skin &found, const Skin &of_rod) {
  EXPECT_EQ(found.triangles, of_rod.triangles);
  ASSERT_EQ(found.points.size(), of_rod.points.size());
  for (std::size_t p = 0; p < found.points.size(); ++p) {
    const SkinPoint &a = found.points[p], &b = of_rod.points[p];
    ASSERT_EQ(a.edges, b.edges) << p;
    for (std::size_t k = 0; k < std::size_t(a.edges); ++k) {
      EXPECT_EQ(a.edge[k], b.edge[k]) << p;
      EXPECT_TRUE(sameBits(a.weight[k], b.weight[k])) << p;
      EXPECT_TRUE(sameBits(a.local[k], b.local[k])) << p;
    }
  }
}

void expectSameShapes(const std::vector<Polyline> &lines, const std::vector<Rod> &rods) {
  ASSERT_EQ(lines.size(), rods.size());
  for (std::size_t r = 0; r < rods.size(); ++r) {
    const Rod &rod = rods[r];
    const Polyline &line = lines[r];
    EXPECT_EQ(line.closed, rod.closed);
    ASSERT_EQ(line.points.size(), rod.position.size());
    for (std::size_t v = 0; v < rod.position.size(); ++v)
      EXPECT_TRUE(sameBits(line.points[v], rod.position[v])) << "rod " << r << ", vertex " << v;
    ASSERT_EQ(line.directors.size(), rod.director.size());
    for (std::size_t e = 0; e < rod.director.size(); ++e)
      EXPECT_TRUE(sameBits(line.directors[e], rod.director[e])) << "rod " << r << ", edge " << e;
    ASSERT_EQ(line.skin != nullptr, rod.skin != nullptr) << r;
    if (rod.skin) expectSameSkin(*line.skin, skinOf(rod));
  }
}

/// A scene whose only block is a file, with what else the block says.
Scene sceneOfFile(const Folder &folder, const std::string &file, const std::string &more = "") {
  return readScene(folder.write("of_file.yaml", "rods: [{file: " + file + ", " + shape_material + more + "}]")).scene;
}

TEST(ShapeFile, ReadsTheBitsThatWereWritten) {
  const Folder folder;
  const Scene scene = threeRods(folder);
  ASSERT_EQ(skinOf(scene.rods[1]).width(), 3);
  ASSERT_EQ(scene.rods[2].skin, nullptr);
  for (const char *name : shape_kinds) {
    writeShapes(folder.path(name), scene);
    expectSameShapes(readShapes(folder.path(name)), scene.rods);
  }
}

TEST(ShapeFile, ReadsTheBitsOfNumbersThatAreHardToWrite) {
  const Folder folder;
  folder.write("a.csv", "0 0 0\n0.1 0 0\n0.3 0 0\n");
  Scene scene = sceneOfFile(folder, "a.csv");
  scene.rods[0].position = {Vec3(-0.0, 0.1 + 0.2, 1.0 / 3), Vec3(-0.0, std::nextafter(1.0, 2.0), 1e-99),
                            Vec3(12345678.90123456789, -1e22, 2e99)};
  scene.rods[0].director = {Vec3(1, 0, 0), Vec3(1, 0, 0)}; // normal to these edges to 1e-3
  for (const char *name : shape_kinds) {
    writeShapes(folder.path(name), scene);
    const std::vector<Polyline> lines = readShapes(folder.path(name));
    for (std::size_t v = 0; v < 3; ++v) EXPECT_TRUE(sameBits(lines[0].points[v], scene.rods[0].position[v])) << v;
  }
}

TEST(ShapeFile, WrittenAgainIsTheSame) {
  const Folder folder;
  writeShapes(folder.path("shapes.json"), threeRods(folder));
  writeShapes(folder.path("shapes.h5"), threeRods(folder));
  const std::string first = shapeBytes(folder.path("shapes.json"));
  ASSERT_FALSE(first.empty());
  for (const char *name : shape_kinds) {
    const Scene again = sceneOfFile(folder, name);
    ASSERT_EQ(again.rods.size(), 3u);
    EXPECT_EQ(again.rods[2].name, "rod0.2");
    writeShapes(folder.path("again.json"), again);
    EXPECT_EQ(shapeBytes(folder.path("again.json")), first) << name;
  }
}

TEST(ShapeFile, EndsInCapitalsToo) {
  const Folder folder;
  const Scene scene = threeRods(folder);
  for (const char *name : {"A.JSON", "A.HDF5", "A.H5"}) {
    writeShapes(folder.path(name), scene);
    EXPECT_EQ(readShapes(folder.path(name)).size(), 3u) << name;
  }
  EXPECT_EQ(shapeBytes(folder.path("A.JSON"))[0], '{');
}

TEST(ShapeFile, SkinGoesWithTheRodThatIsPlaced) {
  const Folder folder;
  const Scene scene = threeRods(folder);
  const Vec3 turn(0.3, -0.2, 1.1), shift(0.5, -0.25, 0.125);
  const Mat3 rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  for (const char *name : shape_kinds) {
    writeShapes(folder.path(name), scene);
    const Scene placed =
        sceneOfFile(folder, name, ", place: {scale: 2, rotation: [0.3, -0.2, 1.1], translation: [0.5, -0.25, 0.125]}");
    ASSERT_EQ(placed.rods.size(), 3u);
    for (std::size_t r = 0; r < 2; ++r) {
      const Rod &rod = scene.rods[r], &moved = placed.rods[r];
      const Skin before = skinOf(rod), after = skinOf(moved);
      EXPECT_EQ(after.triangles, before.triangles);
      ASSERT_EQ(after.points.size(), before.points.size());
      for (std::size_t p = 0; p < before.points.size(); ++p) {
        const Vec3 to = 2 * (rotation * placeOf(rod, before.points[p])) + shift;
        // A few roundings of numbers of the size of the place.
        EXPECT_LT((placeOf(moved, after.points[p]) - to).norm(), 1e-15 * (1 + to.norm())) << r << " " << p;
        EXPECT_EQ(after.points[p].edge, before.points[p].edge);
      }
      // What the mesh of the recipe says is where the points are.
      ASSERT_TRUE(moved.skin && moved.skin->mesh);
      for (std::size_t p = 0; p < after.points.size(); ++p)
        EXPECT_LT((moved.skin->mesh->vertices[p] - placeOf(moved, after.points[p])).norm(), 1e-15);
    }
    EXPECT_EQ(placed.rods[2].skin, nullptr);
  }
}

TEST(ShapeFile, SkinGoesWithCopies) {
  const Folder folder;
  const Scene scene = threeRods(folder);
  writeShapes(folder.path("shapes.json"), scene);
  const Scene copied = sceneOfFile(folder, "shapes.json", ", copies: {count: 2, offset: [0, 0, 4]}");
  ASSERT_EQ(copied.rods.size(), 6u);
  const Skin skin = skinOf(scene.rods[1]), moved = skinOf(copied.rods[4]);
  EXPECT_EQ(copied.rods[4].name, "rod0.1#1");
  ASSERT_EQ(moved.points.size(), skin.points.size());
  for (std::size_t p = 0; p < skin.points.size(); ++p)
    EXPECT_LT(
        (placeOf(copied.rods[4], moved.points[p]) - placeOf(scene.rods[1], skin.points[p]) - Vec3(0, 0, 4)).norm(),
        4e-15); // roundings of numbers of this size
}

TEST(ShapeFile, SkinOfTheSceneReplacesThatOfTheFile) {
  const Folder folder;
  writeShapes(folder.path("shapes.json"), threeRods(folder));
  const Scene scene = sceneOfFile(folder, "shapes.json", ", skin: {tube: {sides: 4}}");
  for (const Rod &rod : scene.rods)
    EXPECT_EQ(skinOf(rod).points.size(), std::size_t(rod.closed ? 4 * rod.edges() : 4 * (rod.edges() + 2) + 2));
}

/// Tables of a file that is written by hand.
struct HandTable {
  std::vector<hsize_t> shape;
  std::vector<double> values;
};
using HandTables = std::map<std::string, HandTable>;

/// Two rods with a tetrahedron each: an open one of two edges, and a square.
HandTables twoHandRods() {
  return {{"position", {{7, 3}, {0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 0, 5, 1, 0, 5, 1, 1, 5, 0, 1, 5}}},
          {"rod_vertex_offsets", {{3}, {0, 3, 7}}},
          {"closed", {{2}, {0, 1}}},
          {"director", {{6, 3}, {0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}}},
          {"skins/point_offsets", {{3}, {0, 4, 8}}},
          {"skins/triangle_offsets", {{3}, {0, 4, 8}}},
          {"skins/triangles", {{8, 3}, {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3, 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3}}},
          {"skins/edge", {{8, 2}, {0, 0, 0, 1, 1, 0, 0, 1, 3, 0, 0, 1, 2, 0, 2, 3}}},
          {"skins/weight", {{8, 2}, {1, 0, 0.5, 0.5, 1, 0, 0.25, 0.75, 0.5, 0.5, 0.5, 0.5, 1, 0, 0.125, 0.875}}},
          {"skins/local", {{8, 2, 3}, {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 2, 0, 0, 2,
                                       0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 2, 0, 0, 2}}}};
}

/// One rod, without any tables of offsets.
HandTables oneHandRod() {
  return {{"position", {{3, 3}, {0, 0, 0, 1, 0, 0, 2, 0, 0}}},
          {"skins/triangles", {{4, 3}, {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3}}},
          {"skins/edge", {{4, 1}, {0, 0, 1, 1}}},
          {"skins/weight", {{4, 1}, {1, 1, 1, 1}}},
          {"skins/local", {{4, 1, 3}, {0, 0, 0, 0, 1, 0, 0, 0, 1, 0.5, 0, 0}}}};
}

std::string handJson(const HandTable &table, std::size_t level, std::size_t &next) {
  if (level == table.shape.size()) {
    const double x = table.values[next++];
    if (std::isnan(x)) return ".nan";
    if (std::isinf(x)) return ".inf";
    std::ostringstream text;
    text.precision(17);
    text << x;
    return text.str();
  }
  std::string rows;
  for (hsize_t k = 0; k < table.shape[level]; ++k) rows += (k > 0 ? "," : "") + handJson(table, level + 1, next);
  return "[" + rows + "]";
}

std::string writeHand(const Folder &folder, const std::string &name, const HandTables &tables) {
  if (name == "shapes.h5") {
    Hdf5File file = Hdf5File::create(folder.path(name));
    bool group = false;
    for (const auto &[key, table] : tables) {
      if (key.rfind("skins/", 0) == 0 && !group) {
        file.createGroup("skins");
        group = true;
      }
      file.write(key, table.shape, table.values.data());
    }
    file.close();
    return folder.path(name);
  }
  std::string top, skins;
  for (const auto &[key, table] : tables) {
    std::size_t next = 0;
    const bool inner = key.rfind("skins/", 0) == 0;
    std::string &out = inner ? skins : top;
    out += (out.empty() ? "\"" : ",\n\"") + (inner ? key.substr(6) : key) + "\": " + handJson(table, 0, next);
  }
  if (!skins.empty()) top += ",\n\"skins\": {" + skins + "}";
  return folder.write(name, "{" + top + "}\n");
}

TEST(ShapeFile, ReadsTablesWrittenByHand) {
  const Folder folder;
  for (const char *name : shape_kinds) {
    const std::vector<Polyline> lines = readShapes(writeHand(folder, name, twoHandRods()));
    ASSERT_EQ(lines.size(), 2u) << name;
    EXPECT_EQ(lines[0].points, (std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
    EXPECT_FALSE(lines[0].closed);
    EXPECT_TRUE(lines[1].closed);
    EXPECT_EQ(lines[1].directors.size(), 4u);
    ASSERT_TRUE(lines[0].skin && lines[1].skin);
    EXPECT_EQ(lines[0].skin->points.size(), 4u);
    EXPECT_EQ(lines[0].skin->points[0].edges, 1); // a weight of zero is left out
    EXPECT_EQ(lines[0].skin->points[3].edges, 2);
    EXPECT_EQ(lines[0].skin->points[3].weight[1], 0.75);
    EXPECT_EQ(lines[0].skin->points[3].local[1], Vec3(0, 0, 2));
    EXPECT_EQ(lines[1].skin->points[0].edge[0], 3); // over the end of the ring
    EXPECT_EQ(lines[1].skin->points[0].edge[1], 0);
    EXPECT_EQ(lines[1].skin->triangles.size(), 4u);
  }
}

TEST(ShapeFile, OfOneRodNeedsNoOffsets) {
  const Folder folder;
  for (const char *name : shape_kinds) {
    const std::vector<Polyline> lines = readShapes(writeHand(folder, name, oneHandRod()));
    ASSERT_EQ(lines.size(), 1u) << name;
    EXPECT_FALSE(lines[0].closed);
    EXPECT_TRUE(lines[0].directors.empty());
    ASSERT_TRUE(lines[0].skin);
    EXPECT_EQ(lines[0].skin->points.size(), 4u);
    EXPECT_EQ(lines[0].skin->triangles.size(), 4u);
    HandTables closed = oneHandRod();
    closed["closed"] = {{1}, {1}};
    EXPECT_TRUE(readShapes(writeHand(folder, name, closed))[0].closed);
    HandTables bare{{"position", oneHandRod()["position"]}};
    EXPECT_EQ(readShapes(writeHand(folder, name, bare))[0].skin, nullptr);
  }
  EXPECT_TRUE(
      readShapes(folder.write("true.json", "{\"position\": [[0,0,0],[1,0,0],[0,1,0]], \"closed\": [true]}"))[0].closed);
}

TEST(ShapeFile, OnlySomeRodsHaveSkins) {
  const Folder folder;
  for (const char *name : shape_kinds) {
    HandTables tables = twoHandRods();
    for (const char *key : {"triangles", "edge", "weight", "local"}) {
      HandTable &table = tables["skins/" + std::string(key)];
      table.values.erase(table.values.begin(), table.values.begin() + std::ptrdiff_t(table.values.size() / 2));
      table.shape[0] = 4;
    }
    tables["skins/point_offsets"].values = tables["skins/triangle_offsets"].values = {0, 0, 4};
    const std::vector<Polyline> lines = readShapes(writeHand(folder, name, tables));
    EXPECT_EQ(lines[0].skin, nullptr) << name;
    ASSERT_TRUE(lines[1].skin) << name;
    EXPECT_EQ(lines[1].skin->points[0].edge[0], 3);
  }
}

/// One number, or all of a table, is another.
struct HandMistake {
  const char *table;
  int at; ///< of its numbers; -1: the whole table, -2: without it
  std::vector<double> value;
  std::vector<hsize_t> shape;
  std::vector<const char *> says;
};

TEST(ShapeFile, MistakesNameTheTableAndTheRow) {
  const double nan = std::nan(""), inf = HUGE_VAL;
  const std::vector<HandMistake> mistakes{
      {"position", -2, {}, {}, {"'position'", "has no"}},
      {"position", 4, {nan}, {}, {"'position'", "finite"}},
      {"position", 4, {inf}, {}, {"'position'", "finite"}},
      {"position", -1, {0, 0, 1, 1}, {2, 2}, {"'position' must have shape (n, 3), found 2 rows and 4 numbers in all"}},
      {"position", -1, {0, 0, 0, 1, 1, 1}, {6}, {"'position' must have shape (n, 3), found 6 rows"}},
      {"rod_vertex_offsets", 1, {2.5}, {}, {"row 1 of 'rod_vertex_offsets' is not a whole number"}},
      {"rod_vertex_offsets", 1, {3e9}, {}, {"row 1 of 'rod_vertex_offsets' is not a whole number"}},
      {"rod_vertex_offsets", 2, {6}, {}, {"'rod_vertex_offsets' must rise from 0 to 7", "two or more a rod"}},
      {"rod_vertex_offsets", 0, {1}, {}, {"'rod_vertex_offsets' must rise from 0 to 7"}},
      {"rod_vertex_offsets", 1, {6}, {}, {"'rod_vertex_offsets' must rise from 0 to 7"}},
      {"rod_vertex_offsets", 1, {-2}, {}, {"'rod_vertex_offsets' must rise from 0 to 7"}},
      {"rod_vertex_offsets", -1, {7}, {1}, {"'rod_vertex_offsets' must rise from 0 to 7"}},
      {"rod_vertex_offsets", -1, {0, 3, 3, 7}, {2, 2}, {"'rod_vertex_offsets' must have one dimension, found 2"}},
      {"closed", -1, {1}, {1}, {"'closed' must have one number per rod (2), found 1"}},
      {"closed", -1, {0, 1, 1}, {3}, {"'closed' must have one number per rod (2), found 3"}},
      {"closed", 1, {0.5}, {}, {"row 1 of 'closed' is not a whole number"}},
      {"director", -1, {0, 1, 0}, {1, 3}, {"'director' must have a row for each of 6 edges, found 1"}},
      {"director", 4, {1.01}, {}, {"row 1 of 'director' is not of unit length"}},
      {"director", 4, {nan}, {}, {"'director'", "finite"}},
      {"director",
       -1,
       {0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1},
       {6, 3},
       {"row 1 of 'director' is not normal to its edge"}},
      {"director",
       -1,
       {0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 1, 0},
       {6, 3},
       {"row 5 of 'director' is not normal to its edge"}}, // that which closes the ring
      {"skins/point_offsets", -2, {}, {}, {"of several rods needs 'skins/point_offsets'"}},
      {"skins/triangle_offsets", -2, {}, {}, {"of several rods needs 'skins/triangle_offsets'"}},
      {"skins/edge", -2, {}, {}, {"has no", "'skins/edge'"}},
      {"skins/weight", -2, {}, {}, {"has no", "'skins/weight'"}},
      {"skins/local", -2, {}, {}, {"has no", "'skins/local'"}},
      {"skins/point_offsets",
       2,
       {7},
       {},
       {"'skins/point_offsets' must rise from 0 to 8", "one number more than there are rods"}},
      {"skins/point_offsets", 1, {9}, {}, {"'skins/point_offsets' must rise from 0 to 8"}},
      {"skins/point_offsets", -1, {0, 8}, {2}, {"'skins/point_offsets' must rise from 0 to 8"}},
      {"skins/point_offsets", 1, {0.5}, {}, {"row 1 of 'skins/point_offsets' is not a whole number"}},
      {"skins/triangle_offsets", 2, {7}, {}, {"'skins/triangle_offsets' must rise from 0 to 8"}},
      {"skins/triangle_offsets", 1, {-1}, {}, {"'skins/triangle_offsets' must rise from 0 to 8"}},
      {"skins/triangle_offsets", 1, {0}, {}, {"the skin of rod 0 has points and no triangles"}},
      {"skins/point_offsets", 1, {0}, {}, {"row 0 of 'skins/triangles' names point 0, and its rod has 0"}},
      {"skins/triangles", 5, {4}, {}, {"row 1 of 'skins/triangles' names point 4, and its rod has 4, numbered from 0"}},
      {"skins/triangles", 13, {-1}, {}, {"row 4 of 'skins/triangles' names point -1, and its rod has 4"}},
      {"skins/triangles", 13, {1.5}, {}, {"row 4 of 'skins/triangles' is not a whole number"}},
      {"skins/triangles", -1, {0, 2, 1, 3}, {1, 4}, {"'skins/triangles' must have shape (n, 3), found 1 rows"}},
      {"skins/edge", 3, {2}, {}, {"row 1 of 'skins/edge' names edge 2, and its rod has 2, numbered from 0"}},
      {"skins/edge", 3, {-1}, {}, {"row 1 of 'skins/edge' names edge -1, and its rod has 2"}},
      {"skins/edge", 3, {0}, {}, {"row 1 of 'skins/edge' has edges 0 and 0, which do not follow each other"}},
      {"skins/edge", 2, {1}, {}, {"row 1 of 'skins/edge' has edges 1 and 1, which do not follow each other"}},
      {"skins/edge", 9, {1}, {}, {"row 4 of 'skins/edge' has edges 3 and 1, which do not follow each other"}},
      {"skins/edge", 14, {4}, {}, {"row 7 of 'skins/edge' names edge 4, and its rod has 4"}},
      {"skins/edge", 14, {0.5}, {}, {"row 7 of 'skins/edge' is not a whole number"}},
      {"skins/weight", 2, {0.25}, {}, {"row 1 of 'skins/weight' sums to 0.75 and must sum to 1"}},
      {"skins/weight", 0, {0}, {}, {"row 0 of 'skins/weight' sums to 0 and must sum to 1"}},
      {"skins/weight", 15, {-0.125}, {}, {"row 7 of 'skins/weight' is negative"}},
      {"skins/weight", 15, {nan}, {}, {"'skins/weight'", "finite"}},
      {"skins/local", 15, {nan}, {}, {"'skins/local'", "finite"}},
      {"skins/local",
       -1,
       {0, 0, 0},
       {1, 1, 3},
       {"'skins/edge' and 'skins/weight' must have a row", "found 16, 16 and 3"}},
      {"skins/weight", -1, {1, 1, 1, 1, 1, 1, 1, 1}, {8}, {"'skins/edge' and 'skins/weight' must have a row", "16, 8"}},
      {"skins/edge", -1, std::vector<double>(32, 0), {8, 4}, {"a row of one to 3 numbers for each point", "found 32"}},
  };
  const Folder folder;
  for (const char *name : shape_kinds)
    for (const HandMistake &mistake : mistakes) {
      HandTables tables = twoHandRods();
      HandTable &table = tables[mistake.table];
      if (mistake.at == -2)
        tables.erase(mistake.table);
      else if (mistake.at == -1)
        table = {mistake.shape, mistake.value};
      else
        table.values[std::size_t(mistake.at)] = mistake.value[0];
      SCOPED_TRACE(std::string(name) + ": " + mistake.table + " " + std::to_string(mistake.at));
      const std::string path = writeHand(folder, name, tables), message = messageOf([&] { readShapes(path); });
      EXPECT_TRUE(says(message, name));
      for (const char *part : mistake.says) EXPECT_TRUE(says(message, part));
      EXPECT_EQ(message.find('\n'), std::string::npos);
    }
}

TEST(ShapeFile, RowsAreAllOfOneWidth) {
  const Folder folder;
  auto json = [&](const std::string &text) { return messageOf([&] { readShapes(folder.write("a.json", text)); }); };
  EXPECT_TRUE(says(json("{\"position\": [[0,0],[1,0,0,0]]}"), "'position'"));
  EXPECT_TRUE(says(
      json("{\"position\": [[0,0,0],[1,0,0],[2,0,0]], \"skins\": {\"triangles\": [[0,2,1]], \"edge\": "
           "[[0],[0,1],[0,1,1]], \"weight\": [[1],[1,1],[0,0,1]], \"local\": [0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]}}"),
      "'skins/edge'"));
}

TEST(ShapeFile, FilesThatAreNone) {
  const Folder folder;
  EXPECT_TRUE(says(messageOf([&] { readShapes(folder.path("none.json")); }), "none.json: cannot be opened"));
  EXPECT_TRUE(says(messageOf([&] { readShapes(folder.path("none.h5")); }), "none.h5: is not a readable HDF5 file"));
  EXPECT_TRUE(says(messageOf([&] { readShapes(folder.write("a.h5", "text")); }), "a.h5: is not a readable HDF5 file"));
  for (const char *text : {"", "[]", "[[0, 0, 0]]", "3", "\"position\"", "{\"position\": []}\n---\n{}\n"})
    EXPECT_TRUE(says(messageOf([&] { readShapes(folder.write("a.json", text)); }),
                     "a.json:1: must be one JSON object, with a table 'position'"))
        << text;
  for (const char *text : {"{}", "{\"position\": {\"x\": 1}}", "{\"position\": null}"})
    EXPECT_TRUE(says(messageOf([&] { readShapes(folder.write("a.json", text)); }), "has no table 'position'")) << text;
  EXPECT_TRUE(
      says(messageOf([&] { readShapes(folder.write("a.json", "{\"position\": [[0, 0, 0], [1, 0")); }), "a.json:"));
  const std::string word =
      messageOf([&] { readShapes(folder.write("a.json", "{\"position\": [[0, 0, 0],\n [1, \"x\", 0]]}")); });
  EXPECT_TRUE(says(word, "a.json:2: 'position' must be a number, found 'x'"));
  folder.write("a.json", "{\"position\": []}");
  EXPECT_TRUE(says(messageOf([&] { sceneOfFile(folder, "a.json"); }), "of_file.yaml:1"));
}

TEST(ShapeFile, IsNotWrittenWhereItCannotBe) {
  const Folder folder;
  const Scene scene = threeRods(folder);
  for (const char *name : {"a.obj", "a", "a.yaml", "a.json.txt"})
    EXPECT_TRUE(says(messageOf([&] { checkShapesPath(folder.path(name), {}, "out"); }), "ends in .h5, .hdf5 or .json"))
        << name;
  EXPECT_TRUE(says(messageOf([&] { checkShapesPath(folder.path("none/a.json"), {}, "out"); }), "make it first"));
  const std::string read = folder.write("read.json", "{}");
  EXPECT_TRUE(says(messageOf([&] { checkShapesPath(read, {read}, "out"); }), "is read by this run"));
  EXPECT_TRUE(says(messageOf([&] { checkShapesPath("out/trajectory.h5", {}, "out"); }), "a result of this run"));
  EXPECT_NO_THROW(checkShapesPath("out/shapes.h5", {read}, "out"));
  EXPECT_NO_THROW(checkShapesPath("", {read}, "out"));
  for (const char *name : {"none/a.json", "none/a.h5"}) {
    const std::string message = messageOf([&] { writeShapes(folder.path(name), scene); });
    EXPECT_TRUE(says(message, name));
    EXPECT_TRUE(says(message, "cannot be written"));
  }
  if (std::filesystem::exists("/dev/full")) {
    std::filesystem::create_symlink("/dev/full", folder.path("full.json"));
    EXPECT_THROW(writeShapes(folder.path("full.json"), scene), WriteError);
  }
}

} // namespace
} // namespace tendril::test
