#include "tendril/io/polyline_reader.hpp"

#include "tendril/io/shape_file.hpp"
#include "tendril/io/text.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>

namespace tendril {
namespace {

[[noreturn]] void fail(const std::string &path, int line, const std::string &message) {
  throw SceneError(path + ":" + std::to_string(line) + ": " + message);
}

Vec3 parsePoint(std::istream &in, const std::string &path, int line, const std::string &text) {
  Vec3 x;
  std::string word;
  for (int k = 0; k < 3; ++k) {
    if (!(in >> word)) fail(path, line, "expected three numbers, found " + excerpt(text));
    std::size_t used = 0;
    try {
      x[k] = std::stod(word, &used);
    } catch (const std::exception &) {
      used = 0;
    }
    if (used != word.size()) fail(path, line, excerpt(word) + " is not a number, found in " + excerpt(text));
    if (!std::isfinite(x[k])) fail(path, line, excerpt(word) + " is not finite");
  }
  return x;
}

std::vector<Polyline> readPoints(std::istream &file, const std::string &path) {
  std::vector<Polyline> lines(1);
  std::string text;
  auto endLine = [&](int number) {
    if (lines.back().points.size() == 1)
      fail(path, number, "a polyline of one point ends here; it needs at least two, and no empty line between them");
    if (!lines.back().points.empty()) lines.emplace_back();
  };
  int last = 0;
  for (int number = 1; std::getline(file, text); ++number) {
    std::string clean = text.substr(0, text.find('#'));
    std::replace(clean.begin(), clean.end(), ',', ' ');
    std::istringstream in(clean);
    if (!(in >> std::ws) || in.peek() == EOF) {
      if (text.find('#') == std::string::npos) endLine(number);
      continue;
    }
    lines.back().points.push_back(parsePoint(in, path, number, text));
    if (std::string rest; in >> rest) fail(path, number, "expected three numbers, found more in " + excerpt(text));
    last = number;
  }
  endLine(last);
  lines.pop_back();
  return lines;
}

/// Edges between numbered vertices as polylines: one that ends where it began is closed. A polyline stands where its
/// first edge does, and runs its way.
class Chains {
public:
  explicit Chains(std::string path) : path_(std::move(path)) {}

  void add(int from, int to, int line) {
    const int edge = int(edges_.size());
    if (from == to) fail(path_, line, "an edge from vertex " + std::to_string(from + 1) + " to itself has no length");
    for (const int v : {from, to}) {
      if (std::size_t(v) >= edges_at_.size()) edges_at_.resize(std::size_t(v) + 1, {-1, -1});
      auto &[first, second] = edges_at_[std::size_t(v)];
      if (second >= 0)
        fail(path_, line,
             "vertex " + std::to_string(v + 1) +
                 " has a third edge here, and rods do not branch; give every rod vertices of its own");
      (first < 0 ? first : second) = edge;
    }
    edges_.push_back({from, to});
  }

  std::vector<Polyline> polylines(const std::vector<Vec3> &vertices) const {
    std::vector<Polyline> lines;
    std::vector<bool> taken(edges_.size());
    for (int edge = 0; edge < int(edges_.size()); ++edge) {
      if (taken[std::size_t(edge)]) continue;
      const auto [from, to] = edges_[std::size_t(edge)];
      std::vector<int> before = walk(edge, from), behind = walk(edge, to);
      Polyline &line = lines.emplace_back();
      line.closed = behind.size() > 1 && behind.back() == edge; // came back to where it began
      if (line.closed) before = {edge};
      std::vector<int> order(before.rbegin(), before.rend());
      order.insert(order.end(), behind.begin() + 1, behind.end());
      if (line.closed) order.pop_back();
      int vertex = from; // where the polyline begins
      for (std::size_t k = 1; k < before.size(); ++k) vertex = otherEnd(before[k], vertex);
      line.points.push_back(vertices[std::size_t(vertex)]);
      for (const int e : order) {
        taken[std::size_t(e)] = true;
        vertex = otherEnd(e, vertex);
        line.points.push_back(vertices[std::size_t(vertex)]);
      }
      if (line.closed) line.points.pop_back();
    }
    return lines;
  }

private:
  std::string path_;
  std::vector<std::array<int, 2>> edges_;    ///< their vertices
  std::vector<std::array<int, 2>> edges_at_; ///< of a vertex, -1 where there is none

  int otherEnd(int edge, int vertex) const {
    const auto [a, b] = edges_[std::size_t(edge)];
    return vertex == a ? b : a;
  }
  /// The edges from one on, over one of its vertices, to the end of the polyline or back to itself.
  std::vector<int> walk(int edge, int vertex) const {
    std::vector<int> way{edge};
    for (int at = edge;;) {
      const auto [a, b] = edges_at_[std::size_t(vertex)];
      at = at == a ? b : a;
      if (at < 0) return way;
      way.push_back(at);
      if (at == edge) return way;
      vertex = otherEnd(at, vertex);
    }
  }
};

std::vector<Polyline> readObj(std::istream &file, const std::string &path) {
  std::vector<Vec3> vertices;
  Chains chains(path);
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    std::istringstream in(text);
    std::string kind;
    in >> kind;
    if (kind == "v") vertices.push_back(parsePoint(in, path, number, text));
    if (kind != "l") continue;
    int last = -1, count = 0;
    for (std::string word; in >> word; ++count) {
      char *end; // of the vertex's number; a texture coordinate may follow
      const long i = std::strtol(word.c_str(), &end, 10), known = long(vertices.size());
      const long v = i < 0 ? known + i : i - 1;
      if ((*end != 0 && *end != '/') || i == 0 || v < 0 || v >= known)
        fail(path, number, excerpt(word) + " is not one of the " + std::to_string(known) + " vertices above");
      if (count > 0) chains.add(last, int(v), number);
      last = int(v);
    }
    if (count < 2) fail(path, number, "a line needs at least two vertices, found " + excerpt(text));
  }
  return chains.polylines(vertices);
}

std::string textOf(const std::string &path, const std::string &missing) {
  constexpr std::size_t most = 2'000'000'000;
  std::string text = readBytes(path, missing, most);
  if (const std::size_t at = text.find('\0'); at != std::string::npos)
    fail(path, 1 + int(std::count(text.begin(), text.begin() + std::ptrdiff_t(at), '\n')),
         "the byte 0x00 is no text; save the file as UTF-8");
  return text;
}

} // namespace

bool isTextPolyline(const std::string &path) { return extensionOf(path) != ".h5" && extensionOf(path) != ".hdf5"; }

std::vector<Polyline> readPolylines(const std::string &path) {
  const std::string extension = extensionOf(path);
  const std::string missing = ": cannot be opened; check the path (it is relative to the scene file)";
  if (std::filesystem::is_directory(path)) throw SceneError(path + missing);
  if (extension == ".json" || !isTextPolyline(path)) return readShapes(path);
  std::istringstream file(textOf(path, missing));
  std::vector<Polyline> lines;
  if (extension == ".csv" || extension == ".txt")
    lines = readPoints(file, path);
  else if (extension == ".obj")
    lines = readObj(file, path);
  else
    throw SceneError(path + ": unknown kind of file '" + extension + "'; use .csv, .txt, .obj, .json, .h5 or .hdf5");
  if (lines.empty())
    throw SceneError(path + ": holds no polyline" + (extension == ".obj" ? "; write one as an element 'l 1 2 3'" : ""));
  return lines;
}

} // namespace tendril
