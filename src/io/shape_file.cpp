#include "tendril/io/shape_file.hpp"

#include "tendril/embedding/embedding.hpp"
#include "tendril/io/hdf5.hpp"
#include "tendril/io/text.hpp"
#include "tendril/io/yaml.hpp"

#include <cctype>
#include <cstdio>
#include <filesystem>
#include <fstream>

namespace tendril {
namespace {

bool isJson(const std::string &path) { return extensionOf(path) == ".json"; }

/// Tables of numbers by name, of a file of either kind.
class Tables {
public:
  explicit Tables(const std::string &path) : path_(path) {
    if (!isJson(path)) {
      file_.emplace(Hdf5File::open(path));
      return;
    }
    const std::vector<YAML::Node> documents = loadYaml(readText(path, ": cannot be opened; check the path"), path);
    if (documents.size() != 1 || !documents[0].IsMap())
      throw SceneError(path + ":1: must be one JSON object, with a table 'position'");
    json_ = documents[0];
    refuseUnknown(json_, {"position", "rod_vertex_offsets", "closed", "director", "skins"});
    if (const YAML::Node skins = json_["skins"]) {
      if (!skins.IsMap()) throw SceneError(path + ": 'skins' must be an object with tables, such as 'triangles'");
      refuseUnknown(skins, {"point_offsets", "triangle_offsets", "triangles", "edge", "weight", "local"});
    }
  }
  bool has(const std::string &name) const { return file_ ? file_->has(name) : bool(nodeOf(name)); }
  /// All numbers of a table, row by row.
  struct Table {
    std::vector<double> values;
    std::size_t rows = 0;
    std::size_t columns() const { return rows > 0 ? values.size() / rows : 0; }
  };
  Table read(const std::string &name) const {
    Table table;
    if (file_) {
      std::vector<hsize_t> shape;
      table.values = file_->readAll(name, &shape);
      table.rows = shape[0];
      return table;
    }
    const std::optional<YAML::Node> node = nodeOf(name);
    if (!node || node->IsMap() || node->IsNull()) throw SceneError(path_ + ": has no table '" + name + "'");
    add(*node, name, table.values);
    table.rows = node->IsSequence() ? node->size() : 1;
    return table;
  }
  /// One whose rows have so many numbers.
  std::vector<double> read(const std::string &name, std::size_t columns) const {
    Table table = read(name);
    if (table.values.size() != table.rows * columns)
      throw SceneError(path_ + ": '" + name + "' must have " +
                       (columns == 1 ? "one dimension" : "shape (n, " + std::to_string(columns) + ")") + ", found " +
                       std::to_string(table.rows) + " rows and " + std::to_string(table.values.size()) +
                       " numbers in all");
    return table.values;
  }
  std::vector<int> readWhole(const std::string &name, std::size_t columns) const {
    return whole(name, read(name, columns), columns);
  }
  std::vector<int> whole(const std::string &name, const std::vector<double> &values, std::size_t columns) const {
    std::vector<int> numbers;
    for (const double x : values) {
      if (!(std::abs(x) < 2e9) || x != std::round(x)) fail(name, numbers.size() / columns, "is not a whole number");
      numbers.push_back(int(x));
    }
    return numbers;
  }
  [[noreturn]] void fail(const std::string &name, std::size_t row, const std::string &what) const {
    throw SceneError(path_ + ": row " + std::to_string(row) + " of '" + name + "' " + what);
  }
  const std::string &path() const { return path_; }

private:
  std::string path_;
  std::optional<Hdf5File> file_;
  YAML::Node json_;

  void refuseUnknown(const YAML::Node &map, const std::vector<std::string> &names) const {
    for (const auto &entry : map) {
      const std::string name = entry.first.Scalar();
      if (std::find(names.begin(), names.end(), name) != names.end()) continue;
      const std::string near = closest(name, names);
      throw SceneError(path_ + ":" + std::to_string(entry.first.Mark().line + 1) + ": unknown table " + excerpt(name) +
                       (near.empty() ? "" : "; did you mean '" + near + "'?"));
    }
  }
  std::optional<YAML::Node> nodeOf(const std::string &name) const {
    const std::size_t slash = name.find('/');
    const YAML::Node &top = json_; // of a node that may change, [] makes what is missing
    const YAML::Node node = top[name.substr(0, slash)];
    if (!node) return {};
    if (slash == std::string::npos) return node;
    if (!node.IsMap()) return {};
    const YAML::Node &map = node;
    const YAML::Node inner = map[name.substr(slash + 1)];
    if (!inner) return {};
    return inner;
  }
  /// Rows must be alike. \return how many numbers it has
  std::size_t add(const YAML::Node &node, const std::string &name, std::vector<double> &values) const {
    if (node.IsSequence()) {
      std::size_t before = 0, all = 0;
      bool first = true;
      for (const YAML::Node &item : node) {
        const std::size_t count = add(item, name, values);
        if (!first && count != before)
          throw SceneError(path_ + ":" + std::to_string(item.Mark().line + 1) + ": a row of '" + name + "' has " +
                           std::to_string(count) + " numbers, and the one before " + std::to_string(before));
        first = false;
        before = count;
        all += count;
      }
      return all;
    }
    const YamlValue value(node, path_, name);
    if (node.IsScalar() && (node.Scalar() == "true" || node.Scalar() == "false"))
      values.push_back(value.boolean());
    else
      values.push_back(value.number());
    return 1;
  }
};

/// Rows that each rod has: an offset table, or all of the only one.
std::vector<int> offsetsOf(const Tables &tables, const std::string &name, int rows, std::size_t rods, int least) {
  if (!tables.has(name)) {
    if (rods > 1) throw SceneError(tables.path() + ": of several rods needs '" + name + "'");
    return {0, rows};
  }
  const std::vector<int> offsets = tables.readWhole(name, 1);
  bool fits = offsets.size() >= 2 && (rods == 0 || offsets.size() == rods + 1) && offsets.front() == 0 &&
              offsets.back() == rows;
  for (std::size_t r = 0; r + 1 < offsets.size(); ++r) fits = fits && offsets[r] + least <= offsets[r + 1];
  if (!fits)
    throw SceneError(tables.path() + ": '" + name + "' must rise from 0 to " + std::to_string(rows) +
                     ", the number of rows that it counts" + (least > 0 ? ", by two or more a rod" : "") +
                     (rods > 0 ? ", and have one number more than there are rods" : ""));
  return offsets;
}

/// How points of skins go with edges, of all rods.
struct PointTables {
  std::vector<int> edge;
  std::vector<double> weight, local;
  std::size_t rows = 0, width = 1;
};

SkinPoint pointFrom(const Tables &tables, const PointTables &points, std::size_t row, int edges, bool closed) {
  SkinPoint point;
  double sum = 0;
  for (std::size_t k = 0; k < points.width; ++k) {
    const std::size_t at = row * points.width + k;
    const int edge = points.edge[at];
    const double weight = points.weight[at];
    if (!(weight >= 0)) tables.fail("skins/weight", row, "is negative");
    if (edge < 0 || edge >= edges)
      tables.fail("skins/edge", row,
                  "names edge " + std::to_string(edge) + ", and its rod has " + std::to_string(edges) +
                      ", numbered from 0");
    sum += weight;
    if (weight == 0) continue;
    if (point.edges > 0) {
      const int before = point.edge[std::size_t(point.edges - 1)], next = before + 1;
      if (edge != (closed && next == edges ? 0 : next))
        tables.fail("skins/edge", row,
                    "has edges " + std::to_string(before) + " and " + std::to_string(edge) +
                        ", which do not follow each other");
    }
    const double *const local = points.local.data() + 3 * at;
    point.add(edge, weight, {local[0], local[1], local[2]});
  }
  if (!(std::abs(sum - 1) <= 1e-5))
    tables.fail("skins/weight", row, "sums to " + shortText(sum) + " and must sum to 1");
  return point;
}

void readSkins(const Tables &tables, std::vector<Polyline> &lines) {
  PointTables points;
  const Tables::Table edge = tables.read("skins/edge");
  points.rows = edge.rows;
  points.width = std::max<std::size_t>(edge.columns(), 1);
  points.edge = tables.whole("skins/edge", edge.values, points.width);
  points.weight = tables.read("skins/weight").values;
  points.local = tables.read("skins/local").values;
  const std::size_t numbers = points.rows * points.width;
  if (points.width > std::size_t(SkinPoint::most) || points.edge.size() != numbers || points.weight.size() != numbers ||
      points.local.size() != 3 * numbers)
    throw SceneError(tables.path() + ": 'skins/edge' and 'skins/weight' must have a row of one to " +
                     std::to_string(SkinPoint::most) +
                     " numbers for each point, and 'skins/local' three numbers for each of these; found " +
                     std::to_string(points.edge.size()) + ", " + std::to_string(points.weight.size()) + " and " +
                     std::to_string(points.local.size()));
  const std::vector<int> triangles = tables.readWhole("skins/triangles", 3);
  const std::vector<int> begins = offsetsOf(tables, "skins/point_offsets", int(points.rows), lines.size(), 0),
                         faces =
                             offsetsOf(tables, "skins/triangle_offsets", int(triangles.size() / 3), lines.size(), 0);
  for (std::size_t r = 0; r < lines.size(); ++r) {
    Polyline &line = lines[r];
    const int count = begins[r + 1] - begins[r], edges = int(line.points.size()) - (line.closed ? 0 : 1);
    auto skin = std::make_shared<Skin>();
    for (int row = begins[r]; row < begins[r + 1]; ++row)
      skin->points.push_back(pointFrom(tables, points, std::size_t(row), edges, line.closed));
    for (int row = faces[r]; row < faces[r + 1]; ++row) {
      std::array<int, 3> corners;
      for (std::size_t k = 0; k < 3; ++k) {
        corners[k] = triangles[3 * std::size_t(row) + k];
        if (corners[k] < 0 || corners[k] >= count)
          tables.fail("skins/triangles", std::size_t(row),
                      "names point " + std::to_string(corners[k]) + ", and its rod has " + std::to_string(count) +
                          ", numbered from 0");
      }
      if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0])
        tables.fail("skins/triangles", std::size_t(row), "names one point twice");
      skin->triangles.push_back(corners);
    }
    if (count > 0 && skin->triangles.empty())
      throw SceneError(tables.path() + ": the skin of rod " + std::to_string(r) + " has points and no triangles");
    if (count > 0) line.skin = skin;
  }
}

/// A number with as many digits as tell it from all others.
std::string exact(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}

/// Rows of numbers as JSON.
template <class Number, class Text>
std::string rowsOf(const std::vector<Number> &values, std::size_t columns, std::size_t inner, Text text) {
  std::string out = "[";
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (columns > 1 && k % columns == 0) out += k > 0 ? "],\n   [" : "\n   [";
    if (inner > 1 && k % inner == 0) out += k % columns > 0 ? "], [" : "[";
    if (k % inner > 0 || (inner == 1 && k % columns > 0) || (columns == 1 && k > 0)) out += ", ";
    out += text(values[k]);
    if (inner > 1 && (k + 1) % columns == 0) out += "]";
  }
  return out + (columns > 1 && !values.empty() ? "]]" : "]");
}
std::string wholeRows(const std::vector<int> &values, std::size_t columns) {
  return rowsOf(values, columns, 1, [](int x) { return std::to_string(x); });
}

} // namespace

std::vector<Polyline> readShapes(const std::string &path) {
  const Tables tables(path);
  const std::vector<double> x = tables.read("position", 3);
  const int n = int(x.size() / 3);
  const std::vector<int> offsets = offsetsOf(tables, "rod_vertex_offsets", n, 0, 2);
  std::vector<int> closed;
  if (tables.has("closed")) closed = tables.readWhole("closed", 1);
  const std::size_t rods = offsets.size() - 1;
  if (!closed.empty() && closed.size() != rods)
    throw SceneError(path + ": 'closed' must have one number per rod (" + std::to_string(rods) + "), found " +
                     std::to_string(closed.size()));
  for (std::size_t r = 0; r < closed.size(); ++r)
    if (closed[r] != 0 && closed[r] != 1) tables.fail("closed", r, "is neither 0 nor 1");
  std::vector<Polyline> lines(rods);
  std::size_t edges = 0;
  for (std::size_t r = 0; r < rods; ++r) {
    for (int v = offsets[r]; v < offsets[r + 1]; ++v)
      lines[r].points.emplace_back(x[3 * v], x[3 * v + 1], x[3 * v + 2]);
    lines[r].closed = r < closed.size() && closed[r] != 0;
    edges += lines[r].points.size() - (lines[r].closed ? 0 : 1);
  }
  if (tables.has("director")) {
    const std::vector<double> d = tables.read("director", 3);
    if (d.size() != 3 * edges)
      throw SceneError(path + ": 'director' must have a row for each of " + std::to_string(edges) + " edges, found " +
                       std::to_string(d.size() / 3));
    std::size_t row = 0;
    for (Polyline &line : lines)
      for (std::size_t e = 0; e < line.points.size() - (line.closed ? 0 : 1); ++e, ++row) {
        const Vec3 a(d[3 * row], d[3 * row + 1], d[3 * row + 2]);
        const Vec3 edge = line.points[(e + 1) % line.points.size()] - line.points[e];
        if (!a.allFinite() || std::abs(a.norm() - 1) > 1e-3) tables.fail("director", row, "is not of unit length");
        if (std::abs(a.dot(edge)) > 1e-3 * edge.norm()) tables.fail("director", row, "is not normal to its edge");
        line.directors.push_back(a);
      }
  }
  if (tables.has("skins/triangles") || tables.has("skins/edge")) readSkins(tables, lines);
  return lines;
}

SkinTables::SkinTables(const std::vector<Rod> &rods) {
  std::vector<Skin> skins;
  for (const Rod &rod : rods) width = std::max(width, skins.emplace_back(skinOf(rod)).width());
  for (const Skin &skin : skins) {
    for (const std::array<int, 3> &t : skin.triangles) triangles.insert(triangles.end(), t.begin(), t.end());
    for (const SkinPoint &p : skin.points)
      for (int k = 0; k < width; ++k) {
        const std::size_t from = std::size_t(k < p.edges ? k : 0);
        edge.push_back(p.edge[from]);
        weight.push_back(k < p.edges ? p.weight[from] : 0);
        local.insert(local.end(), p.local[from].data(), p.local[from].data() + 3);
      }
    point_offsets.push_back(point_offsets.back() + int(skin.points.size()));
    triangle_offsets.push_back(triangle_offsets.back() + int(skin.triangles.size()));
  }
}

void write(Hdf5File &file, const SkinTables &skins) {
  const hsize_t n = hsize_t(skins.point_offsets.back()), k = hsize_t(skins.width);
  file.createGroup("skins");
  file.write("skins/point_offsets", {skins.point_offsets.size()}, skins.point_offsets.data());
  file.write("skins/triangle_offsets", {skins.triangle_offsets.size()}, skins.triangle_offsets.data());
  file.write("skins/triangles", {hsize_t(skins.triangle_offsets.back()), 3}, skins.triangles.data());
  file.write("skins/edge", {n, k}, skins.edge.data());
  file.write("skins/weight", {n, k}, skins.weight.data(), "1");
  file.write("skins/local", {n, k, 3}, skins.local.data(), "m");
}

void checkShapesPath(const std::string &path, const std::vector<std::string> &inputs, const std::string &output_dir) {
  if (path.empty()) return;
  const std::string option = "option -output_shapes: '" + inOneLine(path) + "' ";
  const std::string extension = extensionOf(path);
  if (extension != ".json" && extension != ".h5" && extension != ".hdf5")
    throw SceneError(option + "is no file of shapes; its name ends in .h5, .hdf5 or .json");
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && folder != output_dir && !std::filesystem::is_directory(folder))
    throw SceneError(option + "is in a folder that is not there; make it first");
  std::error_code error;
  for (const std::string &input : inputs)
    if (std::filesystem::equivalent(path, input, error))
      throw SceneError(option + "is read by this run; choose another file");
  const std::string name = std::filesystem::path(path).filename().string();
  if ((name == "trajectory.h5" || name == "checkpoint.h5") &&
      (folder == output_dir || std::filesystem::equivalent(folder, output_dir, error)))
    throw SceneError(option + "has the name of a result of this run; choose another one");
}

void writeShapes(const std::string &path, const Scene &scene) {
  std::vector<double> position, director;
  std::vector<int> offsets{0}, closed;
  for (const Rod &rod : scene.rods) {
    for (const Vec3 &x : rod.position) position.insert(position.end(), x.data(), x.data() + 3);
    for (const Vec3 &d : rod.director) director.insert(director.end(), d.data(), d.data() + 3);
    offsets.push_back(offsets.back() + rod.vertices());
    closed.push_back(rod.closed);
  }
  const SkinTables skins(scene.rods);
  if (!isJson(path)) {
    Hdf5File file = Hdf5File::create(path);
    file.write("position", {position.size() / 3, 3}, position.data(), "m");
    file.write("rod_vertex_offsets", {offsets.size()}, offsets.data());
    file.write("closed", {closed.size()}, closed.data());
    file.write("director", {director.size() / 3, 3}, director.data(), "1");
    if (!skins.empty()) write(file, skins);
    return file.close();
  }
  std::ofstream out(path);
  const std::size_t k = std::size_t(skins.width);
  out << "{\"position\": " << rowsOf(position, 3, 1, exact) << ",\n \"rod_vertex_offsets\": " << wholeRows(offsets, 1)
      << ",\n \"closed\": " << wholeRows(closed, 1) << ",\n \"director\": " << rowsOf(director, 3, 1, exact);
  if (!skins.empty())
    out << ",\n \"skins\": {\n  \"point_offsets\": " << wholeRows(skins.point_offsets, 1)
        << ",\n  \"triangle_offsets\": " << wholeRows(skins.triangle_offsets, 1)
        << ",\n  \"triangles\": " << wholeRows(skins.triangles, 3) << ",\n  \"edge\": " << wholeRows(skins.edge, k)
        << ",\n  \"weight\": " << rowsOf(skins.weight, k, 1, exact)
        << ",\n  \"local\": " << rowsOf(skins.local, 3 * k, 3, exact) << "}";
  out << "}\n";
  out.close();
  if (!out) throw WriteError(path + ": cannot be written; is there room, and may one write there?");
}

} // namespace tendril
