#pragma once
/// \file secants.hpp
/// Iterations that share a factorisation: its direction corrected by what the steps since have changed of the gradient
/// (limited-memory BFGS, two-loop recursion, Nocedal and Wright 2006, algorithm 7.4), rod by rod.

#include "tendril/layout/dof_map.hpp"

#include <functional>

namespace tendril {

/// All values of a vector of this process.
PetscErrorCode copyValues(Vec from, std::vector<double> *values);

class Secants {
public:
  void clear() { pairs_.clear(); }
  /// y becomes the direction for the gradient f. \param solve with the matrix factored last \param work a vector like f
  PetscErrorCode apply(const DofMap &dofs, const std::vector<RodSet> &islands,
                       const std::function<PetscErrorCode(Vec, Vec)> &solve, Vec f, Vec work, Vec y) const;
  /// A step, a direction times a length per rod, and what it changed of the gradient from `before` to f.
  PetscErrorCode add(const DofMap &dofs, const std::vector<RodSet> &islands, Vec direction,
                     const std::vector<double> &lengths, const std::vector<double> &before, Vec f);

private:
  /// By unknowns; per rod one over the product of both, 0 where that is not positive.
  struct Pair {
    std::vector<double> step, change, inverse;
  };
  std::vector<Pair> pairs_;
};

} // namespace tendril
