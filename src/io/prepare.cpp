#include "tendril/io/prepare.hpp"

#include "tendril/dynamics/plane_watch.hpp"
#include "tendril/io/checks.hpp"
#include "tendril/io/quiet_errors.hpp"
#include "tendril/io/text.hpp"
#include "tendril/solver/activity.hpp"
#include "tendril/solver/events.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// What PETSc finds wrong is a mistake in the options of its solvers.
void guarded(const std::function<PetscErrorCode()> &work) {
  const QuietErrors errors;
  if (work()) throw SceneError("setting up the solvers: " + errors.message());
}

/// \param meet whether what different ranks have may come to touch
Share shareOf(const Partition &parts, const Team &team, bool meet) {
  Share share{team, parts.blocksOf(team.rank()), parts.placesOf(team.rank()), {}, {}};
  if (meet && !team.isAlone()) {
    share.owner = parts.owner;
    share.group = parts.group;
  }
  return share;
}

/// A path of equilibria has one load factor for all rods, which makes them one island.
void makeReady(Scene scene, const Options &o, Prepared &prepared) {
  const Team world = Team::world();
  const bool path = !o.loop.dynamic && o.loop.continuation == Continuation::arclength, among = scene.touchesMoving(),
             together = path || (among && !o.loop.dynamic);
  const Partition parts = partition(scene, together ? 1 : world.size(), o.partition);
  const Team &team = prepared.team = world.first(parts.ranks);
  prepared.ranks.clear();
  if (!world.isAlone() && together)
    prepared.ranks = {(path ? std::string("warning: with -continuation arclength all rods share one load factor and "
                                          "run on one rank; the other ")
                            : "warning: in statics rods that touch each other or bodies run on one rank; the other ") +
                      std::to_string(world.size() - 1) + " have nothing to do"};
  else if (!world.isAlone())
    prepared.ranks = describe(parts, scene, world.size());
  prepared.all.reset();
  if (team.size() > 1 && among) prepared.all = std::make_shared<const Scene>(scene);
  Share share;
  Simulation *run = nullptr;
  if (!team.isEmpty()) {
    prepared.slice = Slice(scene, parts, team);
    prepared.described.reset();
    run = (prepared.run = std::make_unique<Simulation>()).get();
    if (!prepared.slice.isAll()) {
      share = shareOf(parts, team, among);
      guarded([&] { return run->prepare(prepared.slice.sceneOf(scene), o.loop, team); });
    }
  }
  world.together([&] { // ranks without rods hear of mistakes, too
    if (!run) return;
    if (prepared.slice.isAll()) return guarded([&] { return run->setUp(std::move(scene), o.loop); });
    guarded([&] { return run->setUpSolver(o.loop, share); });
    if (!team.leads()) return;
    prepared.described = std::make_unique<Simulation>();
    prepared.described->describe(std::move(scene), o.loop.dynamic);
  });
  world.together([&] {
    if (!run) return;
    if (team.leads() && o.loop.dynamic && o.restart.empty()) refuseTearing(prepared.whole());
    const Scene &all = prepared.whole().scene;
    if (team.leads() && (!all.colliders.empty() || all.touchesMoving()) && o.restart.empty())
      refuseOverlaps(prepared.whole());
    guarded([&] { return run->solver.rehearse(run->state, TimeLoop::stepOf(o.loop, run->state, o.loop.dt)); });
  });
}

void remeshAsAsked(SceneFile &file, const Options &o) {
  const std::vector<int> edges = edgesAsked(file.scene, o);
  try {
    file.scene = remesh(file.scene, file.drawings, edges);
  } catch (const SceneError &e) {
    throw SceneError(std::string("option -rod_edges: ") + e.what());
  }
}

} // namespace

/// The scene as it will run, checked against the options.
static Scene sceneFor(Prepared &prepared, Options &o) {
  SceneFile file = readScene(o.scene, o.overrides);
  prepared.source = std::move(file.source);
  prepared.notes = std::move(file.notes);
  if (o.gravity) file.scene.gravity = *o.gravity;
  resolve(file.run, o);
  for (Rod &rod : file.scene.rods) rod.chooses_model = rod.chooses_model && o.modes == 0; // modes are in all directions
  settleModels(file.scene, o.loop.dynamic || (o.modes > 0 && !o.buckling),
               Team::world().isAlone() && (o.loop.dynamic || o.loop.continuation == Continuation::load),
               &prepared.notes);
  checkScene(file.scene, o, &prepared.notes);
  if (o.accuracy || (o.error_estimate && !o.loop.dynamic)) {
    prepared.written = file.scene;
    prepared.drawings = file.drawings;
    if (o.accuracy) grade(prepared.written, prepared.drawings);
  }
  if (!o.rod_edges.empty()) remeshAsAsked(file, o);
  return std::move(file.scene);
}

PetscErrorCode unite(Prepared &prepared, const Options &o, std::string *line) {
  PetscFunctionBeginUser;
  Simulation &run = *prepared.run;
  const Scene &whole = *prepared.all;
  prepared.collect(run.state);
  const int before = prepared.team.size();
  const Partition parts = partition(whole, before, o.partition, run.solver.groups());
  prepared.team = prepared.team.first(parts.ranks);
  const Team &team = prepared.team;
  if (team.isEmpty()) PetscFunctionReturn(0);
  prepared.slice = Slice(whole, parts, team, true);
  PetscCall(run.prepare(prepared.slice.sceneOf(whole), o.loop, team));
  PetscCall(run.setUpSolver(o.loop, shareOf(parts, team, true)));
  prepared.spread();
  std::ostringstream text;
  text << "ranks: rods or bodies of different ones come near each other: " << parts.ranks << " of " << before
       << " go on, " << parts.least << " to " << parts.most << " edges a rank";
  *line = text.str();
  PetscFunctionReturn(0);
}

PetscErrorCode leaveModel(RodModel model, Prepared &prepared, const Options &o) {
  PetscFunctionBeginUser;
  Simulation &run = *prepared.run;
  State state = std::move(run.state);
  PetscCall(run.setUp(freeOf(model, run.scene), o.loop));
  run.state = std::move(state);
  PetscFunctionReturn(0);
}

void prepare(Prepared &prepared, Options &o) {
  (void)PetscLogStagePush(events().setup);
  Scene scene;
  Team::world().together([&] { scene = sceneFor(prepared, o); });
  makeReady(std::move(scene), o, prepared);
  if (prepared.team.leads() && !prepared.team.isEmpty())
    for (std::string &note : notesOnContact(prepared.whole())) prepared.notes.push_back(std::move(note));
  (void)PetscLogStagePop();
}

void meetAccuracy(Prepared &prepared, Options &o, Choice *choice) {
  const Team world = Team::world();
  world.together([&] { // by one rank: its runs are small, and many are alike
    if (!world.leads()) return;
    watch().tell = [](const std::string &line) {
      std::printf("%s\n", printable(line).c_str());
      std::fflush(stdout);
    };
    choice->tell = [](const std::string &line) {
      watch().tell(line);
      watch().restart();
    };
    guarded([&] { return chooseResolution(prepared.written, prepared.drawings, o.loop, *o.accuracy, choice); });
    o.loop = choice->loop;
  });
  double steps[] = {o.loop.dt, o.loop.dt_rtol, o.loop.dt_atol};
  world.share(steps);
  world.shareList(choice->edges);
  o.loop.dt = steps[0];
  o.loop.dt_rtol = steps[1];
  o.loop.dt_atol = steps[2];
  makeReady(remesh(prepared.written, prepared.drawings, choice->edges), o, prepared);
}

} // namespace tendril
