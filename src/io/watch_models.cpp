#include "tendril/io/watch_models.hpp"

#include "tendril/dynamics/plane_watch.hpp"

#include <algorithm>
#include <iomanip>
#include <petsctime.h>
#include <sstream>

namespace tendril {
namespace {

void tell(const State &state, const Options &o, Progress &progress) {
  std::ostringstream line;
  line << "model auto: after " << (o.loop.dynamic ? "time " : "load factor ") << state.time
       << " planar rods lose their stability: they go on as full ones";
  progress.say(line.str());
}

} // namespace

PetscErrorCode watchModels(Prepared &prepared, const Options &o, Progress &progress, TimeLoop &loop) {
  constexpr int seldom = 8;
  PetscFunctionBeginUser;
  Simulation &run = *prepared.run;
  if (const int r = leftPlane(run.scene, run.state); r >= 0) {
    const Rod &rod = run.scene.rods[std::size_t(r)];
    if (!rod.chooses_model)
      throw SceneError("rod '" + rod.name +
                       "' cannot be of model planar: it begins out of its plane, or moves out of "
                       "it; take model full, or auto");
    tell(run.state, o, progress);
    PetscCall(leavePlanes(prepared, o));
  }
  if (!hasChosenPlanes(run.scene)) PetscFunctionReturn(0);
  auto watch = std::make_shared<PlaneWatch>();
  PetscCall(watch->setUp(run.scene, o.loop));
  loop.widen = [&, watch](const State &next, bool unstable, bool *widened) {
    PetscFunctionBeginUser;
    if (!hasChosenPlanes(run.scene) || (o.loop.dynamic && run.state.step % seldom != 0)) PetscFunctionReturn(0);
    *widened = unstable && !o.loop.dynamic; // its branch may lead anywhere
    if (!*widened) PetscCall(watch->check(next, widened));
    if (!*widened) PetscFunctionReturn(0);
    tell(run.state, o, progress);
    PetscCall(leavePlanes(prepared, o));
    PetscFunctionReturn(0);
  };
  PetscFunctionReturn(0);
}

PetscErrorCode proveModels(const Prepared &prepared, const Options &o, double seconds, Progress &progress,
                           int *exit_code) {
  PetscFunctionBeginUser;
  const Simulation &run = prepared.whole();
  Scene scene = run.scene;
  const auto leaves_out = [](const Rod &r) {
    return r.bends() ? r.chooses_model || r.model != RodModel::full : r.left_out != std::array{0.0, 0.0};
  };
  if (std::none_of(scene.rods.begin(), scene.rods.end(), leaves_out)) {
    progress.say("model check: no rod leaves anything out, there is nothing to prove");
    PetscFunctionReturn(0);
  }
  for (Rod &rod : scene.rods) {
    if (rod.model == RodModel::cable) rod.material.flexural_stiffness = rod.left_out;
    rod.model = RodModel::full;
    rod.flat = -1;
  }
  Simulation full;
  PetscCall(full.setUp(std::move(scene), o.loop));
  TimeLoop loop(full.solver, o.loop);
  bool finished;
  PetscLogDouble begin, end;
  PetscCall(PetscTime(&begin));
  PetscCall(loop.run(
      full.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
  PetscCall(PetscTime(&end));
  if (!finished) {
    progress.fail("model check: full rods do not come to the end: " + loop.failure());
    *exit_code = 2;
    PetscFunctionReturn(0);
  }
  double apart = 0;
  const Elements &elements = *full.elements;
  for (std::size_t r = 0; r < elements.rods.size(); ++r)
    for (int v = elements.rods[r].first_vertex; v < elements.rods[r].first_vertex + elements.rods[r].vertices; ++v)
      apart = std::max(apart, (full.state.position[std::size_t(v)] - run.state.position[std::size_t(v)]).norm() /
                                  elements.length(int(r)));
  const double most = o.accuracy ? o.accuracy->tolerance : 1e-6;
  std::ostringstream line;
  line << std::setprecision(3) << "model check: full rods end " << apart << " rod lengths away";
  if (apart <= most) {
    line << ", and took " << end - begin << " s, this run " << seconds << " s";
    progress.say(line.str());
    PetscFunctionReturn(0);
  }
  line << ", more than " << most << ": take -model full";
  progress.fail(line.str());
  *exit_code = 2;
  PetscFunctionReturn(0);
}

} // namespace tendril
