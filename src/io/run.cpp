#include "tendril/io/run.hpp"

#include "tendril/accuracy/accuracy.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/dynamics/simulation.hpp"
#include "tendril/energy/widest_angle.hpp"
#include "tendril/io/checkpoint.hpp"
#include "tendril/io/estimate_writer.hpp"
#include "tendril/io/keys.hpp"
#include "tendril/io/option_files.hpp"
#include "tendril/io/options.hpp"
#include "tendril/io/prepare.hpp"
#include "tendril/io/progress.hpp"
#include "tendril/io/provenance.hpp"
#include "tendril/io/quiet_errors.hpp"
#include "tendril/io/stop.hpp"
#include "tendril/io/summary.hpp"
#include "tendril/io/take_up.hpp"
#include "tendril/io/text.hpp"
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
                          redraw(prepared.written, prepared.drawings, edgesOf(run.scene, 2)), o.loop, &estimate));
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

/// The rod of the largest kinetic energy.
std::size_t liveliest(const Simulation &run) {
  std::size_t most = 0;
  double largest = -1;
  for (std::size_t r = 0; r < run.elements->rods.size(); ++r) {
    const RodRange &rod = run.elements->rods[r];
    double energy = 0;
    for (int i = 0; i < rod.vertices; ++i)
      energy +=
          0.5 * run.elements->mass()[rod.slot(i)] * run.state.velocity[std::size_t(rod.first_vertex + i)].squaredNorm();
    if (energy > largest) largest = energy, most = r;
  }
  return most;
}

PetscErrorCode execute(int argc, char **argv, const OptionFiles &files, StopRequest::Clock::time_point begin,
                       int *exit_code) {
  PetscFunctionBeginUser;
  Options o;
  {
    const QuietErrors errors;
    if (readOptions(argc, argv, &o)) throw SceneError("command line: " + errors.message());
  }
  if (o.schema || o.keys) {
    print(o.schema ? schemaAsJson() : keysAsJson());
    PetscFunctionReturn(0);
  }
  if (o.scene.empty())
    throw SceneError("option -scene: is required: tendril -scene data/scenes/helix.yaml (-help lists all options)");
  if (const std::string place = files.place("scene"); !place.empty() && !std::filesystem::exists(o.scene))
    throw SceneError(place + ": the scene '" + o.scene +
                     "' cannot be opened; its path begins in the folder where tendril is started");
  int ranks;
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &ranks));
  if (ranks > 1)
    throw SceneError("tendril runs on one process, found " + std::to_string(ranks) + "; start it without mpiexec");
  Prepared prepared;
  {
    const QuietErrors errors;
    if (prepare(prepared, o)) throw SceneError("setting up the solvers: " + errors.message());
  }
  if (o.help) PetscFunctionReturn(0);
  PetscCall(refuseUnknownOptions());
  const OutputFolder folder(o.output_dir);
  std::vector<std::string> inputs = files.files();
  inputs.insert(inputs.end(), prepared.source.paths.begin(), prepared.source.paths.end());
  for (const std::string &input : inputs)
    if (folder.replaces(input))
      throw SceneError("option -output_dir: results would replace '" + input +
                       "', which this run reads; choose another folder, or another name for that file");
  Choice choice;
  if (o.accuracy) PetscCall(meetAccuracy(prepared, o, &choice));
  const StopRequest request(begin, o.time_limit); // before this, nothing is written: a signal ends the run at once
  Simulation &run = *prepared.run;
  TimeLoop loop(run.solver, o.loop);
  RunFacts facts(run.scene, o.loop, textOf(prepared.source));
  for (const char *name : {"snes_rtol", "snes_max_it"}) {
    char value[64];
    PetscBool given;
    PetscCall(PetscOptionsGetString(nullptr, nullptr, (std::string("-") + name).c_str(), value, sizeof value, &given));
    facts.facts.push_back({RunFacts::Kind::option, name, given ? value : findKey(std::string("-") + name)->fallback});
  }
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

  auto writer =
      std::make_unique<TrajectoryWriter>(o.output_dir, run.scene, *run.elements, origin, o.fields, o.loop.dynamic);
  TrajectoryWriter &trajectory = *writer;
  trajectory.writeFrame(run.state);
  trajectory.flushWhenDue();
  Diagnostics last;
  std::vector<double> critical_factors;
  double next_output = o.output_interval > 0
                           ? o.output_interval * (1 + std::floor(run.state.time / o.output_interval * (1 + 1e-12)))
                           : 0;
  const std::string checkpoint = o.output_dir + "/checkpoint.h5";
  long steps = 0, iterations = 0, rejected = 0;
  bool warned = false;
  WidestAngle widest{pi / 6};
  widest.include(run.scene, *run.elements, run.state); // told above
  widest.rod = -1;
  // Where energy rises by more than the work of loads and supports, the method has put it in: that is measured by the
  // motion's own and by that work.
  double dissipated = 0, gained = 0, work = 0, most_kinetic = 0,
         little = 0; // little: what rounding moves, 1e-9 of bending by one radian
  for (std::size_t r = 0; r < run.scene.rods.size(); ++r) {
    const Material &m = run.scene.rods[r].material;
    const double length = run.potential->length(int(r)),
                 stiff = std::max(m.flexural_stiffness[0], m.flexural_stiffness[1]);
    little += 1e-9 * (stiff > 0 ? stiff / length : 1e-6 * m.axial_stiffness * length);
  }
  const bool arclength = !o.loop.dynamic && o.loop.continuation == Continuation::arclength;
  auto observe = [&](const State &state, const Diagnostics &row) -> PetscErrorCode {
    PetscFunctionBeginUser;
    PetscCall(PetscLogEventBegin(events().output, 0, 0, 0, 0));
    ++steps;
    iterations += row.newton_iterations;
    rejected += row.rejected_steps;
    last = row;
    trajectory.writeDiagnostics(row);
    if (arclength || state.time >= next_output * (1 - 1e-12) || state.time >= o.loop.t_end) {
      trajectory.writeFrame(state);
      widest.include(run.scene, *run.elements, state);
      while (o.output_interval > 0 && next_output <= state.time * (1 + 1e-12)) next_output += o.output_interval;
    }
    trajectory.flushWhenDue();
    if (o.checkpoint_interval > 0 && state.step % o.checkpoint_interval == 0) {
      trajectory.flush(); // a restart goes on where the frames end
      writeCheckpoint(checkpoint, run, loop.control, facts);
    }
    progress.step(row);
    dissipated += row.dissipated;
    work += std::abs(row.work.total());
    most_kinetic = std::max(most_kinetic, row.energy.kinetic);
    gained = std::max(gained, -dissipated);
    if (!o.loop.dynamic && row.negative_pivots > 0 && !warned) {
      const std::string count =
          std::to_string(row.negative_pivots) + (row.negative_pivots == 1 ? " negative pivot" : " negative pivots");
      progress.say(
          run.scene.moments.empty()
              ? "at load factor " + shortText(row.time) +
                    " the path is unstable, as it is wherever negative_pivots in the diagnostics is not 0: " + count
              : "warning: " + count +
                    " at an accepted state with couples: couples have no potential, so its stability is not known");
      warned = true;
    }
    PetscCall(PetscLogEventEnd(events().output, 0, 0, 0, 0));
    PetscFunctionReturn(0);
  };
  PetscCall(PetscLogStagePush(events().run));
  auto critical = [&](const CriticalPoint &point) -> PetscErrorCode {
    PetscFunctionBeginUser;
    std::ostringstream line;
    line << (point.limit ? "limit point: " : "") << "critical load factor " << std::setprecision(10)
         << point.load_factor;
    progress.say(line.str());
    critical_factors.push_back(point.load_factor);
    trajectory.writeCritical(point.load_factor);
    trajectory.writeFrame(*point.state);
    trajectory.flush();
    PetscFunctionReturn(0);
  };
  bool finished;
  std::string failure;
  auto stops = [&] { return request.asked(); };
  if (arclength) {
    ArcLength path(run.solver, o.loop);
    path.on_critical = critical;
    path.stops = stops;
    PetscCall(path.run(run.state, observe, &finished));
    failure = path.failure();
  } else {
    loop.on_critical = critical;
    loop.stops = stops;
    PetscCall(loop.run(run.state, observe, &finished));
    failure = loop.failure();
  }
  const bool stopped = !finished && failure.empty();
  if (arclength && finished && run.state.time < o.loop.t_end && steps >= o.loop.arclength_steps) {
    std::ostringstream line;
    line << "the path ends at load factor " << run.state.time << " after " << steps
         << " steps; to follow it on, raise -arclength_steps";
    progress.say(line.str());
  }
  if (stopped && trajectory.lastTime() < run.state.time) trajectory.writeFrame(run.state);
  PetscCall(PetscLogEventBegin(events().output, 0, 0, 0, 0));
  const Summary at_end = summarize(run.scene, *run.elements, run.state, o.loop.dynamic ? 1 : run.state.time);
  trajectory.writeSummary(at_end);
  trajectory.finish();
  if (!arclength) writeCheckpoint(checkpoint, run, loop.control, facts);
  PetscCall(PetscLogEventEnd(events().output, 0, 0, 0, 0));
  PetscCall(PetscLogStagePop());
  std::ostringstream summary;
  summary << steps << " steps, " << iterations << " Newton iterations (mean " << std::setprecision(3)
          << (steps ? double(iterations) / double(steps) : 0) << "), " << rejected << " rejected, " << last.wall_seconds
          << " s, results in " << o.output_dir;
  progress.say(summary.str());
  for (const std::string &line : describe(at_end, run.scene)) progress.say(line);
  constexpr double most_gained = 0.5; // of what the motion's own energy and the work of loads and supports come to
  const double moved = most_kinetic + work;
  if (o.loop.dynamic && gained > 0.1 * moved + little) {
    std::ostringstream growth;
    growth << "the energy rose by " << std::setprecision(2) << gained / moved << " of the largest kinetic energy"
           << (work > 0 ? " and the work of loads and supports" : "") << " (at most " << most_gained
           << " passes), with nothing to put it in but -integrator " << o.loop.integrator.name
           << " in steps too long for it: shorten -dt, or take bdf2 or energy_momentum; "
           << labelOf(run.scene.rods[liveliest(run)]) << " moves most";
    // A method that is unstable has made most of the motion itself.
    if (finished && gained > most_gained * moved + little) {
      finished = false;
      failure = growth.str();
    } else
      progress.say("warning: " + growth.str());
  }
  if (widest.rod >= 0) {
    std::ostringstream line;
    line << "warning: neighbouring edges of rod '" << run.scene.rods[std::size_t(widest.rod)].name
         << "' came to turn or twist by up to " << std::setprecision(3) << widest.angle * 180 / pi
         << " degrees, at vertex " << widest.vertex << " and " << (o.loop.dynamic ? "time " : "load factor ")
         << widest.time << "; measure tan is stiffer than the rod above 30: use more edges, or -rod_measure angle";
    progress.say(line.str());
  }
  if (last.rounding_error > 0) {
    std::ostringstream rounding;
    rounding << "rounding error: " << std::setprecision(2) << last.rounding_error << " of the rod length"
             << (o.loop.dynamic ? ", summed over the steps" : "");
    progress.say(rounding.str());
  }
  if (stopped) {
    std::ostringstream line;
    line << "stopped by " << request.reason() << " at " << (o.loop.dynamic ? "time " : "load factor ") << run.state.time
         << " of " << o.loop.t_end;
    if (arclength)
      line << "; a path of equilibria cannot be gone on with";
    else
      line << "; go on with: " << origin.command_line << (o.restart == "auto" ? "" : " -restart auto");
    progress.say(line.str());
    *exit_code = request.exitCode();
  } else if (!finished) {
    progress.fail(failure);
    *exit_code = 2;
  }
  writer.reset();
  if (finished && o.error_estimate && o.loop.dynamic) tellTimeError(last, o, progress);
  if (finished && o.error_estimate && !o.loop.dynamic)
    PetscCall(tellError(prepared, last.rounding_error, critical_factors, o, progress));
  PetscFunctionReturn(0);
}

} // namespace

int runMain(int count, char **arguments) {
  // A word that belongs to no option is the scene, where none is given.
  std::vector<char *> words(arguments, arguments + count);
  if (std::none_of(words.begin(), words.end(), [](const char *word) { return std::string_view(word) == "-scene"; }))
    for (std::size_t i = 1; i < words.size(); ++i)
      if (words[i][0] != '-' && (i == 1 || words[i - 1][0] != '-')) {
        static char option[] = "-scene";
        words.insert(words.begin() + std::ptrdiff_t(i), option);
        break;
      }
  int argc = int(words.size());
  words.push_back(nullptr);
  char **argv = words.data();
  const auto begin = StopRequest::Clock::now();
  const KeptSignals signals;
  std::signal(SIGXFSZ, SIG_IGN); // a file that grows beyond its limit cannot be written: that is told
  // Ours before PETSc's, which come only where solvers are set up for a scene.
  auto given = [&](const char *option) {
    return std::any_of(argv + 1, argv + argc, [&](const char *word) { return std::string_view(word) == option; });
  };
  try {
    if (given("--version")) return print(versionText() + "\n"), 0;
    if (given("-help") || given("-h") || given("--help")) {
      print(helpText());
      if (!given("-scene") && !given("-options_file")) return 0;
    }
  } catch (const WriteError &e) {
    std::fprintf(stderr, "tendril: %s\n", e.what());
    return 3;
  }
  OptionFiles files;
  try {
    files.read(argc, argv);
  } catch (const SceneError &e) {
    std::fprintf(stderr, "tendril: %s\n", printable(e.what()).c_str());
    return 1;
  }
  if (const std::string mistake = initializePetsc(&argc, &argv); !mistake.empty()) {
    std::fprintf(stderr, "tendril: %s\n", printable(files.locate("command line: " + mistake)).c_str());
    return 1;
  }
  signals.restore();
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
    if (rank == 0) std::fprintf(stderr, "tendril: %s\n", printable(message).c_str());
    exit_code = 1;
    if (dynamic_cast<const WriteError *>(&e)) {
      std::fflush(nullptr);
      std::_Exit(3); // HDF5 tries a file again that it could not write, when MPI ends, and crashes there
    }
  }
  (void)PetscOptionsSetValue(nullptr, "-options_left", "no"); // checked before the first step, with better words
  (void)PetscFinalize();
  return exit_code;
}

} // namespace tendril
