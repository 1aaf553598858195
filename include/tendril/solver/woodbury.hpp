#pragma once
/// \file woodbury.hpp
/// LDL^T of the Hessian of rods that ties join. A tie adds C' H C of rank three to what the rods, or rods and
/// junctions, have without it, K0, which keeps its own factorisation: with the capacitance D = H^-1 + C K0^-1 C',
///   (K0 + C' H C)^-1 b = K0^-1 (b - C' D^-1 C K0^-1 b)
/// (Woodbury 1950), and the negative pivots of all are those of K0, and the positive ones of D less those of H
/// (Haynsworth 1968). D is dense, and factored with pivots by LAPACK. Where K0 has pivots of zero, as that of a rod
/// which only ties hold, springs from the tied vertices to the ground are added to K0 and taken off again by the
/// update, of rank six a tie then. Registered with PETSc as the solver type `woodbury` for Cholesky.

#include "tendril/solver/condensed.hpp"

#include <optional>

namespace tendril {

class WoodburyFactor {
public:
  static constexpr const char *name = "woodbury";
  WoodburyFactor(const DofMap &dofs, RodSet rods, BandedWorkspace &workspace);
  /// Whether it can factor some rods: there are ties, and the rods without them suit `banded` or `condensed`.
  static bool suits(const DofMap &dofs, RodSet rods);
  /// Whether it is cheaper than a factorisation of the whole matrix.
  static bool pays(const DofMap &dofs, RodSet rods);

  void factor(const BandedSystem &system);
  /// By the unknowns of the rods; x may be b.
  void solve(const PetscScalar *b, PetscScalar *x);
  bool isRegular() const { return regular_; }
  int negative() const { return negative_; }
  int zero() const { return zero_; }
  std::size_t numbers() const;
  std::size_t bytes() const;
  PetscErrorCode view(PetscViewer viewer) const;

private:
  /// What of a tie is in one group: its ends there.
  struct Part {
    int tie;
    std::array<bool, 2> has;
  };
  /// The capacitance for so many columns a tie: 3 of its difference, and where it is lifted 3 of its sum.
  struct Capacitance {
    int columns = 0; ///< of a tie
    std::unique_ptr<Schur> matrix;
    std::vector<double> entries;
  };
  const DofMap &dofs_;
  RodSet rods_;
  std::optional<BandedFactor> banded_; ///< of the rods without ties, or ...
  std::optional<CondensedFactor> condensed_;
  std::vector<std::array<std::array<int, 3>, 2>> unknown_; ///< of the two ends of each tie, -1 where held
  std::vector<std::vector<Part>> groups_; ///< of what K0 does not couple: rods, or all where junctions are
  Capacitance plain_, lifted_, *now_ = nullptr;
  std::vector<Mat3> direction_;      ///< of the columns of each tie
  std::vector<double> coefficient_;  ///< of each column [N/m]
  std::vector<double> right_, part_; ///< by the unknowns
  std::vector<double> columns_;      ///< by the columns
  bool regular_ = true;
  int negative_ = 0, zero_ = 0;

  template <class Visit> auto base(Visit visit) { return banded_ ? visit(*banded_) : visit(*condensed_); }
  template <class Visit> auto base(Visit visit) const { return banded_ ? visit(*banded_) : visit(*condensed_); }
  void make(Capacitance &capacitance, int columns);
  void fillCapacitance();
  double factorLifted(const BandedSystem &system);
  template <class Visit> void eachEntry(const Part &part, int column, Visit visit) const;
};

} // namespace tendril
