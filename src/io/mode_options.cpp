/// What options mean in the mode of a run, and which have no meaning there.
#include "tendril/io/options.hpp"

namespace tendril {
namespace {

[[noreturn]] void refuseOption(const std::string &option, const std::string &message) {
  throw SceneError("option -" + option + ": " + message);
}

void checkAccuracy(const Options &o) {
  if (o.accuracy_of && !o.accuracy) refuseOption("accuracy_of", "needs -accuracy, e.g. -accuracy 1e-3");
  if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength && (o.accuracy || o.error_estimate))
    refuseOption(o.accuracy ? "accuracy" : "error_estimate",
                 "needs -continuation load: paths of two resolutions have no states in common");
  if (o.accuracy && o.loop.bifurcation == Bifurcation::stop)
    refuseOption("accuracy", "is that of the answer at full load; -bifurcation stop ends before");
  if (o.accuracy && !o.rod_edges.empty())
    refuseOption("rod_edges", "gives the edges that -accuracy chooses; take one of the two away");
  if (o.accuracy && !o.restart.empty())
    refuseOption("accuracy", "chooses the edges, which a checkpoint already has; take -restart or -accuracy away");
}

/// The load factor goes from zero on, and nothing is left out of the path.
void checkBuckling(const Options &o) {
  const std::string no_meaning = "has no meaning in -mode buckling, which ";
  if (o.bifurcation)
    refuseOption("bifurcation", no_meaning + "goes on along the path that begins at rest; take it away");
  if (o.continuation || o.arclength_steps)
    refuseOption(o.continuation ? "continuation" : "arclength_steps",
                 no_meaning + "takes steps of the load; take it away");
  if (o.accuracy || o.error_estimate)
    refuseOption(o.accuracy ? "accuracy" : "error_estimate",
                 no_meaning + "has no answer at full load; compare runs with -rod_edges");
  if (o.model_check) refuseOption("model_check", no_meaning + "never chooses a model; take it away");
  if (o.loop.dt_min > 0) refuseOption("dt_min", no_meaning + "shortens steps as it needs; take it away");
}

} // namespace

void resolve(const RunSettings &scene, Options &o) {
  const std::string mode = o.mode.value_or(scene.mode), no_meaning = "has no meaning in -mode " + mode;
  o.loop.dynamic = mode == "dynamic";
  o.buckling = mode == "buckling";
  if (mode != "modes" && !o.buckling) {
    if (o.modes_given) refuseOption("modes", no_meaning + "; use -mode modes or buckling");
    o.modes = 0;
  }
  if (o.buckling_to && !o.buckling) refuseOption("buckling_to", no_meaning + "; use -mode buckling");
  o.load_steps = o.given_load_steps.value_or(scene.load_steps);
  if (o.loop.dynamic) {
    if (o.given_load_steps) refuseOption("load_steps", "has no meaning in -mode dynamic; use -dt");
    if (o.continuation || o.bifurcation || o.arclength_steps)
      refuseOption(o.continuation  ? "continuation"
                   : o.bifurcation ? "bifurcation"
                                   : "arclength_steps",
                   "has no meaning in -mode dynamic; use -mode static");
    o.loop.dt = o.dt.value_or(scene.dt);
    o.loop.t_end = o.t_end.value_or(scene.t_end);
    if (o.loop.t_end / o.loop.dt > 1e12)
      refuseOption("dt", "a step of " + shortText(o.loop.dt) + " s never reaches the end at " +
                             shortText(o.loop.t_end) + " s; write a larger dt or a smaller t_end");
  } else {
    if (o.dt) refuseOption("dt", no_meaning + "; use -load_steps");
    if (o.t_end)
      refuseOption("t_end", no_meaning + (o.buckling ? "; use -buckling_to" : "; the load factor ends at 1"));
    if (!o.dynamic_only.empty()) refuseOption(o.dynamic_only, no_meaning);
    o.loop.t_end = o.buckling ? o.buckling_to.value_or(furthest_buckling) : 1;
    o.loop.dt = 1.0 / o.load_steps;
    if (o.buckling) checkBuckling(o);
    const bool arclength = o.loop.continuation == Continuation::arclength;
    if (o.arclength_steps && !arclength) refuseOption("arclength_steps", "needs -continuation arclength");
  }
  if (o.restart_time && o.restart.empty()) refuseOption("restart_time", "needs -restart");
  if (o.restart_time && !o.loop.dynamic) refuseOption("restart_time", no_meaning + ", where time is the load factor");
  checkAccuracy(o);
  if (o.loop.dt_min > o.loop.dt) refuseOption("dt_min", "must not be larger than the step " + shortText(o.loop.dt));
  if (o.loop.dt_max > 0 && o.loop.dt_min > o.loop.dt_max)
    refuseOption("dt_min", "must not be larger than -dt_max " + shortText(o.loop.dt_max));
}

} // namespace tendril
