#include "tendril/io/tendon_reader.hpp"

#include "tendril/energy/tendon.hpp"
#include "tendril/geometry/wrap.hpp"
#include "tendril/io/body_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/text.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// An entry of a path: one of these, by its number.
struct Entry {
  enum class Kind { point, joint, wrap } kind;
  int index;
};

std::string placeText(const Vec3 &x) {
  return "(" + shortText(x[0]) + ", " + shortText(x[1]) + ", " + shortText(x[2]) + ") m";
}

std::string entry(std::size_t k) { return "entry " + std::to_string(k) + " of the path"; }

/// The body that a key names, or none for the world.
std::optional<SceneFile::BodyPlace> readBearer(const YamlValue &value, const SceneFile &file) {
  if (value.text() == "world") return std::nullopt;
  return findBody(value, file);
}

void refuse(YamlMap &map, std::initializer_list<AnyKey> keys, const std::string &reason) {
  for (const AnyKey key : keys)
    if (map.has(key)) map.at(key).fail("'" + std::string(key->name()) + "' " + reason + "; take it away");
}

Waypoint readBodyPoint(YamlMap &map, const SceneFile &file) {
  const auto place = readBearer(map.at("tendons[].path[].body"), file);
  if (!place && !map.has("tendons[].path[].point"))
    map.at("tendons[].path[].body").fail("a point of the world needs its 'point'");
  Waypoint p;
  p.point = map.has("tendons[].path[].point") ? map.vector("tendons[].path[].point") : file.bodyAt(*place).position;
  if (place && !place->held) p.body = place->index;
  if (place && place->held) {
    const Body &holder = file.bodyAt(*place);
    p.motion = holder.motion.at(p.point - holder.position);
  }
  return p;
}

Waypoint readRodPoint(YamlMap &map, const SceneFile &file) {
  const std::vector<int> rods = readTargets(map, "tendons[].path[].rod", file.names);
  if (rods.size() != 1)
    map.at("tendons[].path[].rod").fail("a point is on one rod, and these are " + std::to_string(rods.size()));
  const Rod &rod = file.scene.rods[std::size_t(rods.front())];
  Waypoint p;
  p.rod = rods.front();
  if (map.has("tendons[].path[].vertex") == map.has("tendons[].path[].edge"))
    map.value().fail("a point of a rod is a 'vertex', or the middle of an 'edge' with an 'offset'; give one of both");
  if (map.has("tendons[].path[].vertex")) {
    refuse(map, {"tendons[].path[].offset"}, "is for a point beside an 'edge'");
    p.setVertex(readIndex(map, "tendons[].path[].vertex", rod.vertices(), rod.name), rod.edges());
    return p;
  }
  p.edge = readIndex(map, "tendons[].path[].edge", rod.edges(), rod.name);
  p.at = 0.5;
  const std::array<double, 2> offset =
      map.has("tendons[].path[].offset") ? map.pair("tendons[].path[].offset") : std::array<double, 2>{0, 0};
  p.point = {0, offset[0], offset[1]};
  if (rod.material.isCable() && !p.point.isZero(0))
    map.at("tendons[].path[].offset")
        .fail("rod '" + rod.name + "' has no flexural stiffness and no frames that could carry points beside it");
  return p;
}

Tendon::Pull readCoordinate(YamlMap &map, const SceneFile &file) {
  const YamlValue value = map.at("tendons[].path[].joint");
  const std::string name = value.text();
  const std::vector<Joint> &joints = file.scene.joints;
  const auto found = std::find_if(joints.begin(), joints.end(), [&](const Joint &j) { return j.name == name; });
  if (found == joints.end()) {
    std::vector<std::string> names;
    for (const Joint &j : joints) names.push_back(j.name);
    const std::string near = closest(name, names);
    value.fail("there is no joint '" + inOneLine(name) + "'" + (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }
  if (!found->held().turnsFreely() && !found->held().slidesFreely())
    value.fail("joint '" + name + "' is of 'type: " + std::string(nameOf(found->type)) +
               "' and has no one coordinate; a tendon takes those of a hinge, prismatic, cylindrical or planar joint");
  const Tendon::Pull pull{int(found - joints.begin()), map.number("tendons[].path[].coefficient")};
  if (pull.coefficient == 0)
    map.at("tendons[].path[].coefficient").fail("'coefficient' must not be 0: the joint does nothing then");
  return pull;
}

Wrap readWrap(YamlMap &map, const SceneFile &file, bool sphere) {
  const AnyKey key = sphere ? AnyKey("tendons[].path[].sphere") : AnyKey("tendons[].path[].cylinder");
  const auto place = readBearer(map.at(key), file);
  Wrap wrap;
  wrap.sphere = sphere;
  if (place && !place->held) wrap.body = place->index;
  const Body *const body = place ? &file.bodyAt(*place) : nullptr;
  if (body && place->held && body->motion.moves())
    map.at(key).fail("body '" + body->name +
                     "' goes by its 'motion'; a tendon winds round bodies that are free or fixed: hold a free "
                     "one by a joint that a 'drive' moves");
  if (!body && !map.has("tendons[].path[].point")) map.at(key).fail("in the world it needs a 'point'");
  wrap.centre = map.has("tendons[].path[].point") ? map.vector("tendons[].path[].point") : body->position;
  const bool same = body && body->shape == (sphere ? "sphere" : "cylinder");
  if (!map.has("tendons[].path[].radius") && !same)
    map.at(key).fail("needs a 'radius'" +
                     (body ? ": body '" + body->name + "' is no " + (sphere ? "sphere" : "cylinder") : std::string()));
  wrap.radius = map.has("tendons[].path[].radius") ? map.number("tendons[].path[].radius") : body->size[0];
  if (sphere) refuse(map, {"tendons[].path[].axis", "tendons[].path[].side"}, "is for a cylinder");
  if (!sphere) {
    wrap.axis = map.has("tendons[].path[].axis") ? unit(map.at("tendons[].path[].axis"))
                : same                           ? Vec3(body->rotation.col(2))
                                                 : Vec3(Vec3::UnitZ());
    wrap.side = map.integer("tendons[].path[].side");
  }
  return wrap;
}

Entry readEntry(const YamlValue &value, const SceneFile &file, Tendon &out) {
  YamlMap map(value, "tendons[].path");
  map.refuseUnknown();
  const std::array<AnyKey, 5> kinds{"tendons[].path[].body", "tendons[].path[].rod", "tendons[].path[].joint",
                                    "tendons[].path[].cylinder", "tendons[].path[].sphere"};
  const auto given = std::count_if(kinds.begin(), kinds.end(), [&](AnyKey key) { return map.has(key); });
  if (given != 1)
    value.fail("each entry of a path is one of 'body', 'rod', 'joint', 'cylinder' and 'sphere', found " +
               std::to_string(given) + " of them");
  const bool of_body = map.has(kinds[0]), of_rod = map.has(kinds[1]), joint = map.has(kinds[2]),
             cylinder = map.has(kinds[3]), wraps = cylinder || map.has(kinds[4]);
  if (!of_body && !wraps) refuse(map, {"tendons[].path[].point"}, "is for a body, cylinder or sphere");
  if (!of_rod)
    refuse(map, {"tendons[].path[].vertex", "tendons[].path[].edge", "tendons[].path[].offset"}, "is for a rod");
  if (!joint) refuse(map, {"tendons[].path[].coefficient"}, "is for a joint");
  if (!wraps)
    refuse(map, {"tendons[].path[].radius", "tendons[].path[].axis", "tendons[].path[].side"},
           "is for a cylinder or sphere");
  Entry entry{Entry::Kind::point, int(out.points.size())};
  if (of_body)
    out.points.push_back(readBodyPoint(map, file));
  else if (of_rod)
    out.points.push_back(readRodPoint(map, file));
  else if (joint) {
    entry = {Entry::Kind::joint, int(out.joints.size())};
    out.joints.push_back(readCoordinate(map, file));
  } else {
    entry = {Entry::Kind::wrap, int(out.wraps.size())};
    out.wraps.push_back(readWrap(map, file, !cylinder));
  }
  if (joint) refuse(map, {"tendons[].path[].friction"}, "is for a point, cylinder or sphere");
  const double friction =
      map.has("tendons[].path[].friction") ? map.number("tendons[].path[].friction") : -1; // not said
  if (entry.kind == Entry::Kind::point) out.points.back().friction = friction;
  if (entry.kind == Entry::Kind::wrap) out.wraps.back().friction = friction;
  map.finish();
  return entry;
}

/// Segments between points that follow each other, past what they wind round.
void connect(const std::vector<YamlValue> &values, const std::vector<Entry> &path, Tendon &out) {
  auto isPoint = [&](std::size_t k) { return k < path.size() && path[k].kind == Entry::Kind::point; };
  std::vector<char> used(out.points.size(), false);
  for (std::size_t k = 0; k < path.size(); ++k) {
    if (path[k].kind == Entry::Kind::joint) out.joints[std::size_t(path[k].index)].after = int(out.segments.size());
    if (path[k].kind == Entry::Kind::wrap && !(k > 0 && isPoint(k - 1) && isPoint(k + 1)))
      values[k].fail(entry(k) +
                     " must stand between two points, that before and that behind what the tendon winds round");
    if (!isPoint(k)) continue;
    const bool winds = k + 1 < path.size() && path[k + 1].kind == Entry::Kind::wrap;
    const std::size_t next = k + (winds ? 2 : 1);
    if (!isPoint(next)) continue;
    out.segments.push_back({path[k].index, path[next].index, winds ? path[k + 1].index : -1});
    used[std::size_t(path[k].index)] = used[std::size_t(path[next].index)] = true;
  }
  for (std::size_t k = 0; k < path.size(); ++k)
    if (isPoint(k) && !used[std::size_t(path[k].index)])
      values[k].fail(
          entry(k) +
          " is a point by itself; a straight part lies between two points that follow each other in the list");
}

/// Friction where it runs over something; that of the tendon where a place has none of its own.
void readFriction(YamlMap &map, const std::vector<YamlValue> &values, const std::vector<Entry> &path, double length,
                  Tendon &out) {
  const double all = map.number("tendons[].friction");
  std::vector<char> passes(out.points.size(), false); // the tendon goes on behind it
  for (std::size_t n = 0; n + 1 < out.segments.size(); ++n)
    if (out.segments[n + 1].from == out.segments[n].to) passes[std::size_t(out.segments[n].to)] = true;
  for (std::size_t k = 0; k < path.size(); ++k) {
    const bool point = path[k].kind == Entry::Kind::point;
    if (path[k].kind == Entry::Kind::joint) continue;
    const auto index = std::size_t(path[k].index);
    double &friction = point ? out.points[index].friction : out.wraps[index].friction;
    const bool own = friction >= 0, ends = point && !passes[index];
    if (own && ends && friction > 0)
      values[k].fail(entry(k) + " is an end of a straight part with none behind it, where the tendon does not slide; "
                                "take its 'friction' away");
    if (!own) friction = ends ? 0 : all;
  }
  if (map.has("tendons[].slip_length") && out.rubs().empty())
    map.at("tendons[].slip_length").fail("'slip_length' is for a tendon with 'friction'");
  if (all > 0 && out.rubs().empty())
    map.at("tendons[].friction")
        .fail("there is nothing that it rubs on: no point between two others, no cylinder and no sphere");
  out.slip_length = map.has("tendons[].slip_length") ? map.number("tendons[].slip_length") : 1e-4 * length;
  if (out.rubs().empty()) return;
  if (out.actuator.kind == Actuator::Kind::none)
    map.value().fail("it has 'friction' and no actuator: without tension nothing rubs");
  if (out.actuator.compression)
    map.value().fail("it has 'friction' and 'compression: true': a cord that pushes does not lie on what it runs over");
}

/// How long its parts are as drawn.
double measure(const YamlValue &value, const SceneFile &file, const Tendon &tendon) {
  double sum = 0;
  for (const Tendon::Segment &s : tendon.segments) {
    const Vec3 from = asDrawn(file.scene, tendon.points[std::size_t(s.from)]),
               to = asDrawn(file.scene, tendon.points[std::size_t(s.to)]);
    if (!((to - from).norm() > 1e-9 * (to.norm() + from.norm())))
      value.fail("points " + std::to_string(s.from) + " and " + std::to_string(s.to) +
                 " of its path are at one place, " + placeText(from) +
                 ", and what acts along the part between has no direction; take one of them away");
    if (s.wrap >= 0) {
      const Wrap &wrap = tendon.wraps[std::size_t(s.wrap)];
      for (const Vec3 &x : {from, to}) {
        const Vec3 arm = x - wrap.centre, off = wrap.sphere ? arm : Vec3(arm - arm.dot(wrap.axis) * wrap.axis);
        if (!(off.norm() > wrap.radius))
          value.fail("a point at " + placeText(x) + " lies within the " + (wrap.sphere ? "sphere" : "cylinder") +
                     " of radius " + shortText(wrap.radius) + " m that the tendon winds round, " +
                     shortText(off.norm()) + " m from its " + (wrap.sphere ? "middle" : "axis") +
                     "; move it out, or take a smaller 'radius'");
      }
    }
    const double length = segmentAsDrawn(file.scene, tendon, s);
    if (!std::isfinite(length))
      value.fail("by which way it winds round from point " + std::to_string(s.from) + " to point " +
                 std::to_string(s.to) +
                 " cannot be told as they are drawn: in line with the middle of a sphere, or about three quarters of a "
                 "turn round a cylinder with a 'side'; put a point between");
    sum += length;
  }
  return sum;
}

void readInput(YamlMap &map, KeyOf<KeyType::number> value, AnyKey table, bool required, Actuator &out) {
  const std::string name(value->name());
  if (map.has(table)) {
    if (map.has(*value)) map.at(table).fail("it takes a '" + name + "' or a 'table', not both");
    out.input_motion = readProfile(map.at(table));
    if (out.kind != Actuator::Kind::displacement)
      for (const Motion::Key &row : out.input_motion.table)
        if (row.displacement[0] < 0)
          map.at(table).fail("a " + name + " must not be negative, found " + shortText(row.displacement[0]));
    return;
  }
  if (required && !map.has(*value)) map.value().fail("needs a '" + name + "' or a 'table'");
  out.input = map.number(value);
}

void readActuator(YamlMap &map, double length, Tendon &tendon) {
  Actuator &out = tendon.actuator;
  const std::array<AnyKey, 3> kinds{"tendons[].displacement", "tendons[].force", "tendons[].mckibben"};
  if (std::count_if(kinds.begin(), kinds.end(), [&](AnyKey key) { return map.has(key); }) > 1)
    map.value().fail("a tendon has one actuator, of 'displacement', 'force' and 'mckibben'; write two tendons with one "
                     "path for two");
  if (map.has("tendons[].displacement")) {
    YamlMap block(map.at("tendons[].displacement"), "tendons[].displacement");
    out.kind = Actuator::Kind::displacement;
    out.rigid = block.flag("tendons[].displacement.rigid");
    for (const AnyKey key : {AnyKey("tendons[].displacement.stiffness"), AnyKey("tendons[].displacement.damping")})
      if (out.rigid && block.has(key))
        block.at(key).fail("'" + std::string(key->name()) +
                           "' is of a spring, and the tendon is 'rigid'; take it away");
    if (!out.rigid && !block.has("tendons[].displacement.stiffness"))
      block.value().fail("needs the key 'stiffness', or 'rigid: true'");
    if (!out.rigid) out.stiffness = block.number("tendons[].displacement.stiffness");
    out.damping = block.number("tendons[].displacement.damping");
    out.compression = block.flag("tendons[].displacement.compression");
    readInput(block, "tendons[].displacement.target", "tendons[].displacement.table", false, out);
    if (!out.rigid && out.stiffness == 0 && out.damping == 0)
      block.value().fail("'stiffness' and 'damping' are both zero: nothing is pulled");
    block.finish();
  }
  if (map.has("tendons[].force")) {
    YamlMap block(map.at("tendons[].force"), "tendons[].force");
    out.kind = Actuator::Kind::force;
    readInput(block, "tendons[].force.tension", "tendons[].force.table", true, out);
    block.finish();
  }
  if (map.has("tendons[].mckibben")) {
    YamlMap block(map.at("tendons[].mckibben"), "tendons[].mckibben");
    out.kind = Actuator::Kind::mckibben;
    out.braid_length = block.number("tendons[].mckibben.braid_length");
    out.turns = block.number("tendons[].mckibben.turns");
    out.minimum_pressure = block.number("tendons[].mckibben.minimum_pressure");
    out.damping = block.number("tendons[].mckibben.damping");
    if (!block.has("tendons[].mckibben.length") && !tendon.joints.empty())
      block.value().fail("with joints in its path a muscle needs its 'length' as drawn");
    out.muscle_length = block.has("tendons[].mckibben.length") ? block.number("tendons[].mckibben.length") : length;
    readInput(block, "tendons[].mckibben.pressure", "tendons[].mckibben.table", true, out);
    block.finish();
  }
}

} // namespace

Motion readProfile(const YamlValue &table) {
  Motion motion;
  for (const YamlValue &row : table.items()) {
    const std::vector<double> v = row.numbers(2);
    std::vector<Motion::Key> &rows = motion.table;
    if (!rows.empty() && rows.back().time >= v[0])
      row.fail("the times of 'table' must increase, found " + shortText(v[0]) + " after " +
               shortText(rows.back().time));
    rows.push_back({v[0], {v[1], 0, 0}, Vec3::Zero()});
  }
  if (motion.table.empty()) table.fail("'table' is empty");
  return motion;
}

void readTendon(const YamlValue &value, SceneFile &out) {
  YamlMap map(value, "tendons");
  Tendon tendon;
  tendon.name = map.has("tendons[].name") ? readName(map.at("tendons[].name"))
                                          : "tendon" + std::to_string(out.scene.tendons.size());
  for (const Tendon &t : out.scene.tendons)
    if (t.name == tendon.name) value.fail("a tendon with the name '" + tendon.name + "' is there already");
  map.refuseUnknown();
  const std::vector<YamlValue> entries = map.at("tendons[].path").items();
  std::vector<Entry> path;
  for (const YamlValue &v : entries) path.push_back(readEntry(v, out, tendon));
  if (path.empty()) map.at("tendons[].path").fail("'path' is empty; list points or joints");
  connect(entries, path, tendon);
  const double length = measure(value, out, tendon);
  if (out.scene.rodsOf(tendon).empty())
    value.fail("nothing that it runs through can move: bodies that are free, rods, or joints of such bodies");
  readActuator(map, length, tendon);
  readFriction(map, entries, path, length, tendon);
  map.finish();
  out.scene.tendons.push_back(std::move(tendon));
}

} // namespace tendril
