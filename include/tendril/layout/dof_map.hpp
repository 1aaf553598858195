#pragma once
/// \file dof_map.hpp
/// Where the unknowns are. Three numberings:
///   vertices and edges   of the whole scene, rod after rod, in scene order;
///   rows                 v0 (3), e0 (1), v1 (3), e1 (1), ... of each rod, with the rows a cell may touch beyond its ends: four spare rows
///                        before and after an open rod, copies of v0, e0, v1 behind a closed one. Element loops work on rows and
///                        know neither ends nor rings;
///   unknowns             of PETSc's global vector: rows that are neither spare, nor copies, nor held by a support.
/// Cables have no twist: their vertices follow each other at three rows.

#include "tendril/layout/petsc.hpp"
#include "tendril/model/scene.hpp"

namespace tendril {

/// Numbering and unknowns of one rod.
struct RodRange {
  int first_vertex, vertices;
  int first_edge, edges;
  int first_row; ///< of vertex 0
  int rows;      ///< rows of its own, without spares and copies
  int stride;    ///< rows from a vertex to the next: 4, or 3 for a cable
  bool closed;
};

class DofMap {
public:
  /// Rows a row couples to, itself included: the 11 unknowns of a cell.
  static constexpr int band = cell_size;

  PetscErrorCode setUp(const Scene &scene);

  const std::vector<RodRange> &rods() const { return rods_; }
  int vertices() const { return vertices_; }
  int edges() const { return edges_; }
  int rows() const { return rows_; }
  PetscInt unknowns() const { return unknowns_; }
  int vertexRow(const RodRange &rod, int vertex) const { return rod.first_row + rod.stride * vertex; }
  int twistRow(const RodRange &rod, int edge) const { return rod.first_row + rod.stride * edge + 3; }
  /// Unknown of each row, or -1 where the row is spare or held.
  const std::vector<PetscInt> &unknownOfRow() const { return unknown_of_row_; }
  bool isHeld(int vertex) const { return held_[vertex]; }

  DM dm() const { return dm_; }
  /// Matrix over the unknowns, preallocated for the band; values come in the order of fillMatrix.
  PetscErrorCode createMatrix(Mat *matrix);
  /// Adds the band (rows x band, upper part: entry (r, k) couples rows r and r + k) into the matrix, both triangles.
  PetscErrorCode fillMatrix(const std::vector<double> &band_values, Mat matrix);
  /// out[unknown] = sum of the rows that stand for it.
  PetscErrorCode gather(const std::vector<double> &row_values, Vec out) const;
  /// Rows from unknowns; spare and held rows are left as they are.
  PetscErrorCode scatter(Vec in, std::vector<double> &row_values) const;

private:
  std::vector<RodRange> rods_;
  int vertices_ = 0, edges_ = 0, rows_ = 0;
  PetscInt unknowns_ = 0;
  std::vector<bool> held_;
  std::vector<PetscInt> unknown_of_row_;
  std::vector<PetscInt> band_slot_; ///< slots of the band that reach the matrix, in the order of the matrix's entries
  std::vector<double> entries_;
  OwnedDM dm_;

  PetscErrorCode createSection(const Scene &scene, PetscSection *section) const;
};

} // namespace tendril
