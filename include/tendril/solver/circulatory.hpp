#pragma once
/// \file circulatory.hpp
/// What the derivative of couples has beyond a symmetric matrix. A couple M fixed in space, or a torque T about the
/// tangent, does the work (M + T t).phi in a motion whose spin is phi, and no potential has that for its differential:
/// the derivative of its generalised forces
/// -(M + T t).phi_i by the unknowns j, in the coordinates of the retraction, is the symmetric part that the band holds,
/// and
///
///     A_ij = (M - T t).(phi_i x phi_j)/2
///
/// (the Maurer-Cartan equation of the rotations, in space for M, in the frame for T; structural mechanics calls such
/// forces circulatory, Ziegler 1968, Principles of Structural Stability). That is of rank two for each couple, so that
/// Newton's direction comes from the factored symmetric part and two more solves a couple, by the formula of Sherman,
/// Morrison and Woodbury, whatever the linear solver.

#include "tendril/solver/incremental_potential.hpp"

#include <Eigen/Dense>
#include <functional>

namespace tendril {

class Circulatory {
public:
  /// Of the couples on the rods of some islands.
  Circulatory(const IncrementalPotential &potential, std::vector<RodSet> islands);
  bool isNone() const { return couples_.empty(); }
  bool acts(RodSet island) const { return countOn(island) > 0; }

  /// Takes up the couples at the iterate, and the symmetric part of the Hessian there, which `solve` (right-hand side,
  /// solution) solves with.
  using Solve = std::function<PetscErrorCode(const Planes &, Planes &)>;
  PetscErrorCode update(const Solve &solve);
  /// Of the solution of the symmetric part makes that of all of it. False where the latter is singular.
  bool correct(Planes &solution) const;

private:
  /// One of the two columns of a couple: over x, y, z of the edge's vector, and its twist; or over the spin of a body
  /// at the slot.
  struct Column {
    int rod, slot;
    Vec3 edge;
    double twist;
    bool of_body;
    double dot(const Planes &x) const;
    void addTo(Planes &x) const;
  };
  const IncrementalPotential &potential_;
  std::vector<RodSet> islands_;
  /// On an edge, or where that is -1 what the spin of a body has beyond a symmetric matrix.
  struct Couple : EdgeMoment {
    const JoinedBody *body = nullptr;
  };
  std::vector<Couple> couples_; ///< by rod
  int countOn(RodSet island) const;
  std::vector<Column> columns_;  ///< two for each couple
  std::vector<double> strength_; ///< half of |M| for each couple [N m]
  Planes right_;                 ///< of the islands, as those solved
  std::vector<Planes> solved_;   ///< the k-th columns of all islands, solved
};

} // namespace tendril
