#include "tendril/model/scene.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace tendril {
namespace {

double degrees(double radians) { return radians * 180 / pi; }

} // namespace

std::string shortText(double value) {
  std::ostringstream s;
  s << std::setprecision(3) << value;
  return s.str();
}

double Rod::length() const {
  double sum = 0;
  for (int i = 0; i < edges(); ++i) sum += edge(i).norm();
  return sum;
}

bool Scene::collidersMove() const {
  return std::any_of(colliders.begin(), colliders.end(), [](const Collider &c) { return c.motion.moves(); });
}

double Scene::collidersEvenUntil(double from, double to) const {
  for (const Collider &c : colliders)
    if (c.motion.moves()) to = c.motion.evenUntil(from, to);
  return to;
}

std::int64_t Scene::edges() const {
  if (whole) return whole->edges;
  std::int64_t sum = 0;
  for (const Rod &rod : rods) sum += rod.edges();
  return sum;
}

bool Scene::slides() const {
  if (whole) return whole->slides;
  return !colliders.empty() &&
         std::any_of(rods.begin(), rods.end(), [](const Rod &r) { return r.contact.on && r.contact.slides(); });
}

bool Scene::strainsDissipate() const {
  if (whole) return whole->strains_dissipate;
  return std::any_of(rods.begin(), rods.end(),
                     [](const Rod &rod) { return rod.material.stiffness_damping_coefficient != 0; }) ||
         std::any_of(constraints.begin(), constraints.end(), [](const Constraint &c) { return c.damping != 0; }) ||
         std::any_of(joints.begin(), joints.end(), [](const Joint &j) { return j.dissipates(); }) ||
         std::any_of(tendons.begin(), tendons.end(), [](const Tendon &t) { return t.dissipates(); });
}

template <class Item>
static void keep(const std::vector<Item> &from, const std::vector<int> &place, std::vector<Item> &to) {
  for (const Item &item : from)
    if (place[item.rod] >= 0) to.emplace_back(item).rod = place[item.rod];
}

Scene withRods(const Scene &scene, const std::vector<int> &rods) {
  Scene out;
  out.gravity = scene.gravity;
  out.rotation = scene.rotation;
  out.colliders = scene.colliders;
  std::vector<int> place(scene.rods.size(), -1);
  for (const int r : rods) {
    place[r] = int(out.rods.size());
    out.rods.push_back(scene.rods[r]);
  }
  keep(scene.supports, place, out.supports);
  keep(scene.constraints, place, out.constraints);
  for (Constraint &c : out.constraints)
    if (c.isTie()) c.to_rod = place[c.to_rod];
  for (const Junction &j : scene.junctions) {
    if (place[j.members.front().rod] < 0) continue;
    Junction &kept = out.junctions.emplace_back(j);
    for (Junction::Member &m : kept.members) m.rod = place[m.rod];
  }
  std::vector<int> body(scene.bodies.size(), -1);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (place[scene.bodies[b].rod] < 0) continue;
    body[b] = int(out.bodies.size());
    out.bodies.push_back(scene.bodies[b]);
    out.bodies.back().rod = place[scene.bodies[b].rod];
  }
  keep(scene.attachments, place, out.attachments);
  for (Attachment &a : out.attachments) a.body = body[a.body];
  for (Constraint &c : out.constraints)
    if (c.isToBody()) c.to_body = body[c.to_body];
  std::vector<int> joint(scene.joints.size(), -1);
  for (std::size_t k = 0; k < scene.joints.size(); ++k) {
    const Joint &j = scene.joints[k];
    if (body[j.child] < 0) continue;
    joint[k] = int(out.joints.size());
    Joint &kept = out.joints.emplace_back(j);
    kept.child = body[j.child];
    if (j.parent >= 0) kept.parent = body[j.parent];
  }
  keep(scene.tendons, place, out.tendons);
  for (Tendon &t : out.tendons) {
    for (Waypoint &p : t.points) {
      if (p.body >= 0) p.body = body[p.body];
      if (p.rod >= 0) p.rod = place[p.rod];
    }
    for (Wrap &w : t.wraps)
      if (w.body >= 0) w.body = body[w.body];
    for (Tendon::Pull &p : t.joints) p.joint = joint[p.joint];
  }
  out.hostBodies();
  keep(scene.forces, place, out.forces);
  keep(scene.followers, place, out.followers);
  keep(scene.moments, place, out.moments);
  return out;
}

void setBishopDirectors(Rod &rod, const Vec3 &start) {
  const int ne = rod.edges();
  rod.director.resize(ne);
  Vec3 t = rod.edge(0).normalized();
  rod.director[0] = start.isZero(0) ? anyNormal(t) : orthonormalised(start, t);
  for (int i = 1; i < ne; ++i) {
    const Vec3 next = rod.edge(i).normalized();
    rod.director[i] = orthonormalised(transport<double>(rod.director[i - 1], t, next), next);
    t = next;
  }
  if (!rod.closed) return;
  // Angle from the frame that comes round to the first one, spread over the round by arc length between edge midpoints.
  const double holonomy = halfAngleBetween(referenceFrame(rod, ne - 1), referenceFrame(rod, 0)).angle();
  double length = 0, along = 0;
  for (int i = 0; i < ne; ++i) length += rod.edge(i).norm();
  for (int i = 1; i < ne; ++i) {
    along += 0.5 * (rod.edge(i - 1).norm() + rod.edge(i).norm());
    const Vec3 ti = rod.edge(i).normalized();
    rod.director[i] = rotateAbout<double>(rod.director[i], ti, holonomy * along / length);
  }
}

Frame referenceFrame(const Rod &rod, int edge) {
  const Vec3 e = rod.edge(edge);
  const double length = e.norm();
  return {e / length, rod.director[edge], length};
}

Frame frameAtVertex(const Rod &rod, int vertex) {
  const int a = rod.edgeBefore(vertex), b = rod.edgeAfter(vertex);
  if (a >= 0 && b >= 0) {
    const Frame f0 = referenceFrame(rod, a), f1 = referenceFrame(rod, b);
    const Vec3 t = (f0.tangent + f1.tangent).normalized();
    const Vec3 d = transport<double>(f0.director, f0.tangent, t) + transport<double>(f1.director, f1.tangent, t);
    return {t, orthonormalised(d, t), 1};
  }
  const int end = a < 0 ? b : a, inner = a < 0 ? rod.edgeAfter(vertex + 1) : rod.edgeBefore(vertex - 1);
  Frame f = referenceFrame(rod, end);
  if (inner >= 0) {
    const Frame g = referenceFrame(rod, inner);
    const Vec3 t = (f.tangent - (g.tangent - f.tangent) * f.length / (f.length + g.length)).normalized();
    f.director = orthonormalised(transport<double>(f.director, f.tangent, t), t);
    f.tangent = t;
  }
  f.length = 1;
  return f;
}

void checkRod(const Rod &rod) {
  auto fail = [&](auto &&...parts) {
    std::ostringstream message;
    message << "rod '" << rod.name << "': ";
    (message << ... << parts);
    throw SceneError(message.str());
  };
  const int minimum = rod.closed ? 3 : 2;
  if (rod.vertices() < minimum)
    fail("has ", rod.vertices(), " vertices; a", rod.closed ? " closed" : "n open", " rod needs at least ", minimum);
  double scale = 0;
  for (const Vec3 &x : rod.position) scale = std::max(scale, (x - rod.position[0]).norm());
  for (int i = 0; i < rod.vertices(); ++i)
    if (!rod.position[i].allFinite()) fail("vertex ", i, " has a coordinate that is not finite");
  for (int i = 0; i < rod.edges(); ++i)
    if (!std::isfinite(rod.edge(i).norm()))
      fail("edge ", i, " (vertex ", i, " to ", rod.next(i), ") is too long to compute with; SI units?");
  for (int i = 0; i < rod.edges(); ++i)
    if (rod.edge(i).norm() <= 1e-12 * scale)
      fail("edge ", i, " (vertex ", i, " to ", rod.next(i), ") has zero length; remove one of the two vertices");
  for (int v = 0; v < rod.vertices(); ++v) {
    const int a = rod.edgeBefore(v), b = rod.edgeAfter(v);
    if (a < 0 || b < 0) continue;
    const double c = rod.edge(a).normalized().dot(rod.edge(b).normalized());
    if (c < -0.9999)
      fail("folds back on itself at vertex ", v, " (turning angle ", degrees(std::acos(std::max(-1.0, c))),
           " degrees); edges may turn by less than 179");
  }
  if (rod.material.isCable()) return;
  double length = 0, longest = 0; // of a cell
  for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
  for (int v = 0; v < rod.vertices(); ++v) {
    const int a = rod.edgeBefore(v), b = rod.edgeAfter(v);
    if (a >= 0 && b >= 0) longest = std::max(longest, 0.5 * (rod.edge(a).norm() + rod.edge(b).norm()));
  }
  // What one vertex may take: half a turn, of twist only in measure tan.
  const Vec3 natural = rod.natural == Rod::Natural::given ? rod.natural_strain : Vec3::Zero();
  const double bend = std::hypot(natural[0], natural[1]) * longest,
               drawn = 2 * pi * std::abs(rod.initial_turns) / length * longest;
  if (!(bend < pi))
    fail("its natural curvature turns it by ", degrees(bend),
         " degrees at a vertex; use more edges: less than 180 is possible");
  if (rod.measure != Measure::tan) return;
  const double twist = std::abs(natural[2]) * longest;
  if (!(twist < pi))
    fail("its natural twist is ", degrees(twist),
         " degrees at a vertex; measure tan takes less than 180: use more edges, or measure angle");
  if (!(drawn < pi))
    fail("'turns' twist it by ", degrees(drawn),
         " degrees at a vertex; measure tan takes less than 180: use more edges, or measure angle");
}

DimensionlessGroups dimensionlessGroups(const Rod &rod, const Vec3 &gravity, const std::vector<char> &corners) {
  DimensionlessGroups g{};
  for (int i = 0; i < rod.edges(); ++i) g.length += rod.edge(i).norm();
  const double ei = std::min(rod.material.flexural_stiffness[0], rod.material.flexural_stiffness[1]);
  g.gravito_bending = rod.gravity ? rod.material.linear_density * gravity.norm() * std::pow(g.length, 3) / ei : 0;
  g.axial_to_bending = rod.material.axial_stiffness * g.length * g.length / ei;
  for (int v = 0; v < rod.vertices(); ++v) {
    const int a = rod.edgeBefore(v), b = rod.edgeAfter(v);
    if (a < 0 || b < 0 || (!corners.empty() && corners[v])) continue;
    const Frame f0 = referenceFrame(rod, a), f1 = referenceFrame(rod, b);
    const double turning = std::acos(std::clamp(f0.tangent.dot(f1.tangent), -1.0, 1.0));
    g.largest_turning = std::max(g.largest_turning, degrees(turning));
    const double softness =
        turning * turning * g.length / (g.axial_to_bending * (rod.edge(a).norm() + rod.edge(b).norm()));
    if (rod.energy == Energy::seed && rod.natural == Rod::Natural::as_drawn && turning > pi / 6 &&
        softness > g.corner_softness) {
      g.corner_softness = softness;
      g.softest_corner = v;
    }
    const double drawn = pi * rod.initial_turns * (f0.length + f1.length) / g.length; // over the cell, by `turns`
    g.largest_twist = std::max(g.largest_twist, std::abs(degrees(halfAngleBetween(f0, f1).angle() + drawn)));
  }
  return g;
}

void Scene::hostBodies() {
  std::vector<int> first(bodies.size(), int(rods.size()));
  for (const Attachment &a : attachments) first[a.body] = std::min(first[a.body], a.rod);
  for (const Constraint &c : constraints)
    if (c.isToBody()) first[c.to_body] = std::min(first[c.to_body], c.rod);
  for (const Tendon &t : tendons)
    for (const Waypoint &p : t.points)
      for (const int b : p.rod >= 0 ? bodiesOf(t) : std::vector<int>()) first[b] = std::min(first[b], p.rod);
  for (bool spreads = true; spreads;) {
    spreads = false;
    auto spread = [&](int a, int b) {
      if (first[a] == first[b]) return;
      first[a] = first[b] = std::min(first[a], first[b]);
      spreads = true;
    };
    for (const Joint &j : joints)
      if (j.parent >= 0) spread(j.child, j.parent);
    for (const Tendon &t : tendons) {
      const std::vector<int> pulled = bodiesOf(t);
      for (const int b : pulled) spread(b, pulled.front());
    }
  }
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (first[b] < int(rods.size())) bodies[b].rod = first[b];
  for (Joint &j : joints) j.rod = bodies[j.child].rod;
  for (Tendon &t : tendons)
    if (const std::vector<int> of = rodsOf(t); !of.empty()) t.rod = of.front();
}

std::vector<int> Scene::bodiesOf(const Tendon &tendon) const {
  std::vector<int> all;
  for (const Waypoint &p : tendon.points) all.push_back(p.body);
  for (const Wrap &w : tendon.wraps) all.push_back(w.body);
  for (const Tendon::Pull &p : tendon.joints) {
    all.push_back(joints[p.joint].child);
    all.push_back(joints[p.joint].parent);
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  if (!all.empty() && all.front() < 0) all.erase(all.begin());
  return all;
}

std::vector<int> Scene::rodsOf(const Tendon &tendon) const {
  std::vector<int> all;
  for (const Waypoint &p : tendon.points)
    if (p.rod >= 0) all.push_back(p.rod);
  for (const int b : bodiesOf(tendon)) all.push_back(bodies[b].rod);
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

bool Scene::tendonsRub() const {
  return whole ? whole->tendons_rub
               : std::any_of(tendons.begin(), tendons.end(), [](const Tendon &t) { return !t.rubs().empty(); });
}

int Scene::firstMemory(int tendon) const {
  int count = 0;
  for (int k = 0; k < tendon; ++k) count += tendons[std::size_t(k)].remembered();
  return count;
}

bool Scene::tendonsTwist() const {
  return std::any_of(tendons.begin(), tendons.end(), [](const Tendon &t) {
    return std::any_of(t.points.begin(), t.points.end(),
                       [](const Waypoint &p) { return p.rod >= 0 && !p.point.isZero(0); });
  });
}

bool Scene::isPressed(int body) const {
  if (touchesBody(body)) return true;
  return std::any_of(tendons.begin(), tendons.end(), [&](const Tendon &t) {
    const std::vector<int> pulled = bodiesOf(t);
    return std::binary_search(pulled.begin(), pulled.end(), body);
  });
}

bool Scene::hasCouples() const {
  if (whole) return whole->has_couples;
  return !moments.empty() || !followers.empty() ||
         std::any_of(bodies.begin(), bodies.end(), [](const Body &b) { return !b.torque.isZero(0); });
}

bool Scene::isJoined() const {
  return !junctions.empty() || !bodies.empty() || !tendons.empty() ||
         std::any_of(constraints.begin(), constraints.end(), [](const Constraint &c) { return c.isTie(); });
}

const char *nameOf(Constraint::Kind kind) { return kind == Constraint::Kind::pin ? "pin" : "rotation"; }

const char *nameOf(Support::Kind kind) {
  switch (kind) {
  case Support::Kind::clamp:
    return "clamp";
  case Support::Kind::pin:
    return "pin";
  case Support::Kind::fix_twist:
    return "fix_twist";
  }
  return "";
}

} // namespace tendril
