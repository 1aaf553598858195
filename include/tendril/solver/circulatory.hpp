#pragma once
/// \file circulatory.hpp
/// What the derivative of couples and of follower forces has beyond a symmetric matrix. A couple M fixed in space, or a
/// torque T about the tangent, does the work (M + T t).phi (docs/theory.md (33.1)) in a motion whose spin is phi, and
/// no potential has that for its differential: the derivative of its generalised forces -(M + T t).phi_i by the
/// unknowns j, in the coordinates of the retraction, is the symmetric part that the band holds, and
///
///     A_ij = (M - T t).(phi_i x phi_j)/2    (33.2)
///
/// (the Maurer-Cartan equation of the rotations, in space for M, in the frame for T; structural mechanics calls such
/// forces circulatory, Ziegler 1968, Principles of Structural Stability). That is of rank two for each couple, so that
/// Newton's direction comes from the factored symmetric part and two more solves a couple, by the formula of Sherman,
/// Morrison and Woodbury, whatever the linear solver. A force F on a vertex v that turns with an edge whose spin is phi
/// has the derivative
///
///     -phi x F = |F| (q (p.phi) - p (q.phi)),  p, q and F/|F| orthonormal and right-handed    (33.3)
///
/// in the rows of the vertex, of rank two as well: all of it stands here, none in the band.

#include "tendril/solver/incremental_potential.hpp"

#include <Eigen/Dense>
#include <functional>

namespace tendril {

class Circulatory {
public:
  /// Of the couples and follower forces on the rods of some islands. \param rods those that arrays of `solve` are over
  Circulatory(const IncrementalPotential &potential, std::vector<RodSet> islands, RodSet rods);
  bool isNone() const { return sources_.empty(); }
  bool acts(RodSet island) const { return pairsOn(island) > 0; }

  /// Takes up the couples at the iterate, and the symmetric part of the Hessian there, which `solve` (right-hand side,
  /// solution) solves with.
  using Solve = std::function<PetscErrorCode(const Planes &, Planes &)>;
  PetscErrorCode update(const Solve &solve);
  /// Of the solution of the symmetric part makes that of all of it. False where the latter is singular.
  bool correct(Planes &solution) const;

private:
  /// One of the columns: over x, y, z of the edge's vector, and its twist; or over the vector at the slot, the spin of
  /// a body or the place of a vertex.
  struct Column {
    int rod, slot;
    Vec3 edge;
    double twist;
    bool of_vector;
    double dot(const Planes &x) const;
    void addTo(Planes &x) const;
  };
  const IncrementalPotential &potential_;
  std::vector<RodSet> islands_;
  /// One of a couple on an edge, what the spin of a body has beyond a symmetric matrix, a follower force, and how the
  /// half edge beyond an end couple pulls.
  struct Source {
    int rod;
    const EdgeMoment *couple = nullptr;
    const JoinedBody *body = nullptr;
    const PlacedFollower *follower = nullptr;
    const EndCouple *end = nullptr;
    int pairs() const { return follower ? 2 : 1; } ///< of columns
  };
  /// The matrix has forward a b' + backward b a' of two columns a and b that follow each other.
  struct Strength {
    double forward, backward;
  };
  std::vector<Source> sources_; ///< by rod
  int pairsOn(RodSet island) const;
  void addCouple(const Source &source, int slot, const Vec3 &moment);
  void addFollower(const PlacedFollower &follower);
  void addEndPull(int rod, const EndCouple &end);
  std::vector<Column> columns_;    ///< two for each pair
  std::vector<Strength> strength_; ///< of each pair
  Planes right_;                   ///< over the rods, as those solved
  std::vector<Planes> solved_;     ///< the k-th columns of all islands, solved
};

} // namespace tendril
