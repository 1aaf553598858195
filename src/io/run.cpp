#include "tendril/io/run.hpp"

#include "tendril/accuracy/accuracy.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/dynamics/simulation.hpp"
#include "tendril/io/estimate_writer.hpp"
#include "tendril/io/keys.hpp"
#include "tendril/io/mode_output.hpp"
#include "tendril/io/option_files.hpp"
#include "tendril/io/options.hpp"
#include "tendril/io/prepare.hpp"
#include "tendril/io/progress.hpp"
#include "tendril/io/provenance.hpp"
#include "tendril/io/quiet_errors.hpp"
#include "tendril/io/recorder.hpp"
#include "tendril/io/shape_file.hpp"
#include "tendril/io/stop.hpp"
#include "tendril/io/take_up.hpp"
#include "tendril/io/text.hpp"
#include "tendril/io/watch_models.hpp"
#include "tendril/layout/launch.hpp"
#include "tendril/solver/activity.hpp"
#include "tendril/solver/events.hpp"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <iomanip>
#include <memory>
#include <sstream>

namespace tendril {
namespace {

/// What PETSc finds wrong with the command line; empty when it has started. An error handler would be memory of ours,
/// which -malloc_debug takes for corrupted.
std::string initializePetsc(int *argc, char ***argv) {
  auto *const print = std::exchange(PetscErrorPrintf, &PetscErrorPrintfNone);
  prepareMpi();
  const PetscErrorCode error = PetscInitialize(argc, argv, nullptr, nullptr);
  PetscErrorPrintf = print;
  if (!error) return {};
  char *specific = nullptr;
  (void)PetscErrorMessage(error, nullptr, &specific);
  return specific && *specific ? specific : "PETSc cannot start";
}

/// All of a text. \throws WriteError
void print(const std::string &text) {
  std::fputs(text.c_str(), stdout);
  if (std::fflush(stdout) != 0 || std::ferror(stdout))
    throw WriteError("standard output cannot be written; is the disk full?");
}

/// The error of a static answer, told and written.
PetscErrorCode tellError(const Prepared &prepared, double rounding_error, const std::vector<double> &critical,
                         const Options &o, Progress &progress) {
  PetscFunctionBeginUser;
  const Simulation &run = prepared.whole();
  Estimate estimate;
  PetscCall(estimateError(run, rounding_error, critical,
                          remesh(prepared.written, prepared.drawings, edgesOf(run.scene, 2)), o.loop, &estimate));
  for (const std::string &line : describe(estimate, run.scene)) progress.say(line);
  writeEstimate(o.output_dir + "/trajectory.h5", estimate);
  PetscFunctionReturn(0);
}

void tellTimeError(const Diagnostics &last, const Options &o, Progress &progress) {
  std::ostringstream line;
  const double with_rounding = last.error_estimate + last.rounding_error;
  line << "estimated error: " << std::setprecision(3) << with_rounding
       << " rod lengths in time, the local errors of all steps and their rounding errors added up; that of the edges "
          "is not in it";
  progress.say(line.str());
  writeTimeError(o.output_dir + "/trajectory.h5", with_rounding);
}

/// The command line, as far as it stands alone. \throws SceneError
void readCommandLine(int argc, char **argv, const OptionFiles &files, Options *o) {
  {
    const QuietErrors errors;
    if (readOptions(argc, argv, o)) throw SceneError("command line: " + errors.message());
  }
  if (o->schema || o->keys) return;
  if (o->scene.empty())
    throw SceneError("option -scene: is required: tendril -scene data/scenes/helix.yaml (-help lists all options)");
  if (const std::string place = files.place("scene"); !place.empty() && !std::filesystem::exists(o->scene))
    throw SceneError(place + ": the scene '" + o->scene +
                     "' cannot be opened; its path begins in the folder where tendril is started");
}

/// What a restart asks of the run that it goes on with.
RunFacts factsOf(const Simulation &run, const Options &o, const SceneSource &source) {
  RunFacts facts(run.scene, o.loop, source.all());
  for (const char *name : {"snes_rtol", "snes_max_it"}) {
    const std::string option = std::string("-") + name;
    char value[64];
    PetscBool given = PETSC_FALSE;
    (void)PetscOptionsGetString(nullptr, nullptr, option.c_str(), value, sizeof value, &given);
    facts.facts.push_back({RunFacts::Kind::option, name, given ? value : findKey(option)->fallback});
  }
  return facts;
}

/// From the state of a run to its end, a stop or a failure, which is empty else.
PetscErrorCode march(Prepared &prepared, TimeLoop &loop, const Options &o, const StopRequest &request,
                     Recorder &recorder, Progress &progress, bool *finished, std::string *failure) {
  PetscFunctionBeginUser;
  Simulation &run = *prepared.run;
  auto observe = [&](const State &state, const Diagnostics &row) { return recorder.observe(state, row); };
  auto critical = [&](const CriticalPoint &point) { return recorder.noteCritical(point); };
  auto stops = [&] { return request.asked(); };
  PetscCall(PetscLogStagePush(events().run));
  if (o.buckling) {
    PetscCall(followBuckling(prepared, o, observe, critical, stops, finished, failure));
  } else if (o.modes > 0 && isAlone(run.scene)) {
    PetscCall(settleAlone(run, o, observe, finished, failure));
  } else if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength) {
    ArcLength path(run.solver, o.loop);
    path.on_critical = critical;
    path.stops = stops;
    PetscCall(path.run(run.state, observe, finished));
    *failure = path.failure();
    if (*finished && run.state.time < o.loop.t_end && recorder.steps() >= o.loop.arclength_steps) {
      std::ostringstream line;
      line << "the path ends at load factor " << run.state.time << " after " << recorder.steps()
           << " steps; to follow it on, raise -arclength_steps";
      progress.say(line.str());
    }
  } else {
    loop.on_critical = critical;
    loop.stops = stops;
    loop.unite = [&](bool *stays) {
      PetscFunctionBeginUser;
      std::string line;
      PetscCall(unite(prepared, o, &line));
      *stays = !prepared.team.isEmpty();
      if (*stays) progress.say(line);
      PetscFunctionReturn(0);
    };
    PetscCall(watchModels(prepared, o, progress, loop));
    PetscCall(loop.run(run.state, observe, finished));
    *failure = loop.failure();
  }
  if (!prepared.team.isEmpty()) PetscCall(recorder.end(!*finished && failure->empty()));
  PetscCall(PetscLogStagePop());
  PetscFunctionReturn(0);
}

void tellStop(const State &state, const Options &o, int exit_code, const std::string &command_line,
              Progress &progress) {
  std::ostringstream line;
  line << "stopped by " << StopRequest::reason(exit_code) << " at " << (o.loop.dynamic ? "time " : "load factor ")
       << state.time << " of " << o.loop.t_end;
  if (o.buckling || (!o.loop.dynamic && o.loop.continuation == Continuation::arclength))
    line << "; a path of equilibria cannot be gone on with";
  else
    line << "; go on with: " << command_line << (o.restart == "auto" ? "" : " -restart auto");
  progress.say(line.str());
}

/// The first option that no rank has asked for: not all have the same solvers.
PetscErrorCode findUnused(const Team &team, bool touches, std::string *unused) {
  PetscFunctionBeginUser;
  std::vector<std::string> mine;
  PetscCall(unusedOptions(touches, &mine));
  std::string names;
  for (const std::string &name : mine) names += name + '\n';
  team.share(names);
  std::istringstream lines(names);
  for (std::string name; std::getline(lines, name);)
    if (team.all(std::find(mine.begin(), mine.end(), name) != mine.end()) && unused->empty()) *unused = name;
  PetscFunctionReturn(0);
}

/// What a run has before its first step, on the leading rank.
struct Begun {
  std::optional<OutputFolder> folder;
  RunFacts facts;
  Provenance origin;
  std::optional<Progress> progress;
  Choice choice;
};

/// Takes up what is to be gone on with, and tells what is run. \return false where nothing is left to do
bool begin(int argc, char **argv, const Options &o, Prepared &prepared, StepControl *control, Begun *out) {
  Simulation &whole = prepared.whole();
  std::vector<std::string> told;
  if (!takeUp(o, *out->folder, out->facts, whole, control, &told)) return false;
  Provenance &origin = out->origin;
  origin = provenance(argc, argv);
  origin.ranks = prepared.team.size();
  origin.scene = std::move(prepared.source);
  origin.effective_options = writeOptionsFile(o.output_dir + "/options.yaml", o, origin, whole.scene);
  Progress &progress = out->progress.emplace(o.loop, o.output_dir + "/log.txt", true);
  progress.say(origin.command_line);
  for (const std::string &line : told) progress.say(line);
  std::istringstream groups(groupsText(whole.scene));
  for (std::string line; std::getline(groups, line);) progress.say(line);
  for (const auto *lines : {&prepared.notes, &prepared.ranks})
    for (const std::string &line : *lines) progress.say(line);
  for (const std::string &line : out->choice.lines) progress.log(line);
  return true;
}

/// \return the exit code; of use on the leading rank
PetscErrorCode runPrepared(Prepared &prepared, int argc, char **argv, const Options &o, const StopRequest &request,
                           Begun &begun, int *exit_code) {
  PetscFunctionBeginUser;
  const Team &team = prepared.team;
  Simulation &run = *prepared.run;
  TimeLoop loop(run.solver, o.loop);
  bool goes_on = true;
  team.together([&] {
    if (!team.leads()) return;
    begun.facts = factsOf(prepared.whole(), o, prepared.source);
    goes_on = begin(argc, argv, o, prepared, &loop.control, &begun);
  });
  if (!team.all(goes_on)) PetscFunctionReturn(0);
  if (!o.restart.empty()) prepared.spread();
  loop.control.share(team);
  if (!team.leads()) begun.progress.emplace(o.loop, "", false);
  Progress &progress = *begun.progress;
  Recorder recorder(o, prepared, loop.control, begun.facts, begun.origin, progress);
  bool finished;
  std::string failure;
  PetscCall(march(prepared, loop, o, request, recorder, progress, &finished, &failure));
  if (team.isEmpty()) PetscFunctionReturn(0); // others have all there is
  int asked = request.exitCode();             // by a signal that not all ranks may have had
  Tally tally;
  team.combine(tally.largest(asked));
  if (!team.leads()) PetscFunctionReturn(0);
  const bool stopped = !finished && failure.empty();
  if (const std::string growth = recorder.tellGrowth(finished); !growth.empty()) {
    finished = false;
    failure = growth;
  }
  recorder.tellAccuracy();
  if (stopped) {
    tellStop(run.state, o, asked, begun.origin.command_line, progress);
    *exit_code = asked;
  } else if (!finished) {
    progress.fail(failure);
    *exit_code = 2;
  }
  recorder.close();
  if (finished && o.model_check) PetscCall(proveModels(prepared, o, progress, exit_code));
  if (finished && o.error_estimate && o.loop.dynamic) tellTimeError(recorder.last(), o, progress);
  if (finished && o.error_estimate && !o.loop.dynamic)
    PetscCall(tellError(prepared, recorder.last().rounding_error, recorder.criticalFactors(), o, progress));
  if (finished && o.modes > 0) PetscCall(tellModes(prepared, o, progress, exit_code));
  PetscFunctionReturn(0);
}

PetscErrorCode execute(int argc, char **argv, const OptionFiles &files, StopRequest::Clock::time_point start,
                       int *exit_code) {
  PetscFunctionBeginUser;
  const Team world = Team::world();
  Options o;
  world.together([&] { readCommandLine(argc, argv, files, &o); });
  if (o.schema || o.keys) {
    if (world.leads()) print(o.schema ? schemaAsJson() : keysAsJson());
    PetscFunctionReturn(0);
  }
  Prepared prepared;
  prepare(prepared, o);
  if (o.help) PetscFunctionReturn(0);
  Begun begun;
  std::string unknown;
  if (!prepared.team.isEmpty()) PetscCall(findUnused(prepared.team, prepared.run->scene.touchesMoving(), &unknown));
  world.together([&] {
    if (!unknown.empty()) refuseUnused(unknown);
    if (o.modes > 0) refuseTooManyModes(*prepared.run, o);
    if (!world.leads()) return;
    begun.folder.emplace(o.output_dir);
    std::vector<std::string> inputs = files.files();
    inputs.insert(inputs.end(), prepared.source.paths.begin(), prepared.source.paths.end());
    begun.folder->refuseToReplace(inputs);
    inputs.push_back(o.restart);
    checkShapesPath(o.output_shapes, inputs, o.output_dir);
  });
  if (o.accuracy) meetAccuracy(prepared, o, &begun.choice);
  const StopRequest request(start, o.time_limit, world.leads()); // before, nothing is written: a signal ends at once
  std::string mistake;
  try {
    if (!prepared.team.isEmpty()) PetscCall(runPrepared(prepared, argc, argv, o, request, begun, exit_code));
  } catch (const SceneError &e) {
    if (!prepared.team.isAlone() && !dynamic_cast<const AgreedError *>(&e)) throw; // others wait for this rank
    mistake = e.what();
    *exit_code = e.exitCode();
  }
  double code = *exit_code; // ranks without rods wait here
  world.share({&code, 1});
  world.share(mistake);
  *exit_code = int(code);
  if (!mistake.empty()) throw AgreedError(mistake, *exit_code);
  PetscFunctionReturn(0);
}

} // namespace

namespace {

/// A word that belongs to no option is the scene, where none is given.
std::vector<char *> wordsOf(int count, char **arguments) {
  std::vector<char *> words(arguments, arguments + count);
  if (std::any_of(words.begin(), words.end(), [](const char *word) { return std::string_view(word) == "-scene"; }))
    return words;
  for (std::size_t i = 1; i < words.size(); ++i)
    if (words[i][0] != '-' && (i == 1 || words[i - 1][0] != '-')) {
      static char option[] = "-scene";
      words.insert(words.begin() + std::ptrdiff_t(i), option);
      break;
    }
  return words;
}

/// What is printed instead of a run: ours before PETSc's, which come only where solvers are set up for a scene.
/// \return whether that is all
bool printAsked(const std::vector<char *> &words) {
  auto given = [&](const char *option) {
    return std::any_of(words.begin() + 1, words.end(),
                       [&](const char *word) { return std::string_view(word) == option; });
  };
  if (given("--version")) {
    if (launchedRank() == 0) print(versionText() + "\n");
    return true;
  }
  if (!given("-help") && !given("-h") && !given("--help")) return false;
  if (launchedRank() == 0) print(helpText());
  return !given("-scene") && !given("-options_file");
}

int fail(const std::string &message, int exit_code) {
  std::fprintf(stderr, "tendril: %s\n", printable(message).c_str());
  return exit_code;
}

/// The run itself, between PetscInitialize and PetscFinalize. \return the exit code
int runScene(int argc, char **argv, const OptionFiles &files, StopRequest::Clock::time_point begin) {
  int exit_code = 0;
  const Team world = Team::world();
  try {
    const QuietErrors errors;
    const PetscErrorCode error = [&]() -> PetscErrorCode {
      PetscFunctionBeginUser;
      PetscCall(registerEvents());
      PetscCall(registerSolvers());
      PetscCall(execute(argc, argv, files, begin, &exit_code));
      PetscFunctionReturn(0);
    }();
    if (error) throw SceneError("solving: " + errors.message());
  } catch (const std::exception &e) {
    const bool agreed = world.isAlone() || dynamic_cast<const AgreedError *>(&e);
    const std::string message =
        dynamic_cast<const std::bad_alloc *>(&e) ? "there is not enough memory for this scene" : files.locate(e.what());
    const auto *known = dynamic_cast<const SceneError *>(&e);
    exit_code = known ? known->exitCode() : 1;
    if (!agreed || world.leads()) fail(message, exit_code);
    if (!agreed ||
        exit_code == 3) { // HDF5 tries a file again that it could not write, when MPI ends, and crashes there
      std::fflush(nullptr);
      world.abort(exit_code);
    }
  }
  return exit_code;
}

} // namespace

int runMain(int count, char **arguments) {
  std::vector<char *> words = wordsOf(count, arguments);
  const auto begin = StopRequest::Clock::now();
  const KeptSignals signals;
  std::signal(SIGXFSZ, SIG_IGN); // a file that grows beyond its limit cannot be written: that is told
  try {
    if (printAsked(words)) return 0;
  } catch (const WriteError &e) {
    return fail(e.what(), 3);
  }
  int argc = int(words.size());
  words.push_back(nullptr);
  char **argv = words.data();
  OptionFiles files;
  try {
    files.read(argc, argv);
  } catch (const SceneError &e) {
    return launchedRank() == 0 ? fail(e.what(), 1) : 1;
  }
  if (const std::string mistake = initializePetsc(&argc, &argv); !mistake.empty())
    return launchedRank() == 0 ? fail(files.locate("command line: " + mistake), 1) : 1;
  signals.restore();
  const int exit_code = runScene(argc, argv, files, begin);
  (void)PetscOptionsSetValue(nullptr, "-options_left", "no"); // checked before the first step, with better words
  (void)PetscFinalize();
  return exit_code;
}

} // namespace tendril
