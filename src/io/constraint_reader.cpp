#include "tendril/geometry/rotation.hpp"
#include "tendril/io/body_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/text.hpp"

#include <algorithm>

namespace tendril {
namespace {

constexpr MotionKeys constraint_motion_keys{
    "constraints[].motion",           "constraints[].motion.velocity", "constraints[].motion.angular_velocity",
    "constraints[].motion.amplitude", "constraints[].motion.period",   "constraints[].motion.table"};

double stiffestTurning(const Material &m) {
  return std::max({m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness});
}

/// \param but a vertex that is not meant, or -1
int closestVertex(const Rod &rod, const Vec3 &point, int but = -1) {
  int closest = -1;
  for (int v = 0; v < rod.vertices(); ++v)
    if (v != but &&
        (closest < 0 || (rod.position[v] - point).squaredNorm() < (rod.position[closest] - point).squaredNorm()))
      closest = v;
  return closest;
}

std::string labelOf(const Scene &scene, int rod, int vertex) {
  return "vertex " + std::to_string(vertex) + " of rod '" + scene.rods[rod].name + "'";
}

bool isHeld(const Scene &scene, int rod, int vertex) {
  return std::any_of(scene.supports.begin(), scene.supports.end(),
                     [&](const Support &s) { return s.rod == rod && s.vertex == vertex && s.holdsPosition(); });
}

/// What a constraint between two vertices does not have.
void refuseForTie(YamlMap &map, const std::string &type) {
  if (type != "pin")
    map.at("constraints[].to").fail("a rotation turns an edge to a frame of the world; a vertex is for 'type: pin'");
  for (const AnyKey key : {AnyKey("constraints[].point"), AnyKey("constraints[].motion"),
                           AnyKey("constraints[].closest"), AnyKey("constraints[].update_old_target")})
    if (map.has(key)) map.at(key).fail("'" + std::string(key->name()) + "' is for a constraint 'to: world'");
}

/// The other end of a tie.
void readOther(YamlMap &map, const SceneFile &file, Constraint &c) {
  const Scene &scene = file.scene;
  const YamlValue value = map.at("constraints[].to");
  YamlMap to(value, "constraints[].to");
  to.refuseUnknown();
  const std::vector<int> rods = readTargets(to, "constraints[].to.rod", file.names);
  if (rods.size() != 1)
    value.fail("the other end is on one rod, as '" + scene.rods[rods.front()].name + "'; these are " +
               std::to_string(rods.size()));
  c.to_rod = rods.front();
  const Rod &rod = scene.rods[c.to_rod];
  const bool closest = to.flag("constraints[].to.closest");
  if (closest == to.has("constraints[].to.vertex"))
    value.fail(std::string("the other end needs a 'vertex', or 'closest: true'") + (closest ? ", not both" : ""));
  c.to_vertex = closest ? closestVertex(rod, scene.rods[c.rod].position[c.at], c.to_rod == c.rod ? c.at : -1)
                        : readIndex(to, "constraints[].to.vertex", rod.vertices(), rod.name);
  to.finish();
  const std::string own = labelOf(scene, c.rod, c.at), other = labelOf(scene, c.to_rod, c.to_vertex);
  if (c.rod == c.to_rod && c.at == c.to_vertex) value.fail("both ends are " + own);
  if (isHeld(scene, c.rod, c.at) && isHeld(scene, c.to_rod, c.to_vertex))
    value.fail("supports hold " + own + " and " + other + ", which a pin cannot move; take one of them away");
}

void readPin(YamlMap &map, const Rod &rod, const SceneFile &file, Constraint &c) {
  for (const AnyKey key : {AnyKey("constraints[].edge"), AnyKey("constraints[].tangent"),
                           AnyKey("constraints[].director"), AnyKey("constraints[].measure")})
    if (map.has(key)) map.at(key).fail("'" + std::string(key->name()) + "' is for 'type: rotation'");
  c.point_given = map.has("constraints[].point");
  const bool closest = map.flag("constraints[].closest");
  if (closest && !c.point_given) map.value().fail("'closest' needs the 'point' whose nearest vertex is meant");
  if (closest && map.has("constraints[].vertex"))
    map.at("constraints[].vertex").fail("write 'vertex' or 'closest: true', not both");
  if (c.point_given) c.point = map.at("constraints[].point").vector();
  if (!closest && !map.has("constraints[].vertex"))
    map.value().fail("a pin needs a 'vertex', or a 'point' with 'closest: true'");
  c.at = closest ? closestVertex(rod, c.point) : readIndex(map, "constraints[].vertex", rod.vertices(), rod.name);
  if (!c.point_given) c.point = rod.position[c.at];
  if (map.at("constraints[].to").isMap()) return readOther(map, file, c);
  if (isHeld(file.scene, c.rod, c.at))
    map.value().fail(labelOf(file.scene, c.rod, c.at) +
                     " is held by a support, which a pin cannot move; take one of them away");
}

void readRotation(YamlMap &map, const Rod &rod, Constraint &c) {
  for (const AnyKey key :
       {AnyKey("constraints[].vertex"), AnyKey("constraints[].closest"), AnyKey("constraints[].point")})
    if (map.has(key)) map.at(key).fail("'" + std::string(key->name()) + "' is for 'type: pin'");
  if (rod.material.isCable())
    map.value().fail("rod '" + rod.name + "' has no flexural stiffness and no frames to turn; write 'type: pin'");
  c.at = readIndex(map, "constraints[].edge", rod.edges(), rod.name);
  const Frame drawn = referenceFrame(rod, c.at);
  c.frame = {drawn.tangent, drawn.director, 1};
  c.tangent_given = map.has("constraints[].tangent");
  c.director_given = map.has("constraints[].director");
  if (c.tangent_given) {
    c.frame.tangent = unit(map.at("constraints[].tangent"));
    c.frame.director =
        orthonormalised(transport<double>(drawn.director, drawn.tangent, c.frame.tangent), c.frame.tangent);
  }
  if (c.director_given) {
    const YamlValue d = map.at("constraints[].director");
    c.frame.director = unit(d);
    if (std::abs(c.frame.director.dot(c.frame.tangent)) > 1e-6)
      d.fail("'director' is not normal to the tangent of the constraint");
    c.frame.director = orthonormalised(c.frame.director, c.frame.tangent);
  } else if (!c.frame.director.allFinite())
    map.at("constraints[].tangent")
        .fail("'tangent' points against edge " + std::to_string(c.at) + " of rod '" + rod.name +
              "'; give a 'director', too");
  c.measure = map.word("constraints[].measure") == "sine" ? Constraint::Measure::sine : Constraint::Measure::angle;
  if (c.measure == Constraint::Measure::sine && c.saturation > 0)
    map.at("constraints[].saturation").fail("'saturation' is for 'measure: angle'");
  const double angle = rotationBetween(drawn, c.frameAt(0)).norm() * 180 / pi;
  if (c.measure == Constraint::Measure::angle && angle > 170)
    map.value().fail("the frame is turned by " + shortText(angle) + " degrees from edge " + std::to_string(c.at) +
                     " of rod '" + rod.name +
                     "' as drawn, too near to half a turn; turn it by a 'motion', or write 'measure: sine'");
}

/// Stiffness, damping and what goes with them.
void readSpring(YamlMap &map, const YamlValue &value, bool to_vertex, Constraint &c) {
  if (!map.has("constraints[].stiffness")) {
    map.refuseUnknown();
    value.fail("'stiffness' is missing; to " +
               (to_vertex ? "make two vertices one point exactly, write a junction of 'type: ball'"
                          : "hold a " + std::string(c.isPin() ? "vertex" : "frame") +
                                " exactly, write a support of 'type: " + (c.isPin() ? "pin" : "clamp") + "'"));
  }
  c.stiffness = map.number("constraints[].stiffness");
  c.damping = map.number("constraints[].damping");
  c.saturation = map.number("constraints[].saturation");
  c.damps_motion = !map.flag("constraints[].update_old_target");
  if (c.stiffness == 0 && c.damping == 0) value.fail("'stiffness' and 'damping' are both zero: nothing is constrained");
  if (c.saturation == 0)
    map.at("constraints[].saturation").fail("'saturation' must be positive, or negative for none; found 0");
}

void readMotionOf(YamlMap &map, Constraint &c) {
  if (!map.has("constraints[].motion")) return;
  const YamlValue motion = map.at("constraints[].motion");
  c.motion = readMotion(motion, constraint_motion_keys);
  if (c.isPin())
    refuseTurning(motion, c.motion, "a pin turns nothing; take the rotation away, or write 'type: rotation', too");
  else
    refuseTravel(motion, c.motion, "a rotation moves nothing; take the displacement away, or add a pin that moves");
}

/// To a free body, or by the motion of a held one.
void tieToBody(YamlMap &map, const SceneFile &file, Constraint &c) {
  const SceneFile::BodyPlace place = findBody(map.at("constraints[].body"), file);
  const Body &body = file.bodyAt(place);
  if (place.held)
    c.motion = body.motion.at(c.isPin() ? Vec3(c.point - body.position) : Vec3(Vec3::Zero()));
  else
    c.to_body = place.index;
}

/// A warning where a constraint is far stiffer than its rod; empty where it is not.
std::string warningOf(const Constraint &c, const Rod &rod, bool to_body, const YamlValue &stiffness) {
  const double length = rod.length();
  const double own = c.isPin() ? rod.material.axial_stiffness / length : stiffestTurning(rod.material) / length;
  if (!(c.stiffness > 1e6 * own)) return "";
  return "warning: " + stiffness.place() + ": 'stiffness' is " + shortText(c.stiffness / own) + " times that of rod '" +
         rod.name + "', which costs digits; a " +
         (to_body     ? "constraint without 'stiffness', of 'type: weld"
          : c.isTie() ? "junction of 'type: ball"
          : c.isPin() ? "support of 'type: pin"
                      : "support of 'type: clamp") +
         "' is exact";
}

} // namespace

void readConstraint(const YamlValue &value, SceneFile &out) {
  Scene &scene = out.scene;
  YamlMap map(value, "constraints");
  const std::string type = map.word("constraints[].type");
  const std::string name = map.has("constraints[].name") ? readName(map.at("constraints[].name"))
                                                         : "constraint" + std::to_string(out.constraint_blocks);
  ++out.constraint_blocks;
  const bool to_body = map.has("constraints[].body");
  if (type == "weld" || (to_body && !map.has("constraints[].stiffness"))) return readAttachments(map, name, out);
  for (const AnyKey key :
       {AnyKey("constraints[].to"), AnyKey("constraints[].motion"), AnyKey("constraints[].update_old_target")})
    if (to_body && map.has(key))
      map.at(key).fail("'" + std::string(key->name()) +
                       "' is for a constraint without a 'body', whose point and frame "
                       "are those of the body");
  const YamlValue to = map.at("constraints[].to");
  if (to.isMap())
    refuseForTie(map, type);
  else if (!to.isScalar() || to.text() != "world")
    to.fail("'to' must be world, or a map of the other vertex, as {rod: b, vertex: 0}; a body is a 'body'");
  const std::vector<int> rods = readTargets(map, "constraints[].rod", out.names);
  bool told = false;
  const std::size_t before = scene.constraints.size();
  for (const int r : rods) {
    const Rod &rod = scene.rods[r];
    Constraint c{};
    c.kind = type == "pin" ? Constraint::Kind::pin : Constraint::Kind::rotation;
    c.name = rods.size() == 1 ? name : name + "#" + std::to_string(scene.constraints.size() - before);
    if (!out.constraint_names.insert(c.name).second)
      value.fail("a constraint with the name '" + c.name + "' is there already");
    c.rod = r;
    readSpring(map, value, to.isMap(), c);
    readMotionOf(map, c);
    c.isPin() ? readPin(map, rod, out, c) : readRotation(map, rod, c);
    if (to_body) tieToBody(map, out, c);
    const std::string warning = warningOf(c, rod, to_body, map.at("constraints[].stiffness"));
    if (!warning.empty() && !told) out.notes.push_back(warning);
    told = told || !warning.empty();
    scene.constraints.push_back(std::move(c));
  }
  map.finish();
}

} // namespace tendril
