#include "tendril/io/mesh_reader.hpp"

#include "tendril/io/mesh_formats.hpp"
#include "tendril/io/text.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace tendril {
namespace {

constexpr std::size_t most_bytes = std::size_t(256) << 20;

std::string lowercase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return text;
}

/// Number of a vertex, as `7`, `7/1/2` or, counted from the last, `-1`.
int cornerOf(std::string_view word, int vertices, const MeshLines &lines) {
  const std::string_view first = word.substr(0, word.find('/'));
  const double number = numberOf(first, lines);
  const double index = number < 0 ? vertices + number : number - 1;
  if (!(index >= 0 && index < vertices) || index != std::floor(index))
    lines.fail("a face names vertex " + excerpt(std::string(first)) + ", and there are " + std::to_string(vertices) +
               " above it");
  return int(index);
}

TriangleMesh readObj(const std::string &text, const std::string &path) {
  TriangleMesh mesh;
  MeshCorners corners(mesh);
  std::vector<Vec3> points;
  std::vector<int> face;
  for (MeshLines lines(text, path, '#'); lines.next();) {
    const std::string_view kind = lines.word();
    if (kind == "v") points.push_back(lines.point());
    if (kind != "f") continue;
    face.clear();
    for (std::string_view word; !(word = lines.word()).empty();)
      face.push_back(cornerOf(word, int(points.size()), lines));
    if (face.size() < 3) lines.fail(too_few_corners);
    corners.add(points, face.data(), face.size());
  }
  return mesh;
}

/// OFF, or with texture coordinates, colours and normals, in this order.
bool isOffHeader(std::string_view word) {
  for (const std::string_view extra : {"ST", "C", "N"})
    if (word.starts_with(extra)) word.remove_prefix(extra.size());
  return word == "OFF";
}

/// The corners in a line; what is behind them is a colour.
void readOffFace(MeshLines &lines, std::size_t vertices, std::vector<int> &face) {
  const std::size_t size = lines.count("corners of a face");
  if (size < 3) lines.fail(too_few_corners);
  for (face.clear(); face.size() < size;) {
    const std::string_view word = lines.word();
    if (word.empty())
      lines.fail("a face of " + std::to_string(size) + " corners names " + std::to_string(face.size()) +
                 "; write all of them in its line");
    const auto index = wholeNumber(word);
    if (!index || *index >= vertices) lines.fail(namesVertex(word, vertices));
    face.push_back(int(*index));
  }
}

/// What a vertex has behind its coordinates is left out.
TriangleMesh readOff(const std::string &text, const std::string &path) {
  MeshLines lines(text, path, '#');
  if (!lines.next() || !isOffHeader(lines.word()))
    lines.failFile("is no OFF file; write 'OFF', or COFF, NOFF or STOFF, in its first line");
  if (!lines.hasWords() && !lines.next())
    lines.failFile("ends behind 'OFF'; write how many vertices and faces there are");
  const std::size_t vertices = lines.count("vertices"), faces = lines.count("faces"); // that of edges is often 0
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < vertices; ++k) {
    if (!lines.next()) lines.failCutOff("vertices", k, vertices);
    points.push_back(lines.point());
  }
  TriangleMesh mesh;
  MeshCorners corners(mesh);
  std::vector<int> face;
  for (std::size_t k = 0; k < faces; ++k) {
    if (!lines.next()) lines.failCutOff("faces", k, faces);
    readOffFace(lines, vertices, face);
    corners.add(points, face.data(), face.size());
  }
  if (lines.next()) lines.fail("is behind the last face that is counted; correct the counts");
  return mesh;
}

TriangleMesh readTextStl(const std::string &text, const std::string &path) {
  TriangleMesh mesh;
  MeshCorners corners(mesh);
  std::array<Vec3, 3> triangle;
  int count = 0;
  for (MeshLines lines(text, path); lines.next();) {
    const std::string word = lowercase(std::string(lines.word()));
    if (word == "vertex") {
      if (count == 3) lines.fail("a facet has three vertices");
      triangle[count++] = lines.point();
    }
    if (word != "endfacet") continue;
    if (count != 3) lines.fail("a facet has three vertices, found " + std::to_string(count));
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
  MeshCorners corners(mesh);
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

TriangleMesh readStl(const std::string &bytes, const std::string &path) {
  std::uint32_t count = 0;
  if (bytes.size() >= 84) std::memcpy(&count, bytes.data() + 80, sizeof count);
  const std::size_t expected = 84 + std::size_t(50) * count;
  if (bytes.size() >= 84 && bytes.size() == expected) return readBinaryStl(bytes, count, path);
  if (bytes.size() >= 84 && bytes.find('\0') != std::string::npos)
    throw SceneError(path + ": says that it has " + std::to_string(count) + " triangles, in " +
                     std::to_string(expected) + " bytes, and has " + std::to_string(bytes.size()) +
                     ": is the file cut off?");
  return readTextStl(bytes, path);
}

struct MeshFormat {
  std::string_view extension;
  TriangleMesh (*read)(const std::string &bytes, const std::string &path);
};

constexpr MeshFormat mesh_formats[] = {{".obj", readObj}, {".off", readOff}, {".ply", readPly}, {".stl", readStl}};

} // namespace

TriangleMesh readMesh(const std::string &path) {
  const std::string extension = extensionOf(path);
  const auto format = std::find_if(std::begin(mesh_formats), std::end(mesh_formats),
                                   [&](const MeshFormat &f) { return f.extension == extension; });
  if (format == std::end(mesh_formats)) throw SceneError(path + ": a mesh is a file .obj, .off, .ply or .stl");
  const std::string bytes = readBytes(path, ": cannot be opened; give an existing mesh file", most_bytes);
  TriangleMesh mesh = format->read(bytes, path);
  if (mesh.triangles.empty()) throw SceneError(path + ": has no triangles");
  return mesh;
}

} // namespace tendril
