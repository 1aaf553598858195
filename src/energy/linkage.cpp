#include "tendril/energy/linkage.hpp"

#include <algorithm>
#include <numeric>

namespace tendril {

Linkage::Linkage(const Scene &scene, const Elements &elements)
    : scene_(scene), elements_(elements), links_(scene.rods.size()), in_tree_(scene.bodies.size(), false),
      of_tree_(scene.joints.size(), false), moves_(scene.bodies.size()) {
  const int count = int(scene.bodies.size()), world = count;
  std::vector<int> first(std::size_t(count) + 1);
  std::iota(first.begin(), first.end(), 0);
  auto rootOf = [&](int b) {
    while (first[std::size_t(b)] != b) b = first[std::size_t(b)] = first[std::size_t(first[std::size_t(b)])];
    return b;
  };
  std::vector<std::vector<int>> joints(std::size_t(count) + 1); // of trees, by their bodies and the world
  for (int k = 0; k < int(scene.joints.size()); ++k) {
    const Joint &j = scene.joints[std::size_t(k)];
    const int parent = j.parent < 0 ? world : j.parent, a = rootOf(j.child), b = rootOf(parent);
    if (!j.isExact() || a == b) continue;
    first[std::size_t(a)] = b;
    of_tree_[std::size_t(k)] = true;
    joints[std::size_t(j.child)].push_back(k);
    joints[std::size_t(parent)].push_back(k);
    for (const int body : {j.child, j.parent})
      if (body >= 0) in_tree_[std::size_t(body)] = true;
  }
  // From the world, and then from the first body of each tree that floats.
  std::vector<char> placed(std::size_t(count) + 1, false);
  auto grow = [&](int root) {
    placed[std::size_t(root)] = true;
    std::vector<int> reached{root};
    for (std::size_t n = 0; n < reached.size(); ++n)
      for (const int k : joints[std::size_t(reached[n])]) {
        const Joint &j = scene.joints[std::size_t(k)];
        const int other = j.child == reached[n] ? (j.parent < 0 ? world : j.parent) : j.child;
        if (placed[std::size_t(other)]) continue;
        placed[std::size_t(other)] = true;
        reached.push_back(other);
        links_[std::size_t(j.rod)].push_back({k, other != j.child});
      }
  };
  grow(world);
  for (int b = 0; b < count; ++b)
    if (!placed[std::size_t(b)]) grow(b);
  if (std::none_of(in_tree_.begin(), in_tree_.end(), [](char c) { return c; })) return;
  hosts_.resize(scene.rods.size());
  auto goesWith = [&](int rod, int body) {
    if (!in_tree_[std::size_t(body)]) return;
    const int host = scene.bodies[std::size_t(body)].rod;
    std::vector<int> &hosts = hosts_[std::size_t(rod)];
    if (std::find(hosts.begin(), hosts.end(), host) == hosts.end()) hosts.push_back(host);
  };
  const RodSet all{0, int(scene.rods.size())};
  for (const JoinedBody &b : elements.bodies(all)) goesWith(b.rod, b.body);
  for (const JoinedVertex &j : elements.joinedVertices(all))
    if (j.isOnBody()) goesWith(j.rod, j.body);
  for (const JoinedEdge &j : elements.joinedEdges(all))
    if (j.of_body) goesWith(j.rod, j.group - (elements.groups - count));
}

/// The part of a rotation about an axis [rad].
static double turnAbout(const Mat3 &rotation, const Vec3 &axis) {
  const Eigen::Quaterniond q(rotation);
  return 2 * std::atan2(q.vec().dot(axis), q.w());
}

/// The turn that a frame makes to where it is afterwards, as a rotation vector near another one, so that more than half
/// a turn counts as such.
static Vec3 turnNear(const Vec3 &about, const Frame &before, const Mat3 &turned) {
  const Frame after{turned.col(0), turned.col(1), 1};
  Vec3 turn = rotationBetween(before, after);
  const double angle = turn.norm();
  if (angle > 0) {
    const Vec3 along = turn / angle;
    turn += 2 * pi * std::round((about.dot(along) - angle) / (2 * pi)) * along;
  }
  return turn;
}

/// With T what a body has turned by since it was drawn, a joint has T_child = T_parent exp(axis q), and the child's
/// point as far from the parent's, in the parent's axes, as it slides.
void Linkage::follow(const TreeJoint &link, const Configuration &from, const Planes &increment, double scale) const {
  const Joint &joint = scene_.joints[std::size_t(link.joint)];
  const BodyPair &pair = elements_.pairOf(link.joint);
  const JointPlace place = placeOf(joint, pair, elements_, from);
  const Joint::Held held = joint.held();
  auto moveOf = [&](int body) { return moves_[std::size_t(body)]; };
  struct Pose {
    Vec3 point; ///< by how much that of the joint has moved from the parent's before
    Mat3 turned;
  };
  const Vec3 parent_point = place.reach - place.parent_arm; // of the child, from the parent's
  auto childPose = [&](const Move &m) {
    const Mat3 turn = rotationBy(m.turn);
    return Pose{parent_point + m.translation + (turn * place.arm - place.arm), turn * from.rotationAt(pair.of[1])};
  };
  auto parentPose = [&](const Move &m) {
    const Mat3 turn = rotationBy(m.turn);
    return Pose{m.translation + (turn * place.parent_arm - place.parent_arm), turn * from.rotationAt(pair.of[3])};
  };
  const Pose world{Vec3::Zero(), place.parent_axes * joint.axes.transpose()};
  const Pose child = childPose(moveOf(joint.child)),
             parent = joint.parent < 0 ? world : parentPose(moveOf(joint.parent));
  // Coordinates: the one that the joint counts goes as the increments say, others as both bodies have gone.
  Vec12 moved = Vec12::Zero();
  for (int k = 0; k < 4; ++k)
    if (pair.of[std::size_t(k)] >= 0) moved.segment<3>(3 * k) = scale * increment.vector(0, pair.of[std::size_t(k)]);
  double counted = 0;
  if (held.turnsFreely() || held.slidesFreely()) {
    const JointRow row = jointRow(joint, place, coordinate_row);
    counted = row.value + row.gradient.dot(moved);
  }
  const Vec3 axis = joint.axes.col(2);
  Mat3 relative = parent.turned.transpose() * child.turned;
  if (held.turn)
    relative = Mat3::Identity();
  else if (held.tilt)
    relative = rotationBy((held.slidesFreely() ? turnAbout(relative, axis) : counted) * axis);
  // The gap is measured in the parent's axes, which a child that is placed gives it.
  const Mat3 parent_turned = link.places_parent ? Mat3(child.turned * relative.transpose()) : parent.turned;
  Vec3 gap = (parent_turned * joint.axes).transpose() * (child.point - parent.point);
  for (int k = 0; k < 3; ++k)
    if (k < 2 ? held.across : held.along) gap[k] = 0;
  if (held.slidesFreely()) gap[2] = counted;
  const Vec3 off = parent_turned * joint.axes * gap;
  if (!link.places_parent) {
    const Mat3 turned = parent.turned * relative;
    const Mat3 turn = turned * from.rotationAt(pair.of[1]).transpose();
    moves_[std::size_t(joint.child)] = {parent.point + off - parent_point - (turn * place.arm - place.arm),
                                        turnNear(moveOf(joint.child).turn, from.frameAt(pair.of[1]), turned)};
  } else {
    const Mat3 turn = parent_turned * from.rotationAt(pair.of[3]).transpose();
    moves_[std::size_t(joint.parent)] = {child.point - off - (turn * place.parent_arm - place.parent_arm),
                                         turnNear(moveOf(joint.parent).turn, from.frameAt(pair.of[3]), parent_turned)};
  }
}

double Linkage::correct(const Configuration &from, const Planes &increment, double scale, int r, Planes &out) const {
  const RodRange &rod = elements_.rods[std::size_t(r)];
  if (out.size() == 0) out = Planes(slot_size, elements_.slots);
  for (int a = 0; a < slot_size; ++a)
    for (int s = rod.first_slot - 1; s < rod.first_slot + rod.slots - 1; ++s) out[a][s] = scale * increment[a][s];
  for (const int host : hosts_[std::size_t(r)]) {
    for (const JoinedBody &b : elements_.bodies({host, host + 1}))
      moves_[std::size_t(b.body)] = {scale * increment.vector(0, b.position), scale * increment.vector(0, b.rotation)};
    for (const TreeJoint &link : links_[std::size_t(host)]) follow(link, from, increment, scale);
  }
  for (const JoinedBody &b : elements_.bodies({r, r + 1})) {
    if (!in_tree_[std::size_t(b.body)]) continue;
    out.setVector(0, b.position, moves_[std::size_t(b.body)].translation);
    out.setVector(0, b.rotation, moves_[std::size_t(b.body)].turn);
  }
  for (const JoinedVertex &j : elements_.joinedVertices({r, r + 1})) {
    if (!j.isOnBody() || !in_tree_[std::size_t(j.body)]) continue;
    const Move &move = moves_[std::size_t(j.body)];
    out.setVector(0, j.frame, move.turn);
    out.setVector(0, j.slot, move.translation + move.turn.cross(from.rotationAt(j.frame) * elements_.armAsDrawn(j)));
  }
  const int first_group = elements_.groups - int(in_tree_.size());
  for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1}))
    if (j.of_body && in_tree_[std::size_t(j.group - first_group)])
      out.setVector(0, j.frame, moves_[std::size_t(j.group - first_group)].turn);
  double most = 0;
  for (const int host : hosts_[std::size_t(r)])
    for (const JoinedBody &b : elements_.bodies({host, host + 1}))
      if (in_tree_[std::size_t(b.body)]) most = std::max(most, moves_[std::size_t(b.body)].turn.norm());
  return most;
}

} // namespace tendril
