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

} // namespace

/// Section over the points v0, e0, v1, e1, ... of every rod; the last vertex of an open rod has no edge after it.
PetscErrorCode DofMap::createSection(PetscSection *section) const {
  PetscFunctionBeginUser;
  PetscInt points = 0;
  for (const RodRange &r : rods_) points += r.vertices + r.edges;
  PetscCall(PetscSectionCreate(PETSC_COMM_WORLD, section));
  PetscCall(PetscSectionSetNumFields(*section, 2));
  PetscCall(PetscSectionSetFieldName(*section, 0, "position"));
  PetscCall(PetscSectionSetFieldComponents(*section, 0, 3));
  PetscCall(PetscSectionSetFieldName(*section, 1, "twist"));
  PetscCall(PetscSectionSetFieldComponents(*section, 1, 1));
  PetscCall(PetscSectionSetChart(*section, 0, points));
  PetscInt point = 0;
  for (std::size_t r = 0; r < rods_.size(); ++r)
    for (int i = 0; i < rods_[r].vertices; ++i) {
      const PetscInt vertex = point++;
      PetscCall(PetscSectionSetDof(*section, vertex, 3));
      PetscCall(PetscSectionSetFieldDof(*section, vertex, 0, 3));
      if (held_[rods_[r].first_vertex + i]) {
        PetscCall(PetscSectionSetConstraintDof(*section, vertex, 3));
        PetscCall(PetscSectionSetFieldConstraintDof(*section, vertex, 0, 3));
      }
      if (i == rods_[r].edges) continue;
      const PetscInt edge = point++;
      if (!rods_[r].twist) continue;
      PetscCall(PetscSectionSetDof(*section, edge, 1));
      PetscCall(PetscSectionSetFieldDof(*section, edge, 1, 1));
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

PetscErrorCode DofMap::setUp(const Scene &scene) {
  PetscFunctionBeginUser;
  rods_.clear();
  unknown_begin_.clear();
  vertices_ = edges_ = 0;
  std::vector<int> along(scene.rods.size(), 0); // slots of supports that are not at ends, and of constraints
  for (const Support &s : scene.supports)
    if (scene.rods[s.rod].edgeBefore(s.vertex) >= 0 && scene.rods[s.rod].edgeAfter(s.vertex) >= 0)
      along[s.rod] += 3; // a frame and two cells
  for (const Constraint &c : scene.constraints) along[c.rod] += c.slots();
  slots_ = lanes; // room for the frame before the first rod
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

  OwnedSection section;
  PetscCall(createSection(section.out()));
  PetscCall(DMShellCreate(PETSC_COMM_WORLD, dm_.out()));
  PetscCall(DMSetLocalSection(dm_, section));
  PetscCall(DMShellSetCreateGlobalVector(dm_, createGlobalVector));
  PetscCall(DMShellSetCreateLocalVector(dm_, createLocalVector));
  PetscSection global;
  PetscCall(DMGetGlobalSection(dm_, &global));
  PetscCall(PetscSectionGetConstrainedStorageSize(global, &unknowns_));

  unknown_.assign(std::size_t(slots_) * slot_size, -1);
  PetscInt point = 0, next = 0;
  for (const RodRange &rod : rods_) {
    unknown_begin_.push_back(next);
    for (int i = 0; i < rod.vertices; ++i) {
      PetscInt *here = &unknown_[std::size_t(slot_size) * rod.slot(i)];
      PetscInt offset;
      PetscCall(PetscSectionGetOffset(global, point++, &offset));
      if (!held_[rod.first_vertex + i])
        for (int a = 0; a < 3; ++a) here[a] = offset + a;
      if (i == rod.edges) continue;
      if (rod.twist) {
        PetscCall(PetscSectionGetOffset(global, point, &offset));
        here[3] = offset;
      }
      ++point;
    }
    for (PetscInt *u = &unknown_[std::size_t(slot_size) * rod.first_slot];
         u < &unknown_[std::size_t(slot_size) * rod.vertexEnd()]; ++u)
      if (*u >= 0) PetscCheck(*u == next++, PETSC_COMM_SELF, PETSC_ERR_PLIB, "unknowns must follow the slots");
  }
  unknown_begin_.push_back(next);
  PetscFunctionReturn(0);
}

namespace {

/// An unknown that an edge variable is made of, or the position of a vertex: e_i = x_{i+1} - x_i.
struct Part {
  PetscInt unknown;
  bool minus;
};

} // namespace

PetscErrorCode DofMap::createMatrix(Mat *matrix, bool joins) {
  PetscFunctionBeginUser;
  std::vector<PetscInt> row, column;
  source_.clear();
  EdgeBlocks blocks(0, joins); // its window is that of all rods, which begins with the first
  blocks.setOrigin(rods_.front().first_slot);
  for (const RodRange &rod : rods_) {
    auto slot = [&](int i) { return rod.slot(rod.closed ? i % rod.vertices : i); };
    auto edge = [&](int i, int r) {
      std::vector<Part> parts;
      if (r == 3)
        parts = {{unknown(slot(i), 3), false}};
      else
        parts = {{unknown(slot(i), r), true}, {unknown(slot(i + 1), r), false}};
      return parts;
    };
    auto position = [&](int i, int r) { return std::vector<Part>{{unknown(slot(i), r), false}}; };
    auto couple = [&](const std::vector<Part> &left, const std::vector<Part> &right, int plane, int i, bool once) {
      const std::ptrdiff_t source = std::ptrdiff_t(blocks.offset(rod, plane)) + i;
      for (const Part &a : left)
        for (const Part &b : right) {
          if (a.unknown < 0 || b.unknown < 0) continue;
          for (const bool mirrored : {false, true}) {
            if (mirrored && once) continue;
            row.push_back(mirrored ? b.unknown : a.unknown);
            column.push_back(mirrored ? a.unknown : b.unknown);
            source_.push_back(a.minus == b.minus ? source : ~source);
          }
        }
    };
    for (int i = 0; i < rod.edges; ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = r; c < edge_size; ++c) couple(edge(i, r), edge(i, c), EdgeBlocks::own(r, c), i, r == c);
    for (int i = 1; i < rod.edges + (rod.closed ? 1 : 0); ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = 0; c < edge_size; ++c) couple(edge(i - 1, r), edge(i, c), EdgeBlocks::across(r, c), i, false);
    for (int i = 0; i < rod.edges && joins; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < edge_size; ++c) couple(position(i, r), edge(i, c), EdgeBlocks::joined(r, c), i, false);
    for (int i = 0; i < rod.vertices; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c) couple(position(i, r), position(i, c), EdgeBlocks::vertex(r, c), i, r == c);
  }
  PetscCall(MatCreate(PETSC_COMM_WORLD, matrix));
  PetscCall(MatSetSizes(*matrix, unknowns_, unknowns_, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(*matrix, MATAIJ));
  PetscCall(MatSetFromOptions(*matrix));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscCall(MatSetPreallocationCOO(*matrix, PetscCount(row.size()), row.data(), column.data()));
  entries_.resize(source_.size());
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::fillMatrix(const EdgeBlocks &blocks, Mat matrix) {
  PetscFunctionBeginUser;
  for (std::size_t n = 0; n < source_.size(); ++n)
    entries_[n] = source_[n] >= 0 ? blocks.data()[source_[n]] : -blocks.data()[~source_[n]];
  PetscCall(MatSetValuesCOO(matrix, entries_.data(), INSERT_VALUES));
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
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s, u += slot_size) // unknowns follow each other
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
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s, u += slot_size)
      for (int a = 0; a < slot_size; ++a) values[a][s] = u[a] >= 0 ? *next++ : 0.0;
    copyBehindRing(rod, values);
  }
  PetscCall(VecRestoreArrayRead(in, &from));
  PetscFunctionReturn(0);
}

} // namespace tendril
