#include "tendril/model/alike.hpp"

#include <algorithm>

namespace tendril {
namespace {

constexpr double rounding = 1e-9; ///< that of a shift, over lengths

bool same(const Support &a, const Support &b) {
  return a.kind == b.kind && a.vertex == b.vertex && a.motion == b.motion && a.tangent_given == b.tangent_given &&
         a.director_given == b.director_given &&
         (a.kind == Support::Kind::pin || ((a.frame.tangent - b.frame.tangent).norm() < rounding &&
                                           (a.frame.director - b.frame.director).norm() < rounding));
}

bool same(const NodalForce &a, const NodalForce &b) {
  return a.vertex == b.vertex && a.force == b.force && a.mass == b.mass;
}

bool same(const FollowerForce &a, const FollowerForce &b) { return a.vertex == b.vertex && a.force == b.force; }

bool same(const EdgeMoment &a, const EdgeMoment &b) {
  return a.edge == b.edge && a.torque == b.torque && a.moment == b.moment;
}

/// Places that are given by the scene stand in the world; others go with the rod.
bool same(const Constraint &a, const Constraint &b) {
  const bool same_place = a.isPin() ? !a.point_given && !b.point_given
                                    : (a.frame.tangent - b.frame.tangent).norm() < rounding &&
                                          (a.frame.director - b.frame.director).norm() < rounding;
  return a.kind == b.kind && a.at == b.at && a.motion == b.motion && a.stiffness == b.stiffness &&
         a.damping == b.damping && a.saturation == b.saturation && a.measure == b.measure &&
         a.damps_motion == b.damps_motion && a.point_given == b.point_given && a.tangent_given == b.tangent_given &&
         a.director_given == b.director_given && same_place;
}

bool sameShape(const Rod &a, const Drawing &drawing_a, const Rod &b, const Drawing &drawing_b) {
  if (a.position.size() != b.position.size() || a.closed != b.closed ||
      bool(drawing_a.curve) != bool(drawing_b.curve) || drawing_a.directors_given != drawing_b.directors_given)
    return false;
  const Vec3 shift = b.position[0] - a.position[0];
  const double close = rounding * a.edge(0).norm();
  for (int i = 0; i < a.vertices(); ++i)
    if ((b.position[i] - a.position[i] - shift).norm() > close) return false;
  for (int i = 0; i < a.edges(); ++i) {
    if ((b.director[i] - a.director[i]).norm() > rounding) return false;
    const double middle = (i + 0.5) / a.edges();
    if (drawing_a.curve && (drawing_b.curve(middle) - drawing_a.curve(middle) - shift).norm() > close) return false;
  }
  return true;
}

/// What belongs to each rod, in the scene's order.
template <class Item> std::vector<std::vector<Item>> byRod(const std::vector<Item> &items, std::size_t rods) {
  std::vector<std::vector<Item>> out(rods);
  for (const Item &item : items) out[item.rod].push_back(item);
  return out;
}

template <class Item> bool sameList(const std::vector<Item> &a, const std::vector<Item> &b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Item &x, const Item &y) { return same(x, y); });
}

} // namespace

std::vector<int> firstAlike(const Scene &scene, const std::vector<Drawing> &drawings) {
  const std::size_t rods = scene.rods.size();
  const auto supports = byRod(scene.supports, rods);
  const auto constraints = byRod(scene.constraints, rods);
  const auto forces = byRod(scene.forces, rods);
  const auto followers = byRod(scene.followers, rods);
  const auto moments = byRod(scene.moments, rods);
  auto alike = [&](int r, int s) {
    const Rod &a = scene.rods[r], &b = scene.rods[s];
    return a.material == b.material && a.measure == b.measure && a.energy == b.energy && a.gravity == b.gravity &&
           a.natural == b.natural && a.natural_strain == b.natural_strain && a.initial_velocity == b.initial_velocity &&
           a.initial_turns == b.initial_turns && sameShape(a, drawings[r], b, drawings[s]) &&
           sameList(supports[r], supports[s]) && sameList(constraints[r], constraints[s]) &&
           sameList(forces[r], forces[s]) && sameList(followers[r], followers[s]) && sameList(moments[r], moments[s]);
  };
  std::vector<int> first, kinds;
  for (int s = 0; s < int(rods); ++s) {
    const auto found = scene.rotation.angular_velocity.isZero(0) && scene.colliders.empty() && !scene.isJoined() &&
                               !scene.touchesMoving() && scene.tendons.empty()
                           ? std::find_if(kinds.begin(), kinds.end(), [&](int r) { return alike(r, s); })
                           : kinds.end();
    first.push_back(found == kinds.end() ? s : *found);
    if (found == kinds.end()) kinds.push_back(s);
  }
  return first;
}

} // namespace tendril
