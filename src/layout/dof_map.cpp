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

PetscErrorCode nameFields(PetscSection section, bool rotations) {
  PetscFunctionBeginUser;
  PetscCall(PetscSectionSetNumFields(section, rotations ? 3 : 2));
  PetscCall(PetscSectionSetFieldName(section, 0, "position"));
  PetscCall(PetscSectionSetFieldComponents(section, 0, 3));
  PetscCall(PetscSectionSetFieldName(section, 1, "twist"));
  PetscCall(PetscSectionSetFieldComponents(section, 1, 1));
  if (rotations) {
    PetscCall(PetscSectionSetFieldName(section, 2, "rotation"));
    PetscCall(PetscSectionSetFieldComponents(section, 2, 3));
  }
  PetscFunctionReturn(0);
}

/// Vertices whose positions are no unknowns: those that are held, and copies in junctions.
std::vector<bool> withoutUnknowns(std::vector<bool> held, const std::vector<RodRange> &rods,
                                  const std::vector<JoinedVertex> &joined) {
  for (const JoinedVertex &j : joined)
    if (j.isCopy() && j.isVertex()) held[rods[j.rod].first_vertex + j.vertex] = true;
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
  PetscCall(nameFields(*section, groups_ > 0));
  PetscCall(PetscSectionSetChart(*section, 0, points));
  PetscInt point = 0;
  std::unordered_map<PetscInt, PetscInt> flat; // coordinates of vertices that are no unknowns
  const std::vector<bool> fixed = withoutUnknowns(held_, rods_, joined_vertices_.items);
  for (int r = 0; r < int(rods_.size()); ++r) {
    for (int i = 0; i < rods_[r].vertices; ++i) {
      const PetscInt vertex = point++;
      PetscCall(PetscSectionSetDof(*section, vertex, 3));
      PetscCall(PetscSectionSetFieldDof(*section, vertex, 0, 3));
      if (fixed[rods_[r].first_vertex + i]) {
        PetscCall(PetscSectionSetConstraintDof(*section, vertex, 3));
        PetscCall(PetscSectionSetFieldConstraintDof(*section, vertex, 0, 3));
      } else if (rods_[r].flat >= 0) {
        flat[vertex] = rods_[r].flat;
        PetscCall(PetscSectionSetConstraintDof(*section, vertex, 1));
        PetscCall(PetscSectionSetFieldConstraintDof(*section, vertex, 0, 1));
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
    const PetscInt *which = constrained == 1 ? &flat.at(p) : all;
    PetscCall(PetscSectionSetConstraintIndices(*section, p, which));
    PetscCall(PetscSectionSetFieldConstraintIndices(*section, p, 0, which));
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
    if (c.isToWorld()) along[c.rod] += c.slots();
  const std::vector<int> before_joins = along;
  bool joins = !scene.junctions.empty() || !scene.bodies.empty();
  for (const Constraint &c : scene.constraints)
    if (c.isTie()) {
      ++along[c.rod];
      joins = true;
    } else if (c.isToBody())
      along[c.rod] += 4; // a point and its frame, or three of a frame and a cell
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) along[m.rod] += 4; // frames and half cells of two edges
  for (const Body &b : scene.bodies) along[b.rod] += 2;
  for (const Joint &j : scene.joints) along[j.rod] += BodyPair::slots;
  for (int b = 0; b < int(scene.bodies.size()); ++b)
    if (scene.isPressed(b)) along[scene.bodies[b].rod] += BodyPair::slots;
  for (const Attachment &a : scene.attachments) along[a.rod] += 5; // and a frame of the vertex
  tendon_slot_.clear();
  for (const Tendon &t : scene.tendons) {
    tendon_slot_.push_back(along[t.rod]);
    along[t.rod] += t.slots();
  }
  slots_ = lanes; // room for the frame before the first rod
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    // A pack between the slots behind the last vertex and what follows, so that no pack holds parts of both; and a slot
    // before the next rod.
    const int slots = Planes::planeStride(rod.vertices() + RodRange::behind + along[r] + 1);
    rods_.push_back({vertices_, rod.vertices(), edges_, rod.edges(), slots_, slots, rod.twists(), rod.closed,
                     rod.bends(), rod.flat});
    vertices_ += rod.vertices();
    edges_ += rod.edges();
    slots_ += slots;
  }
  for (std::size_t k = 0; k < tendon_slot_.size(); ++k) tendon_slot_[k] += rods_[scene.tendons[k].rod].looseSlot();
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
        for (int a = 0; a < 3; ++a)
          if (rod.has(a)) here[a] = offset++;
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
