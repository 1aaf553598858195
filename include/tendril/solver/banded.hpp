#pragma once
/// \file banded.hpp
/// LDL^T of the Hessian of chains and rings, without pivoting: the band of a cell, and for a ring the few last rows that also meet its first
/// (a border). The signs of the pivots give the inertia (Sylvester). Registered with PETSc as the solver type `banded` for Cholesky.

#include "tendril/layout/petsc.hpp"

#include <vector>

namespace tendril {

class BandedCholesky {
public:
  /// Couplings to the next rows kept in the band: the cell has 11 unknowns.
  static constexpr int half_band = 10;

  /// Finds the blocks and borders in a symmetric CSR pattern (both triangles). False when it is neither a set of chains nor of rings.
  bool analyse(PetscInt rows, const PetscInt *row_start, const PetscInt *column);
  /// Factors values of the analysed pattern.
  void factor(const PetscInt *row_start, const PetscInt *column, const PetscScalar *value);
  /// x may be b.
  void solve(const PetscScalar *b, PetscScalar *x) const;

  PetscInt negativePivots() const { return negative_; }
  /// Pivots lost in rounding (|pivot| within a few epsilon of its diagonal): motions that cost no energy. They are replaced by a small
  /// positive number, so that a solve does not move along them.
  PetscInt neutralPivots() const { return neutral_; }

private:
  static constexpr int width = 16; ///< of a stored row, padded for vector loads

  /// A block of rows that couple among themselves; the last `border` of them also meet rows further away.
  struct Block {
    PetscInt begin, end;
    int border;
  };
  PetscInt rows_ = 0, negative_ = 0, neutral_ = 0;
  std::vector<Block> blocks_;
  std::vector<double> band_;     ///< row i: pivot, then entries (i, i + 1 ... i + 10) of L'
  std::vector<double> diagonal_; ///< before elimination
  std::vector<std::vector<double>> far_; ///< per block: border x rows entries beyond the band

  double pivot(PetscInt row);
  void eliminate(const Block &block, std::vector<double> &far);
};

/// Registers `-pc_factor_mat_solver_type banded` for MATSEQAIJ.
PetscErrorCode registerBanded();

} // namespace tendril
