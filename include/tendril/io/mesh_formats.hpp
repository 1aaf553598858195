#pragma once
/// \file mesh_formats.hpp
/// What the readers of mesh files share, and that of PLY.

#include "tendril/geometry/mesh_distance.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace tendril {

/// The lines of a mesh file that have words, and their words.
class MeshLines {
public:
  /// \param comment begins what is left out of a line; none by default, as no line contains a newline
  MeshLines(const std::string &text, const std::string &path, char comment = '\n')
      : text_(text), path_(path), comment_(comment) {}
  /// Goes to the next line that has words; false at the end of the file.
  bool next();
  /// The next word of the line; empty behind the last.
  std::string_view word();
  bool hasWords() const; ///< behind those that are read
  /// The next three words. \throws SceneError: fewer, or not coordinates
  Vec3 point();
  /// The next word as how many `what` follow. Each takes a byte or more, so that a count beyond the file is seen before
  /// anything is read by it, and every other one fits an int. \throws SceneError: no such count
  std::size_t count(const std::string &what);
  std::string_view text() const { return text_; }
  /// Bytes of the file up to the end of the line.
  std::size_t end() const { return end_; }
  [[noreturn]] void fail(const std::string &message) const; ///< with the path and the number of the line
  [[noreturn]] void failFile(const std::string &message) const;
  /// The file ends behind `found` of `count` things.
  [[noreturn]] void failCutOff(const std::string &what, std::size_t found, std::size_t count) const;

private:
  std::string_view text_, rest_;
  std::string path_;
  char comment_;
  std::size_t end_ = 0;
  int number_ = 0;
};

/// What a word says as a number; not finite where it is beyond a double. \throws SceneError: it is no number
double numberOf(std::string_view word, const MeshLines &lines);

/// A whole number in digits only, without a sign.
std::optional<std::uint64_t> wholeNumber(std::string_view word);

/// Finite, as its powers are.
bool isCoordinate(double x);

/// Makes triangles of faces; joins their corners at the same place, so that a closed surface is closed.
class MeshCorners {
public:
  explicit MeshCorners(TriangleMesh &mesh) : mesh_(mesh) {}
  void add(const std::array<Vec3, 3> &corners) {
    std::array<int, 3> triangle;
    for (int k = 0; k < 3; ++k) {
      const std::array<double, 3> place{corners[k][0], corners[k][1], corners[k][2]};
      const auto [found, is_new] = numbers_.try_emplace(place, int(mesh_.vertices.size()));
      if (is_new) mesh_.vertices.push_back(corners[k]);
      triangle[k] = found->second;
    }
    mesh_.triangles.push_back(triangle);
  }
  /// A polygon of three points or more, as triangles that share its first.
  void add(const std::vector<Vec3> &points, const int *face, std::size_t size) {
    auto point = [&](std::size_t k) { return points[std::size_t(face[k])]; };
    for (std::size_t k = 2; k < size; ++k) add({point(0), point(k - 1), point(k)});
  }

private:
  TriangleMesh &mesh_;
  std::map<std::array<double, 3>, int> numbers_;
};

/// What is wrong with a face.
inline constexpr const char *too_few_corners = "a face needs three vertices or more";
std::string namesVertex(std::string_view word, std::size_t vertices);

/// The bytes of a PLY file of version 1.0, as text or binary of either order; what is neither a coordinate of a vertex
/// nor the list of corners of a face is left out. \throws SceneError with `path`, and line or row
TriangleMesh readPly(const std::string &bytes, const std::string &path);

} // namespace tendril
