#pragma once
/// \file banded.hpp
/// LDL^T of the Hessians of chains and rings, without pivoting: the band of a cell, and for a ring the last rows that also meet its first (a
/// border). The signs of the pivots give the inertia (Sylvester). Rods of the same shape are factored together, one to a lane.
/// Registered with PETSc as the solver type `banded` for Cholesky.

#include "tendril/layout/dof_map.hpp"

namespace tendril {

/// Memory for factors. Solvers that work one after the other may share it: a factor is lost when the next is made.
struct BandedRoom {
  AlignedVector band, far, rows, copy;
};

/// What there is to factor: band + shift x metric of the rods that are wanted.
struct BandedSystem {
  const DofMap *dofs = nullptr;
  RodSet rods{0, 0};
  const Band *band = nullptr;
  const Planes *metric = nullptr;
  const std::vector<char> *wanted = nullptr;  ///< per rod of the scene; the others are left out, and a solve gives them zero
  const std::vector<double> *shift = nullptr; ///< per rod of the scene
  BandedRoom *room = nullptr;
};

class BandedFactor {
public:
  BandedFactor(const DofMap &dofs, RodSet rods, BandedRoom &room);

  void factor(const BandedSystem &system);
  /// By the unknowns of the rods; x may be b.
  void solve(const PetscScalar *b, PetscScalar *x);

  RodSet rods() const { return rods_; }
  int negativePivots(int rod) const { return negative_[rod - rods_.begin]; }
  /// Pivots lost in rounding (|pivot| within a few epsilon of its diagonal): motions that cost no energy. They are replaced by a small
  /// positive number, so that a solve does not move along them.
  int neutralPivots(int rod) const { return neutral_[rod - rods_.begin]; }
  std::size_t bytes() const { return bytes_; }

private:
  /// Rods factored together: one, or as many as there are lanes of a pack.
  struct Group {
    std::array<int, lanes> rod;
    int count;
    bool packed;
    std::size_t band, far; ///< where its factor begins
  };
  const DofMap &dofs_;
  RodSet rods_;
  std::vector<int> order_;              ///< rods by shape
  std::vector<std::vector<int>> fixed_; ///< per rod: rows that are held or do not exist
  std::vector<Group> groups_;
  std::vector<int> negative_, neutral_;
  BandedRoom &room_;
  std::size_t bytes_ = 0;

  void plan(const char *wanted);
  template <class T> void factorGroup(const Group &group, const BandedSystem &system);
  template <class T> void solveGroup(const Group &group, const PetscScalar *b, PetscScalar *x);
};

/// Registers `-pc_factor_mat_solver_type banded`.
PetscErrorCode registerBanded();
/// Matrix whose entries are those of `system`, which must outlive it; its Cholesky factorisation is `banded`. Increase its state
/// (PetscObjectStateIncrease) when the values have changed.
PetscErrorCode createBandedMatrix(BandedSystem *system, Mat *matrix);
/// The factorisation inside PETSc's factored matrix, or null when it is another's.
const BandedFactor *bandedFactorOf(Mat factored);

} // namespace tendril
