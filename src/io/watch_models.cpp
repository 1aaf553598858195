#include "tendril/io/watch_models.hpp"

#include "tendril/dynamics/plane_watch.hpp"

#include <algorithm>
#include <iomanip>
#include <petsctime.h>
#include <sstream>

namespace tendril {
namespace {

std::string after(const State &state, const Options &o) {
  std::ostringstream text;
  text << "after " << (o.loop.dynamic ? "time " : "load factor ") << state.time << " planar rods lose their stability";
  return text.str();
}

} // namespace

PetscErrorCode watchModels(Prepared &prepared, const Options &o, Progress &progress, TimeLoop &loop) {
  constexpr int seldom = 8;
  PetscFunctionBeginUser;
  Simulation &run = *prepared.run;
  for (int r; prepared.team.any((r = leftModel(run.scene, run.state)) >= 0);) {
    if (prepared.team.size() > 1)
      throw SceneError("a rod begins out of its plane or twisted, which its model leaves out; take -model full");
    const Rod &rod = run.scene.rods[std::size_t(r)];
    const RodModel model = rod.model;
    const std::string who = "rod '" + rod.name + "' ",
                      why = model == RodModel::planar
                                ? "begins out of its plane, moves out of it or is turned about its tangent"
                                : "begins twisted";
    if (!rod.chooses_model)
      throw SceneError(who + "cannot be of model " + nameOf(model) + ": it " + why + "; take model full, or auto");
    progress.say("model auto: " + who + why + ": all that are " + nameOf(model) + " go on as full ones");
    PetscCall(leaveModel(model, prepared, o));
  }
  if (!hasChosen(run.scene, RodModel::planar)) PetscFunctionReturn(0);
  auto watch = std::make_shared<PlaneWatch>();
  PetscCall(watch->setUp(run.scene, o.loop));
  loop.widen = [&, watch](const State &next, bool unstable, bool *widened, std::string *failure) {
    PetscFunctionBeginUser;
    if (!hasChosen(run.scene, RodModel::planar) || (o.loop.dynamic && run.state.step % seldom != 0))
      PetscFunctionReturn(0);
    *widened = unstable && !o.loop.dynamic; // its branch may lead anywhere
    if (!*widened) PetscCall(watch->check(next, widened));
    if (!*widened) PetscFunctionReturn(0);
    if (o.accuracy) {
      *widened = false;
      *failure = after(run.state, o) + ", and -accuracy has chosen the edges for these; take -model full";
      PetscFunctionReturn(0);
    }
    progress.say("model auto: " + after(run.state, o) + ": they go on as full ones");
    PetscCall(leaveModel(RodModel::planar, prepared, o));
    PetscFunctionReturn(0);
  };
  PetscFunctionReturn(0);
}

PetscErrorCode proveModels(const Prepared &prepared, const Options &o, Progress &progress, int *exit_code) {
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
  for (Rod &rod : scene.rods) giveAllUnknowns(rod);
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
    line << ", and took " << end - begin << " s without output";
    progress.say(line.str());
    PetscFunctionReturn(0);
  }
  line << ", more than " << most << ": take -model full";
  progress.fail(line.str());
  *exit_code = 2;
  PetscFunctionReturn(0);
}

} // namespace tendril
