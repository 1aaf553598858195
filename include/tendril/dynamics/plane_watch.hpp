#pragma once
/// \file plane_watch.hpp
/// Whether planar rods (RodModel) would stay in their planes if they were free to leave them.

#include "tendril/dynamics/simulation.hpp"

namespace tendril {

/// Counts, after a step of planar rods, the unstable motions of the same rods with all unknowns: what the plane holds
/// is at rest in it, and a motion out of it that lowers the energy is one that the planar rod does not have. In
/// dynamics it counts those that grow so fast that they would come out of rounding before the end.
class PlaneWatch {
public:
  /// \param scene with planar rods, of which those that choose their model may leave their planes
  PetscErrorCode setUp(const Scene &scene, const LoopSettings &settings);
  /// Whether a state is unstable out of its planes; in statics its time is the load factor.
  PetscErrorCode check(const State &state, bool *leaves);

private:
  Simulation full_;
  Step step_;
};

/// The scene in which rods that chose a model have all unknowns.
Scene freeOf(RodModel model, Scene scene);
/// Whether a rod of the scene chose a model.
bool hasChosen(const Scene &scene, RodModel model);
/// The first rod of a scene that cannot have its state by its model: planar, and out of its plane, moving out of it, or
/// turned about its tangent; without torsion, and twisted. -1: none.
int leftModel(const Scene &scene, const State &state);

} // namespace tendril
