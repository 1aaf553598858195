#include "tendril/dynamics/plane_watch.hpp"

#include "tendril/dynamics/bifurcation.hpp"

#include <algorithm>

namespace tendril {

static bool choseItsPlane(const Rod &rod) { return rod.chooses_model && rod.model == RodModel::planar; }

bool hasChosenPlanes(const Scene &scene) { return std::any_of(scene.rods.begin(), scene.rods.end(), choseItsPlane); }

Scene freeOfPlanes(Scene scene) {
  for (Rod &rod : scene.rods) {
    if (!choseItsPlane(rod)) continue;
    rod.model = RodModel::full;
    rod.flat = -1;
  }
  return scene;
}

int leftPlane(const Scene &scene, const State &state) {
  int v = 0;
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    const Rod &rod = scene.rods[std::size_t(r)];
    for (int i = 0; i < rod.vertices(); ++i, ++v)
      if (rod.flat >= 0 && (state.position[std::size_t(v)][rod.flat] != rod.position[std::size_t(i)][rod.flat] ||
                            state.velocity[std::size_t(v)][rod.flat] != 0))
        return r;
  }
  return -1;
}

PetscErrorCode PlaneWatch::setUp(const Scene &scene, const LoopSettings &settings) {
  constexpr double e_folds = 32; // from rounding, 1e-16, to a hundredth
  PetscFunctionBeginUser;
  PetscCall(full_.setUp(freeOfPlanes(scene), settings));
  // With steps of this length, backward Euler's potential has unstable motions where they grow faster than 1/dt.
  step_ = TimeLoop::stepOf(settings, full_.state, settings.dynamic ? settings.t_end / e_folds : 0);
  PetscFunctionReturn(0);
}

PetscErrorCode PlaneWatch::check(const State &state, bool *leaves) {
  PetscFunctionBeginUser;
  int unstable;
  step_.time = state.time;
  if (step_.isStatic()) step_.load_factor = state.time;
  PetscCall(full_.solver.begin(state, step_));
  PetscCall(countUnstable(full_.solver, &unstable));
  *leaves = unstable != 0;
  PetscFunctionReturn(0);
}

} // namespace tendril
