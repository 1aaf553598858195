#include "tendril/io/body_reader.hpp"

#include "tendril/contact/body_samples.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/io/collider_reader.hpp"
#include "tendril/io/mesh_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/text.hpp"

#include <algorithm>
#include <filesystem>

namespace tendril {
namespace {

constexpr MotionKeys body_motion_keys{
    "bodies[].motion",           "bodies[].motion.velocity", "bodies[].motion.angular_velocity",
    "bodies[].motion.amplitude", "bodies[].motion.period",   "bodies[].motion.table"};
constexpr const char *shape_names = "box, sphere, capsule, cylinder or mesh";

/// A closed surface.
std::shared_ptr<const TriangleMesh> readSurface(YamlMap &map) {
  const YamlValue file = map.at("bodies[].mesh.file");
  if (file.text() != inOneLine(file.text()))
    file.fail("'file' must be in one line, found '" + inOneLine(file.text()) + "'");
  const std::string path = (std::filesystem::path(file.file()).parent_path() / file.text()).string();
  const double scale = map.number("bodies[].mesh.scale");
  auto mesh = std::make_shared<TriangleMesh>();
  try {
    *mesh = readMesh(path);
    for (Vec3 &x : mesh->vertices) x *= scale;
    [[maybe_unused]] const MeshDistance closed(*mesh);
  } catch (const SceneError &e) {
    file.fail(e.what());
  } catch (const std::invalid_argument &e) {
    file.fail(path + ": " + e.what() +
              "; a body needs a closed surface, its triangles anticlockwise seen from outside");
  }
  return mesh;
}

struct BodyShapeKey {
  KeyOf<KeyType::map, KeyType::list, KeyType::word_or_map> key;
  /// Its mass properties with the density 1 in its own axes; `turn` is from these to those of the file.
  MassProperties (*read)(YamlMap &map, Body &out, Mat3 &turn);
};

constexpr BodyShapeKey body_shape_keys[] = {
    {"bodies[].box",
     [](YamlMap &map, Body &out, Mat3 &) {
       out.size = map.vector("bodies[].box.size");
       if (!(out.size.minCoeff() > 0)) map.at("bodies[].box.size").fail("'size' must be positive");
       return boxMass(out.size, 1);
     }},
    {"bodies[].sphere",
     [](YamlMap &map, Body &out, Mat3 &) {
       out.size[0] = map.number("bodies[].sphere.radius");
       return sphereMass(out.size[0], 1);
     }},
    {"bodies[].capsule",
     [](YamlMap &map, Body &out, Mat3 &turn) {
       turn = turnTo(axisOf(map, "bodies[].capsule.axis"));
       out.size = {map.number("bodies[].capsule.radius"), map.number("bodies[].capsule.length"), 0};
       return capsuleMass(out.size[0], out.size[1], 1);
     }},
    {"bodies[].cylinder",
     [](YamlMap &map, Body &out, Mat3 &turn) {
       turn = turnTo(axisOf(map, "bodies[].cylinder.axis"));
       out.size = {map.number("bodies[].cylinder.radius"), map.number("bodies[].cylinder.length"), 0};
       return cylinderMass(out.size[0], out.size[1], 1);
     }},
    {"bodies[].mesh", [](YamlMap &map, Body &out, Mat3 &) {
       out.mesh = readSurface(map);
       if (map.has("bodies[].mesh.cell")) out.cell = map.number("bodies[].mesh.cell");
       return meshMass(*out.mesh, 1);
     }}};

/// By which constraints may find it without doubt.
std::string readBodyName(YamlMap &map, const SceneFile &file) {
  const bool given = map.has("bodies[].name");
  const std::string name = given ? readName(map.at("bodies[].name")) : "body" + std::to_string(file.bodies.size());
  if (given && name.find_first_not_of("0123456789") == std::string::npos)
    map.at("bodies[].name").fail("'name' must not be a number, by which bodies are counted, found '" + name + "'");
  if (name == "world") map.at("bodies[].name").fail("'name' must not be world, which is what stands still");
  if (file.body_numbers.count(name))
    (given ? map.at("bodies[].name") : map.value())
        .fail("a body with the name '" + name + "' is there already; " +
              (given ? "choose another 'name'" : "give this body a 'name'"));
  return name;
}

/// Of three or six numbers: the diagonal of the matrix, then its elements xy, xz and yz.
Mat3 readInertia(const YamlValue &value) {
  const std::size_t count = value.node().IsSequence() ? value.node().size() : 0;
  if (count != 3 && count != 6)
    value.fail("'inertia' must be a list of 3 numbers, [Ixx, Iyy, Izz], or of 6, [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]" +
               (count > 0 ? ", found " + std::to_string(count) : ""));
  std::vector<double> v = value.numbers(count);
  v.resize(6, 0);
  Mat3 inertia;
  inertia << v[0], v[3], v[4], v[3], v[1], v[5], v[4], v[5], v[2];
  return inertia;
}

/// Mass, centre of mass and inertia about it, in the axes of the file. \param solid those of its shape with the density
/// 1, or of no mass
MassProperties readMass(YamlMap &map, const std::string &shape, MassProperties solid) {
  const YamlValue &value = map.value();
  const bool dense = map.has("bodies[].density"), weighed = map.has("bodies[].mass"),
             turned = map.has("bodies[].inertia"), shaped = shape != "none";
  if (dense && weighed) value.fail("'density' and 'mass' both tell the mass of this body; take one of them away");
  if (!weighed && !(dense && shaped)) map.refuseUnknown();
  if (dense && !shaped)
    map.at("bodies[].density")
        .fail("'density' is for a body with a shape: " + std::string(shape_names) +
              "; give it one, or write 'mass' and 'inertia' instead");
  if (!weighed && !shaped)
    value.fail("a body needs a shape (" + std::string(shape_names) +
               ") with a 'density' or 'mass', or 'mass' and 'inertia' without a shape");
  if (!weighed && !dense) value.fail("the shape '" + shape + "' alone has no mass; give a 'density' or the 'mass'");
  if (!shaped && !turned) {
    map.refuseUnknown();
    value.fail("a body of 'mass' alone is a point, which nothing can turn; give it a shape (" +
               std::string(shape_names) + ") or an 'inertia', or write {vertex: ..., mass: ...} among the 'loads'");
  }
  const YamlValue says = map.at(dense ? AnyKey("bodies[].density") : AnyKey("bodies[].mass"));
  if (shaped && !(solid.mass > 0 && std::isfinite(solid.mass)))
    value.fail("the volume of the shape '" + shape + "' comes out as " + shortText(solid.mass) + " m^3; SI units?");
  const double mass = weighed ? map.number("bodies[].mass") : map.number("bodies[].density") * solid.mass;
  if (!(mass > 0 && std::isfinite(mass))) says.fail("the mass comes out as " + shortText(mass) + " kg; SI units?");
  if (shaped) solid.inertia *= mass / solid.mass;
  solid.mass = mass;
  if (map.has("bodies[].centre")) {
    if (shaped && !turned)
      map.at("bodies[].centre")
          .fail("a 'centre' other than that of the shape asks for the 'inertia' about it, too; give it, or take "
                "'centre' away");
    solid.centre = map.vector("bodies[].centre");
  }
  if (turned) solid.inertia = readInertia(map.at("bodies[].inertia"));
  if (const std::string flaw = flawOf(solid.inertia); !flaw.empty()) {
    if (turned) map.at("bodies[].inertia").fail("no body has this 'inertia': " + flaw + "; it is in kg m^2");
    value.fail("the inertia of the shape '" + shape + "' cannot be computed with: " + flaw +
               "; SI units? Or give an 'inertia'");
  }
  return solid;
}

// ---- ties

/// What is for springs, or for other ties.
void refuseForAttachment(YamlMap &map, bool weld) {
  if (map.has("constraints[].to"))
    map.at("constraints[].to").fail("'to' and 'body' name two other ends of one tie; take one of them away");
  if (map.has("constraints[].stiffness"))
    map.at("constraints[].stiffness")
        .fail("a weld is exact; leave 'stiffness' away, or write springs of 'type: pin' and 'type: rotation'");
  for (const AnyKey key :
       {AnyKey("constraints[].motion"), AnyKey("constraints[].point"), AnyKey("constraints[].closest"),
        AnyKey("constraints[].edge"), AnyKey("constraints[].measure"), AnyKey("constraints[].saturation"),
        AnyKey("constraints[].damping"), AnyKey("constraints[].update_old_target")})
    if (map.has(key))
      map.at(key).fail("'" + std::string(key->name()) +
                       "' has no meaning for a tie to a body, which is exact and at a 'vertex' as drawn; take it away");
  for (const AnyKey key : {AnyKey("constraints[].tangent"), AnyKey("constraints[].director")})
    if (!weld && map.has(key))
      map.at(key).fail("'" + std::string(key->name()) + "' is for 'type: weld'; a pin lets the rod turn");
}

} // namespace

SceneFile::BodyPlace findBody(const YamlValue &value, const SceneFile &file) {
  const std::string word = value.text();
  const std::vector<SceneFile::BodyPlace> &bodies = file.bodies;
  if (const auto named = file.body_numbers.find(word); named != file.body_numbers.end())
    return bodies[std::size_t(named->second)];
  const bool number = !word.empty() && word.size() < 10 && word.find_first_not_of("0123456789") == std::string::npos &&
                      (word == "0" || word[0] != '0');
  if (number && std::stoi(word) < int(bodies.size())) return bodies[std::size_t(std::stoi(word))];
  const std::string none = "there is no body '" + inOneLine(word) + "'";
  if (bodies.empty()) value.fail(none + ": the scene has no 'bodies'; describe it there");
  constexpr std::size_t most = 5;
  std::vector<std::string> names;
  std::string some;
  for (const SceneFile::BodyPlace body : bodies) names.push_back(file.bodyAt(body).name);
  for (std::size_t b = 0; b < std::min(most, names.size()); ++b) some += (b > 0 ? ", '" : "'") + names[b] + "'";
  if (names.size() > most) some += " and " + std::to_string(names.size() - most) + " more";
  const std::string near = closest(word, names);
  value.fail(none + "; write the name of a body (" + some + ") or its number, from 0 to " +
             std::to_string(names.size() - 1) + (near.empty() ? "" : "; did you mean '" + near + "'?"));
}

namespace {

/// Refuses a vertex that something else holds, and a rod that cannot be tied so.
void check(const YamlValue &value, const Attachment &a, SceneFile::BodyPlace place, const SceneFile &file) {
  const Scene &scene = file.scene;
  const Rod &rod = scene.rods[a.rod];
  const Body &body = file.bodyAt(place);
  const std::string vertex = "vertex " + std::to_string(a.vertex) + " of rod '" + rod.name + "'",
                    tie = "constraint '" + a.name + "' ties it to body '" + body.name + "'";
  if (a.weld && rod.material.isCable())
    value.fail("rod '" + rod.name + "' has no flexural stiffness that a weld could hold; write 'type: pin'");
  if (!place.held && rod.gravity != body.gravity)
    value.fail("gravity acts on " + (rod.gravity ? "rod '" + rod.name + "'" : "body '" + body.name + "'") +
               ", and not on " + (rod.gravity ? "body '" + body.name + "'" : "rod '" + rod.name + "'") +
               "; the mass of the half edge at the tied vertex belongs to the body: give both the same 'gravity'");
  if (const auto at = file.supports_at.find({a.rod, a.vertex}); at != file.supports_at.end())
    for (const int k : at->second)
      if (const Support &s = scene.supports[k]; s.holdsPosition() || a.weld)
        value.fail(vertex + " has a support of 'type: " + nameOf(s.kind) + "', and " + tie +
                   "; take one of the two away");
  if (const auto other = file.attached.find({a.rod, a.vertex}); other != file.attached.end())
    value.fail(vertex + " is tied to a body by constraint '" + other->second + "' already, and " + tie +
               "; take one of the two away");
}

/// The frame of a weld.
Frame readFrame(YamlMap &map, const Rod &rod, int vertex) {
  Frame frame = frameAtVertex(rod, vertex);
  const int before = rod.edgeBefore(vertex), after = rod.edgeAfter(vertex), edge = before < 0 ? after : before;
  const bool inner = before >= 0 && after >= 0;
  for (const AnyKey key : {AnyKey("constraints[].tangent"), AnyKey("constraints[].director")})
    if (inner && map.has(key))
      map.at(key).fail("'" + std::string(key->name()) + "' is for the ends of a rod; at vertex " +
                       std::to_string(vertex) + " of rod '" + rod.name +
                       "' both edges beside it are welded as drawn; take it away");
  if (map.has("constraints[].tangent")) {
    const YamlValue given = map.at("constraints[].tangent");
    const Vec3 tangent = unit(given);
    const double cosine = std::clamp(tangent.dot(rod.edge(edge).normalized()), -1.0, 1.0);
    if (cosine < 0)
      given.fail("'tangent' is " + shortText(std::acos(cosine) * 180 / pi) + " degrees off edge " +
                 std::to_string(edge) + " of rod '" + rod.name +
                 "' as drawn; it points along the rod, from vertex to vertex by their numbers, and less than 90 "
                 "degrees off: turn it round, or draw the rod so");
    frame.director = orthonormalised(transport<double>(frame.director, frame.tangent, tangent), tangent);
    frame.tangent = tangent;
  }
  if (map.has("constraints[].director")) {
    const YamlValue given = map.at("constraints[].director");
    const Vec3 director = unit(given);
    if (std::abs(director.dot(frame.tangent)) > 1e-6)
      given.fail("'director' is not normal to the tangent of the weld; take away its part along the tangent");
    frame.director = orthonormalised(director, frame.tangent);
  } else if (!frame.director.allFinite())
    map.value().fail("'tangent' points against that of the rod as drawn; give a 'director', too");
  return frame;
}

} // namespace

/// How a body touches obstacles.
static void readContact(YamlMap &map, const ContactSettings &of_scene, Body &body) {
  ContactSettings &contact = body.contact;
  contact.on = body.shape != "none";
  contact.bodies = of_scene.bodies;
  contact.friction = of_scene.friction;
  contact.fall_off_velocity = of_scene.fall_off_velocity;
  contact.tangential_damping = of_scene.tangential_damping;
  contact.normal_damping = of_scene.normal_damping;
  contact.stick = of_scene.stick;
  const double gyration = std::sqrt(body.own.inertia.trace() / body.own.mass);
  contact.slip_length = of_scene.slip_length > 0 ? of_scene.slip_length : 1e-4 * gyration;
  contact.distance = 0.02 * gyration;
  if (!map.has("bodies[].contact")) return;
  const YamlValue value = map.at("bodies[].contact");
  if (!contact.on) value.fail("a body without a shape (" + std::string(shape_names) + ") touches nothing; give it one");
  if (!value.isMap()) {
    contact.on = map.word("bodies[].contact") != "none";
    return;
  }
  YamlMap block(value, "bodies[].contact");
  auto read = [&](KeyOf<KeyType::number> key, double &to) {
    if (block.has(*key)) to = block.number(key);
  };
  if (block.has("bodies[].contact.bodies")) contact.bodies = block.flag("bodies[].contact.bodies");
  read("bodies[].contact.distance", contact.distance);
  read("bodies[].contact.stiffness", contact.stiffness);
  read("bodies[].contact.friction", contact.friction);
  read("bodies[].contact.fall_off_velocity", contact.fall_off_velocity);
  read("bodies[].contact.tangential_damping", contact.tangential_damping);
  read("bodies[].contact.normal_damping", contact.normal_damping);
  if (contact.distance > gyration)
    block.at("bodies[].contact.distance")
        .fail("the 'distance' of its contact, " + shortText(contact.distance) +
              " m, must not exceed the body's radius of gyration, " + shortText(gyration) + " m");
  block.finish();
}

void readBody(const YamlValue &value, const ContactSettings &contact, SceneFile &out) {
  YamlMap map(value, "bodies");
  Body body;
  body.name = readBodyName(map, out);
  MassProperties solid;
  Mat3 turn = Mat3::Identity();
  for (const BodyShapeKey &shape : body_shape_keys) {
    if (!map.has(*shape.key)) continue;
    const std::string name(shape.key->name());
    if (body.shape != "none")
      value.fail("has two shapes, '" + body.shape + "' and '" + name +
                 "'; keep one, and for a body of both give a mesh, or 'mass', 'centre' and 'inertia'");
    body.shape = name;
    YamlMap block(map.at(*shape.key), shape.key);
    solid = shape.read(block, body, turn);
    block.finish();
  }
  const MassProperties own = readMass(map, body.shape, solid.moved(turn, Vec3::Zero()));
  const Mat3 rotation = rotationBy(map.vector("bodies[].rotation"));
  body.position = map.vector("bodies[].position");
  body.rotation = rotation * turn;
  body.own = own.moved(rotation, body.position);
  body.velocity = map.vector("bodies[].velocity");
  body.angular_velocity = map.vector("bodies[].angular_velocity");
  body.gravity = map.flag("bodies[].gravity");
  body.force = map.vector("bodies[].force");
  body.torque = map.vector("bodies[].torque");
  readContact(map, contact, body);
  if (body.contact.touchesBodies()) {
    try {
      body.solid = solidOf(body);
    } catch (const std::invalid_argument &e) {
      map.at("bodies[].mesh").fail(e.what());
    }
  }
  if (map.has("bodies[].layer")) body.layer = readName(map.at("bodies[].layer"));
  const bool held = map.flag("bodies[].fixed") || map.has("bodies[].motion");
  if (map.has("bodies[].motion")) {
    const YamlValue motion = map.at("bodies[].motion");
    if (map.flag("bodies[].fixed")) motion.fail("'fixed' and 'motion' contradict each other; take one of them away");
    body.motion = readMotion(motion, body_motion_keys);
  }
  for (const AnyKey key : {AnyKey("bodies[].velocity"), AnyKey("bodies[].angular_velocity"), AnyKey("bodies[].force"),
                           AnyKey("bodies[].torque"), AnyKey("bodies[].contact")})
    if (held && map.has(key) && !(key->name() == "contact" && !body.contact.on))
      map.at(key).fail("'" + std::string(key->name()) +
                       "' has no meaning for a body that is 'fixed' or goes by its "
                       "'motion'; take it away");
  map.finish();
  std::vector<Body> &among = held ? out.scene.held_bodies : out.scene.bodies;
  out.body_numbers[body.name] = int(out.bodies.size());
  out.bodies.push_back({held, int(among.size())});
  among.push_back(std::move(body));
}

void readAttachments(YamlMap &map, const std::string &name, SceneFile &out) {
  const YamlValue &value = map.value();
  const std::string type = map.word("constraints[].type");
  const bool weld = type == "weld";
  map.refuseUnknown();
  if (!map.has("constraints[].body"))
    value.fail("a weld ties a vertex to a 'body', which is missing; to hold it in the world write a support of 'type: "
               "clamp', to join rods a junction of 'type: rigid'");
  if (type == "rotation")
    value.fail("'stiffness' is missing: a rotation is a spring; to hold the angle exactly write 'type: weld' at a "
               "'vertex'");
  refuseForAttachment(map, weld);
  const SceneFile::BodyPlace body = findBody(map.at("constraints[].body"), out);
  const std::vector<int> rods = readTargets(map, "constraints[].rod", out.names);
  for (std::size_t k = 0; k < rods.size(); ++k) {
    const Rod &rod = out.scene.rods[rods[k]];
    Attachment a{};
    a.name = rods.size() == 1 ? name : name + "#" + std::to_string(k);
    if (!out.constraint_names.insert(a.name).second)
      value.fail("a constraint with the name '" + a.name + "' is there already");
    a.rod = rods[k];
    a.vertex = readIndex(map, "constraints[].vertex", rod.vertices(), rod.name);
    a.body = body.index;
    a.weld = weld;
    check(value, a, body, out);
    a.frame = weld ? readFrame(map, rod, a.vertex) : frameAtVertex(rod, a.vertex);
    a.tangent_given = map.has("constraints[].tangent");
    a.director_given = map.has("constraints[].director");
    out.attached[{a.rod, a.vertex}] = a.name;
    if (!body.held) {
      out.scene.attachments.push_back(std::move(a));
      continue;
    }
    // A body that goes its own way holds what is tied to it as a support does.
    const Body &holder = out.bodyAt(body);
    out.supports_at[{a.rod, a.vertex}].push_back(int(out.scene.supports.size()));
    out.scene.supports.push_back({weld ? Support::Kind::clamp : Support::Kind::pin, a.rod, a.vertex,
                                  holder.motion.at(rod.position[a.vertex] - holder.position), a.frame, a.tangent_given,
                                  a.director_given});
  }
  map.finish();
}

} // namespace tendril
