/// Closed surfaces from files of every kind: one body, whatever the file repeats. Numbers are read exactly.
#include "tendril/io/mesh_reader.hpp"

#include "support/files.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>

namespace tendril::test {
namespace {

const std::array<std::array<Vec3, 3>, 4> tetrahedron = {{{Vec3(0, 0, 0), Vec3(0, 1, 0), Vec3(1, 0, 0)},
                                                         {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 0, 1)},
                                                         {Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(0, 1, 0)},
                                                         {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}}};

/// All digits.
std::string words(const Vec3 &x) {
  std::ostringstream out;
  out.precision(17);
  out << x[0] << " " << x[1] << " " << x[2];
  return out.str();
}

/// Each corner written as often as a facet has it.
std::string asObj() {
  std::string text, faces;
  int count = 0;
  for (const auto &facet : tetrahedron) {
    for (const Vec3 &x : facet) text += "v " + words(x) + "\n";
    count += 3;
    faces += "f " + std::to_string(count - 2) + " " + std::to_string(count - 1) + "//7 " + std::to_string(count) +
             " # one\n";
  }
  return text + faces;
}

std::string asText() {
  std::string text = "solid body\n";
  for (const auto &facet : tetrahedron) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const Vec3 &x : facet) text += "vertex " + words(x) + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid body\n";
}

std::string asBytes() {
  std::string bytes(80, ' ');
  auto add = [&](const auto &value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  };
  add(std::uint32_t(tetrahedron.size()));
  for (const auto &facet : tetrahedron) {
    for (int k = 0; k < 3; ++k) add(0.f);
    for (const Vec3 &x : facet)
      for (int k = 0; k < 3; ++k) add(float(x[k]));
    add(std::uint16_t(0));
  }
  return bytes;
}

TEST(MeshReader, ReadsTheSameBodyFromEveryKindOfFile) {
  const Folder folder;
  const std::pair<const char *, std::string> files[] = {
      {"body.OBJ", asObj()}, {"text.Stl", asText()}, {"bytes.stl", asBytes()}};
  for (const auto &[name, content] : files) {
    const TriangleMesh mesh = readMesh(folder.write(name, content));
    EXPECT_EQ(mesh.vertices.size(), 4u) << name;
    ASSERT_EQ(mesh.triangles.size(), tetrahedron.size()) << name;
    for (std::size_t t = 0; t < tetrahedron.size(); ++t)
      for (int k = 0; k < 3; ++k)
        EXPECT_EQ(mesh.vertices[std::size_t(mesh.triangles[t][k])], tetrahedron[t][k]) << name;
  }
}

/// A cube of quads whose corners are no binary fractions.
const std::array<Vec3, 8> cube_points = {Vec3(0.1, 0.2, 0.3), Vec3(1.1, 0.2, 0.3), Vec3(1.1, 1.2, 0.3),
                                         Vec3(0.1, 1.2, 0.3), Vec3(0.1, 0.2, 1.3), Vec3(1.1, 0.2, 1.3),
                                         Vec3(1.1, 1.2, 1.3), Vec3(0.1, 1.2, 1.3)};
constexpr int cube_faces[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

std::string cubeAsObj() {
  std::string text;
  for (const Vec3 &x : cube_points) text += "v " + words(x) + "\n";
  for (const auto &face : cube_faces) {
    text += "f";
    for (const int corner : face) text += " " + std::to_string(corner + 1);
    text += "\n";
  }
  return text;
}

/// \param extra what is behind each vertex, and behind each face
std::string cubeAsOff(const std::string &header, const std::string &extra) {
  std::string text = header;
  for (const Vec3 &x : cube_points) text += words(x) + extra + "\n";
  for (const auto &face : cube_faces) {
    text += "4";
    for (const int corner : face) text += " " + std::to_string(corner);
    text += extra + "\n";
  }
  return text;
}

/// The bytes of a value in an order.
template <class T> std::string packed(T value, bool big) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (big) std::reverse(raw, raw + sizeof value);
  return std::string(raw, sizeof value);
}

/// With an element and properties that no mesh needs, numbers and lists, before, between and behind what it does.
/// Faces are above the vertices.
std::string cubeAsPly(const std::string &format) {
  const std::string header = "ply\r\nformat " + format +
                             " 1.0\r\ncomment of the\r\nobj_info kind\r\nelement hint 2\r\n"
                             "property list uint8 int16 values\r\nproperty ushort one\r\nelement nothing 3\r\n"
                             "element face 6\r\nproperty float32 quality\r\n"
                             "property list uchar uint vertex_index\r\nproperty list int32 double texcoord\r\n"
                             "element vertex 8\r\nproperty uchar red\r\nproperty double x\r\nproperty float64 y\r\n"
                             "property list char float s\r\nproperty double z\r\nproperty int8 last\r\nend_header\r\n";
  const bool text = format == "ascii", big = format == "binary_big_endian";
  std::string rows;
  auto add = [&](auto value) {
    std::ostringstream out;
    out.precision(17);
    out << +value << " ";
    rows += text ? out.str() : packed(value, big);
  };
  auto endRow = [&] { rows += text ? "\r\n" : ""; };
  add(std::uint8_t(0)), add(std::uint16_t(65535)), endRow();
  add(std::uint8_t(2)), add(std::int16_t(-7)), add(std::int16_t(8)), add(std::uint16_t(10)), endRow();
  for (const auto &face : cube_faces) {
    add(0.5f), add(std::uint8_t(4));
    for (const int corner : face) add(std::uint32_t(corner));
    add(std::int32_t(1)), add(0.7), endRow();
  }
  for (const Vec3 &x : cube_points) {
    add(std::uint8_t(255)), add(x[0]), add(x[1]), add(std::int8_t(2)), add(1.f), add(2.f), add(x[2]);
    add(std::int8_t(-1)), endRow();
  }
  return header + rows;
}

void expectSame(const TriangleMesh &mesh, const TriangleMesh &other) {
  EXPECT_EQ(mesh.triangles, other.triangles);
  ASSERT_EQ(mesh.vertices.size(), other.vertices.size());
  EXPECT_EQ(std::memcmp(mesh.vertices.data(), other.vertices.data(), mesh.vertices.size() * sizeof(Vec3)), 0);
}

TEST(MeshReader, ReadsTheSameQuadsToTheBitFromEveryKindOfFile) {
  const Folder folder;
  const TriangleMesh cube = readMesh(folder.write("cube.obj", cubeAsObj()));
  EXPECT_EQ(cube.vertices.size(), 8u);
  EXPECT_EQ(cube.triangles.size(), 12u);
  const std::pair<const char *, std::string> files[] = {
      {"plain.off", cubeAsOff("OFF\n8 6 12\n", "")},
      {"one_line.off", cubeAsOff("# a cube\n\nOFF 8 6\r\n", " # one\r\n\n")},
      {"COLOURS.OFF", cubeAsOff("COFF\n# counts\n8 6 0 # of all\n", " 255 0 0 255")},
      {"all.off", cubeAsOff("STCNOFF 8 6 0\n", " 0.5 0.5 1")},
      {"normals.off", cubeAsOff("NOFF 8 6 0\n", " 0.5 0.5 1")},
      {"text.ply", cubeAsPly("ascii")},
      {"text_without_newline.PLY", cubeAsPly("ascii").substr(0, cubeAsPly("ascii").size() - 2)},
      {"little.ply", cubeAsPly("binary_little_endian")},
      {"newline.ply", cubeAsPly("binary_little_endian") + "\n"},
      {"big.Ply", cubeAsPly("binary_big_endian")}};
  for (const auto &[name, content] : files) {
    SCOPED_TRACE(name);
    expectSame(readMesh(folder.write(name, content)), cube);
  }
}

TEST(MeshReader, JoinsCornersAtTheSamePlaceInOffAndPly) {
  const Folder folder;
  std::string rows;
  for (const auto &facet : tetrahedron)
    for (const Vec3 &x : facet) rows += words(x) + "\n";
  rows += "3 0 1 2\n3 3 4 5\n3 6 7 8\n3 9 10 11\n";
  const TriangleMesh body = readMesh(folder.write("body.obj", asObj()));
  expectSame(readMesh(folder.write("body.off", "OFF\n12 4 0\n" + rows)), body);
  expectSame(readMesh(folder.write("body.ply", "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\n"
                                               "property float y\nproperty float z\nelement face 4\n"
                                               "property list uchar int vertex_indices\nend_header\n" +
                                                   rows)),
             body);
}

/// A triangle whose coordinates, corners and lengths of lists are of the type T, by either of its names.
template <class T> void readsType(const std::string &name, bool whole) {
  const Folder folder;
  const std::string index = whole ? name : "int", length = whole ? name : "uchar";
  for (const bool big : {false, true}) {
    std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                        "_endian 1.0\nelement vertex 3\nproperty " + name + " x\nproperty " + name + " y\nproperty " +
                        name + " z\nelement face 1\nproperty list " + length + " " + index +
                        " vertex_indices\nend_header\n";
    for (const T x : {T(0), T(0), T(0), T(100), T(0), T(0), T(0), T(-1), T(0)}) bytes += packed(x, big);
    bytes += whole ? packed(T(3), big) : packed(std::uint8_t(3), big);
    for (int k = 0; k < 3; ++k) bytes += whole ? packed(T(k), big) : packed(k, big);
    const TriangleMesh mesh = readMesh(folder.write("one.ply", bytes));
    EXPECT_EQ(mesh.vertices[1], Vec3(100, 0, 0)) << name;
    EXPECT_EQ(mesh.vertices[2], Vec3(0, double(T(-1)), 0)) << name;
  }
}

TEST(MeshReader, ReadsEveryTypeOfPly) {
  for (const char *name : {"char", "int8"}) readsType<std::int8_t>(name, true);
  for (const char *name : {"uchar", "uint8"}) readsType<std::uint8_t>(name, true);
  for (const char *name : {"short", "int16"}) readsType<std::int16_t>(name, true);
  for (const char *name : {"ushort", "uint16"}) readsType<std::uint16_t>(name, true);
  for (const char *name : {"int", "int32"}) readsType<std::int32_t>(name, true);
  for (const char *name : {"uint", "uint32"}) readsType<std::uint32_t>(name, true);
  for (const char *name : {"float", "float32"}) readsType<float>(name, false);
  for (const char *name : {"double", "float64"}) readsType<double>(name, false);
}

/// A file that is read, one place in it that is changed, and what the message says behind the path.
struct Damage {
  std::string place, change, message;
};

std::string replaced(std::string text, const Damage &damage) {
  const std::size_t at = text.find(damage.place);
  EXPECT_NE(at, std::string::npos) << damage.place;
  return text.replace(at, damage.place.size(), damage.change);
}

void expectMessages(const std::string &name, const std::string &text, const std::vector<Damage> &damages) {
  const Folder folder;
  EXPECT_EQ(readMesh(folder.write(name, text)).triangles.size(), 4u);
  for (const Damage &damage : damages) {
    const std::string path = folder.write(name, replaced(text, damage));
    const std::string message = messageOf([&] { readMesh(path); });
    EXPECT_TRUE(message.starts_with(path + damage.message)) << message << "\nfor " << damage.message;
  }
}

TEST(MeshReader, SaysWhatIsWrongWithAnOffFile) {
  const std::string text = "OFF\n4 4 6\n0 0 0\n0 1 0\n1 0 0\n0 0 1\n3 0 1 2\n3 0 2 3\n3 0 3 1\n3 2 1 3\n";
  expectMessages("body.off", text,
                 {{text, "", ": is no OFF file; write 'OFF', or COFF, NOFF or STOFF, in its first line"},
                  {"OFF", "4OFF", ": is no OFF file"},
                  {text, "OFF\n# of nothing\n", ": ends behind 'OFF'; write how many vertices and faces there are"},
                  {"4 4 6", "-4 4 6", ":2: '-4' is not a count of vertices; write a whole number, 0 or more"},
                  {"4 4 6", "BINARY", ":2: 'BINARY' is not a count of vertices"},
                  {"4 4 6", "4", ":2: has no count of faces; write how many there are"},
                  {"4 4 6", "4000000000 4 6", ":2: says that there are 4000000000 vertices, and the file has 75 bytes"},
                  {"4 4 6", "4 0 6", ":7: is behind the last face that is counted; correct the counts"},
                  {"4 4 6", "4 5 6", ": ends behind 4 of 5 faces: is the file cut off?"},
                  {text, "OFF 0 0 0", ": has no triangles"},
                  {"0 1 0\n", "0 1\n", ":4: expected three coordinates"},
                  {"0 1 0\n", "0 one 0\n", ":4: 'one' is not a number"},
                  {"0 1 0\n", "0 nan 0\n", ":4: 'nan' is not a coordinate"},
                  {"0 1 0\n", "0 -inf 0\n", ":4: '-inf' is not a coordinate"},
                  {"3 0 1 2", "2 0 1", ":7: a face needs three vertices or more"},
                  {"3 0 1 2", "-3 0 1", ":7: '-3' is not a count of corners of a face"},
                  {"3 0 1 2", "3 0 1", ":7: a face of 3 corners names 2; write all of them in its line"},
                  {"3 0 1 2", "7 0 1", ":7: a face of 7 corners names 2"},
                  {"3 0 1 2", "900 0 1", ":7: says that there are 900 corners of a face, and the file has 66 bytes"},
                  {"3 0 1 2", "3 0 1 4", ":7: a face names vertex '4', and there are 4, with numbers from 0"},
                  {"3 0 1 2", "3 0 1 -1", ":7: a face names vertex '-1'"},
                  {"3 0 1 2", "3 0 1 0.5", ":7: a face names vertex '0.5'"}});
}

const std::string ply_header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                               "property float z\nelement face 4\nproperty list char short vertex_indices\n"
                               "property list char short other\nend_header\n";

TEST(MeshReader, SaysWhatIsWrongWithTheHeaderOfAPlyFile) {
  const std::string rows = "0 0 0\n0 1 0\n1 0 0\n0 0 1\n3 0 1 2 0\n3 0 2 3 0\n3 0 3 1 0\n3 2 1 3 0\n";
  const std::string x = "property float x\n", list = "property list char short vertex_indices\n";
  expectMessages(
      "body.ply", ply_header + rows,
      {{ply_header + rows, "", ": is no PLY file; write 'ply' alone in its first line"},
       {"ply\n", "plyx\n", ": is no PLY file"},
       {"ply\n", "ply \t1\n", ": is no PLY file"},
       {"end_header\n" + rows, "", ": ends within its header; write 'end_header' below it"},
       {"end_header", "header_end", ":10: 'header_end' is no word of a header; write format, element, property, "},
       {"format ascii 1.0\n", "", ":9: the header says no format; write a line format ascii 1.0"},
       {"ascii", "text", ":2: 'text' is not a format; write ascii, binary_little_endian or binary_big_endian"},
       {"1.0", "2.0", ":2: '2.0' is not a version that is read; write 1.0"},
       {"1.0\n", "1.0\nformat ascii 1.0\n", ":3: says its format twice; write one line 'format'"},
       {"1.0\n", "1.0 1.0\n", ":2: has more words than 'format' takes; leave them out"},
       {x, "property float x y\n", ":4: has more words than 'property' takes"},
       {"element vertex 4", "element", ":3: an element has no name; write element NAME COUNT"},
       {"element vertex 4", "element vertex", ":3: has no count of rows of 'vertex'; write how many there are"},
       {"element vertex 4", "element vertex -4", ":3: '-4' is not a count of rows of 'vertex'"},
       {"element vertex 4", "element vertex 4294967295", ":3: says that there are 4294967295 rows of 'vertex', and "},
       {"element face", "element vertex", ":7: there is an element 'vertex' above; write all of them as one"},
       {"element vertex", "element point", ":10: there is no element 'vertex'; write element vertex COUNT"},
       {"element vertex 4\n", "", ":3: a property has no element; write element NAME COUNT above it"},
       {x, "", ":9: 'vertex' has no x; write property float x"},
       {"float y", "float v", ":10: 'vertex' has no y"},
       {"float y", "float x", ":5: 'x' is there twice; write it once"},
       {x, "property list uchar float x\n", ":4: 'x' is a list; write property float x"},
       {x, "property number x\n", ":4: 'number' is not a type; write char, uchar, short, "},
       {x, "property float\n", ":4: a property has no name; write property TYPE NAME"},
       {list, "", ":9: 'face' has no corners; write property list uchar int vertex_indices"},
       {list, "property int vertex_index\n", ":8: 'vertex_index' is not a list of whole numbers; write property list "},
       {list, "property list uchar float vertex_indices\n", ":8: 'vertex_indices' is not a list of whole numbers"},
       {list, "property list float int vertex_indices\n",
        ":8: the length of a list is not a whole number; write uchar"},
       {"other", "vertex_index", ":9: 'vertex_index' is there twice"},
       {"element face", "element strip", ": has no triangles"}});
}

TEST(MeshReader, SaysWhatIsWrongWithTheRowsOfAPlyFile) {
  const std::string text = ply_header + "0 0 0\n0 1 0\n1 0 0\n0 0 1\n3 0 1 2 0\n3 0 2 3 0\n3 0 3 1 0\n3 2 1 3 0\n";
  expectMessages("body.ply", text,
                 {{"0 1 0\n", "0 1\n", ":12: has fewer numbers than its properties; write a row in one line"},
                  {"0 1 0\n", "0 1 0 0\n", ":12: has more numbers than its properties; leave them out"},
                  {"0 1 0\n", "0 one 0\n", ":12: 'one' is not a number"},
                  {"0 1 0\n", "0 nan 0\n", ":12: 'y' is nan, which is not a coordinate"},
                  {"0 1 0\n", "0 -1e101 0\n", ":12: 'y' is -1e+101, which is not a coordinate"},
                  {"3 0 1 2 0\n", "2 0 1 0\n", ":15: a face needs three vertices or more"},
                  {"3 0 1 2 0\n", "-3 0 1 2 0\n", ":15: the list 'vertex_indices' has a length below 0"},
                  {"3 0 1 2 0\n", "3 0 1 2 -1\n", ":15: the list 'other' has a length below 0"},
                  {"3 0 1 2 0\n", "128 0 1 2 0\n", ":15: '128' is not of the type char"},
                  {"3 0 1 2 0\n", "100 0 1 2 0\n", ":15: has fewer numbers than its properties"},
                  {"3 0 1 2 0\n", "3 0 1 2 100 1\n", ":15: has fewer numbers than its properties"},
                  {"3 0 1 2 0\n", "3 0 1 4 0\n", ":15: a face names vertex '4', and there are 4, with numbers from 0"},
                  {"3 0 1 2 0\n", "3 0 1 -1 0\n", ":15: a face names vertex '-1'"},
                  {"3 2 1 3 0\n", "", ": ends behind 3 of 4 rows of 'face': is the file cut off?"},
                  {"3 2 1 3 0\n", "3 2 1 3 0\n3 2 1 3 0\n", ":19: is behind the last row that the header counts"}});
}

TEST(MeshReader, SaysWhatIsWrongWithABinaryPlyFile) {
  const Folder folder;
  const std::string header = replaced(ply_header, {"ascii", "binary_big_endian", ""});
  const auto message = [&](const std::vector<float> &coordinates, const std::string &faces) {
    std::string rows;
    for (const float x : coordinates) rows += packed(x, true);
    const std::string path = folder.write("body.ply", header + rows + faces);
    return messageOf([&] { readMesh(path); }).substr(path.size());
  };
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> points{0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1};
  const std::string face("\3\0\0\0\1\0\2\0", 8);
  EXPECT_EQ(message({0, 0, 0, 0, nan}, {}), ": row 1 of 'vertex': 'y' is nan, which is not a coordinate");
  EXPECT_EQ(message({-inf}, {}), ": row 0 of 'vertex': 'x' is -inf, which is not a coordinate");
  EXPECT_EQ(message({0, 0, 0, 0}, {}), ": ends behind 1 of 4 rows of 'vertex': is the file cut off?");
  EXPECT_EQ(message(points, face + "\3"), ": ends behind 1 of 4 rows of 'face': is the file cut off?");
  EXPECT_EQ(message(points, face + "\x7F"), ": ends behind 1 of 4 rows of 'face': is the file cut off?");
  EXPECT_EQ(message(points, face.substr(0, 7) + "\x7F"), ": ends behind 0 of 4 rows of 'face': is the file cut off?");
  EXPECT_EQ(message(points, "\2"), ": row 0 of 'face': a face needs three vertices or more");
  EXPECT_EQ(message(points, "\xFF"), ": row 0 of 'face': the list 'vertex_indices' has a length below 0");
  EXPECT_EQ(message(points, face + std::string("\3\0\4", 3)),
            ": row 1 of 'face': a face names vertex '4', and there are 4, with numbers from 0");
  EXPECT_EQ(message(points, "\3\xFF\xFE"),
            ": row 0 of 'face': a face names vertex '-2', and there are 4, with numbers from 0");
  EXPECT_EQ(message(points, face + face + face + face + "ab"),
            ": has 2 bytes behind the last row that the header counts; correct its counts");
}

TEST(MeshReader, EndsWithAMessageWhereverAFileIsCutOff) {
  const Folder folder;
  for (const char *format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const std::string whole = cubeAsPly(format);
    for (std::size_t size = 0; size + 4 < whole.size(); size += 11) {
      const std::string path = folder.write("cut.ply", whole.substr(0, size));
      EXPECT_FALSE(messageOf([&] { readMesh(path); }).empty()) << format << " " << size;
    }
  }
}

TEST(MeshReader, NamesTheKindsOfFileThatAreRead) {
  for (const char *name : {"body.obx", "body", "body.ply.gz"})
    EXPECT_EQ(messageOf([&] { readMesh(name); }), std::string(name) + ": a mesh is a file .obj, .off, .ply or .stl");
}

} // namespace
} // namespace tendril::test
