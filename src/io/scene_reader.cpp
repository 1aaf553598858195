#include "tendril/io/scene_reader.hpp"

#include "tendril/io/polyline_reader.hpp"
#include "tendril/io/yaml.hpp"
#include "tendril/model/builders.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace tendril {
namespace {

Vec3 unit(const YamlValue &value) {
  const Vec3 v = value.vector();
  if (v.norm() == 0) value.fail("'" + value.name() + "' must not be zero");
  return v.normalized();
}

/// Shapes a rod block may give; exactly one must be there.
std::vector<Polyline> readShape(YamlMap &rod) {
  std::vector<Polyline> shapes;
  int given = 0;
  if (rod.has("line") && ++given) {
    YamlMap m(rod.at("line"));
    shapes = {lineShape(m.at("from").vector(), m.at("to").vector(), m.at("edges").integer(1))};
    m.finish();
  }
  if (rod.has("ring") && ++given) {
    YamlMap m(rod.at("ring"));
    shapes = {ringShape(m.vector("center", Vec3::Zero()), m.has("normal") ? unit(m.at("normal")) : Vec3::UnitZ(), m.at("radius").positive(),
                        m.at("edges").integer(3))};
    m.finish();
  }
  if (rod.has("helix") && ++given) {
    YamlMap m(rod.at("helix"));
    HelixShape h;
    h.origin = m.vector("origin", Vec3::Zero());
    h.axis = m.has("axis") ? unit(m.at("axis")) : Vec3::UnitX();
    h.start = m.has("start") ? unit(m.at("start")) : anyNormal(h.axis);
    if (std::abs(h.start.dot(h.axis)) > 1e-6) m.at("start").fail("'start' must be normal to 'axis', found a cosine of " + std::to_string(h.start.dot(h.axis)));
    h.length = m.at("length").positive();
    h.radius = m.at("radius").positive();
    h.turns = m.at("turns").number();
    h.taper = m.has("taper") ? m.at("taper").notNegative() : 0;
    if (h.taper > 0.5) m.at("taper").fail("'taper' must be at most 0.5: it is taken off both ends");
    h.edges = m.at("edges").integer(2);
    shapes = {helixShape(h)};
    m.finish();
  }
  if (rod.has("points") && ++given) {
    Polyline p;
    for (const YamlValue &v : rod.at("points").items()) p.points.push_back(v.vector());
    shapes = {p};
  }
  if (rod.has("file") && ++given) {
    const YamlValue v = rod.at("file");
    const std::filesystem::path path(v.text());
    try {
      shapes = readPolylines(path.is_absolute() ? path.string() : (std::filesystem::path(v.file()).parent_path() / path).string());
    } catch (const SceneError &e) {
      v.fail(e.what());
    }
  }
  if (given != 1) rod.value().fail("a rod needs exactly one shape: line, ring, helix, points or file; found " + std::to_string(given));
  return shapes;
}

void readDirectors(YamlMap &map, Rod &rod) {
  if (map.has("directors")) {
    const YamlValue list = map.at("directors");
    const auto items = list.items();
    if (int(items.size()) != rod.edges())
      list.fail("'directors' must have one vector per edge (" + std::to_string(rod.edges()) + "), found " + std::to_string(items.size()));
    for (int i = 0; i < rod.edges(); ++i) {
      const Vec3 d = unit(items[i]), t = rod.edge(i).normalized();
      if (std::abs(d.dot(t)) > 1e-6)
        items[i].fail("director " + std::to_string(i) + " is not normal to its edge (cosine " + std::to_string(d.dot(t)) +
                      "); take away its part along the edge");
      rod.director.push_back(orthonormalised(d, t));
    }
    return;
  }
  Vec3 start = Vec3::Zero();
  if (map.has("director")) {
    const YamlValue v = map.at("director");
    start = unit(v);
    const double cosine = start.dot(rod.edge(0).normalized());
    if (std::abs(cosine) > 1e-6)
      v.fail("'director' is not normal to the first edge (cosine " + std::to_string(cosine) + "); take away its part along the edge");
  }
  setBishopDirectors(rod, start);
}

/// Rods of one block of the scene share its name and add a number.
bool isNamed(const Rod &rod, const std::string &name) { return rod.name == name || rod.name.rfind(name + ".", 0) == 0 || rod.name.rfind(name + "#", 0) == 0; }

void readNatural(YamlMap &map, Rod &rod) {
  if (!map.has("natural")) return;
  const YamlValue v = map.at("natural");
  if (v.isMap()) {
    YamlMap m(v);
    rod.natural = Rod::Natural::given;
    if (m.has("curvature")) {
      const std::vector<double> k = m.at("curvature").numbers(2);
      rod.natural_strain.head<2>() = Eigen::Vector2d(k[0], k[1]);
    }
    rod.natural_strain[2] = m.number("twist", 0);
    m.finish();
  } else if (v.oneOf({"as_drawn", "straight"}) == "straight")
    rod.natural = Rod::Natural::given;
}

/// Name of a rod, by which supports and loads may find it without doubt.
std::string readName(YamlMap &map, const std::vector<Rod> &rods) {
  if (!map.has("name")) return "rod" + std::to_string(rods.size());
  const YamlValue v = map.at("name");
  const std::string name = v.text();
  if (name.empty() || name == "all" || name.find_first_not_of("0123456789") == std::string::npos)
    v.fail("'name' must not be empty, a number or 'all', found '" + name + "'");
  for (const Rod &rod : rods)
    if (isNamed(rod, name)) v.fail("there is a rod '" + name + "' already; choose another 'name'");
  return name;
}

void readRod(const YamlValue &value, const Overrides &overrides, std::vector<Rod> &rods, std::vector<Drawing> &drawings) {
  YamlMap map(value);
  const std::string name = readName(map, rods);
  const std::vector<Polyline> shapes = readShape(map);
  Rod common;
  if (map.has("material")) {
    YamlMap material(map.at("material"));
    common.material = readMaterial(material, overrides);
  } else {
    YamlMap material(YamlValue(YAML::Load("{}"), value.file(), "material"));
    common.material = readMaterial(material, overrides);
  }
  std::string measure = map.has("measure") ? map.at("measure").oneOf({"tan", "angle"}) : "tan";
  if (const auto o = overrides.find("measure"); o != overrides.end())
    measure = YamlValue(YAML::Node(o->second), "option -rod_measure", "measure").oneOf({"tan", "angle"});
  common.measure = measure == "tan" ? Measure::tan : Measure::angle;
  common.gravity = !map.has("gravity") || map.at("gravity").boolean();
  common.initial_velocity = map.vector("velocity", Vec3::Zero());
  common.initial_turns = map.number("turns", 0);
  readNatural(map, common);
  const bool closed = map.has("closed") && map.at("closed").boolean();
  int copies = 1;
  Vec3 offset = Vec3::Zero();
  if (map.has("copies")) {
    YamlMap m(map.at("copies"));
    copies = m.at("count").integer(1);
    offset = m.at("offset").vector();
    m.finish();
  }
  double vertices = 0;
  for (const Polyline &shape : shapes) vertices += double(copies) * double(shape.points.size());
  if (vertices > 1e8) value.fail("this makes " + std::to_string(std::int64_t(vertices)) + " vertices; a scene may have 1e8");
  for (const Polyline &shape : shapes)
    if (shape.closed && map.has("closed") && !closed) map.at("closed").fail("'closed: false' contradicts the shape, which is closed");
  for (int copy = 0; copy < copies; ++copy)
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      Rod rod = common;
      rod.name = name;
      if (shapes.size() > 1) rod.name += "." + std::to_string(k);
      if (copies > 1) rod.name += "#" + std::to_string(copy);
      rod.position = shapes[k].points;
      rod.closed = shapes[k].closed || closed;
      for (Vec3 &x : rod.position) x += double(copy) * offset;
      try {
        checkRod(rod);
      } catch (const SceneError &e) {
        value.fail(e.what());
      }
      readDirectors(map, rod);
      if (rod.closed && rod.initial_turns != std::round(rod.initial_turns))
        map.at("turns").fail("'turns' of a closed rod must be a whole number, or its ends do not meet");
      if (rod.material.isCable() && rod.initial_turns != 0) map.at("turns").fail("a rod without flexural stiffness has no twist");
      rods.push_back(rod);
      Drawing &drawing = drawings.emplace_back();
      drawing.directors_given = map.has("directors");
      if (rod.closed == shapes[k].closed && shapes[k].curve) // a curve that `closed` closes by one more edge is points to us
        drawing.curve = [curve = shapes[k].curve, shift = Vec3(double(copy) * offset)](double s) { return Vec3(curve(s) + shift); };
    }
  map.finish();
}

/// Rods a support or load speaks of: a name, a number, or `all`.
std::vector<int> readTargets(YamlMap &map, const std::vector<Rod> &rods) {
  std::vector<int> found;
  if (!map.has("rod")) {
    if (rods.size() > 1) map.value().fail("say which 'rod' is meant: a name, a number from 0, or all");
    return {0};
  }
  const YamlValue v = map.at("rod");
  const std::string word = v.text();
  for (std::size_t r = 0; r < rods.size(); ++r) {
    if (word == "all" || isNamed(rods[r], word) || std::to_string(r) == word) found.push_back(int(r));
  }
  if (found.empty()) v.fail("there is no rod '" + word + "'; write the name of a rod, its number from 0 to " + std::to_string(rods.size() - 1) + ", or all");
  return found;
}

int readIndex(const YamlValue &v, int count, const std::string &rod) {
  if (v.isScalar() && v.node().Scalar() == "last") return count - 1;
  const int i = v.integer(0);
  if (i >= count)
    v.fail("'" + v.name() + "' " + std::to_string(i) + " is out of range: rod '" + rod + "' has " + std::to_string(count) + ", numbered 0 to " +
           std::to_string(count - 1));
  return i;
}

Motion readMotion(const YamlValue &value) {
  YamlMap map(value);
  Motion m;
  m.velocity = map.vector("velocity", Vec3::Zero());
  m.angular_velocity = map.vector("angular_velocity", Vec3::Zero());
  if (!map.has("velocity") && !map.has("angular_velocity") && !map.has("table"))
    value.fail("'motion' needs 'velocity' and/or 'angular_velocity', or a 'table'");
  if (map.has("table")) {
    if (map.has("velocity") || map.has("angular_velocity")) value.fail("'motion' takes a 'table' or velocities, not both");
    for (const YamlValue &row : map.at("table").items()) {
      const std::size_t n = row.node().size();
      if (n != 4 && n != 7) row.fail("a row of 'table' is [time, dx, dy, dz] or [time, dx, dy, dz, rx, ry, rz]");
      const std::vector<double> v = row.numbers(n);
      m.table.push_back({v[0], Vec3(v[1], v[2], v[3]), n == 7 ? Vec3(v[4], v[5], v[6]) : Vec3(Vec3::Zero())});
      if (m.table.size() > 1 && m.table[m.table.size() - 2].time >= v[0])
        row.fail("the times of 'table' must increase, found " + std::to_string(v[0]) + " after " + std::to_string(m.table[m.table.size() - 2].time));
    }
    if (m.table.empty()) value.fail("'table' is empty");
  }
  map.finish();
  return m;
}

void readSupport(const YamlValue &value, Scene &scene) {
  YamlMap map(value);
  const std::string type = map.at("type").oneOf({"clamp", "pin", "fix_twist"});
  for (const int r : readTargets(map, scene.rods)) {
    const Rod &rod = scene.rods[r];
    Support s{};
    s.kind = type == "clamp" ? Support::Kind::clamp : type == "pin" ? Support::Kind::pin : Support::Kind::fix_twist;
    s.rod = r;
    s.vertex = readIndex(map.at("vertex"), rod.vertices(), rod.name);
    for (const Support &other : scene.supports)
      if (other.rod == r && other.vertex == s.vertex && ((other.holdsPosition() && s.holdsPosition()) || (other.holdsTwist() && s.holdsTwist())))
        value.fail("vertex " + std::to_string(s.vertex) + " of rod '" + rod.name + "' is held twice");
    s.frame = frameAtVertex(rod, s.vertex);
    if (type != "pin") {
      s.tangent_given = map.has("tangent");
      s.director_given = map.has("director");
      if (s.tangent_given) s.frame.tangent = unit(map.at("tangent"));
      s.frame.director = orthonormalised(s.frame.director, s.frame.tangent);
      if (s.director_given) {
        const YamlValue d = map.at("director");
        const Vec3 v = unit(d);
        if (std::abs(v.dot(s.frame.tangent)) > 1e-6) d.fail("'director' is not normal to the tangent of the support");
        s.frame.director = v;
      }
      if (!s.frame.director.allFinite()) value.fail("'tangent' is parallel to the rod's director; give a 'director' too");
    }
    if (type == "fix_twist" && rod.material.isCable()) value.fail("rod '" + rod.name + "' has no flexural stiffness and no twist to fix");
    if (map.has("motion")) {
      const YamlValue motion = map.at("motion");
      s.motion = readMotion(motion);
      const auto turns = [](const Motion::Key &k) { return !k.rotation.isZero(0); };
      const auto travels = [](const Motion::Key &k) { return !k.displacement.isZero(0); };
      const auto &table = s.motion.table;
      if (type == "pin" && (!s.motion.angular_velocity.isZero(0) || std::any_of(table.begin(), table.end(), turns)))
        motion.fail("a pin holds no rotation; take it away or write 'type: clamp'");
      if (type == "fix_twist" && (!s.motion.velocity.isZero(0) || std::any_of(table.begin(), table.end(), travels)))
        motion.fail("fix_twist holds no position; take the displacement away or add a pin that moves");
    }
    scene.supports.push_back(s);
  }
  map.finish();
}

void readLoad(const YamlValue &value, Scene &scene) {
  YamlMap map(value);
  for (const int r : readTargets(map, scene.rods)) {
    const Rod &rod = scene.rods[r];
    if (map.has("force")) {
      scene.forces.push_back({r, readIndex(map.at("vertex"), rod.vertices(), rod.name), map.at("force").vector()});
    } else if (map.has("torque") || map.has("moment")) {
      if (rod.material.isCable()) value.fail("rod '" + rod.name + "' has no flexural stiffness: it cannot carry a torque or moment");
      EdgeMoment m{r, readIndex(map.at("edge"), rod.edges(), rod.name), 0, Vec3::Zero()};
      if (map.has("torque")) m.torque = map.at("torque").number();
      if (map.has("moment")) m.moment = map.at("moment").vector();
      scene.moments.push_back(m);
    } else
      value.fail("a load needs 'vertex' and 'force', or 'edge' and 'torque' or 'moment'");
  }
  map.finish();
}

void readRun(const YamlValue &value, RunSettings &run) {
  YamlMap map(value);
  if (map.has("mode")) run.mode = map.at("mode").oneOf({"dynamic", "static"});
  if (map.has("dt")) run.dt = map.at("dt").positive();
  if (map.has("t_end")) run.t_end = map.at("t_end").positive();
  if (map.has("load_steps")) run.load_steps = map.at("load_steps").integer(1);
  map.finish();
}

std::string contentOf(const std::filesystem::path &path, const std::string &mistake) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw SceneError(path.string() + mistake);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The polyline files of the rods; HDF5 files are no text.
void keepFiles(const YamlValue &rods, SceneSource &source) {
  for (const YamlValue &rod : rods.items()) {
    const YAML::Node node = rod.node()["file"];
    if (!node) continue;
    const std::string path = node.Scalar();
    const std::filesystem::path place = std::filesystem::path(rods.file()).parent_path() / path;
    const bool seen = std::any_of(source.files.begin(), source.files.end(), [&](const auto &file) { return file.first == path; });
    if (!seen && isTextPolyline(place.string())) source.files.emplace_back(path, contentOf(place, ": cannot be read again"));
  }
}

} // namespace

SceneFile readScene(const std::string &path, const Overrides &overrides) {
  YAML::Node root;
  SceneFile out;
  try {
    if (std::filesystem::is_directory(path)) throw SceneError(path + ": is a folder; give a scene file with -scene");
    out.source.text = contentOf(path, ": cannot be opened; give an existing scene file with -scene");
    const std::vector<YAML::Node> documents = YAML::LoadAll(out.source.text);
    if (documents.empty() || documents[0].IsNull()) throw SceneError(path + ":1: is empty; a scene needs at least 'rods'");
    if (documents.size() > 1) throw SceneError(path + ":" + std::to_string(documents[1].Mark().line + 1) + ": a second document begins here; a scene is one");
    root = documents[0];
  } catch (const YAML::Exception &e) {
    throw SceneError(path + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
  YamlMap map(YamlValue(root, path, "scene"));
  out.scene.gravity = map.vector("gravity", Vec3(0, -9.81, 0));
  if (map.has("rotation")) {
    YamlMap rotation(map.at("rotation"));
    out.scene.rotation.angular_velocity = rotation.at("angular_velocity").vector();
    out.scene.rotation.centre = rotation.vector("centre", Vec3::Zero());
    rotation.finish();
  }
  if (map.has("simulation")) readRun(map.at("simulation"), out.run);
  for (const YamlValue &v : map.at("rods").items()) readRod(v, overrides, out.scene.rods, out.drawings);
  if (out.scene.rods.empty()) map.at("rods").fail("a scene needs at least one rod");
  if (map.has("supports"))
    for (const YamlValue &v : map.at("supports").items()) readSupport(v, out.scene);
  if (map.has("loads"))
    for (const YamlValue &v : map.at("loads").items()) readLoad(v, out.scene);
  map.finish();
  keepFiles(map.at("rods"), out.source);
  return out;
}

} // namespace tendril
