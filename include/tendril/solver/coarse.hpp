#pragma once
/// \file coarse.hpp
/// Nested iteration: a static step of finely cut rods begins where the same step with fewer edges ends. Newton's
/// direction is smooth there, while far from the answer a fine rod buckles edge by edge.

#include "tendril/solver/newton.hpp"

namespace tendril {

/// Edges of a rod from which on fewer are worth a try.
inline constexpr int fine_edges = 200;

/// Solves the step that has begun for some rods of about a quarter of their edges; those in turn begin with a quarter
/// of theirs, down to fine_edges. Vertices of supports, forces and corners stay, and no edge turns or twists by more
/// than a quarter of a radian against the next for that. \param start of the step, of the whole scene \param guess over
/// the slots of the scene \param report of all coarser steps together; converged when there is a guess
PetscErrorCode solveCoarse(const IncrementalPotential &fine, const State &start, RodSet rods, Guess *guess,
                           NewtonReport *report);

} // namespace tendril
