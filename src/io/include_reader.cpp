#include "tendril/io/include_reader.hpp"

#include "tendril/energy/tendon.hpp"
#include "tendril/io/yaml.hpp"

#include <algorithm>

namespace tendril {
namespace {

void turn(Motion &motion, const Mat3 &rotation) {
  for (Vec3 *v : {&motion.velocity, &motion.angular_velocity, &motion.amplitude, &motion.arm}) *v = rotation * *v;
  for (Motion::Key &row : motion.table) {
    row.displacement = rotation * row.displacement;
    row.rotation = rotation * row.rotation;
  }
}

void turn(Frame &frame, const Mat3 &rotation) {
  frame.tangent = rotation * frame.tangent;
  frame.director = rotation * frame.director;
}

std::shared_ptr<const SkinRecipe> moved(const SkinRecipe &skin, const std::function<Vec3(const Vec3 &)> &place) {
  auto out = std::make_shared<SkinRecipe>(skin);
  if (!skin.mesh) return out;
  auto mesh = std::make_shared<TriangleMesh>(*skin.mesh);
  for (Vec3 &x : mesh->vertices) x = place(x);
  out->mesh = mesh;
  return out;
}

} // namespace

void place(Scene &scene, std::vector<Drawing> &drawings, const Mat3 &rotation, const Vec3 &translation) {
  const std::function<Vec3(const Vec3 &)> place = [=](const Vec3 &x) { return Vec3(rotation * x + translation); };
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    Rod &rod = scene.rods[r];
    for (Vec3 &x : rod.position) x = place(x);
    for (Vec3 &d : rod.director) d = rotation * d;
    rod.initial_velocity = rotation * rod.initial_velocity;
    if (rod.skin) rod.skin = moved(*rod.skin, place);
    if (drawings[r].curve) drawings[r].curve = [place, curve = drawings[r].curve](double s) { return place(curve(s)); };
  }
  for (Support &s : scene.supports) {
    turn(s.frame, rotation);
    turn(s.motion, rotation);
  }
  for (Constraint &c : scene.constraints) {
    c.point = place(c.point);
    turn(c.frame, rotation);
    turn(c.motion, rotation);
  }
  for (std::vector<Body> *bodies : {&scene.bodies, &scene.held_bodies})
    for (Body &b : *bodies) {
      b.own = b.own.moved(rotation, translation);
      b.position = place(b.position);
      b.rotation = rotation * b.rotation;
      for (Vec3 *v : {&b.velocity, &b.angular_velocity, &b.force, &b.torque}) *v = rotation * *v;
      turn(b.motion, rotation);
    }
  for (Attachment &a : scene.attachments) turn(a.frame, rotation);
  for (Joint &j : scene.joints) {
    j.point = place(j.point);
    j.axes = rotation * j.axes;
    turn(j.motion, rotation);
  }
  for (Tendon &t : scene.tendons) {
    for (Waypoint &p : t.points) {
      if (p.rod < 0) p.point = place(p.point);
      turn(p.motion, rotation);
    }
    for (Wrap &w : t.wraps) {
      w.centre = place(w.centre);
      w.axis = rotation * w.axis;
    }
  }
  for (NodalForce &f : scene.forces) f.force = rotation * f.force;
  for (EdgeMoment &m : scene.moments) m.moment = rotation * m.moment;
  for (Collider &c : scene.colliders) {
    c.position = place(c.position);
    c.rotation = rotation * c.rotation;
    turn(c.motion, rotation);
  }
}

/// What forces act in a mechanism, about: its residuals are told by it where nothing has weight [N].
static double forceOf(const Scene &scene, const std::vector<const Body *> &bodies, double size) {
  double force = 0, mass = 0;
  for (const Body *body : bodies) {
    mass += body->own.mass;
    force += body->own.mass * scene.gravity.norm() + body->force.norm() + body->torque.norm() / size;
  }
  for (const Joint &j : scene.joints) force = std::max(force, j.drive_stiffness / size);
  for (const Tendon &t : scene.tendons)
    if (t.actuator.kind == Actuator::Kind::force) force = std::max(force, t.actuator.largestInput());
  for (const Tendon &t : scene.tendons) // where nothing else is known
    if (force == 0) force = 1e-6 * size * stiffnessAsDrawn(t);
  return force > 0 ? force : mass * size;
}

/// A rod between two pins, as large and as stiff as a mechanism, beside which its bodies are. \return its number
static int addCarrier(const std::vector<const Body *> &mechanism, SceneFile &out) {
  const Body &body = *mechanism.front();
  double size = std::sqrt(body.own.inertia.trace() / body.own.mass);
  for (const Body *other : mechanism) size = std::max(size, (other->position - body.position).norm());
  Rod rod;
  rod.name = "carrier of " + body.name;
  while (out.names.isTaken(rod.name)) rod.name += "'";
  rod.position = {body.position, body.position + Vec3(size, 0, 0)};
  rod.material = {1e-9 * body.own.mass / size, 0, 1e4 * forceOf(out.scene, mechanism, size), 0, {0, 0}, 0, 0};
  rod.gravity = false;
  rod.contact.on = false;
  setBishopDirectors(rod);
  const int number = int(out.scene.rods.size());
  for (const int v : {0, 1}) out.scene.supports.push_back({Support::Kind::pin, number, v, {}, frameAtVertex(rod, v)});
  out.names.add(rod.name);
  out.scene.rods.push_back(rod);
  out.drawings.emplace_back();
  return number;
}

void carryBodies(SceneFile &out) {
  Scene &scene = out.scene;
  const std::size_t count = scene.bodies.size();
  std::vector<int> first(count);
  std::vector<char> has_rod(count, false), joined(count, false);
  for (std::size_t b = 0; b < count; ++b) first[b] = int(b);
  auto rootOf = [&](int b) {
    while (first[std::size_t(b)] != b) b = first[std::size_t(b)];
    return b;
  };
  auto join = [&](int a, int b) {
    a = rootOf(a);
    b = rootOf(b);
    first[std::size_t(std::max(a, b))] = std::min(a, b);
  };
  for (const Attachment &a : scene.attachments) has_rod[std::size_t(a.body)] = true;
  for (const Constraint &c : scene.constraints)
    if (c.isToBody()) has_rod[std::size_t(c.to_body)] = true;
  for (const Joint &j : scene.joints) {
    joined[std::size_t(j.child)] = true;
    if (j.parent >= 0) join(j.child, j.parent);
  }
  for (const Tendon &t : scene.tendons) {
    const bool of_rod = std::any_of(t.points.begin(), t.points.end(), [](const Waypoint &p) { return p.rod >= 0; });
    const std::vector<int> pulled = scene.bodiesOf(t);
    for (const int b : pulled) {
      joined[std::size_t(b)] = true;
      if (of_rod) has_rod[std::size_t(b)] = true;
      join(b, pulled.front());
    }
  }
  std::vector<std::vector<const Body *>> mechanism(count); // by its first body
  for (std::size_t b = 0; b < count; ++b) {
    const auto root = std::size_t(rootOf(int(b)));
    has_rod[root] = has_rod[root] || has_rod[b];
    joined[root] = joined[root] || joined[b];
    mechanism[root].push_back(&scene.bodies[b]);
  }
  const bool alone = scene.rods.empty();
  for (std::size_t b = 0; b < count; ++b) {
    const auto root = std::size_t(rootOf(int(b)));
    if (has_rod[root] || !(joined[root] || alone)) continue;
    if (root == b) scene.bodies[b].rod = addCarrier(mechanism[b], out);
    scene.bodies[b].rod = scene.bodies[root].rod;
  }
}

/// Puts a prefix before all names and layers of a scene.
static void prefixNames(const std::string &prefix, Scene &scene) {
  auto named = [&](std::string &name) { name = prefix + name; };
  auto layered = [&](std::string &layer) {
    if (!layer.empty()) layer = prefix + layer;
  };
  for (Rod &rod : scene.rods) {
    named(rod.name);
    layered(rod.layer);
  }
  for (std::vector<Body> *list : {&scene.bodies, &scene.held_bodies})
    for (Body &b : *list) {
      named(b.name);
      layered(b.layer);
    }
  for (Constraint &c : scene.constraints) named(c.name);
  for (Attachment &a : scene.attachments) named(a.name);
  for (Junction &j : scene.junctions) named(j.name);
  for (Joint &j : scene.joints) named(j.name);
  for (Tendon &t : scene.tendons) named(t.name);
  for (Collider &c : scene.colliders) {
    named(c.name);
    layered(c.layer);
  }
}

/// Numbers of a scene that comes behind another. \param ignored_pairs of the other
static void shiftNumbers(const Scene &other, int ignored_pairs, Scene &scene) {
  const int rods = int(other.rods.size()), bodies = int(other.bodies.size()), joints = int(other.joints.size()),
            colliders = int(other.colliders.size());
  auto shift = [](int &number, int by) {
    if (number >= 0) number += by;
  };
  auto meet = [&](ContactSettings &contact) {
    for (int &k : contact.passes) k += colliders;
    if (ignored_pairs == 64) return; // it has none
    contact.apart_from <<= ignored_pairs;
    contact.apart_to <<= ignored_pairs;
  };
  for (Rod &rod : scene.rods) meet(rod.contact);
  for (std::vector<Body> *list : {&scene.bodies, &scene.held_bodies})
    for (Body &b : *list) {
      meet(b.contact);
      b.rod = scene.rods.empty() ? 0 : b.rod + rods;
    }
  for (Support &s : scene.supports) s.rod += rods;
  for (Constraint &c : scene.constraints) {
    c.rod += rods;
    shift(c.to_rod, rods);
    shift(c.to_body, bodies);
  }
  for (Attachment &a : scene.attachments) {
    a.rod += rods;
    a.body += bodies;
  }
  for (Junction &j : scene.junctions)
    for (Junction::Member &m : j.members) m.rod += rods;
  for (Joint &j : scene.joints) {
    j.child += bodies;
    shift(j.parent, bodies);
    j.rod += rods;
  }
  for (Tendon &t : scene.tendons) {
    t.rod += rods;
    for (Waypoint &p : t.points) {
      shift(p.body, bodies);
      shift(p.rod, rods);
    }
    for (Wrap &w : t.wraps) shift(w.body, bodies);
    for (Tendon::Pull &p : t.joints) p.joint += joints;
  }
  for (NodalForce &f : scene.forces) f.rod += rods;
  for (FollowerForce &f : scene.followers) f.rod += rods;
  for (EdgeMoment &m : scene.moments) m.rod += rods;
}

/// Adds the names of a scene, which have their prefix, and those that are only in the file, which do not yet.
static void addNames(const SceneFile &part, const std::string &prefix, const YamlValue &where, SceneFile &out) {
  const Scene &from = part.scene;
  auto clash = [&](const std::string &what, const std::string &name) {
    where.fail("there is " + what + " '" + name + "' already; write another 'prefix'");
  };
  for (const Rod &rod : from.rods)
    if (out.names.isTaken(rod.name)) clash("a rod", rod.name);
  for (const Rod &rod : from.rods) out.names.add(rod.name);
  for (const std::vector<Body> *list : {&from.bodies, &from.held_bodies})
    for (const Body &b : *list)
      if (out.body_numbers.count(b.name)) clash("a body", b.name);
  const int all_bodies = int(out.bodies.size());
  for (const auto &[name, number] : part.body_numbers) out.body_numbers[prefix + name] = number + all_bodies;
  for (const Tendon &t : from.tendons)
    for (const Tendon &other : out.scene.tendons)
      if (other.name == t.name) clash("a tendon", t.name);
  for (const Collider &c : from.colliders)
    for (const Collider &other : out.scene.colliders)
      if (other.name == c.name) clash("a collider", c.name);
  for (const std::string &name : part.constraint_names)
    if (!out.constraint_names.insert(prefix + name).second) clash("a constraint", prefix + name);
  for (const std::string &name : part.joint_names)
    if (!out.joint_names.insert(prefix + name).second) clash("a joint", prefix + name);
}

/// Adds where the bodies of a file are, and what is at its vertices.
static void addPlaces(const SceneFile &part, const std::string &prefix, SceneFile &out) {
  const Scene &scene = out.scene;
  const int rods = int(scene.rods.size()), supports = int(scene.supports.size());
  for (SceneFile::BodyPlace place : part.bodies) {
    place.index += int(place.held ? scene.held_bodies.size() : scene.bodies.size());
    out.bodies.push_back(place);
  }
  for (const auto &[vertex, name] : part.joined) out.joined[{vertex.first + rods, vertex.second}] = prefix + name;
  for (const auto &[vertex, name] : part.attached) out.attached[{vertex.first + rods, vertex.second}] = prefix + name;
  for (const auto &[vertex, numbers] : part.supports_at)
    for (const int k : numbers) out.supports_at[{vertex.first + rods, vertex.second}].push_back(k + supports);
}

template <class Item> static void moveBehind(std::vector<Item> &to, std::vector<Item> &items) {
  to.insert(to.end(), std::make_move_iterator(items.begin()), std::make_move_iterator(items.end()));
}

static void moveBehind(Scene &to, Scene &from) {
  moveBehind(to.rods, from.rods);
  moveBehind(to.supports, from.supports);
  moveBehind(to.constraints, from.constraints);
  moveBehind(to.junctions, from.junctions);
  moveBehind(to.bodies, from.bodies);
  moveBehind(to.held_bodies, from.held_bodies);
  moveBehind(to.attachments, from.attachments);
  moveBehind(to.joints, from.joints);
  moveBehind(to.tendons, from.tendons);
  moveBehind(to.forces, from.forces);
  moveBehind(to.followers, from.followers);
  moveBehind(to.moments, from.moments);
  moveBehind(to.colliders, from.colliders);
}

void append(SceneFile part, const std::string &prefix, const YamlValue &where, SceneFile &out) {
  if (out.ignored_pairs + part.ignored_pairs > 64)
    where.fail("with it more than 64 pairs of rods and bodies pass through each other by 'ignore', more than fit");
  prefixNames(prefix, part.scene);
  shiftNumbers(out.scene, out.ignored_pairs, part.scene);
  addNames(part, prefix, where, out);
  addPlaces(part, prefix, out);
  out.ignored_pairs += part.ignored_pairs;
  out.constraint_blocks += part.constraint_blocks;
  out.junction_blocks += part.junction_blocks;
  out.joint_blocks += part.joint_blocks;
  moveBehind(out.scene, part.scene);
  moveBehind(out.drawings, part.drawings);
  moveBehind(out.notes, part.notes);
  moveBehind(out.source.paths, part.source.paths);
  for (auto &file : part.source.files)
    if (std::find(out.source.files.begin(), out.source.files.end(), file) == out.source.files.end())
      out.source.files.push_back(file);
}

} // namespace tendril
