/// The rods of a scene file: their shapes, directors, materials and copies.
#include "tendril/io/rod_reader.hpp"

#include "tendril/geometry/rotation.hpp"
#include "tendril/io/collider_reader.hpp"
#include "tendril/io/polyline_reader.hpp"
#include "tendril/io/skin_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/text.hpp"
#include "tendril/model/builders.hpp"

#include <algorithm>
#include <filesystem>

namespace tendril {
namespace {

/// Shapes a rod block may give; exactly one must be there.
std::vector<Polyline> readShape(YamlMap &rod, double *least_edges) {
  std::vector<Polyline> shapes;
  int given = 0;
  if (rod.has("rods[].line") && ++given) {
    YamlMap m(rod.at("rods[].line"), "rods[].line");
    shapes = {lineShape(m.vector("rods[].line.from"), m.vector("rods[].line.to"), m.integer("rods[].line.edges"))};
    m.finish();
  }
  if (rod.has("rods[].ring") && ++given) {
    YamlMap m(rod.at("rods[].ring"), "rods[].ring");
    shapes = {ringShape(m.vector("rods[].ring.center"), unit(m.at("rods[].ring.normal")),
                        m.number("rods[].ring.radius"), m.integer("rods[].ring.edges"))};
    m.finish();
  }
  if (rod.has("rods[].helix") && ++given) {
    YamlMap m(rod.at("rods[].helix"), "rods[].helix");
    HelixShape h;
    h.origin = m.vector("rods[].helix.origin");
    h.axis = unit(m.at("rods[].helix.axis"));
    h.start = m.has("rods[].helix.start") ? unit(m.at("rods[].helix.start")) : anyNormal(h.axis);
    if (std::abs(h.start.dot(h.axis)) > 1e-6)
      m.at("rods[].helix.start")
          .fail("'start' must be normal to 'axis', found a cosine of " + std::to_string(h.start.dot(h.axis)));
    h.length = m.number("rods[].helix.length");
    h.radius = m.number("rods[].helix.radius");
    h.turns = m.number("rods[].helix.turns");
    h.taper = m.number("rods[].helix.taper");
    h.edges = m.integer("rods[].helix.edges");
    *least_edges = h.leastEdges();
    if (h.edges < h.leastEdges())
      m.at("rods[].helix.edges")
          .fail("a helix of " + shortText(h.turns) + " turns needs at least " + shortText(h.leastEdges()) +
                " edges, found " + std::to_string(h.edges));
    shapes = {helixShape(h)};
    m.finish();
  }
  if (rod.has("rods[].points") && ++given) {
    Polyline p;
    for (const YamlValue &v : rod.at("rods[].points").items()) p.points.push_back(v.vector());
    shapes = {p};
  }
  if (rod.has("rods[].file") && ++given) {
    const YamlValue v = rod.at("rods[].file");
    const std::filesystem::path path(v.text());
    if (path.string() != inOneLine(path.string()))
      v.fail("'file' must be in one line, found '" + inOneLine(path.string()) + "'");
    try {
      shapes = readPolylines(path.is_absolute() ? path.string()
                                                : (std::filesystem::path(v.file()).parent_path() / path).string());
    } catch (const SceneError &e) {
      v.fail(e.what());
    }
  }
  if (given != 1)
    rod.value().fail("a rod needs exactly one shape: line, ring, helix, points or file; found " +
                     std::to_string(given));
  return shapes;
}

void place(const YamlValue &value, std::vector<Polyline> &shapes) {
  YamlMap map(value, "rods[].place");
  const double scale = map.number("rods[].place.scale");
  const Vec3 rotation = map.vector("rods[].place.rotation"), translation = map.vector("rods[].place.translation");
  map.finish();
  const Mat3 turn = rotationBy(rotation);
  auto placed = [=](const Vec3 &x) { return Vec3(turn * (scale * x) + translation); };
  for (Polyline &shape : shapes) {
    for (Vec3 &x : shape.points) x = placed(x);
    for (Vec3 &d : shape.directors) d = turn * d;
    if (shape.skin) {
      auto skin = std::make_shared<Skin>(*shape.skin);
      for (SkinPoint &point : skin->points)
        for (Vec3 &local : point.local) local *= scale;
      shape.skin = skin;
    }
    if (shape.curve) shape.curve = [placed, curve = shape.curve](double s) { return placed(curve(s)); };
  }
}

/// \param of_file those that the shape has in its file
void readDirectors(YamlMap &map, const std::vector<Vec3> &of_file, Rod &rod) {
  if (map.has("rods[].directors")) {
    const YamlValue list = map.at("rods[].directors");
    const auto items = list.items();
    if (int(items.size()) != rod.edges())
      list.fail("'directors' must have one vector per edge (" + std::to_string(rod.edges()) + "), found " +
                std::to_string(items.size()));
    for (int i = 0; i < rod.edges(); ++i) {
      const Vec3 d = unit(items[i]), t = rod.edge(i).normalized();
      if (std::abs(d.dot(t)) > 1e-6)
        items[i].fail("director " + std::to_string(i) + " is not normal to its edge (cosine " +
                      std::to_string(d.dot(t)) + "); take away its part along the edge");
      rod.director.push_back(orthonormalised(d, t));
    }
    return;
  }
  Vec3 start = Vec3::Zero();
  if (!of_file.empty()) {
    if (int(of_file.size()) != rod.edges())
      map.value().fail("the file has directors of " + std::to_string(of_file.size()) + " edges, and the rod has " +
                       std::to_string(rod.edges()) + "; close it in the file, or write 'directors'");
    if (map.has("rods[].director"))
      map.at("rods[].director").fail("the file has directors of its own; take 'director' away, or write 'directors'");
    for (int i = 0; i < rod.edges(); ++i) { // what is normal to rounding stays as it is
      const Vec3 &d = of_file[std::size_t(i)], clean = orthonormalised(d, rod.edge(i).normalized());
      rod.director.push_back((clean - d).norm() < 1e-14 ? d : clean);
    }
    return;
  }
  if (map.has("rods[].director")) {
    const YamlValue v = map.at("rods[].director");
    start = unit(v);
    const double cosine = start.dot(rod.edge(0).normalized());
    if (std::abs(cosine) > 1e-6)
      v.fail("'director' is not normal to the first edge (cosine " + std::to_string(cosine) +
             "); take away its part along the edge");
  }
  setBishopDirectors(rod, start);
}

void readNatural(YamlMap &map, Rod &rod) {
  const YamlValue v = map.at("rods[].natural");
  if (v.isMap()) {
    YamlMap m(v, "rods[].natural");
    rod.natural = Rod::Natural::given;
    const std::array<double, 2> curvature = m.pair("rods[].natural.curvature");
    rod.natural_strain = Vec3(curvature[0], curvature[1], m.number("rods[].natural.twist"));
    m.finish();
  } else if (map.word("rods[].natural") == "straight")
    rod.natural = Rod::Natural::given;
}

/// Name of a rod, by which supports and loads may find it without doubt.
std::string readName(YamlMap &map, const RodNames &names) {
  if (!map.has("rods[].name")) {
    const std::string name = "rod" + std::to_string(names.count());
    if (names.isTaken(name))
      map.value().fail("a rod without a name is '" + name + "', and there is one already; give this rod a 'name'");
    return name;
  }
  const YamlValue v = map.at("rods[].name");
  const std::string name = v.text();
  if (name.empty() || name == "all" || name.find_first_not_of("0123456789") == std::string::npos)
    v.fail("'name' must not be empty, a number or 'all', found '" + name + "'");
  if (std::any_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }))
    v.fail("'name' must be in one line, found '" + inOneLine(name) + "'");
  if (names.isTaken(name)) v.fail("there is a rod '" + name + "' already; choose another 'name'");
  return name;
}

struct Copies {
  int count = 1;
  Vec3 offset = Vec3::Zero(); ///< from one to the next [m]
};

/// One of the rods of a block: a shape, moved. \param rod all but that, and `closed` as written \param skin its mesh is
/// moved, too
void addRod(YamlMap &map, Rod rod, const Polyline &shape, const Vec3 &shift, double least_edges, const SkinRecipe &skin,
            SceneFile &out) {
  const bool by_one_more_edge = rod.closed && !shape.closed; // to us such a curve is points
  rod.position = shape.points;
  rod.closed = shape.closed || rod.closed;
  for (Vec3 &x : rod.position) x += shift;
  try {
    checkRod(rod);
  } catch (const SceneError &e) {
    map.value().fail(e.what());
  }
  readDirectors(map, shape.directors, rod);
  if (rod.closed && rod.initial_turns != std::round(rod.initial_turns))
    map.at("rods[].turns").fail("'turns' of a closed rod must be a whole number, or its ends do not meet");
  if (rod.material.isCable() && rod.initial_turns != 0)
    map.at("rods[].turns").fail("a rod without flexural stiffness has no twist");
  Drawing &drawing = out.drawings.emplace_back();
  drawing.directors_given = map.has("rods[].directors") || !shape.directors.empty();
  drawing.least_edges = least_edges;
  if (shape.curve && !by_one_more_edge)
    drawing.curve = [curve = shape.curve, shift](double s) { return Vec3(curve(s) + shift); };
  if (shape.skin && !map.has("rods[].skin"))
    giveSkin(map, shape.skin, rod, out);
  else
    putSkin(map, skin, shift, rod, out);
  out.names.add(rod.name);
  out.scene.rods.push_back(std::move(rod));
}

} // namespace

void readRod(const YamlValue &value, const Overrides &overrides, SceneFile &out, RodBlocks &sums) {
  YamlMap map(value, "rods");
  const std::string name = readName(map, out.names);
  double least_edges = 1;
  std::vector<Polyline> shapes = readShape(map, &least_edges);
  if (map.has("rods[].place")) place(map.at("rods[].place"), shapes);
  Rod common;
  common.name = name;
  const MaterialRead material = readMaterial(map, overrides);
  common.material = material.material;
  if (!material.defaults.empty()) sums.defaults[material.defaults].push_back(name);
  auto word = [&](KeyOf<KeyType::word, KeyType::word_or_map> key) { // of the scene, or of the option in its place
    const std::string written = map.word(key), name(key->name());
    const auto o = overrides.find(name);
    return o == overrides.end() ? written : YamlValue(YAML::Node(o->second), "option -rod_" + name, name).word(*key);
  };
  const std::string model = word("rods[].model");
  common.chooses_model = model == "auto";
  for (const RodModel m : {RodModel::cable, RodModel::planar, RodModel::torsion_free})
    if (model == nameOf(m)) common.model = m;
  if (common.model == RodModel::cable)
    common.left_out = std::exchange(common.material.flexural_stiffness, std::array{0.0, 0.0});
  common.measure = word("rods[].measure") == "tan" ? Measure::tan : Measure::angle;
  common.energy = word("rods[].energy") == "seed" ? Energy::seed : Energy::classical;
  common.gravity = map.flag("rods[].gravity");
  common.initial_velocity = map.vector("rods[].velocity");
  common.initial_turns = map.number("rods[].turns");
  readNatural(map, common);
  common.closed = map.flag("rods[].closed");
  if (map.has("rods[].layer")) common.layer = readName(map.at("rods[].layer"));
  common.contact = sums.contact;
  readContact(map, common.contact);
  const SkinRecipe skin = readSkin(map, int(shapes.size()), common.material);
  Copies copies;
  if (map.has("rods[].copies")) {
    YamlMap m(map.at("rods[].copies"), "rods[].copies");
    copies.count = m.integer("rods[].copies.count");
    copies.offset = m.vector("rods[].copies.offset");
    m.finish();
  }
  for (const Polyline &shape : shapes) sums.vertices += double(copies.count) * double(shape.points.size());
  if (sums.vertices > 1e8)
    value.fail("this makes " + std::to_string(std::int64_t(sums.vertices)) + " vertices; a scene may have 1e8");
  for (const Polyline &shape : shapes)
    if (shape.closed && map.has("rods[].closed") && !common.closed)
      map.at("rods[].closed").fail("'closed: false' contradicts the shape, which is closed");
  for (int copy = 0; copy < copies.count; ++copy)
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      Rod rod = common;
      if (shapes.size() > 1) rod.name += "." + std::to_string(k);
      if (copies.count > 1) rod.name += "#" + std::to_string(copy);
      addRod(map, std::move(rod), shapes[k], Vec3(double(copy) * copies.offset), least_edges, skin, out);
    }
  map.finish();
}

} // namespace tendril
