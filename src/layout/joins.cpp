/// What junctions, bodies and ties make of the slots of rods.
#include "tendril/layout/dof_map.hpp"

#include <algorithm>

namespace tendril {

/// Joins the islands of two rods to one, with all between them.
void DofMap::makeIsland(RodSet a, RodSet b) {
  const RodSet island{std::min(a.begin, b.begin), std::max(a.end, b.end)};
  for (int r = island.begin; r < island.end; ++r) islands_[r] = island;
}

void DofMap::setTouching(std::vector<TouchingPair> pairs) {
  touching_ = {};
  touching_.items = std::move(pairs);
  if (!touching_.items.empty()) touching_.sort(rods_.size());
  islands_ = lasting_;
  if (islands_.empty() && !touching_.items.empty())
    for (int r = 0; r < int(rods_.size()); ++r) islands_.push_back({r, r + 1});
  for (const TouchingPair &p : touching_.items)
    if (p.to_rod != p.rod) makeIsland(islands_[p.to_rod], islands_[p.rod]);
}

/// Ties the edges beside a vertex to the frame of a group, each by a frame and a half cell of its own. \param joined of
/// the first frame, or with that below 0: it is that of the first edge then
void DofMap::tieEdges(const Scene &scene, JoinedEdge joined, std::vector<int> &free_slots) {
  const RodRange &range = rods_[joined.rod];
  const Rod &rod = scene.rods[joined.rod];
  for (const bool ends : {true, false}) {
    joined.edge = ends ? rod.edgeBefore(joined.vertex) : rod.edgeAfter(joined.vertex);
    if (joined.edge < 0) continue;
    joined.frame = range.looseSlot() + free_slots[joined.rod]++;
    joined.cell = range.looseSlot() + free_slots[joined.rod]++;
    joined.ends = ends;
    if (joined.first_frame < 0) {
      joined.first_frame = joined.frame;
      unknown_end_[joined.rod] = std::max(unknown_end_[joined.rod], joined.frame + 1);
    }
    joined_edges_.items.push_back(joined);
  }
}

void DofMap::joinBodies(const Scene &scene, std::vector<int> &free_slots) {
  for (const Body &body : scene.bodies) {
    const RodRange &range = rods_[body.rod];
    const int position = range.looseSlot() + free_slots[body.rod]++,
              rotation = range.looseSlot() + free_slots[body.rod]++;
    bodies_.items.push_back({body.rod, position, rotation, int(bodies_.items.size()), groups_++});
    unknown_end_[body.rod] = std::max(unknown_end_[body.rod], rotation + 1);
    joined_[body.rod] = true;
  }
  auto makePair = [&](const JoinedBody &body, int joint) {
    const int first = rods_[body.rod].looseSlot() + free_slots[body.rod];
    free_slots[body.rod] += BodyPair::slots;
    return BodyPair{body.rod, first, joint, body.body, {body.position, body.rotation, -1, -1}};
  };
  for (int k = 0; k < int(scene.joints.size()); ++k) {
    const Joint &joint = scene.joints[k];
    const JoinedBody &child = bodies_.items[joint.child];
    BodyPair pair = makePair(child, k);
    if (joint.parent >= 0) {
      const JoinedBody &parent = bodies_.items[joint.parent];
      pair.of[2] = parent.position;
      pair.of[3] = parent.rotation;
      makeIsland(islands_[joint.rod], islands_[parent.rod]);
    }
    pairs_.items.push_back(pair);
  }
  for (int b = 0; b < int(scene.bodies.size()); ++b)
    if (scene.isPressed(b)) pairs_.items.push_back(makePair(bodies_.items[b], -1));
  for (int k = 0; k < int(scene.attachments.size()); ++k) {
    const Attachment &a = scene.attachments[k];
    const RodRange &range = rods_[a.rod];
    const JoinedBody &body = bodies_.items[a.body];
    joined_vertices_.items.push_back({a.rod, a.vertex, range.slot(a.vertex), body.position, -1, k, a.body,
                                      range.looseSlot() + free_slots[a.rod]++, body.rotation});
    makeIsland(islands_[body.rod], islands_[a.rod]);
    joined_[a.rod] = true;
    if (a.weld && range.twist)
      tieEdges(scene, {a.rod, -1, a.vertex, -1, -1, body.rotation, body.group, true, false}, free_slots);
  }
}

/// Points and frames of bodies that springs draw vertices and edges to.
void DofMap::tieToBodies(const Scene &scene, std::vector<int> &free_slots) {
  for (int k = 0; k < int(scene.constraints.size()); ++k) {
    const Constraint &c = scene.constraints[k];
    if (!c.isToBody()) continue;
    const RodRange &range = rods_[c.rod];
    const JoinedBody &body = bodies_.items[c.to_body];
    const int first = range.looseSlot() + free_slots[c.rod];
    makeIsland(islands_[body.rod], islands_[c.rod]);
    joined_[c.rod] = true;
    free_slots[c.rod] += 4;
    if (c.isPin()) {
      ties_.items.push_back({c.rod, range.slot(c.at), first, -1, -1, first, k});
      joined_vertices_.items.push_back({c.rod, -1, first, body.position, -1, k, c.to_body, first + 1, body.rotation});
    } else
      joined_edges_.items.push_back({c.rod, c.at, -1, first + 3, first, body.rotation, body.group, true, true});
  }
}

/// What junctions and ties make of vertices and edges, and the islands. A vertex that a support holds holds the others
/// of its junction with it.
void DofMap::join(const Scene &scene, std::vector<int> free_slots) {
  joined_vertices_ = {};
  joined_edges_ = {};
  ties_ = {};
  bodies_ = {};
  pairs_ = {};
  groups_ = 0;
  islands_.clear();
  joined_.assign(rods_.size(), false);
  for (int r = 0; r < int(rods_.size()); ++r) islands_.push_back({r, r + 1});
  for (int k = 0; k < int(scene.junctions.size()); ++k) {
    const Junction &junction = scene.junctions[k];
    auto isHeldMember = [&](const Junction::Member &m) { return held_[rods_[m.rod].first_vertex + m.vertex]; };
    const auto holder = std::find_if(junction.members.begin(), junction.members.end(), isHeldMember);
    const bool held = holder != junction.members.end();
    const Junction::Member &first = held ? *holder : junction.members.front(); // supports that move, move it
    std::vector<int> first_frame(junction.groups, -1);
    for (const Junction::Member &m : junction.members) {
      const RodRange &range = rods_[m.rod];
      joined_vertices_.items.push_back({m.rod, m.vertex, range.slot(m.vertex), rods_[first.rod].slot(first.vertex), k});
      makeIsland(islands_[first.rod], islands_[m.rod]);
      joined_[m.rod] = true;
      if (m.group < 0 || !range.twist) continue;
      tieEdges(scene, {m.rod, -1, m.vertex, -1, -1, first_frame[m.group], groups_ + m.group, false, false}, free_slots);
      first_frame[m.group] = joined_edges_.items.back().first_frame;
    }
    for (const Junction::Member &m : junction.members)
      if (held) held_[rods_[m.rod].first_vertex + m.vertex] = true;
    groups_ += junction.groups;
  }
  joinBodies(scene, free_slots);
  tieToBodies(scene, free_slots);
  for (int k = 0; k < int(scene.constraints.size()); ++k) {
    const Constraint &c = scene.constraints[k];
    if (!c.isTie()) continue;
    const RodRange &own = rods_[c.rod], &to = rods_[c.to_rod];
    ties_.items.push_back({c.rod, own.slot(c.at), own.looseSlot() + free_slots[c.rod]++, c.to_rod,
                           to.first_vertex + c.to_vertex, to.slot(c.to_vertex), k});
    makeIsland(islands_[c.rod], islands_[c.to_rod]);
    joined_[c.rod] = joined_[c.to_rod] = true;
  }
  joined_vertices_.sort(rods_.size());
  for (std::size_t k = 0; k < joined_vertices_.items.size(); ++k) joined_vertices_.items[k].number = int(k);
  joined_edges_.sort(rods_.size());
  ties_.sort(rods_.size());
  bodies_.sort(rods_.size());
  pairs_.sort(rods_.size());
  arms_.assign(joined_vertices_.items.size(), Vec3::Zero());
  lasting_ = islands_;
}

void DofMap::copyJoined(RodSet islands, Planes &increment) const {
  for (const JoinedVertex &j : joinedVertices(islands)) {
    Vec3 moved = increment.vector(0, j.first_slot);
    if (j.isOnBody()) {
      const Vec3 spin = increment.vector(0, j.first_frame);
      increment.setVector(0, j.frame, spin);
      moved += spin.cross(arm(j));
    }
    if (j.isCopy()) increment.setVector(0, j.slot, moved);
    copyBehindRing(rods_[j.rod], increment);
  }
  for (const JoinedEdge &j : joinedEdges(islands))
    if (!j.isFirst()) increment.setVector(0, j.frame, increment.vector(0, j.first_frame));
  for (const Tie &t : ties(islands))
    if (!t.isToBody()) increment.setVector(0, t.copy, increment.vector(0, t.of));
}

void DofMap::foldJoined(RodSet islands, Planes &sums) const {
  auto move = [&](int from, int to) {
    sums.setVector(0, to, sums.vector(0, to) + sums.vector(0, from));
    sums.setVector(0, from, Vec3::Zero());
  };
  for (const Tie &t : ties(islands))
    if (!t.isToBody()) move(t.copy, t.of);
  for (const BodyPair &p : pairs(islands))
    for (const int k : {0, 1})
      if (p.variables() > 6) move(p.parent(k), p.of[k + 2]);
  for (const JoinedVertex &j : joinedVertices(islands)) {
    if (j.isOnBody()) {
      sums.setVector(0, j.frame, arm(j).cross(sums.vector(0, j.slot)));
      move(j.frame, j.first_frame);
    }
    if (j.isCopy()) move(j.slot, j.first_slot);
  }
  for (const JoinedEdge &j : joinedEdges(islands))
    if (!j.isFirst()) move(j.frame, j.first_frame);
}

} // namespace tendril
