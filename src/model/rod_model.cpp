#include "tendril/model/rod_model.hpp"

#include "tendril/model/builders.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <map>

namespace tendril {
namespace {

constexpr double rounding = 1e-12; ///< of lengths and directions that are meant to be the same

/// What joins a rod to others, or draws at it; empty for a rod by itself.
std::string whatJoins(const Scene &scene, int r) {
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members)
      if (m.rod == r) return "junction '" + j.name + "' joins it";
  for (const Attachment &a : scene.attachments)
    if (a.rod == r) return "a body hangs on it";
  for (const Constraint &c : scene.constraints)
    if (c.rod == r || c.to_rod == r) return "constraint '" + c.name + "' draws at it";
  for (const Tendon &t : scene.tendons) {
    const std::vector<int> rods = scene.rodsOf(t);
    if (std::find(rods.begin(), rods.end(), r) != rods.end()) return "tendon '" + t.name + "' draws at it";
  }
  for (const Body &b : scene.bodies)
    if (b.rod == r) return "body '" + b.name + "' belongs to it";
  return {};
}

/// What a rod may touch.
std::string whatTouches(const Scene &scene, int r) {
  if (scene.touches(r)) return "it may touch colliders";
  if (scene.rods[r].contact.touchesMoving()) return "it may touch rods or bodies";
  return {};
}

bool isNormalTo(const Vec3 &v, int axis) { return std::abs(v[axis]) <= rounding * v.norm(); }
bool isAlong(const Vec3 &v, int axis) { return (v - v[axis] * Vec3::Unit(axis)).norm() <= rounding * v.norm(); }

bool staysIn(const Motion &m, int flat) {
  return isNormalTo(m.velocity, flat) && isNormalTo(m.amplitude, flat) && isAlong(m.angular_velocity, flat) &&
         std::all_of(m.table.begin(), m.table.end(), [&](const Motion::Key &k) {
           return isNormalTo(k.displacement, flat) && isAlong(k.rotation, flat);
         });
}

/// Loads and motions that leave a plane.
std::string whatLeaves(const Scene &scene, int r, int flat) {
  const Rod &rod = scene.rods[r];
  if (rod.gravity && !isNormalTo(scene.gravity, flat)) return "gravity points out of its plane";
  if (!isAlong(scene.rotation.angular_velocity, flat)) return "the scene turns about an axis in its plane";
  if (!isNormalTo(rod.initial_velocity, flat)) return "its velocity at the start leaves its plane";
  for (const NodalForce &f : scene.forces)
    if (f.rod == r && !isNormalTo(f.force, flat)) return "a force points out of its plane";
  for (const EdgeMoment &m : scene.moments) {
    if (m.rod != r) continue;
    if (m.torque != 0) return "a torque twists it";
    if (!isAlong(m.moment, flat)) return "a moment turns it out of its plane";
  }
  for (const Support &s : scene.supports) {
    if (s.rod != r) continue;
    if (!staysIn(s.motion, flat)) return std::string("a ") + nameOf(s.kind) + " moves out of its plane";
    if (s.holdsTwist() && std::abs(s.frame.tangent[flat]) > rounding)
      return std::string("a ") + nameOf(s.kind) + " points out of its plane";
  }
  return {};
}

/// Directors of a planar rod stand at one angle to the plane; natural curvature and, where the two flexural stiffnesses
/// differ, a principal axis of the section are normal to it.
std::string whyNotBentIn(const Scene &scene, int r, int flat) {
  const Rod &rod = scene.rods[r];
  auto parts = [&](const Vec3 &tangent, const Vec3 &director) {
    return Eigen::Vector2d(director[flat], tangent.cross(director)[flat]);
  };
  const Eigen::Vector2d n = parts(rod.edge(0).normalized(), rod.director[0]);
  for (int i = 1; i < rod.edges(); ++i)
    if ((parts(rod.edge(i).normalized(), rod.director[std::size_t(i)]) - n).norm() > 1e-9)
      return "its directors turn about its tangent";
  for (const Support &s : scene.supports)
    if (s.rod == r && s.holdsTwist() && (parts(s.frame.tangent, s.frame.director) - n).norm() > 1e-9)
      return std::string("a ") + nameOf(s.kind) + " turns it about its tangent";
  const auto [k1, k2] = rod.material.flexural_stiffness;
  if (std::abs(k1 - k2) > rounding * (k1 + k2) && std::abs(n[0] * n[1]) > 1e-9)
    return "its section bends out of the plane: no principal axis is normal to it";
  if (rod.natural == Rod::Natural::given) {
    const Vec3 &natural = rod.natural_strain;
    if (natural[2] != 0) return "it is twisted at rest";
    if (std::abs(natural[0] * n[1] - natural[1] * n[0]) > 1e-9 * natural.norm())
      return "its natural curvature leaves the plane";
  }
  return {};
}

std::string whyNotPlanar(const Scene &scene, int r) {
  const Rod &rod = scene.rods[r];
  const int flat = flatCoordinate(scene, r);
  if (flat < 0) return "its vertices agree in no coordinate; turn the scene so that its plane is one of coordinates";
  if (rod.initial_turns != 0) return "it is twisted at the start";
  for (const std::string &why : {whatJoins(scene, r), whatTouches(scene, r), whatLeaves(scene, r, flat)})
    if (!why.empty()) return why;
  return whyNotBentIn(scene, r, flat);
}

/// Whether a rod is straight when stress-free.
bool isStraight(const Rod &rod) {
  if (rod.natural == Rod::Natural::given) return rod.natural_strain.head<2>().isZero(0);
  const Vec3 t = rod.edge(0).normalized();
  for (int i = 1; i < rod.edges(); ++i)
    if (t.cross(rod.edge(i).normalized()).norm() > rounding) return false;
  return true;
}

std::string whyNotTorsionFree(const Scene &scene, int r, bool dynamic) {
  const Rod &rod = scene.rods[r];
  const auto [k1, k2] = rod.material.flexural_stiffness;
  if (rod.closed) return "a closed rod twists when it leaves its plane";
  if (k1 != k2) return "its two flexural stiffnesses differ";
  if (!isStraight(rod)) return "it is curved when stress-free";
  if (rod.initial_turns != 0) return "it is twisted at the start";
  if (rod.material.stiffness_damping_coefficient != 0) return "'stiffness_damping_coefficient' acts on its bending";
  for (const EdgeMoment &m : scene.moments)
    if (m.rod == r) return "a moment or torque twists it";
  int holders = 0;
  for (const Support &s : scene.supports) {
    if (s.rod != r || !s.holdsTwist()) continue;
    if (s.vertex != 0 && s.vertex != rod.edges()) return "its director is held along the rod";
    ++holders;
  }
  if (holders > 1) return "its director is held at both ends, which twists it";
  for (const std::string &why : {whatJoins(scene, r), whatTouches(scene, r)})
    if (!why.empty()) return why;
  if (dynamic && rod.material.linear_rotational_inertia != 0)
    return "it has rotational inertia about its tangent; write 'linear_rotational_inertia: 0'";
  return {};
}

} // namespace

/// Why nobody would see a planar rod buckle out of its plane.
static std::string whyNotWatched(const Scene &scene, int r, bool watched) {
  if (!watched) return "planes are watched on one rank, and not along the arc length of a path";
  for (const EdgeMoment &m : scene.moments)
    if (m.rod == r) return "moments have no potential that would tell whether it leaves its plane";
  return {};
}

int flatCoordinate(const Scene &scene, int r) {
  const Rod &rod = scene.rods[r];
  const double size = rounding * rod.length();
  int found = -1, best = -1;
  for (int a = 0; a < 3; ++a) { // of a straight rod, two
    const auto [low, high] = std::minmax_element(rod.position.begin(), rod.position.end(),
                                                 [a](const Vec3 &x, const Vec3 &y) { return x[a] < y[a]; });
    if ((*high)[a] - (*low)[a] > size) continue;
    const int fits = whatLeaves(scene, r, a).empty() ? 2 : isNormalTo(scene.gravity, a) ? 1 : 0;
    if (fits > best) {
      best = fits;
      found = a;
    }
  }
  return found;
}

std::string whyNot(const Scene &scene, int rod, RodModel model, bool dynamic) {
  switch (model) {
  case RodModel::cable:
    return scene.rods[rod].bends() ? "it bends" : "";
  case RodModel::planar:
    return whyNotPlanar(scene, rod);
  case RodModel::torsion_free:
    return whyNotTorsionFree(scene, rod, dynamic);
  case RodModel::full:
    break;
  }
  return {};
}

void flatten(Rod &rod) {
  for (Vec3 &x : rod.position) x[rod.flat] = rod.position.front()[rod.flat];
}

void settleModels(Scene &scene, bool dynamic, bool watched, std::vector<std::string> *notes) {
  std::map<RodModel, std::pair<int, std::string>> chosen; // how many rods, and why the first has no smaller model
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    Rod &rod = scene.rods[r];
    if (!rod.bends()) {
      rod.model = RodModel::cable;
      chosen[RodModel::cable].first += rod.chooses_model;
      continue;
    }
    if (rod.chooses_model) {
      std::string reasons;
      for (const RodModel model : {RodModel::planar, RodModel::torsion_free, RodModel::full}) {
        rod.model = model;
        std::string why = whyNot(scene, r, model, dynamic);
        if (model == RodModel::planar && why.empty()) why = whyNotWatched(scene, r, watched);
        if (why.empty()) break;
        reasons += (reasons.empty() ? "" : "; ") + std::string("not ") + nameOf(model) + ": " + why;
      }
      auto &[count, why] = chosen[rod.model];
      if (count++ == 0 && !reasons.empty()) why = " (rod '" + rod.name + "': " + reasons + ")";
    } else if (const std::string why = whyNot(scene, r, rod.model, dynamic); !why.empty())
      throw SceneError("rod '" + rod.name + "' cannot be of model " + nameOf(rod.model) + ": " + why +
                       "; take model full, or auto");
    if (rod.model != RodModel::planar) continue;
    rod.flat = flatCoordinate(scene, r);
    flatten(rod);
  }
  for (const auto &[model, of] : chosen) {
    if (of.first == 0) continue;
    notes->push_back(std::string("model auto: ") + nameOf(model) + " for " + std::to_string(of.first) +
                     (of.first == 1 ? " rod" : " rods") + of.second);
  }
}

} // namespace tendril
