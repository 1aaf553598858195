/// Closed surfaces from files of every kind: one body, whatever the file repeats. Numbers are read exactly.
#include "tendril/io/mesh_reader.hpp"

#include "support/files.hpp"

#include <cstdint>
#include <cstring>

namespace tendril::test {
namespace {

const std::array<std::array<Vec3, 3>, 4> tetrahedron = {{{Vec3(0, 0, 0), Vec3(0, 1, 0), Vec3(1, 0, 0)},
                                                         {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 0, 1)},
                                                         {Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(0, 1, 0)},
                                                         {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}}};

std::string words(const Vec3 &x) {
  return std::to_string(x[0]) + " " + std::to_string(x[1]) + " " + std::to_string(x[2]) + "\n";
}

/// Each corner written as often as a facet has it.
std::string asObj() {
  std::string text, faces;
  int count = 0;
  for (const auto &facet : tetrahedron) {
    for (const Vec3 &x : facet) text += "v " + words(x);
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
    for (const Vec3 &x : facet) text += "vertex " + words(x);
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
      {"body.obj", asObj()}, {"text.stl", asText()}, {"bytes.stl", asBytes()}};
  for (const auto &[name, content] : files) {
    const TriangleMesh mesh = readMesh(folder.write(name, content));
    EXPECT_EQ(mesh.vertices.size(), 4u) << name;
    ASSERT_EQ(mesh.triangles.size(), tetrahedron.size()) << name;
    for (std::size_t t = 0; t < tetrahedron.size(); ++t)
      for (int k = 0; k < 3; ++k)
        EXPECT_EQ(mesh.vertices[std::size_t(mesh.triangles[t][k])], tetrahedron[t][k]) << name;
  }
}

} // namespace
} // namespace tendril::test
