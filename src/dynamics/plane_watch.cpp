#include "tendril/dynamics/plane_watch.hpp"

#include "tendril/dynamics/bifurcation.hpp"
#include "tendril/geometry/frame.hpp"

#include <algorithm>

namespace tendril {

bool hasChosen(const Scene &scene, RodModel model) {
  return std::any_of(scene.rods.begin(), scene.rods.end(),
                     [&](const Rod &rod) { return rod.chooses_model && rod.model == model; });
}

Scene freeOf(RodModel model, Scene scene) {
  for (Rod &rod : scene.rods)
    if (rod.chooses_model && rod.model == model) giveAllUnknowns(rod);
  return scene;
}

namespace {

/// Angle that a director is from where another goes by the minimal rotation of its edge.
double turnBetween(const Vec3 &t0, const Vec3 &d0, const Vec3 &t1, const Vec3 &d1) {
  const Vec3 carried = transport<double>(d0, t0, t1);
  return std::atan2(t1.dot(carried.cross(d1)), carried.dot(d1));
}

} // namespace

int leftModel(const Scene &scene, const State &state) {
  constexpr double twisted = 1e-7; // [rad], of an edge against the one before: more than Newton leaves
  int v = 0, e = 0;
  for (int r = 0; r < int(scene.rods.size());
       v += scene.rods[std::size_t(r)].vertices(), e += scene.rods[std::size_t(r)].edges(), ++r) {
    const Rod &rod = scene.rods[std::size_t(r)];
    if (!rod.bends() || rod.model == RodModel::full) continue;
    const Vec3 *const x = &state.position[std::size_t(v)], *const velocity = &state.velocity[std::size_t(v)],
                      *const d = &state.director[std::size_t(e)];
    auto tangent = [&](int i) { return (x[rod.next(i)] - x[i]).normalized(); };
    for (int i = 0; i < rod.vertices() && rod.flat >= 0; ++i)
      if (x[i][rod.flat] != rod.position[std::size_t(i)][rod.flat] || velocity[i][rod.flat] != 0) return r;
    for (int i = 0; i < rod.edges(); ++i) {
      if (rod.flat >= 0 && state.twist_rate[std::size_t(e + i)] != 0) return r;
      // Of a planar rod from where it was drawn, of others from the edge before.
      const double turn = rod.flat >= 0
                              ? turnBetween(rod.edge(i).normalized(), rod.director[std::size_t(i)], tangent(i), d[i])
                          : i > 0 ? turnBetween(tangent(i - 1), d[i - 1], tangent(i), d[i])
                                  : 0;
      if (std::abs(turn) > twisted) return r;
    }
  }
  return -1;
}

PetscErrorCode PlaneWatch::setUp(const Scene &scene, const LoopSettings &settings) {
  constexpr double e_folds = 20; // from rounding, 1e-15, to a millionth
  PetscFunctionBeginUser;
  PetscCall(full_.setUp(freeOf(RodModel::planar, scene), settings));
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
