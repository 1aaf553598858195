#include "tendril/io/mesh_reader.hpp"

#include "tendril/io/text.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>

namespace tendril {
namespace {

constexpr std::size_t most_bytes = std::size_t(256) << 20;

[[noreturn]] void fail(const std::string &path, int line, const std::string &message) {
  throw SceneError(path + ":" + std::to_string(line) + ": " + message);
}

double numberOf(const std::string &word, const std::string &path, int line) {
  std::size_t used = 0;
  double x = 0;
  try {
    x = std::stod(word, &used);
  } catch (const std::exception &) {
    used = 0;
  }
  if (used == 0 || used != word.size()) fail(path, line, excerpt(word) + " is not a number");
  if (!std::isfinite(x) || std::abs(x) > 1e100) fail(path, line, excerpt(word) + " is not a coordinate");
  return x;
}

Vec3 pointOf(std::istream &in, const std::string &path, int line) {
  Vec3 x;
  std::string word;
  for (int k = 0; k < 3; ++k) {
    if (!(in >> word)) fail(path, line, "expected three coordinates");
    x[k] = numberOf(word, path, line);
  }
  return x;
}

/// Number of a vertex, as `7`, `7/1/2` or, counted from the last, `-1`.
int cornerOf(const std::string &word, int vertices, const std::string &path, int line) {
  const std::string first = word.substr(0, word.find('/'));
  const double number = numberOf(first, path, line);
  const double index = number < 0 ? vertices + number : number - 1;
  if (!(index >= 0 && index < vertices) || index != std::floor(index))
    fail(path, line,
         "a face names vertex " + excerpt(first) + ", and there are " + std::to_string(vertices) + " above it");
  return int(index);
}

/// Joins corners at the same place.
class Corners {
public:
  explicit Corners(TriangleMesh &mesh) : mesh_(mesh) {}
  void add(const std::array<Vec3, 3> &corners) {
    std::array<int, 3> triangle;
    for (int k = 0; k < 3; ++k) {
      const std::array<double, 3> key{corners[k][0], corners[k][1], corners[k][2]};
      const auto [found, is_new] = numbers_.try_emplace(key, int(mesh_.vertices.size()));
      if (is_new) mesh_.vertices.push_back(corners[k]);
      triangle[k] = found->second;
    }
    mesh_.triangles.push_back(triangle);
  }

private:
  TriangleMesh &mesh_;
  std::map<std::array<double, 3>, int> numbers_;
};

TriangleMesh readObj(const std::string &text, const std::string &path) {
  TriangleMesh mesh;
  Corners corners(mesh);
  std::vector<Vec3> points;
  std::istringstream file(text);
  std::string line, word;
  for (int number = 1; std::getline(file, line); ++number) {
    std::istringstream in(line.substr(0, line.find('#')));
    if (!(in >> word)) continue;
    if (word == "v") points.push_back(pointOf(in, path, number));
    if (word != "f") continue;
    std::vector<Vec3> face;
    while (in >> word) face.push_back(points[std::size_t(cornerOf(word, int(points.size()), path, number))]);
    if (face.size() < 3) fail(path, number, "a face needs three vertices or more");
    for (std::size_t k = 2; k < face.size(); ++k) corners.add({face[0], face[k - 1], face[k]});
  }
  return mesh;
}

TriangleMesh readTextStl(const std::string &text, const std::string &path) {
  TriangleMesh mesh;
  Corners corners(mesh);
  std::istringstream file(text);
  std::string line, word;
  std::array<Vec3, 3> triangle;
  int count = 0;
  for (int number = 1; std::getline(file, line); ++number) {
    std::istringstream in(line);
    if (!(in >> word)) continue;
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    if (word == "vertex") {
      if (count == 3) fail(path, number, "a facet has three vertices");
      triangle[count++] = pointOf(in, path, number);
    }
    if (word != "endfacet") continue;
    if (count != 3) fail(path, number, "a facet has three vertices, found " + std::to_string(count));
    corners.add(triangle);
    count = 0;
  }
  if (count > 0) throw SceneError(path + ": ends within a facet: is the file cut off?");
  return mesh;
}

/// 80 bytes of anything, a count, and 50 bytes for each triangle: its normal, three corners, and two bytes more.
TriangleMesh readBinaryStl(const std::string &bytes, std::uint32_t count, const std::string &path) {
  static_assert(std::endian::native == std::endian::little);
  TriangleMesh mesh;
  Corners corners(mesh);
  for (std::uint32_t n = 0; n < count; ++n) {
    std::array<Vec3, 3> triangle;
    for (int k = 0; k < 3; ++k) {
      float x[3];
      std::memcpy(x, bytes.data() + 84 + std::size_t(50) * n + 12 * (k + 1), sizeof x);
      triangle[k] = Vec3(x[0], x[1], x[2]);
      if (!triangle[k].allFinite())
        throw SceneError(path + ": triangle " + std::to_string(n) + " has a corner that is not finite");
    }
    corners.add(triangle);
  }
  return mesh;
}

} // namespace

TriangleMesh readMesh(const std::string &path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".obj" && extension != ".stl") throw SceneError(path + ": a mesh is a file .obj or .stl");
  const std::string bytes = readBytes(path, ": cannot be opened; give an existing mesh file", most_bytes);
  TriangleMesh mesh;
  std::uint32_t count = 0;
  if (bytes.size() >= 84) std::memcpy(&count, bytes.data() + 80, sizeof count);
  if (extension == ".obj")
    mesh = readObj(bytes, path);
  else if (bytes.size() >= 84 && bytes.size() == 84 + std::size_t(50) * count)
    mesh = readBinaryStl(bytes, count, path);
  else if (bytes.size() >= 84 && bytes.find('\0') != std::string::npos)
    throw SceneError(path + ": says that it has " + std::to_string(count) + " triangles, in " +
                     std::to_string(84 + std::size_t(50) * count) + " bytes, and has " + std::to_string(bytes.size()) +
                     ": is the file cut off?");
  else
    mesh = readTextStl(bytes, path);
  if (mesh.triangles.empty()) throw SceneError(path + ": has no triangles");
  return mesh;
}

} // namespace tendril
