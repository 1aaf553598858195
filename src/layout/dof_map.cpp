#include "tendril/layout/dof_map.hpp"

#include <petscdmshell.h>

#include <cstring>

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
PetscErrorCode DofMap::createSection(const Scene &scene, PetscSection *section) const {
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
      if (scene.rods[r].material.isCable()) continue;
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
  constexpr int spare = 4, copies = 8;
  rods_.clear();
  vertices_ = edges_ = 0;
  rows_ = spare;
  for (const Rod &rod : scene.rods) {
    const int stride = rod.material.isCable() ? 3 : 4;
    const int rows = 3 * rod.vertices() + (stride == 4 ? rod.edges() : 0);
    rods_.push_back({vertices_, rod.vertices(), edges_, rod.edges(), rows_, rows, stride, rod.closed});
    vertices_ += rod.vertices();
    edges_ += rod.edges();
    rows_ += rows + copies;
  }
  rows_ += band; // the band of the last row ends inside the array
  held_.assign(vertices_, false);
  for (const Support &s : scene.supports)
    if (s.holdsPosition()) held_[rods_[s.rod].first_vertex + s.vertex] = true;

  OwnedSection section;
  PetscCall(createSection(scene, section.out()));
  PetscCall(DMShellCreate(PETSC_COMM_WORLD, dm_.out()));
  PetscCall(DMSetLocalSection(dm_, section));
  PetscCall(DMShellSetCreateGlobalVector(dm_, createGlobalVector));
  PetscCall(DMShellSetCreateLocalVector(dm_, createLocalVector));
  PetscSection global;
  PetscCall(DMGetGlobalSection(dm_, &global));
  PetscCall(PetscSectionGetConstrainedStorageSize(global, &unknowns_));

  unknown_of_row_.assign(rows_, -1);
  PetscInt point = 0;
  for (const RodRange &rod : rods_)
    for (int i = 0; i < rod.vertices; ++i) {
      const int row = vertexRow(rod, i);
      PetscInt offset;
      PetscCall(PetscSectionGetOffset(global, point++, &offset));
      if (!held_[rod.first_vertex + i])
        for (int k = 0; k < 3; ++k) unknown_of_row_[row + k] = offset + k;
      if (i == rod.edges) continue;
      if (rod.stride == 4) {
        PetscCall(PetscSectionGetOffset(global, point, &offset));
        unknown_of_row_[row + 3] = offset;
      }
      ++point;
    }
  for (const RodRange &rod : rods_)
    if (rod.closed)
      for (int k = 0; k < rod.stride + 3; ++k) unknown_of_row_[rod.first_row + rod.rows + k] = unknown_of_row_[rod.first_row + k];
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::createMatrix(Mat *matrix) {
  PetscFunctionBeginUser;
  std::vector<PetscInt> i, j;
  auto &slots = band_slot_;
  slots.clear();
  for (int r = 0; r < rows_ - band; ++r)
    for (int k = 0; k < band; ++k) {
      const PetscInt a = unknown_of_row_[r], b = unknown_of_row_[r + k];
      if (a < 0 || b < 0) continue;
      slots.push_back(r * band + k);
    }
  // A pair of rows of two different rods never meets in a cell; its slot stays zero and must not enter the pattern.
  std::vector<int> rod_of_row(rows_, -1);
  for (std::size_t n = 0; n < rods_.size(); ++n)
    for (int k = 0; k < rods_[n].rows + 8 && rods_[n].first_row + k < rows_; ++k) rod_of_row[rods_[n].first_row + k] = int(n);
  std::erase_if(slots, [&](PetscInt s) { return rod_of_row[s / band] != rod_of_row[s / band + s % band]; });
  for (const PetscInt s : slots) {
    i.push_back(unknown_of_row_[s / band]);
    j.push_back(unknown_of_row_[s / band + s % band]);
  }
  const std::size_t upper = slots.size();
  for (std::size_t n = 0; n < upper; ++n)
    if (slots[n] % band != 0) {
      i.push_back(j[n]);
      j.push_back(i[n]);
      slots.push_back(slots[n]);
    }
  PetscCall(MatCreate(PETSC_COMM_WORLD, matrix));
  PetscCall(MatSetSizes(*matrix, unknowns_, unknowns_, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(*matrix, MATAIJ));
  PetscCall(MatSetFromOptions(*matrix));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscCall(MatSetPreallocationCOO(*matrix, PetscCount(i.size()), i.data(), j.data()));
  entries_.resize(slots.size());
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::fillMatrix(const std::vector<double> &band_values, Mat matrix) {
  PetscFunctionBeginUser;
  for (std::size_t n = 0; n < band_slot_.size(); ++n) entries_[n] = band_values[band_slot_[n]];
  PetscCall(MatSetValuesCOO(matrix, entries_.data(), INSERT_VALUES));
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::gather(const std::vector<double> &row_values, Vec out) const {
  PetscScalar *values;
  PetscFunctionBeginUser;
  PetscCall(VecGetArrayWrite(out, &values));
  std::memset(values, 0, sizeof(PetscScalar) * unknowns_);
  for (int r = 0; r < rows_; ++r)
    if (unknown_of_row_[r] >= 0) values[unknown_of_row_[r]] += row_values[r];
  PetscCall(VecRestoreArrayWrite(out, &values));
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::scatter(Vec in, std::vector<double> &row_values) const {
  const PetscScalar *values;
  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(in, &values));
  for (int r = 0; r < rows_; ++r)
    if (unknown_of_row_[r] >= 0) row_values[r] = values[unknown_of_row_[r]];
  PetscCall(VecRestoreArrayRead(in, &values));
  PetscFunctionReturn(0);
}

} // namespace tendril
