#pragma once
/// \file mass.hpp
/// The mass matrix M of small motions from rest, over the unknowns of the Hessian: masses of vertices, with point
/// masses on them; inertia of edges about their tangents; masses of bodies, and their inertia tensors by spins about
/// axes fixed in space, R I R'. It is diagonal but for the last. Frames of junctions have none, nor have twists of rods
/// without rotational inertia: there M is singular.

#include "tendril/solver/incremental_potential.hpp"

namespace tendril {

/// Adds a multiple of it to blocks of some islands, at the iterate.
void addMass(const IncrementalPotential &potential, RodSet islands, double factor, EdgeBlocks &out);
/// out = M x. \param x with copies, as DofMap::scatter leaves it
void multiplyMass(const IncrementalPotential &potential, RodSet islands, const Planes &x, Planes &out);
/// Its rank: the number of motions that have a frequency.
int massRank(const IncrementalPotential &potential, RodSet islands);

} // namespace tendril
