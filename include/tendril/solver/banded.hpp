#pragma once
/// \file banded.hpp
/// LDL^T of the Hessians of chains and rings, without pivoting, over edge variables. From the last edge to the first,
/// the vector e_i and the twist of edge i are eliminated from what the rod beyond it stores as a function of the
/// position x_i and of edge i - 1: with x_{i+1} = x_i + e_i no differences of positions are formed, and a solve keeps
/// its digits however short the edges are (docs/theory.md, Rounding). Unknowns are those of the vertex coordinates: a
/// change of variables leaves the inertia, which the signs of the pivots give (Sylvester). A ring has its first vertex
/// and edge as a border. Rods of the same shape are factored together, one to a lane. Registered with PETSc as the
/// solver type `banded` for Cholesky.

#include "tendril/layout/dof_map.hpp"

#include <numeric>
#include <string>

namespace tendril {

/// Memory for factors. Solvers that work one after the other may share it: a factor is lost when the next is made.
struct BandedWorkspace {
  AlignedVector factors, rows, copy;
};

/// What there is to factor: blocks + shift x metric (of positions and twists, and of edge vectors) of the rods that are
/// active.
struct BandedSystem {
  const DofMap *dofs = nullptr;
  RodSet rods{0, 0};
  const EdgeBlocks *blocks = nullptr;
  const Planes *metric = nullptr;
  const std::vector<char> *active =
      nullptr; ///< per rod of the scene; the others are left out, and a solve gives them zero
  const std::vector<double> *shift = nullptr; ///< per rod of the scene
  BandedWorkspace *workspace = nullptr;
  bool coupled_positions = true; ///< whether the blocks of vertices have more than a diagonal
  const double *edge_metric =
      nullptr; ///< per slot of the scene, of the square of an edge vector's change; or null: none
};

/// y += scale x metric x v for one rod, copies behind a ring included in v and in y. `edges`: as
/// BandedSystem::edge_metric.
void addMetric(const Planes &metric, const double *edges, const RodRange &rod, const Joins &joins, double scale,
               const Planes &v, Planes &y);

class BandedFactor {
public:
  BandedFactor(const DofMap &dofs, RodSet rods, BandedWorkspace &workspace);

  void factor(const BandedSystem &system);
  /// By the unknowns of the rods; x may be b.
  void solve(const PetscScalar *b, PetscScalar *x);

  static constexpr const char *name = "banded";
  bool isRegular() const { return true; }
  int negative() const { return std::accumulate(negative_.begin(), negative_.end(), 0); }
  int zero() const { return std::accumulate(zero_.begin(), zero_.end(), 0); }
  std::size_t numbers() const { return bytes_ / sizeof(double); }
  PetscErrorCode view(PetscViewer viewer) const;
  RodSet rods() const { return rods_; }
  int negativePivots(int rod) const { return negative_[rod - rods_.begin]; }
  /// Pivots lost in rounding (|pivot| within a few epsilon of its diagonal): motions that cost no energy. A solve
  /// leaves them out.
  int zeroPivots(int rod) const { return zero_[rod - rods_.begin]; }
  std::size_t bytes() const { return bytes_; }

private:
  /// Rods factored together: one, or as many as there are lanes of a pack.
  struct Group {
    std::array<int, lanes> rod;
    int count;
    bool packed, reduced; ///< by the kernel for fewer unknowns
    std::size_t factor;   ///< where its factor begins
  };
  const DofMap &dofs_;
  RodSet rods_;
  std::vector<int> order_;              ///< rods by shape, the held vertices included
  std::vector<std::vector<char>> held_; ///< per rod and vertex
  std::vector<Group> groups_;
  std::vector<int> negative_, zero_;
  BandedWorkspace &workspace_;
  std::size_t bytes_ = 0;

  bool sameShape(int a, int b) const;
  std::size_t plan(const char *active, bool joins);
  template <class T> void factorGroup(const Group &group, const BandedSystem &system);
  template <bool any, class T, class Read>
  void eliminate(const Group &group, const Read &read, bool joins, T *negative, T *zero);
  template <class T> void substitute(const Group &group);
  template <class T> void solveGroup(const Group &group, const PetscScalar *b, PetscScalar *x);
};

/// Registers `-pc_factor_mat_solver_type banded`, condensed (condensed.hpp) and woodbury (woodbury.hpp).
PetscErrorCode registerBanded();
PetscErrorCode registerCondensed();
PetscErrorCode registerWoodbury();
/// Which of them is for some rods; null where another is cheaper or none can factor them.
const char *ownSolver(const DofMap &dofs, RodSet rods);
/// Whether one of them can factor some rods.
bool canFactor(const std::string &solver, const DofMap &dofs, RodSet rods);
/// Matrix whose entries are those of `system`, which must outlive it; its Cholesky factorisation is `banded`. Increase
/// its state (PetscObjectStateIncrease) when the values have changed.
PetscErrorCode createBandedMatrix(BandedSystem *system, Mat *matrix);
/// The factorisation inside PETSc's factored matrix, or null when it is another's.
const BandedFactor *bandedFactorOf(Mat factored);

} // namespace tendril
