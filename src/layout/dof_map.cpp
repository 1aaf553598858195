#include "tendril/layout/dof_map.hpp"

#include <petscdmshell.h>

#include <algorithm>

namespace tendril {
namespace {

PetscErrorCode createGlobalVector(DM dm, Vec *v) {
  PetscSection section;
  PetscInt size;
  PetscFunctionBeginUser;
  PetscCall(DMGetGlobalSection(dm, &section));
  PetscCall(PetscSectionGetConstrainedStorageSize(section, &size));
  PetscCall(VecCreate(PetscObjectComm((PetscObject)dm), v));
  PetscCall(VecSetSizes(*v, size, PETSC_DETERMINE));
  PetscCall(VecSetType(*v, VECSTANDARD));
  PetscCall(VecSetDM(*v, dm));
  PetscFunctionReturn(0);
}

PetscErrorCode createLocalVector(DM dm, Vec *v) {
  PetscSection section;
  PetscInt size;
  PetscFunctionBeginUser;
  PetscCall(DMGetLocalSection(dm, &section));
  PetscCall(PetscSectionGetStorageSize(section, &size));
  PetscCall(VecCreateSeq(PETSC_COMM_SELF, size, v));
  PetscCall(VecSetDM(*v, dm));
  PetscFunctionReturn(0);
}

/// Vertices whose positions are no unknowns: those that are held, and copies in junctions.
std::vector<bool> withoutUnknowns(std::vector<bool> held, const std::vector<RodRange> &rods,
                                  const std::vector<JoinedVertex> &joined) {
  for (const JoinedVertex &j : joined)
    if (j.isCopy()) held[rods[j.rod].first_vertex + j.vertex] = true;
  return held;
}

} // namespace

/// Section over the points v0, e0, v1, e1, ... of every rod, with the frames of junctions that it has behind; the last
/// vertex of an open rod has no edge after it.
PetscErrorCode DofMap::createSection(PetscSection *section) const {
  PetscFunctionBeginUser;
  PetscInt points = 0;
  for (const RodRange &r : rods_) points += r.vertices + r.edges;
  for (const JoinedEdge &j : joined_edges_.items) points += j.isFirst();
  points += 2 * PetscInt(bodies_.items.size());
  PetscCall(PetscSectionCreate(PETSC_COMM_SELF, section));
  PetscCall(PetscSectionSetNumFields(*section, groups_ == 0 ? 2 : 3));
  PetscCall(PetscSectionSetFieldName(*section, 0, "position"));
  PetscCall(PetscSectionSetFieldComponents(*section, 0, 3));
  PetscCall(PetscSectionSetFieldName(*section, 1, "twist"));
  PetscCall(PetscSectionSetFieldComponents(*section, 1, 1));
  if (groups_ > 0) {
    PetscCall(PetscSectionSetFieldName(*section, 2, "rotation"));
    PetscCall(PetscSectionSetFieldComponents(*section, 2, 3));
  }
  PetscCall(PetscSectionSetChart(*section, 0, points));
  PetscInt point = 0;
  const std::vector<bool> fixed = withoutUnknowns(held_, rods_, joined_vertices_.items);
  for (int r = 0; r < int(rods_.size()); ++r) {
    for (int i = 0; i < rods_[r].vertices; ++i) {
      const PetscInt vertex = point++;
      PetscCall(PetscSectionSetDof(*section, vertex, 3));
      PetscCall(PetscSectionSetFieldDof(*section, vertex, 0, 3));
      if (fixed[rods_[r].first_vertex + i]) {
        PetscCall(PetscSectionSetConstraintDof(*section, vertex, 3));
        PetscCall(PetscSectionSetFieldConstraintDof(*section, vertex, 0, 3));
      }
      if (i == rods_[r].edges) continue;
      const PetscInt edge = point++;
      if (!rods_[r].twist) continue;
      PetscCall(PetscSectionSetDof(*section, edge, 1));
      PetscCall(PetscSectionSetFieldDof(*section, edge, 1, 1));
    }
    for (const JoinedEdge &j : joinedEdges({r, r + 1})) {
      if (!j.isFirst()) continue;
      PetscCall(PetscSectionSetDof(*section, point, 3));
      PetscCall(PetscSectionSetFieldDof(*section, point++, 2, 3));
    }
    for (std::size_t b = 0; b < bodies({r, r + 1}).size(); ++b)
      for (const PetscInt field : {0, 2}) {
        PetscCall(PetscSectionSetDof(*section, point, 3));
        PetscCall(PetscSectionSetFieldDof(*section, point++, field, 3));
      }
  }
  PetscCall(PetscSectionSetUp(*section));
  const PetscInt all[3] = {0, 1, 2};
  for (PetscInt p = 0; p < points; ++p) {
    PetscInt constrained;
    PetscCall(PetscSectionGetConstraintDof(*section, p, &constrained));
    if (constrained == 0) continue;
    PetscCall(PetscSectionSetConstraintIndices(*section, p, all));
    PetscCall(PetscSectionSetFieldConstraintIndices(*section, p, 0, all));
  }
  PetscFunctionReturn(0);
}

void DofMap::layOut(const Scene &scene) {
  rods_.clear();
  vertices_ = edges_ = 0;
  std::vector<int> along(scene.rods.size(), 0); // slots of supports that are not at ends, and of constraints
  for (const Support &s : scene.supports)
    if (scene.rods[s.rod].edgeBefore(s.vertex) >= 0 && scene.rods[s.rod].edgeAfter(s.vertex) >= 0)
      along[s.rod] += 3; // a frame and two cells
  for (const Constraint &c : scene.constraints)
    if (!c.isTie()) along[c.rod] += c.slots();
  const std::vector<int> before_joins = along;
  bool joins = !scene.junctions.empty() || !scene.bodies.empty();
  for (const Constraint &c : scene.constraints)
    if (c.isTie()) {
      ++along[c.rod];
      joins = true;
    }
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) along[m.rod] += 4; // frames and half cells of two edges
  for (const Body &b : scene.bodies) along[b.rod] += 2;
  for (const Attachment &a : scene.attachments) along[a.rod] += 5; // and a frame of the vertex
  slots_ = lanes;                                                  // room for the frame before the first rod
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    // A pack between the slots behind the last vertex and what follows, so that no pack holds parts of both; and a slot
    // before the next rod.
    const int slots = Planes::planeStride(rod.vertices() + RodRange::behind + along[r] + 1);
    rods_.push_back(
        {vertices_, rod.vertices(), edges_, rod.edges(), slots_, slots, !rod.material.isCable(), rod.closed});
    vertices_ += rod.vertices();
    edges_ += rod.edges();
    slots_ += slots;
  }
  held_.assign(vertices_, false);
  for (const Support &s : scene.supports)
    if (s.holdsPosition()) held_[rods_[s.rod].first_vertex + s.vertex] = true;
  unknown_end_.clear();
  for (const RodRange &rod : rods_) unknown_end_.push_back(rod.vertexEnd());
  if (joins) join(scene, before_joins);
}

PetscErrorCode DofMap::setUp(const Scene &scene) {
  PetscFunctionBeginUser;
  layOut(scene);
  unknown_begin_.clear();
  OwnedSection section;
  PetscCall(createSection(section.out()));
  PetscCall(DMShellCreate(PETSC_COMM_SELF, dm_.out()));
  PetscCall(DMSetLocalSection(dm_, section));
  PetscCall(DMShellSetCreateGlobalVector(dm_, createGlobalVector));
  PetscCall(DMShellSetCreateLocalVector(dm_, createLocalVector));
  PetscSection global;
  PetscCall(DMGetGlobalSection(dm_, &global));
  PetscCall(PetscSectionGetConstrainedStorageSize(global, &unknowns_));

  unknown_.assign(std::size_t(slots_) * slot_size, -1);
  PetscInt point = 0, next = 0;
  const std::vector<bool> fixed = withoutUnknowns(held_, rods_, joined_vertices_.items);
  for (int r = 0; r < int(rods_.size()); ++r) {
    const RodRange &rod = rods_[r];
    unknown_begin_.push_back(next);
    for (int i = 0; i < rod.vertices; ++i) {
      PetscInt *here = &unknown_[std::size_t(slot_size) * rod.slot(i)];
      PetscInt offset;
      PetscCall(PetscSectionGetOffset(global, point++, &offset));
      if (!fixed[rod.first_vertex + i])
        for (int a = 0; a < 3; ++a) here[a] = offset + a;
      if (i == rod.edges) continue;
      if (rod.twist) {
        PetscCall(PetscSectionGetOffset(global, point, &offset));
        here[3] = offset;
      }
      ++point;
    }
    for (const JoinedEdge &j : joinedEdges({r, r + 1})) {
      if (!j.isFirst()) continue;
      PetscInt offset;
      PetscCall(PetscSectionGetOffset(global, point++, &offset));
      for (int a = 0; a < 3; ++a) unknown_[std::size_t(slot_size) * j.frame + a] = offset + a;
    }
    for (const JoinedBody &b : bodies({r, r + 1}))
      for (const int slot : {b.position, b.rotation}) {
        PetscInt offset;
        PetscCall(PetscSectionGetOffset(global, point++, &offset));
        for (int a = 0; a < 3; ++a) unknown_[std::size_t(slot_size) * slot + a] = offset + a;
      }
    for (PetscInt *u = &unknown_[std::size_t(slot_size) * rod.first_slot];
         u < &unknown_[std::size_t(slot_size) * unknown_end_[r]]; ++u)
      if (*u >= 0) PetscCheck(*u == next++, PETSC_COMM_SELF, PETSC_ERR_PLIB, "unknowns must follow the slots");
  }
  unknown_begin_.push_back(next);
  PetscFunctionReturn(0);
}

/// Joins the islands of two rods to one, with all between them.
void DofMap::makeIsland(RodSet a, RodSet b) {
  const RodSet island{std::min(a.begin, b.begin), std::max(a.end, b.end)};
  for (int r = island.begin; r < island.end; ++r) islands_[r] = island;
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
  for (int k = 0; k < int(scene.attachments.size()); ++k) {
    const Attachment &a = scene.attachments[k];
    const RodRange &range = rods_[a.rod];
    const JoinedBody &body = bodies_.items[a.body];
    joined_vertices_.items.push_back({a.rod, a.vertex, range.slot(a.vertex), body.position, -1, k,
                                      range.looseSlot() + free_slots[a.rod]++, body.rotation});
    makeIsland(islands_[body.rod], islands_[a.rod]);
    joined_[a.rod] = true;
    if (a.weld && range.twist)
      tieEdges(scene, {a.rod, -1, a.vertex, -1, -1, body.rotation, body.group, true, false}, free_slots);
  }
}

/// What junctions and ties make of vertices and edges, and the islands. A vertex that a support holds holds the others
/// of its junction with it.
void DofMap::join(const Scene &scene, std::vector<int> free_slots) {
  joined_vertices_ = {};
  joined_edges_ = {};
  ties_ = {};
  bodies_ = {};
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
  arms_.assign(joined_vertices_.items.size(), Vec3::Zero());
}

void DofMap::copyBehindRing(const RodRange &rod, Planes &increment) const {
  if (!rod.closed) return;
  for (int a = 0; a < 3; ++a)
    for (const int i : {0, 1}) increment[a][rod.slot(rod.vertices + i)] = increment[a][rod.slot(i)];
  increment[3][rod.slot(rod.vertices)] = increment[3][rod.slot(0)];
}

void DofMap::fold(const RodRange &rod, Planes &sums) const {
  if (!rod.closed) return;
  for (int a = 0; a < slot_size; ++a)
    for (const int i : {0, 1}) {
      sums[a][rod.slot(i)] += sums[a][rod.slot(rod.vertices + i)];
      sums[a][rod.slot(rod.vertices + i)] = 0;
    }
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
  for (const Tie &t : ties(islands)) increment.setVector(0, t.copy, increment.vector(0, t.of));
}

void DofMap::foldJoined(RodSet islands, Planes &sums) const {
  auto move = [&](int from, int to) {
    sums.setVector(0, to, sums.vector(0, to) + sums.vector(0, from));
    sums.setVector(0, from, Vec3::Zero());
  };
  for (const Tie &t : ties(islands)) move(t.copy, t.of);
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

double DofMap::dot(RodSet island, const Planes &a, const Planes &b) const {
  double sum = 0;
  for (int r = island.begin; r < island.end; ++r) sum += tendril::dot(rods_[r], a, b);
  for (const JoinedEdge &j : joinedEdges(island))
    if (j.isFirst()) sum += a.vector(0, j.frame).dot(b.vector(0, j.frame));
  for (const JoinedBody &j : bodies(island))
    for (const int s : {j.position, j.rotation}) sum += a.vector(0, s).dot(b.vector(0, s));
  return sum;
}

PetscErrorCode DofMap::gather(const Planes &values, RodSet rods, Vec out, const std::vector<char> *active) const {
  PetscScalar *begin;
  PetscFunctionBeginUser;
  PetscCall(VecGetArrayWrite(out, &begin));
  PetscScalar *to = begin;
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = rods_[r];
    if (active && !(*active)[r]) {
      to = std::fill_n(to, unknown_begin_[r + 1] - unknown_begin_[r], 0.0);
      continue;
    }
    const PetscInt *u = &unknown_[std::size_t(slot_size) * rod.first_slot];
    for (int s = rod.first_slot; s < unknown_end_[r]; ++s, u += slot_size) // unknowns follow each other
      for (int a = 0; a < slot_size; ++a)
        if (u[a] >= 0) *to++ = values[a][s];
  }
  PetscCall(VecRestoreArrayWrite(out, &begin));
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::scatter(Vec in, RodSet rods, Planes &values) const {
  const PetscScalar *from;
  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(in, &from));
  const PetscScalar *next = from;
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = rods_[r];
    const PetscInt *u = &unknown_[std::size_t(slot_size) * rod.first_slot];
    for (int s = rod.first_slot; s < unknown_end_[r]; ++s, u += slot_size)
      for (int a = 0; a < slot_size; ++a) values[a][s] = u[a] >= 0 ? *next++ : 0.0;
    copyBehindRing(rod, values);
  }
  copyJoined(rods, values);
  PetscCall(VecRestoreArrayRead(in, &from));
  PetscFunctionReturn(0);
}

} // namespace tendril
