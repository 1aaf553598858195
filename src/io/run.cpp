#include "tendril/io/run.hpp"

#include "tendril/accuracy/accuracy.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/dynamics/simulation.hpp"
#include "tendril/io/estimate_writer.hpp"
#include "tendril/io/keys.hpp"
#include "tendril/io/option_files.hpp"
#include "tendril/io/options.hpp"
#include "tendril/io/prepare.hpp"
#include "tendril/io/progress.hpp"
#include "tendril/io/provenance.hpp"
#include "tendril/io/quiet_errors.hpp"
#include "tendril/io/recorder.hpp"
#include "tendril/io/stop.hpp"
#include "tendril/io/take_up.hpp"
#include "tendril/io/text.hpp"
#include "tendril/layout/alone.hpp"
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
  startAlone();
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
  const Simulation &run = *prepared.run;
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

std::string textOf(const SceneSource &source) {
  std::string text = source.text;
  for (const auto &[path, content] : source.files) text += '\0' + path + '\0' + content;
  return text;
}

/// The command line, as far as it stands alone. \throws SceneError
PetscErrorCode readCommandLine(int argc, char **argv, const OptionFiles &files, Options *o) {
  PetscFunctionBeginUser;
  {
    const QuietErrors errors;
    if (readOptions(argc, argv, o)) throw SceneError("command line: " + errors.message());
  }
  if (o->schema || o->keys) PetscFunctionReturn(0);
  if (o->scene.empty())
    throw SceneError("option -scene: is required: tendril -scene data/scenes/helix.yaml (-help lists all options)");
  if (const std::string place = files.place("scene"); !place.empty() && !std::filesystem::exists(o->scene))
    throw SceneError(place + ": the scene '" + o->scene +
                     "' cannot be opened; its path begins in the folder where tendril is started");
  int ranks;
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &ranks));
  if (ranks > 1)
    throw SceneError("tendril runs on one process, found " + std::to_string(ranks) + "; start it without mpiexec");
  PetscFunctionReturn(0);
}

/// \throws SceneError where a result would take the place of a file that the run reads.
void refuseToReplaceInputs(const OutputFolder &folder, const OptionFiles &files, const SceneSource &source) {
  std::vector<std::string> inputs = files.files();
  inputs.insert(inputs.end(), source.paths.begin(), source.paths.end());
  for (const std::string &input : inputs)
    if (folder.replaces(input))
      throw SceneError("option -output_dir: results would replace '" + input +
                       "', which this run reads; choose another folder, or another name for that file");
}

/// What a restart asks of the run that it goes on with.
PetscErrorCode factsOf(const Simulation &run, const Options &o, const SceneSource &source, RunFacts *facts) {
  PetscFunctionBeginUser;
  *facts = RunFacts(run.scene, o.loop, textOf(source));
  for (const char *name : {"snes_rtol", "snes_max_it"}) {
    const std::string option = std::string("-") + name;
    char value[64];
    PetscBool given;
    PetscCall(PetscOptionsGetString(nullptr, nullptr, option.c_str(), value, sizeof value, &given));
    facts->facts.push_back({RunFacts::Kind::option, name, given ? value : findKey(option)->fallback});
  }
  PetscFunctionReturn(0);
}

/// From the state of a run to its end, a stop or a failure, which is empty else.
PetscErrorCode march(Simulation &run, TimeLoop &loop, const Options &o, const StopRequest &request, Recorder &recorder,
                     Progress &progress, bool *finished, std::string *failure) {
  PetscFunctionBeginUser;
  auto observe = [&](const State &state, const Diagnostics &row) { return recorder.observe(state, row); };
  auto critical = [&](const CriticalPoint &point) { return recorder.noteCritical(point); };
  auto stops = [&] { return request.asked(); };
  PetscCall(PetscLogStagePush(events().run));
  if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength) {
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
    PetscCall(loop.run(run.state, observe, finished));
    *failure = loop.failure();
  }
  PetscCall(recorder.end(!*finished && failure->empty()));
  PetscCall(PetscLogStagePop());
  PetscFunctionReturn(0);
}

void tellStop(const State &state, const Options &o, const StopRequest &request, const std::string &command_line,
              Progress &progress) {
  std::ostringstream line;
  line << "stopped by " << request.reason() << " at " << (o.loop.dynamic ? "time " : "load factor ") << state.time
       << " of " << o.loop.t_end;
  if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength)
    line << "; a path of equilibria cannot be gone on with";
  else
    line << "; go on with: " << command_line << (o.restart == "auto" ? "" : " -restart auto");
  progress.say(line.str());
}

PetscErrorCode execute(int argc, char **argv, const OptionFiles &files, StopRequest::Clock::time_point begin,
                       int *exit_code) {
  PetscFunctionBeginUser;
  Options o;
  PetscCall(readCommandLine(argc, argv, files, &o));
  if (o.schema || o.keys) {
    print(o.schema ? schemaAsJson() : keysAsJson());
    PetscFunctionReturn(0);
  }
  Prepared prepared;
  {
    const QuietErrors errors;
    if (prepare(prepared, o)) throw SceneError("setting up the solvers: " + errors.message());
  }
  if (o.help) PetscFunctionReturn(0);
  PetscCall(refuseUnknownOptions());
  const OutputFolder folder(o.output_dir);
  refuseToReplaceInputs(folder, files, prepared.source);
  Choice choice;
  if (o.accuracy) PetscCall(meetAccuracy(prepared, o, &choice));
  const StopRequest request(begin, o.time_limit); // before this, nothing is written: a signal ends the run at once
  Simulation &run = *prepared.run;
  TimeLoop loop(run.solver, o.loop);
  RunFacts facts(run.scene, o.loop);
  PetscCall(factsOf(run, o, prepared.source, &facts));
  std::vector<std::string> told;
  if (!takeUp(o, folder, facts, run, &loop.control, &told)) PetscFunctionReturn(0);

  Provenance origin = provenance(argc, argv);
  origin.scene = std::move(prepared.source);
  origin.effective_options = writeOptionsFile(o.output_dir + "/options.yaml", o, origin, run.scene);
  Progress progress(o.loop, o.output_dir + "/log.txt");
  progress.say(origin.command_line);
  for (const std::string &line : told) progress.say(line);
  std::istringstream groups(groupsText(run.scene));
  for (std::string line; std::getline(groups, line);) progress.say(line);
  for (const std::string &note : prepared.notes) progress.say(note);
  for (const std::string &line : choice.lines) progress.log(line);

  Recorder recorder(o, run, loop.control, facts, origin, progress);
  bool finished;
  std::string failure;
  PetscCall(march(run, loop, o, request, recorder, progress, &finished, &failure));
  const bool stopped = !finished && failure.empty();
  if (const std::string growth = recorder.tellGrowth(finished); !growth.empty()) {
    finished = false;
    failure = growth;
  }
  recorder.tellAccuracy();
  if (stopped) {
    tellStop(run.state, o, request, origin.command_line, progress);
    *exit_code = request.exitCode();
  } else if (!finished) {
    progress.fail(failure);
    *exit_code = 2;
  }
  recorder.close();
  if (finished && o.error_estimate && o.loop.dynamic) tellTimeError(recorder.last(), o, progress);
  if (finished && o.error_estimate && !o.loop.dynamic)
    PetscCall(tellError(prepared, recorder.last().rounding_error, recorder.criticalFactors(), o, progress));
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
    print(versionText() + "\n");
    return true;
  }
  if (!given("-help") && !given("-h") && !given("--help")) return false;
  print(helpText());
  return !given("-scene") && !given("-options_file");
}

int fail(const std::string &message, int exit_code) {
  std::fprintf(stderr, "tendril: %s\n", printable(message).c_str());
  return exit_code;
}

/// The run itself, between PetscInitialize and PetscFinalize. \return the exit code
int runScene(int argc, char **argv, const OptionFiles &files, StopRequest::Clock::time_point begin) {
  int exit_code = 0;
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
    int rank;
    MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
    const std::string message =
        dynamic_cast<const std::bad_alloc *>(&e) ? "there is not enough memory for this scene" : files.locate(e.what());
    if (rank == 0) fail(message, 1);
    exit_code = 1;
    if (dynamic_cast<const WriteError *>(&e)) {
      std::fflush(nullptr);
      std::_Exit(3); // HDF5 tries a file again that it could not write, when MPI ends, and crashes there
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
    return fail(e.what(), 1);
  }
  if (const std::string mistake = initializePetsc(&argc, &argv); !mistake.empty())
    return fail(files.locate("command line: " + mistake), 1);
  signals.restore();
  const int exit_code = runScene(argc, argv, files, begin);
  (void)PetscOptionsSetValue(nullptr, "-options_left", "no"); // checked before the first step, with better words
  (void)PetscFinalize();
  return exit_code;
}

} // namespace tendril
