#include "tendril/model/rod_model.hpp"

#include "tendril/model/builders.hpp"
#include "tendril/model/numbers_by_rod.hpp"
#include "tendril/model/scene.hpp"

#include <algorithm>
#include <map>

namespace tendril {
namespace {

constexpr double rounding = 16 * epsilon; ///< of lengths and directions that are meant to be the same
constexpr double turned = 1e-12;          ///< the same of directors, which are carried from edge to edge

bool isNormalTo(const Vec3 &v, int axis) { return std::abs(v[axis]) <= rounding * v.norm(); }
bool isAlong(const Vec3 &v, int axis) { return (v - v[axis] * Vec3::Unit(axis)).norm() <= rounding * v.norm(); }

bool staysIn(const Motion &m, int flat) {
  return isNormalTo(m.velocity, flat) && isNormalTo(m.amplitude, flat) && isAlong(m.angular_velocity, flat) &&
         std::all_of(m.table.begin(), m.table.end(), [&](const Motion::Key &k) {
           return isNormalTo(k.displacement, flat) && isAlong(k.rotation, flat);
         });
}

/// Parts of both directors of an edge along a coordinate.
Eigen::Vector2d partsAlong(int axis, const Vec3 &tangent, const Vec3 &director) {
  return {director[axis], tangent.cross(director)[axis]};
}

/// Finds the models that rods of a scene can be of.
class Judge {
public:
  /// \param dynamic whether inertia counts
  Judge(const Scene &scene, bool dynamic)
      : scene_(scene), dynamic_(dynamic), supports_(scene.supports, scene.rods.size()),
        forces_(scene.forces, scene.rods.size()), followers_(scene.followers, scene.rods.size()),
        moments_(scene.moments, scene.rods.size()), joined_(scene.rods.size()), turned_(scene.rods.size()) {
    noteJoined();
  }
  /// Why a model would leave out what acts on a rod, or what it answers with, as the end of a sentence; empty where its
  /// answers are those of `full`. A planar rod stays in its plane until it buckles out of it.
  std::string whyNot(int r, RodModel model) const;
  /// Why nobody would see a planar rod buckle out of its plane.
  std::string whyNotWatched(int r, bool watched) const;
  /// The coordinate that is no unknown of a planar rod: all vertices agree in it, and nothing moves them along it;
  /// -1: none.
  int flatCoordinate(int r) const;

private:
  const Scene &scene_;
  bool dynamic_;
  NumbersByRod supports_, forces_, followers_, moments_;
  /// By rod: what joins it to others, and what turns its edges; empty where nothing does.
  std::vector<std::string> joined_, turned_;
  std::map<int, std::vector<const Constraint *>> pins_; ///< by rod: those to the world ...
  std::map<int, std::vector<const Tendon *>> tendons_;  ///< ... and those through that rod and points of the world

  void noteJoined();
  bool agrees(int r, int coordinate) const;
  bool isTwisted(int r) const;
  std::string whatTouches(int r, int flat) const;
  std::string whatDraws(int r, int flat) const;
  std::string whatLeaves(int r, int flat) const;
  std::string whatBends(int r, int flat) const;
  std::string whyNotIn(int r, int flat) const;
  std::string whatCurves(int r) const;
  std::string whyNotPlanar(int r) const;
  std::string whyNotTorsionFree(int r) const;
};

void Judge::noteJoined() {
  auto noteFirst = [](std::string &of, const std::string &what) {
    if (of.empty()) of = what;
  };
  auto note = [&](int r, const std::string &what, bool turns) {
    noteFirst(joined_[std::size_t(r)], what);
    if (turns) noteFirst(turned_[std::size_t(r)], what);
  };
  for (const Junction &j : scene_.junctions)
    for (const Junction::Member &m : j.members) note(m.rod, "junction '" + j.name + "' joins it", m.group >= 0);
  for (const Attachment &a : scene_.attachments)
    note(a.rod, "body '" + scene_.bodies[std::size_t(a.body)].name + "' hangs on it", a.weld);
  for (const Constraint &c : scene_.constraints) {
    const std::string what = "constraint '" + c.name + "' draws at it";
    if (c.isPin() && c.isToWorld())
      pins_[c.rod].push_back(&c);
    else
      note(c.rod, what, !c.isPin());
    if (c.isTie()) note(c.to_rod, what, false);
  }
  for (const Tendon &t : scene_.tendons) {
    const std::vector<int> rods = scene_.rodsOf(t);
    const bool of_one = rods.size() == 1 && t.wraps.empty() && scene_.bodiesOf(t).empty();
    if (of_one) tendons_[rods[0]].push_back(&t);
    const std::string what = "tendon '" + t.name + "' draws at it";
    for (const int r : rods)
      if (!of_one) noteFirst(joined_[std::size_t(r)], what);
    for (const Waypoint &p : t.points)
      if (p.rod >= 0 && !p.point.tail<2>().isZero(0)) noteFirst(turned_[std::size_t(p.rod)], what);
  }
  for (const Body &b : scene_.bodies) note(b.rod, "body '" + b.name + "' belongs to it", false);
}

/// What a planar rod may touch, but half spaces whose sides are normal to its plane.
std::string Judge::whatTouches(int r, int flat) const {
  const ContactSettings &contact = scene_.rods[std::size_t(r)].contact;
  if (contact.touchesMoving()) return "it may touch rods or bodies";
  if (!scene_.touches(r)) return {};
  if (contact.on_surface) return "it touches with its surface";
  if (contact.slides()) return "friction or damping acts where it touches";
  for (int k = 0; k < int(scene_.colliders.size()); ++k) {
    const Collider &c = scene_.colliders[std::size_t(k)];
    if (std::find(contact.passes.begin(), contact.passes.end(), k) != contact.passes.end()) continue;
    if (c.kind != "plane" || !isNormalTo(c.rotation.col(2), flat) || !staysIn(c.motion, flat))
      return "collider '" + c.name + "' may push it out of its plane";
  }
  return {};
}

/// What draws a planar rod out of its plane, of springs and tendons between it and the world.
std::string Judge::whatDraws(int r, int flat) const {
  const Rod &rod = scene_.rods[std::size_t(r)];
  const double size = rounding * (rod.length() + std::abs(rod.position[0][flat]));
  auto isIn = [&](const Vec3 &point, const Motion &motion) {
    return std::abs(point[flat] - rod.position[0][flat]) <= size && staysIn(motion, flat);
  };
  auto carries = [&](const Waypoint &p) {
    const Eigen::Vector2d n = partsAlong(flat, rod.edge(p.edge).normalized(), rod.director[std::size_t(p.edge)]);
    return std::abs(n.dot(p.point.tail<2>())) <= size;
  };
  if (const auto of = pins_.find(r); of != pins_.end())
    for (const Constraint *c : of->second)
      if (!isIn(c->point, c->motion)) return "constraint '" + c->name + "' draws it out of its plane";
  if (const auto of = tendons_.find(r); of != tendons_.end())
    for (const Tendon *t : of->second)
      for (const Waypoint &p : t->points)
        if (!(p.isTold() ? isIn(p.point, p.motion) : carries(p)))
          return "tendon '" + t->name + "' draws it out of its plane";
  return {};
}

/// Loads and motions that leave a plane.
std::string Judge::whatLeaves(int r, int flat) const {
  const Rod &rod = scene_.rods[std::size_t(r)];
  if (rod.gravity && !isNormalTo(scene_.gravity, flat)) return "gravity points out of its plane";
  if (!isAlong(scene_.rotation.angular_velocity, flat)) return "the scene turns about an axis in its plane";
  if (!isNormalTo(rod.initial_velocity, flat)) return "its velocity at the start leaves its plane";
  for (const int k : forces_.of(r))
    if (!isNormalTo(scene_.forces[std::size_t(k)].force, flat)) return "a force points out of its plane";
  for (const int k : followers_.of(r)) {
    const FollowerForce &f = scene_.followers[std::size_t(k)];
    const int edge = std::min(f.vertex, rod.edges() - 1); // directors of planar rods stand at one angle to the plane
    if (std::abs(
            partsAlong(flat, rod.edge(edge).normalized(), rod.director[std::size_t(edge)]).dot(f.force.head<2>())) >
        rounding * f.force.norm())
      return "a follower force points out of its plane";
  }
  for (const int k : moments_.of(r)) {
    const EdgeMoment &m = scene_.moments[std::size_t(k)];
    if (m.torque != 0) return "a torque twists it";
    if (!isAlong(m.moment, flat)) return "a moment turns it out of its plane";
  }
  for (const int k : supports_.of(r)) {
    const Support &s = scene_.supports[std::size_t(k)];
    if (!staysIn(s.motion, flat)) return std::string("a ") + nameOf(s.kind) + " moves out of its plane";
    if (s.holdsTwist() && std::abs(s.frame.tangent[flat]) > rounding)
      return std::string("a ") + nameOf(s.kind) + " points out of its plane";
  }
  return {};
}

/// Directors of a planar rod stand at one angle to the plane; natural curvature and, where the two flexural stiffnesses
/// differ, a principal axis of the section are normal to it.
std::string Judge::whatBends(int r, int flat) const {
  const Rod &rod = scene_.rods[std::size_t(r)];
  const Eigen::Vector2d n = partsAlong(flat, rod.edge(0).normalized(), rod.director[0]);
  for (int i = 1; i < rod.edges(); ++i)
    if ((partsAlong(flat, rod.edge(i).normalized(), rod.director[std::size_t(i)]) - n).norm() > turned)
      return "its directors turn about its tangent";
  for (const int k : supports_.of(r)) {
    const Support &s = scene_.supports[std::size_t(k)];
    if (s.holdsTwist() && (partsAlong(flat, s.frame.tangent, s.frame.director) - n).norm() > turned)
      return std::string("a ") + nameOf(s.kind) + " turns it about its tangent";
  }
  const auto [k1, k2] = rod.material.flexural_stiffness;
  if (std::abs(k1 - k2) > rounding * (k1 + k2) && std::abs(n[0] * n[1]) > turned)
    return "its section bends out of the plane: no principal axis is normal to it";
  if (rod.natural == Rod::Natural::given) {
    const Vec3 &natural = rod.natural_strain;
    if (natural[2] != 0) return "it is twisted at rest";
    if (std::abs(natural[0] * n[1] - natural[1] * n[0]) > turned * natural.norm())
      return "its natural curvature leaves the plane";
  }
  return {};
}

/// Whether the vertices of a rod agree in a coordinate.
bool Judge::agrees(int r, int coordinate) const {
  const std::vector<Vec3> &x = scene_.rods[std::size_t(r)].position;
  const double size = rounding * (scene_.rods[std::size_t(r)].length() + std::abs(x[0][coordinate]));
  return std::all_of(x.begin(), x.end(),
                     [&](const Vec3 &p) { return std::abs(p[coordinate] - x[0][coordinate]) <= size; });
}

std::string Judge::whyNotIn(int r, int flat) const {
  for (const std::string &why : {whatTouches(r, flat), whatDraws(r, flat), whatLeaves(r, flat)})
    if (!why.empty()) return why;
  return whatBends(r, flat);
}

int Judge::flatCoordinate(int r) const {
  for (int a = 0; a < 3; ++a) // of a straight rod, two may do
    if (agrees(r, a) && whyNotIn(r, a).empty()) return a;
  return -1;
}

std::string Judge::whyNotPlanar(int r) const {
  if (!joined_[std::size_t(r)].empty()) return joined_[std::size_t(r)];
  if (scene_.rods[std::size_t(r)].initial_turns != 0) return "it is twisted at the start";
  std::string reasons;
  for (int a = 0; a < 3; ++a) {
    if (!agrees(r, a)) continue;
    const std::string why = whyNotIn(r, a);
    if (why.empty()) return {};
    reasons += (reasons.empty() ? "normal to " : ", normal to ") + std::string(1, char('x' + a)) + " " + why;
  }
  if (!reasons.empty()) return reasons;
  return "its vertices agree in no coordinate; turn the scene so that its plane is one of coordinates";
}

/// What is curved when stress-free.
std::string Judge::whatCurves(int r) const {
  const Rod &rod = scene_.rods[std::size_t(r)];
  constexpr const char *curved = "it is curved when stress-free";
  if (rod.natural == Rod::Natural::given) return rod.natural_strain.head<2>().isZero(0) ? "" : curved;
  const Vec3 t = rod.edge(0).normalized();
  for (int i = 1; i < rod.edges(); ++i)
    if (t.cross(rod.edge(i).normalized()).norm() > rounding) return curved;
  for (const int k : supports_.of(r)) {
    const Support &s = scene_.supports[std::size_t(k)];
    if (s.kind == Support::Kind::clamp && t.cross(s.frame.tangent).norm() > rounding)
      return "a clamp points aside, so that it is curved there when stress-free";
  }
  return {};
}

/// Whether a rod is twisted as drawn, or against what holds it.
bool Judge::isTwisted(int r) const {
  const Rod &rod = scene_.rods[std::size_t(r)];
  auto apart = [&](int edge, const Vec3 &tangent, const Vec3 &director) {
    const Vec3 t = rod.edge(edge).normalized();
    return (transport<double>(rod.director[std::size_t(edge)], t, tangent) - director).norm() > turned;
  };
  for (int i = 1; i < rod.edges(); ++i)
    if (apart(i - 1, rod.edge(i).normalized(), rod.director[std::size_t(i)])) return true;
  return std::any_of(supports_.of(r).begin(), supports_.of(r).end(), [&](int k) {
    const Support &s = scene_.supports[std::size_t(k)];
    return s.holdsTwist() && apart(std::min(s.vertex, rod.edges() - 1), s.frame.tangent, s.frame.director);
  });
}

std::string Judge::whyNotTorsionFree(int r) const {
  const Rod &rod = scene_.rods[std::size_t(r)];
  const auto [k1, k2] = rod.material.flexural_stiffness;
  if (rod.closed) return "a closed rod twists when it leaves its plane";
  if (k1 != k2) return "its two flexural stiffnesses differ";
  if (const std::string why = whatCurves(r); !why.empty()) return why;
  if (rod.initial_turns != 0) return "it is twisted at the start";
  if (rod.material.stiffness_damping_coefficient != 0) return "'stiffness_damping_coefficient' acts on its bending";
  for (const int k : moments_.of(r))
    if (scene_.moments[std::size_t(k)].torque != 0 || !scene_.moments[std::size_t(k)].moment.isZero(0))
      return "a moment or torque twists it";
  for (const int k : followers_.of(r))
    if (!scene_.followers[std::size_t(k)].isTangential()) return "a follower force turns with its directors";
  int holders = 0;
  for (const int k : supports_.of(r)) {
    const Support &s = scene_.supports[std::size_t(k)];
    if (!s.holdsTwist()) continue;
    if (s.vertex != 0 && s.vertex != rod.edges()) return "its director is held along the rod";
    ++holders;
  }
  if (holders > 1) return "its director is held at both ends, which twists it";
  if (isTwisted(r)) return "its directors turn about its tangent";
  if (const std::string &why = turned_[std::size_t(r)]; !why.empty()) return why + ", and turns it";
  const bool meets = rod.contact.touchesMoving();
  if (rod.contact.on_surface && (scene_.touches(r) || meets)) return "it touches with its surface, which turns it";
  const bool rubs = (scene_.touches(r) && rod.contact.slides()) || (meets && scene_.slidesAmongMoving());
  if (rubs && rod.contact.friction_at_surface) return "friction at its surface turns it";
  if (dynamic_ && rod.material.linear_rotational_inertia != 0)
    return "it has rotational inertia about its tangent; write 'linear_rotational_inertia: 0'";
  return {};
}

std::string Judge::whyNotWatched(int r, bool watched) const {
  if (!watched) return "planes are watched on one rank, and not along the arc length of a path";
  if (!moments_.of(r).empty() || !followers_.of(r).empty())
    return "moments and follower forces have no potential that would tell whether it leaves its plane";
  return {};
}

std::string Judge::whyNot(int r, RodModel model) const {
  switch (model) {
  case RodModel::cable:
    return scene_.rods[std::size_t(r)].bends() ? "it bends" : "";
  case RodModel::planar:
    return whyNotPlanar(r);
  case RodModel::torsion_free:
    return whyNotTorsionFree(r);
  case RodModel::full:
    break;
  }
  return {};
}

} // namespace

void flatten(Rod &rod) {
  for (Vec3 &x : rod.position) x[rod.flat] = rod.position.front()[rod.flat];
}

void giveAllUnknowns(Rod &rod) {
  if (rod.model == RodModel::cable) rod.material.flexural_stiffness = std::exchange(rod.left_out, {0.0, 0.0});
  rod.model = RodModel::full;
  rod.flat = -1;
}

void settleModels(Scene &scene, bool dynamic, bool watched, std::vector<std::string> *notes) {
  const Judge judge(scene, dynamic);
  int stiff = 0;
  std::map<RodModel, std::pair<int, std::string>> chosen; // how many rods, and why the first has no smaller model
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    Rod &rod = scene.rods[std::size_t(r)];
    if (!rod.bends()) {
      rod.model = RodModel::cable;
      stiff += rod.left_out != std::array{0.0, 0.0};
      chosen[RodModel::cable].first += rod.chooses_model;
      continue;
    }
    if (rod.chooses_model) {
      std::string reasons;
      for (const RodModel model : {RodModel::planar, RodModel::torsion_free, RodModel::full}) {
        rod.model = model;
        std::string why = judge.whyNot(r, model);
        if (model == RodModel::planar && why.empty()) why = judge.whyNotWatched(r, watched);
        if (why.empty()) break;
        reasons += (reasons.empty() ? "" : "; ") + std::string("not ") + nameOf(model) + ": " + why;
      }
      auto &[rods, why] = chosen[rod.model];
      if (rods++ == 0 && !reasons.empty()) why = " (rod '" + rod.name + "': " + reasons + ")";
    } else if (const std::string why = judge.whyNot(r, rod.model); !why.empty())
      throw SceneError("rod '" + rod.name + "' cannot be of model " + nameOf(rod.model) + ": " + why +
                       "; take model full, or auto");
    if (rod.model != RodModel::planar) continue;
    rod.flat = judge.flatCoordinate(r);
    flatten(rod);
  }
  auto count = [](int rods) { return std::to_string(rods) + (rods == 1 ? " rod" : " rods"); };
  if (stiff > 0)
    notes->push_back("model cable: the flexural stiffness of " + count(stiff) +
                     " counts for nothing; -model_check tells what that changes");
  for (const auto &[model, of] : chosen) {
    if (of.first == 0) continue;
    notes->push_back(std::string("model auto: ") + nameOf(model) + " for " + count(of.first) + of.second);
  }
}

} // namespace tendril
