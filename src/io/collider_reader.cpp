#include "tendril/io/collider_reader.hpp"

#include "tendril/embedding/embedding.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/io/mesh_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/text.hpp"

#include <algorithm>
#include <filesystem>

namespace tendril {

Mat3 turnTo(const Vec3 &axis) { return Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), axis).toRotationMatrix(); }

Vec3 axisOf(YamlMap &map, KeyOf<KeyType::vector> key) {
  return map.has(*key) ? unit(map.at(*key)) : map.vector(key).normalized();
}

namespace {

constexpr MotionKeys collider_motion_keys{
    "colliders[].motion",           "colliders[].motion.velocity", "colliders[].motion.angular_velocity",
    "colliders[].motion.amplitude", "colliders[].motion.period",   "colliders[].motion.table"};

/// Endless where it is not given.
double lengthOf(YamlMap &map, KeyOf<KeyType::number> key) { return map.has(*key) ? map.number(key) : HUGE_VAL; }

struct ShapeKey {
  KeyOf<KeyType::map, KeyType::list, KeyType::word_or_map> key;
  /// Makes the shape and notes its size; `turn` is from its axes to those of the collider.
  void (*read)(YamlMap &map, Collider &out, Mat3 &turn);
};

constexpr ShapeKey shape_keys[] = {
    {"colliders[].plane",
     [](YamlMap &map, Collider &out, Mat3 &turn) {
       turn = turnTo(axisOf(map, "colliders[].plane.normal"));
       out.shape = makeHalfSpace();
     }},
    {"colliders[].sphere",
     [](YamlMap &map, Collider &out, Mat3 &) {
       out.size[0] = map.number("colliders[].sphere.radius");
       out.shape = makeSphere(out.size[0]);
     }},
    {"colliders[].capsule",
     [](YamlMap &map, Collider &out, Mat3 &turn) {
       turn = turnTo(axisOf(map, "colliders[].capsule.axis"));
       out.size = {map.number("colliders[].capsule.radius"), map.number("colliders[].capsule.length"), 0};
       out.shape = makeCapsule(out.size[0], out.size[1]);
     }},
    {"colliders[].cylinder",
     [](YamlMap &map, Collider &out, Mat3 &turn) {
       turn = turnTo(axisOf(map, "colliders[].cylinder.axis"));
       out.size = {map.number("colliders[].cylinder.radius"), lengthOf(map, "colliders[].cylinder.length"), 0};
       out.shape = makeCylinder(out.size[0], out.size[1]);
     }},
    {"colliders[].box",
     [](YamlMap &map, Collider &out, Mat3 &) {
       out.size = map.vector("colliders[].box.size");
       if (!(out.size.minCoeff() > 0)) map.at("colliders[].box.size").fail("'size' must be positive");
       out.shape = makeBox(out.size);
     }},
    {"colliders[].mesh",
     [](YamlMap &map, Collider &out, Mat3 &) {
       const YamlValue file = map.at("colliders[].mesh.file");
       const std::string path = (std::filesystem::path(file.file()).parent_path() / file.text()).string();
       auto mesh = std::make_shared<TriangleMesh>(readMesh(path));
       const double scale = map.number("colliders[].mesh.scale");
       for (Vec3 &x : mesh->vertices) x *= scale;
       out.mesh = mesh;
       try {
         out.shape = makeMesh(*mesh, map.has("colliders[].mesh.cell") ? map.number("colliders[].mesh.cell") : 0);
       } catch (const std::invalid_argument &e) {
         throw SceneError(path + ": " + e.what());
       }
     }},
    {"colliders[].tube", [](YamlMap &map, Collider &out, Mat3 &turn) {
       turn = turnTo(axisOf(map, "colliders[].tube.axis"));
       out.size = {map.number("colliders[].tube.bore"), lengthOf(map, "colliders[].tube.outer"),
                   lengthOf(map, "colliders[].tube.length")};
       if (out.size[1] <= out.size[0])
         map.at("colliders[].tube.outer").fail("'outer' must be larger than 'bore', " + shortText(out.size[0]) + " m");
       out.shape = makeTube(out.size[0], out.size[1], out.size[2]);
     }}};

struct ContactKeys {
  KeyOf<KeyType::word, KeyType::word_or_map> on;
  KeyOf<KeyType::flag> bodies;
  KeyOf<KeyType::word, KeyType::word_or_map> collider, cloud;
  KeyOf<KeyType::number> exclusion_ratio;
  KeyOf<KeyType::word, KeyType::word_or_map> rods, law, friction_at, quadrature, stick;
  KeyOf<KeyType::number> radius, distance, stiffness, threshold, smoothing, friction, fall_off_velocity, slip_length,
      tangential_damping, normal_damping;
};
// clang-format off
constexpr ContactKeys of_scene{
    "contact.on", "contact.bodies", "contact.collider", "contact.cloud", "contact.exclusion_ratio", "contact.rods", "contact.law", "contact.friction_at", "contact.quadrature", "contact.stick", "contact.radius",
    "contact.distance", "contact.stiffness", "contact.threshold", "contact.smoothing", "contact.friction",
    "contact.fall_off_velocity", "contact.slip_length", "contact.tangential_damping", "contact.normal_damping"};
constexpr ContactKeys of_rod{
    "rods[].contact.on", "rods[].contact.bodies", "rods[].contact.collider", "rods[].contact.cloud", "rods[].contact.exclusion_ratio", "rods[].contact.rods", "rods[].contact.law", "rods[].contact.friction_at", "rods[].contact.quadrature", "rods[].contact.stick",
    "rods[].contact.radius", "rods[].contact.distance", "rods[].contact.stiffness", "rods[].contact.threshold",
    "rods[].contact.smoothing", "rods[].contact.friction", "rods[].contact.fall_off_velocity", "rods[].contact.slip_length",
    "rods[].contact.tangential_damping", "rods[].contact.normal_damping"};
// clang-format on

void readSettings(YamlMap &map, const ContactKeys &keys, ContactSettings &out) {
  auto read = [&](KeyOf<KeyType::number> key, double &value) {
    if (map.has(*key)) value = map.number(key);
  };
  if (map.has(*keys.on)) out.on_surface = map.word(keys.on) == "surface";
  if (map.has(*keys.rods)) {
    using Rods = ContactSettings::Rods;
    const std::string which = map.word(keys.rods);
    out.rods = which == "all" ? Rods::all : which == "others" ? Rods::others : Rods::none;
  }
  if (map.has(*keys.collider)) out.point_cloud = map.word(keys.collider) == "point_cloud";
  if (map.has(*keys.cloud)) out.cloud = map.word(keys.cloud) == "vertices" ? 0 : std::stoi(map.word(keys.cloud));
  if (map.has(*keys.exclusion_ratio) && !((out.exclusion_ratio = map.number(keys.exclusion_ratio)) > 1))
    map.at(*keys.exclusion_ratio)
        .fail("'exclusion_ratio' must be more than 1, or neighbours along a rod push each other");
  for (const Key *key : {&*keys.cloud, &*keys.exclusion_ratio})
    if (map.has(*key) && !out.point_cloud)
      map.at(*key).fail("'" + std::string(key->name()) + "' is for 'collider: point_cloud'");
  if (map.has(*keys.bodies)) out.bodies = map.flag(keys.bodies);
  if (map.has(*keys.law)) {
    using Law = ContactSettings::Law;
    const Law law = map.word(keys.law) == "penalty" ? Law::penalty : Law::barrier;
    if (law != out.law) { // what the scene says of the other law has no meaning here
      const ContactSettings fresh;
      out.stiffness = fresh.stiffness;
      out.threshold = fresh.threshold;
      out.smoothing = fresh.smoothing;
      out.distance = std::nan("");
    }
    out.law = law;
  }
  read(keys.radius, out.radius);
  read(keys.distance, out.distance);
  read(keys.stiffness, out.stiffness);
  read(keys.threshold, out.threshold);
  read(keys.smoothing, out.smoothing);
  read(keys.friction, out.friction);
  read(keys.fall_off_velocity, out.fall_off_velocity);
  read(keys.slip_length, out.slip_length);
  read(keys.tangential_damping, out.tangential_damping);
  read(keys.normal_damping, out.normal_damping);
  if (map.has(*keys.stick))
    out.stick = map.word(keys.stick) == "creep" ? ContactSettings::Stick::creep : ContactSettings::Stick::anchored;
  if (map.has(*keys.friction_at)) out.friction_at_surface = map.word(keys.friction_at) == "surface";
  if (map.has(*keys.quadrature))
    out.quadrature = map.word(keys.quadrature) == "auto"      ? 0
                     : map.word(keys.quadrature) == "corners" ? ContactSettings::corners
                                                              : std::stoi(map.word(keys.quadrature));
  auto refuse = [&](KeyOf<KeyType::number> key, const char *law) {
    if (map.has(*key)) map.at(*key).fail("'" + std::string(key->name()) + "' is for 'law: " + law + "'");
  };
  if (!out.isBarrier()) refuse(keys.distance, "barrier");
  if (out.isBarrier()) refuse(keys.threshold, "penalty");
  if (out.isBarrier()) refuse(keys.smoothing, "penalty");
  map.finish();
}

/// Of what a rod with a skin may touch, that whose middle is least deep; points of a skin have nothing about them that
/// could not follow through.
std::pair<std::string, double> thinnest(const Scene &scene, const ContactSettings &contact) {
  std::pair<std::string, double> least{"", HUGE_VAL};
  if (!contact.on_surface) return least;
  auto take = [&](const std::string &name, double depth) {
    if (depth < least.second) least = {name, depth};
  };
  for (int k = 0; k < int(scene.colliders.size()); ++k)
    if (std::find(contact.passes.begin(), contact.passes.end(), k) == contact.passes.end())
      take("collider '" + scene.colliders[k].name + "'", scene.colliders[k].shape->depth());
  for (const Body &body : scene.bodies)
    if (contact.touchesBodies() && body.contact.touchesBodies() && body.solid)
      take("body '" + body.name + "'", body.solid->depth());
  return least;
}

/// What a rod needs that touches by its skin; its penalty is per area as written.
void completeSurface(const YamlValue &block, Rod &rod) {
  ContactSettings &contact = rod.contact;
  const std::string who = "rod '" + rod.name + "' touches by its surface";
  if (!rod.skin) block.fail(who + ", and has none; give it one, as 'skin: {tube: {sides: 12}}'");
  if (rod.material.isCable())
    block.fail(who + ", and is a cable, which has no frames that carry one; take 'on: surface' away");
  if (rod.skin->mesh && rod.skin->edges > 2)
    block.fail(who +
               ", whose points no more than two edges may carry; take 'edges: 2' for its mesh, or a file with two");
  if (contact.quadrature == 0) contact.quadrature = 3;
  if (contact.quadrature == 2)
    block.fail(who + ", which has 1, 3 or 6 points of a triangle or its corners for 'quadrature', not 2");
  if (!contact.friction_at_surface) block.fail(who + ", and 'friction_at: centreline' is for 'on: axis'");
  const Skin skin = skinOf(rod);
  try {
    checkClosed(rod, skin);
  } catch (const std::invalid_argument &e) {
    block.fail(who + ": " + e.what());
  }
  const double around = perimeterOf(rod, skin);
  if (!contact.isBarrier() && contact.stiffness == 0) contact.stiffness = 1e9;
  contact.stiffness *= around;
  if (std::isnan(contact.radius) && !rod.material.section) // for rods, and the width of its law
    contact.radius = rod.skin->tube.sides > 0 ? std::max(rod.skin->tube.half_axes[0], rod.skin->tube.half_axes[1])
                                              : around / (2 * pi);
}

} // namespace

ContactSettings readContact(YamlMap &scene) {
  ContactSettings settings;
  settings.radius = settings.distance = std::nan("");
  if (scene.has("contact")) {
    YamlMap map(scene.at("contact"), "contact");
    (void)map.has("contact.ignore"); // for readIgnored
    readSettings(map, of_scene, settings);
  }
  return settings;
}

void readContact(YamlMap &rod, ContactSettings &settings) {
  if (!rod.has("rods[].contact")) return;
  const YamlValue value = rod.at("rods[].contact");
  if (value.isMap()) {
    YamlMap map(value, "rods[].contact");
    readSettings(map, of_rod, settings);
  } else
    settings.on = rod.word("rods[].contact") != "none";
}

/// What a word of 'ignore' names: rods, bodies or colliders with that name or layer.
struct Named {
  std::vector<ContactSettings *> moving;
  std::vector<int> colliders;
};

static Named named(const YamlValue &value, AnyKey key, SceneFile &out) {
  const std::string word = value.text(), kind(key->name());
  Named found;
  auto add = [&](auto &things) {
    for (auto &thing : things)
      if (thing.name == word || thing.layer == word) found.moving.push_back(&thing.contact);
  };
  if (kind == "colliders") {
    for (int k = 0; k < int(out.scene.colliders.size()); ++k)
      if (out.scene.colliders[k].name == word || out.scene.colliders[k].layer == word) found.colliders.push_back(k);
  } else if (kind == "bodies" || kind == "to_bodies") {
    add(out.scene.bodies);
    add(out.scene.held_bodies);
  } else {
    for (const int r : out.names.find(word)) found.moving.push_back(&out.scene.rods[r].contact);
    for (Rod &rod : out.scene.rods)
      if (rod.layer == word) found.moving.push_back(&rod.contact);
  }
  const std::string one = kind == "colliders" ? "collider" : kind.find("bodies") != std::string::npos ? "body" : "rod";
  if (found.moving.empty() && found.colliders.empty())
    value.fail("no " + one + " has the name or layer '" + inOneLine(word) + "'");
  return found;
}

void readIgnored(YamlMap &scene, SceneFile &out) {
  if (!scene.has("contact")) return;
  YamlMap contact(scene.at("contact"), "contact");
  if (!contact.has("contact.ignore")) return;
  int &entries = out.ignored_pairs;
  for (const YamlValue &value : contact.at("contact.ignore").items()) {
    YamlMap map(value, "contact.ignore");
    std::vector<Named> two;
    for (const AnyKey key :
         {AnyKey("contact.ignore[].rods"), AnyKey("contact.ignore[].to_rods"), AnyKey("contact.ignore[].bodies"),
          AnyKey("contact.ignore[].to_bodies"), AnyKey("contact.ignore[].colliders")})
      if (map.has(key)) two.push_back(named(map.at(key), key, out));
    map.finish();
    if (two.size() != 2 || two.front().moving.empty())
      value.fail("names two that pass through each other, as {rods: strands, colliders: floor}, {rods: left, to_rods: "
                 "right} or {rods: strands, bodies: bob}");
    if (two.back().colliders.empty()) {
      if (entries == 64)
        value.fail("is the 65th pair of rods and bodies, more than fit; give things that belong together one layer");
      for (ContactSettings *one : two.front().moving) one->apart_from |= std::uint64_t(1) << entries;
      for (ContactSettings *other : two.back().moving) other->apart_to |= std::uint64_t(1) << entries;
      ++entries;
    }
    for (ContactSettings *one : two.front().moving) {
      std::vector<int> &passes = one->passes;
      passes.insert(passes.end(), two.back().colliders.begin(), two.back().colliders.end());
      std::sort(passes.begin(), passes.end());
      passes.erase(std::unique(passes.begin(), passes.end()), passes.end());
    }
  }
}

void completeContact(const YamlValue &block, const Overrides &overrides, Scene &scene) {
  auto replace = [&](const char *name, double &value) {
    if (const auto o = overrides.find(name); o != overrides.end()) value = std::stod(o->second);
  };
  const Rod *one = nullptr; // the first that touches rods
  for (Rod &rod : scene.rods) {
    ContactSettings &contact = rod.contact;
    if (!contact.on ||
        (scene.colliders.empty() && !contact.touchesRods() && !(contact.bodies && scene.touchesBodies())))
      continue;
    replace("contact_stiffness", contact.stiffness);
    replace("contact_friction", contact.friction);
    replace("contact_distance", contact.distance);
    if (!contact.isBarrier() && overrides.count("contact_distance"))
      throw SceneError("option -contact_distance: is for 'law: barrier', which rod '" + rod.name + "' has not");
    if (contact.on_surface) completeSurface(block, rod);
    if (std::isnan(contact.radius)) {
      if (!rod.material.section)
        block.fail("rod '" + rod.name +
                   "' has no section that tells its radius; give it 'contact: {radius: ...}', or 'contact: none'");
      contact.radius = std::max(rod.material.section->halfAxes()[0], rod.material.section->halfAxes()[1]);
    }
    if (contact.radius == 0 && contact.isBarrier())
      block.fail("rod '" + rod.name + "' has the contact radius 0, for which there is only 'law: penalty'");
    if (contact.radius == 0 && contact.touchesRods())
      block.fail("rod '" + rod.name + "' touches rods, and needs a contact radius above 0 for it");
    if (contact.point_cloud && contact.isBarrier())
      block.fail("rod '" + rod.name + "' is a point cloud, for which there is only 'law: penalty'");
    if (std::isnan(contact.distance))
      contact.distance = std::min(0.2 * contact.radius, thinnest(scene, contact).second);
    if (const auto [name, depth] = thinnest(scene, contact); contact.isBarrier() && contact.distance > depth)
      block.fail("rod '" + rod.name + "': the 'distance' of its contact, " + shortText(contact.distance) +
                 " m, must not exceed the depth of " + name + ", " + shortText(depth) +
                 " m, or points of its skin would pass it");
    if (contact.isBarrier() && contact.distance > contact.radius)
      block.fail("rod '" + rod.name + "': the 'distance' of its contact, " + shortText(contact.distance) +
                 " m, must not exceed its radius, " + shortText(contact.radius) + " m");
    if (!contact.isBarrier() && contact.stiffness == 0) contact.stiffness = 1e9;
    if (!contact.on_surface && contact.quadrature == ContactSettings::corners)
      block.fail("rod '" + rod.name + "' has 'quadrature: corners', those of triangles, which are for 'on: surface'");
    if (!contact.on_surface && contact.quadrature == 6)
      block.fail("rod '" + rod.name + "' has 6 points of a triangle for 'quadrature', which is for 'on: surface'");
    if (contact.touchesRods() && !one) one = &rod;
    if (contact.touchesRods() && one->contact.law != contact.law)
      block.fail("rods '" + one->name + "' and '" + rod.name +
                 "' touch each other by two laws, barrier and penalty; give all rods that touch rods the same");
    if (contact.touchesRods() && one->contact.point_cloud != contact.point_cloud)
      block.fail("rods '" + one->name + "' and '" + rod.name +
                 "' touch each other, one as capsules, one as a point cloud; give all rods that touch rods the same "
                 "'collider'");
    if (contact.slip_length == 0) contact.slip_length = 1e-3 * (contact.radius > 0 ? contact.radius : 0.01);
  }
}

void readCollider(const YamlValue &value, Scene &scene) {
  YamlMap map(value, "colliders");
  Collider c;
  c.name = map.has("colliders[].name") ? readName(map.at("colliders[].name"))
                                       : "collider" + std::to_string(scene.colliders.size());
  for (const Collider &other : scene.colliders)
    if (other.name == c.name) value.fail("a collider with the name '" + c.name + "' is there already");
  Mat3 turn = Mat3::Identity();
  for (const ShapeKey &shape : shape_keys) {
    if (!map.has(*shape.key)) continue;
    const std::string name(shape.key->name());
    if (c.shape) value.fail("has two shapes, '" + c.kind + "' and '" + name + "'; write a collider for each");
    c.kind = name;
    YamlMap block(map.at(*shape.key), shape.key);
    shape.read(block, c, turn);
    block.finish();
  }
  if (!c.shape) {
    map.refuseUnknown();
    value.fail("a collider needs a shape: plane, sphere, capsule, cylinder, box, tube or mesh");
  }
  if (map.has("colliders[].layer")) c.layer = readName(map.at("colliders[].layer"));
  c.position = map.vector("colliders[].position");
  const Vec3 rotation = map.vector("colliders[].rotation");
  c.rotation = rotationBy(rotation) * turn;
  if (map.has("colliders[].motion")) c.motion = readMotion(map.at("colliders[].motion"), collider_motion_keys);
  if (map.has("colliders[].friction")) c.friction = map.number("colliders[].friction");
  map.finish();
  scene.colliders.push_back(std::move(c));
}

} // namespace tendril
