#include "tendril/io/run.hpp"

#include "tendril/dynamics/arc_length.hpp"
#include "tendril/dynamics/simulation.hpp"
#include "tendril/io/progress.hpp"
#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"
#include "tendril/solver/events.hpp"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <memory>
#include <sstream>

namespace tendril {
namespace {

constexpr const char *usage =
    "tendril: elastic rods. Runs the scene given by -scene and writes a trajectory to -output_dir.\n"
    "  tendril -scene data/scenes/helix.yaml -dt 5e-3 -t_end 2 -output_dir out/helix\n"
    "Options of tendril are listed below; -snes_*, -ksp_*, -pc_*, -mat_* and -log_view are PETSc's (add -scene to list them with -help).\n";

/// Everything that the command line says.
struct Options {
  std::string scene;
  bool has_scene = false;
  std::map<std::string, std::string> overrides;
  LoopSettings loop;
  bool has_mode = false, has_dt = false, has_t_end = false, has_load_steps = false, has_continuation = false, has_bifurcation = false, has_arclength_steps = false, has_gravity = false;
  int load_steps = 1;
  Vec3 gravity = Vec3::Zero();
  std::string output_dir = "out";
  double output_interval = 0;
  std::set<std::string> fields{TrajectoryWriter::fieldNames().begin(), TrajectoryWriter::fieldNames().end()};
};

[[noreturn]] void failOption(const std::string &option, const std::string &message) { throw SceneError("option " + option + ": " + message); }

void requirePositive(const char *option, bool given, double value) {
  if (given && !(value > 0 && std::isfinite(value))) failOption(option, "must be a finite number greater than zero, found " + std::to_string(value));
}

PetscErrorCode readOptions(Options *o) {
  char text[PETSC_MAX_PATH_LEN];
  PetscBool set, any;
  PetscFunctionBeginUser;
  PetscOptionsBegin(PETSC_COMM_WORLD, "", "Options of tendril", "docs/user.md");
  PetscCall(PetscOptionsString("-scene", "scene file (YAML)", "", "", text, sizeof text, &set));
  o->has_scene = set;
  if (set) o->scene = text;
  const char *modes[] = {"dynamic", "static"};
  PetscInt choice = 0;
  PetscCall(PetscOptionsEList("-mode", "steps in time, or in load to an equilibrium", "", modes, 2, modes[0], &choice, &set));
  o->has_mode = set;
  o->loop.dynamic = choice == 0;
  PetscReal value = 0;
  PetscCall(PetscOptionsReal("-dt", "time step [s]", "", o->loop.dt, &o->loop.dt, &set));
  o->has_dt = set;
  requirePositive("-dt", set, o->loop.dt);
  PetscCall(PetscOptionsReal("-dt_min", "smallest step after rejections [s or load factor] (default: dt/1024)", "", 0, &o->loop.dt_min, &set));
  requirePositive("-dt_min", set, o->loop.dt_min);
  PetscCall(PetscOptionsReal("-t_end", "end time [s]", "", o->loop.t_end, &o->loop.t_end, &set));
  o->has_t_end = set;
  requirePositive("-t_end", set, o->loop.t_end);
  PetscInt steps = 1;
  PetscCall(PetscOptionsInt("-load_steps", "equal steps of the load factor from 0 to 1 (static)", "", steps, &steps, &set));
  o->has_load_steps = set;
  o->load_steps = int(steps);
  if (set && steps < 1) failOption("-load_steps", "must be at least 1, found " + std::to_string(steps));
  const char *continuations[] = {"load", "arclength"};
  choice = 0;
  PetscCall(PetscOptionsEList("-continuation", "steps of the load factor, or along the path of equilibria, through limit points (static)", "", continuations, 2, continuations[0], &choice, &set));
  o->has_continuation = set;
  o->loop.continuation = choice == 0 ? Continuation::load : Continuation::arclength;
  const char *bifurcations[] = {"off", "locate", "stop"};
  choice = 1;
  PetscCall(PetscOptionsEList("-bifurcation", "where stability is lost between load steps: ignore it, find the critical load and go on, or stop there (static)", "", bifurcations, 3, bifurcations[1], &choice, &set));
  o->has_bifurcation = set;
  o->loop.bifurcation = choice == 0 ? Bifurcation::off : choice == 1 ? Bifurcation::locate : Bifurcation::stop;
  steps = o->loop.arclength_steps;
  PetscCall(PetscOptionsInt("-arclength_steps", "most steps along the path (-continuation arclength)", "", steps, &steps, &set));
  o->has_arclength_steps = set;
  o->loop.arclength_steps = int(steps);
  if (set && steps < 1) failOption("-arclength_steps", "must be at least 1, found " + std::to_string(steps));
  PetscReal gravity[3] = {0, 0, 0};
  PetscInt count = 3;
  PetscCall(PetscOptionsRealArray("-gravity", "acceleration of gravity, e.g. 0,-9.81,0 [m/s^2]", "", gravity, &count, &set));
  o->has_gravity = set;
  if (set && count != 3) failOption("-gravity", "needs three numbers, e.g. 0,-9.81,0");
  o->gravity = Vec3(gravity[0], gravity[1], gravity[2]);
  if (!o->gravity.allFinite()) failOption("-gravity", "must be finite");
  PetscCall(PetscOptionsString("-output_dir", "folder for the results", "", "out", text, sizeof text, &set));
  if (set) o->output_dir = text;
  PetscCall(PetscOptionsReal("-output_interval", "time between frames: the first step at or after each multiple is written (0: every step) [s]", "", 0, &value, &set));
  if (set && !(value >= 0 && std::isfinite(value))) failOption("-output_interval", "must not be negative");
  o->output_interval = value;
  PetscCall(PetscOptionsString("-output_fields", "fields of a frame: position,director,velocity,twist_rate,axial_force", "", "all", text, sizeof text, &set));
  if (set) {
    o->fields.clear();
    std::istringstream in(text);
    for (std::string word; std::getline(in, word, ',');) {
      const auto &names = TrajectoryWriter::fieldNames();
      if (std::find(names.begin(), names.end(), word) == names.end()) failOption("-output_fields", "there is no field '" + word + "'; choose from position,director,velocity,twist_rate,axial_force");
      o->fields.insert(word);
    }
  }
  const char *retractions[] = {"additive", "length"};
  choice = 1;
  PetscCall(PetscOptionsEList("-retraction", "how positions move: straight, or keeping the linearised lengths of the edges", "", retractions, 2, retractions[choice], &choice, &set));
  o->loop.retraction = choice == 0 ? RetractionKind::additive : RetractionKind::length;
  const char *stretches[] = {"primal", "mixed"};
  choice = 1;
  PetscCall(PetscOptionsEList("-stretch", "axial force from the strain, or as an unknown of its own", "", stretches, 2, stretches[choice], &choice, &set));
  o->loop.mixed = choice == 1;
  for (const auto &[name, meaning] : rodOverrides()) {
    PetscCall(PetscOptionsString(("-rod_" + name).c_str(), (meaning + ", for every rod").c_str(), "", "from the scene", text, sizeof text, &set));
    if (set) o->overrides[name] = text;
  }
  PetscOptionsEnd();
  PetscCall(PetscOptionsHasName(nullptr, nullptr, "-options_left", &any));
  PetscFunctionReturn(0);
}

/// Options nobody asked for are mistakes.
PetscErrorCode refuseUnknownOptions() {
  PetscInt n;
  char **names, **values;
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsLeftGet(nullptr, &n, &names, &values));
  std::string unknown;
  for (PetscInt i = 0; i < n; ++i) {
    const std::string name = names[i];
    const bool late = name.rfind("log_", 0) == 0 || name.rfind("options_", 0) == 0 || name.rfind("malloc", 0) == 0 || name == "help" || name.rfind("on_error", 0) == 0;
    if (!late && unknown.empty()) unknown = name;
  }
  PetscCall(PetscOptionsLeftRestore(nullptr, &n, &names, &values));
  if (!unknown.empty()) {
    std::vector<std::string> known{"scene", "mode", "dt", "dt_min", "t_end", "load_steps", "continuation", "bifurcation", "arclength_steps", "gravity", "output_dir", "output_interval", "output_fields", "retraction", "stretch", "snes_rtol", "snes_max_it", "snes_monitor"};
    for (const auto &o : rodOverrides()) known.push_back("rod_" + o.first);
    const std::string near = closest(unknown, known);
    throw SceneError("option -" + unknown + ": unknown or unused" + (near.empty() ? "" : "; did you mean -" + near + "?") + " (-help lists all options)");
  }
  PetscFunctionReturn(0);
}

/// Settings in force: the scene's `simulation` block, replaced by options.
void resolve(const RunSettings &scene, Options &o) {
  if (!o.has_mode) o.loop.dynamic = scene.mode == "dynamic";
  if (!o.has_dt) o.loop.dt = scene.dt;
  if (!o.has_t_end) o.loop.t_end = scene.t_end;
  if (!o.has_load_steps) o.load_steps = scene.load_steps;
  if (!o.loop.dynamic) {
    if (o.has_dt) failOption("-dt", "has no meaning in -mode static; use -load_steps");
    if (o.has_t_end) failOption("-t_end", "has no meaning in -mode static; the load factor ends at 1");
    o.loop.t_end = 1;
    o.loop.dt = 1.0 / o.load_steps;
    const bool arclength = o.loop.continuation == Continuation::arclength;
    if (o.has_arclength_steps && !arclength) failOption("-arclength_steps", "needs -continuation arclength");
    if (o.has_bifurcation && arclength) failOption("-bifurcation", "belongs to -continuation load; along the arc length, negative_pivots in the diagnostics tells stability");
  } else if (o.has_load_steps)
    failOption("-load_steps", "has no meaning in -mode dynamic; use -dt");
  else if (o.has_continuation || o.has_bifurcation || o.has_arclength_steps)
    failOption(o.has_continuation ? "-continuation" : o.has_bifurcation ? "-bifurcation" : "-arclength_steps", "has no meaning in -mode dynamic; use -mode static");
  if (o.loop.dt_min > o.loop.dt) failOption("-dt_min", "must not be larger than the step " + std::to_string(o.loop.dt));
}

void makeFolder(const std::string &folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const std::string probe = folder + "/.probe";
  std::ofstream file(probe);
  if (error || !file) throw SceneError("option -output_dir: '" + folder + "' cannot be written; choose another folder");
  file.close();
  std::filesystem::remove(probe, error);
}

std::string groupsText(const Scene &scene) {
  std::ostringstream s;
  s << std::setprecision(4);
  const std::size_t shown = std::min<std::size_t>(scene.rods.size(), 4);
  for (std::size_t r = 0; r < shown; ++r) {
    const DimensionlessGroups g = dimensionlessGroups(scene.rods[r], scene.gravity);
    s << "rod '" << scene.rods[r].name << "': " << scene.rods[r].edges() << " edges, length " << g.length << " m";
    if (scene.rods[r].material.isCable())
      s << ", a cable\n";
    else
      s << ", rho g L^3/EI " << g.gravito_bending << ", EA L^2/EI " << g.axial_to_bending << ", largest turning " << g.largest_turning << " deg and twist " << g.largest_twist << " deg per vertex\n";
  }
  if (shown < scene.rods.size()) s << "... and " << scene.rods.size() - shown << " more rods\n";
  double turning = 0, twist = 0;
  for (const Rod &rod : scene.rods) {
    const DimensionlessGroups g = dimensionlessGroups(rod, scene.gravity);
    turning = std::max(turning, g.largest_turning);
    twist = std::max(twist, g.largest_twist);
  }
  if (turning > 30 || twist > 30)
    s << "warning: neighbouring edges turn or twist by up to " << std::max(turning, twist) << " degrees; above 30 the strains are more than 10 % off: use more edges\n";
  return s.str();
}

Provenance provenance(int argc, char **argv) {
  Provenance p;
  for (int i = 0; i < argc; ++i) p.command_line += (i ? " " : "") + std::string(argv[i]);
  char *all = nullptr;
  if (PetscOptionsGetAll(nullptr, &all) == 0 && all) p.options = all;
  (void)PetscFree(all);
  p.version = TENDRIL_VERSION;
  p.git_commit = TENDRIL_GIT_COMMIT;
  char version[256];
  (void)PetscGetVersion(version, sizeof version);
  p.petsc_version = version;
  const std::time_t now = std::time(nullptr);
  char stamp[32];
  std::strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  p.created = stamp;
  return p;
}

void writeOptionsFile(const Options &o, const Provenance &p, const Scene &scene) {
  std::ofstream out(o.output_dir + "/options.yaml");
  out << std::setprecision(17) << "# All that was in force in this run.\ncommand_line: \"" << p.command_line << "\"\ntendril_version: " << p.version << "\ngit_commit: " << p.git_commit
      << "\nscene: " << o.scene << "\nmode: " << (o.loop.dynamic ? "dynamic" : "static") << "\n";
  if (o.loop.dynamic)
    out << "dt: " << o.loop.dt << "\nt_end: " << o.loop.t_end << "\n";
  else
    out << "load_steps: " << o.load_steps << "\ncontinuation: " << (o.loop.continuation == Continuation::load ? "load" : "arclength")
        << "\nbifurcation: " << (o.loop.bifurcation == Bifurcation::off ? "off" : o.loop.bifurcation == Bifurcation::stop ? "stop" : "locate")
        << "\narclength_steps: " << o.loop.arclength_steps << "\n";
  out << "dt_min: " << (o.loop.dt_min > 0 ? o.loop.dt_min : o.loop.dt / 1024) << "\ngravity: [" << scene.gravity[0] << ", " << scene.gravity[1] << ", " << scene.gravity[2] << "]\noutput_dir: "
      << o.output_dir << "\noutput_interval: " << o.output_interval << "\nretraction: " << (o.loop.retraction == RetractionKind::length ? "length" : "additive")
      << "\nstretch: " << (o.loop.mixed ? "mixed" : "primal") << "\noutput_fields: [";
  for (auto f = o.fields.begin(); f != o.fields.end(); ++f) out << (f == o.fields.begin() ? "" : ", ") << *f;
  out << "]\nrods:\n";
  for (const Rod &rod : scene.rods) {
    const Material &m = rod.material;
    out << "  - {name: \"" << rod.name << "\", measure: " << (rod.measure == Measure::tan ? "tan" : "angle") << ", linear_density: " << m.linear_density << ", linear_rotational_inertia: " << m.linear_rotational_inertia
        << ", axial_stiffness: " << m.axial_stiffness << ", torsional_stiffness: " << m.torsional_stiffness << ", flexural_stiffness: [" << m.flexural_stiffness[0] << ", " << m.flexural_stiffness[1]
        << "], mass_damping_coefficient: " << m.mass_damping_coefficient << ", stiffness_damping_coefficient: " << m.stiffness_damping_coefficient << "}\n";
  }
  out << "petsc_options: \"" << p.options << "\"\n";
}

/// A rod that nothing holds has no equilibrium to find.
void requireHeld(const Scene &scene) {
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const bool held = std::any_of(scene.supports.begin(), scene.supports.end(), [&](const Support &s) { return s.rod == int(r) && s.holdsPosition(); });
    if (!held) throw SceneError("rod '" + scene.rods[r].name + "' is free to move as a whole: -mode static needs a clamp or pins that hold every rod");
  }
}

PetscErrorCode setUp(Simulation &run, Options &o) {
  PetscFunctionBeginUser;
  PetscCall(PetscLogStagePush(events().setup));
  SceneFile file = readScene(o.scene, o.overrides);
  if (o.has_gravity) file.scene.gravity = o.gravity;
  resolve(file.run, o);
  if (!o.loop.dynamic) requireHeld(file.scene);
  if (o.has_bifurcation && o.loop.bifurcation != Bifurcation::off && !file.scene.moments.empty())
    failOption("-bifurcation", "a scene with couples has no potential whose Hessian could tell stability; use off");
  if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength) requireDeadLoads(file.scene);
  PetscCall(run.setUp(std::move(file.scene), o.loop));
  PetscCall(PetscLogStagePop());
  PetscFunctionReturn(0);
}

PetscErrorCode execute(int argc, char **argv, int *exit_code) {
  PetscFunctionBeginUser;
  Options o;
  PetscCall(readOptions(&o));
  PetscBool help;
  PetscCall(PetscOptionsHasName(nullptr, nullptr, "-help", &help));
  if (!o.has_scene) {
    if (help) PetscFunctionReturn(0);
    failOption("-scene", "is required: tendril -scene data/scenes/helix.yaml (-help lists all options)");
  }
  Simulation run;
  PetscCall(setUp(run, o));
  if (help) PetscFunctionReturn(0);
  PetscCall(refuseUnknownOptions());
  makeFolder(o.output_dir);
  const Provenance origin = provenance(argc, argv);
  writeOptionsFile(o, origin, run.scene);
  Progress progress(o.loop.t_end, o.output_dir + "/log.txt");
  progress.say(origin.command_line);
  std::istringstream groups(groupsText(run.scene));
  for (std::string line; std::getline(groups, line);) progress.say(line);

  TrajectoryWriter trajectory(o.output_dir, run.scene, *run.elements, origin, o.fields);
  std::ofstream csv(o.output_dir + "/diagnostics.csv");
  csv << std::setprecision(17);
  for (std::size_t k = 0; k < Diagnostics::names().size(); ++k) csv << (k ? "," : "") << Diagnostics::names()[k];
  csv << std::endl;
  trajectory.writeFrame(run.state);
  double next_output = o.output_interval;
  long steps = 0, iterations = 0, rejected = 0;
  double wall = 0;
  const bool arclength = !o.loop.dynamic && o.loop.continuation == Continuation::arclength;
  auto observe = [&](const State &state, const Diagnostics &row) -> PetscErrorCode {
    PetscFunctionBeginUser;
    PetscCall(PetscLogEventBegin(events().output, 0, 0, 0, 0));
    ++steps;
    iterations += row.newton_iterations;
    rejected += row.rejected_steps;
    wall = row.wall_seconds;
    trajectory.writeDiagnostics(row);
    const std::vector<double> values = row.values();
    for (std::size_t k = 0; k < values.size(); ++k) csv << (k ? "," : "") << values[k];
    csv << '\n' << std::flush;
    if (arclength || state.time >= next_output * (1 - 1e-12) || state.time >= o.loop.t_end) {
      trajectory.writeFrame(state);
      while (o.output_interval > 0 && next_output <= state.time * (1 + 1e-12)) next_output += o.output_interval;
    }
    progress.step(row);
    PetscCall(PetscLogEventEnd(events().output, 0, 0, 0, 0));
    PetscFunctionReturn(0);
  };
  PetscCall(PetscLogStagePush(events().run));
  auto critical = [&](const CriticalPoint &point) -> PetscErrorCode {
    PetscFunctionBeginUser;
    std::ostringstream line;
    line << (point.limit ? "limit point: " : "") << "critical load factor " << std::setprecision(10) << point.load_factor;
    progress.say(line.str());
    trajectory.writeCritical(point.load_factor);
    trajectory.writeFrame(*point.state);
    PetscFunctionReturn(0);
  };
  bool finished;
  std::string failure;
  if (arclength) {
    ArcLength path(run.solver, o.loop);
    path.on_critical = critical;
    PetscCall(path.run(run.state, observe, &finished));
    failure = path.failure();
  } else {
    TimeLoop loop(run.solver, o.loop);
    loop.on_critical = critical;
    PetscCall(loop.run(run.state, observe, &finished));
    failure = loop.failure();
  }
  PetscCall(PetscLogStagePop());
  std::ostringstream summary;
  summary << steps << " steps, " << iterations << " Newton iterations (mean " << std::setprecision(3) << (steps ? double(iterations) / double(steps) : 0) << "), " << rejected
          << " rejected, " << wall << " s, results in " << o.output_dir;
  progress.say(summary.str());
  if (!finished) {
    progress.say("failed: " + failure);
    std::fprintf(stderr, "tendril: %s\n", failure.c_str());
    *exit_code = 2;
  }
  PetscFunctionReturn(0);
}

} // namespace

int runMain(int argc, char **argv) {
  if (PetscInitialize(&argc, &argv, nullptr, usage)) return 1;
  int exit_code = 0;
  try {
    const PetscErrorCode error = [&]() -> PetscErrorCode {
      PetscFunctionBeginUser;
      PetscCall(registerEvents());
      PetscCall(registerSolvers());
      PetscCall(execute(argc, argv, &exit_code));
      PetscFunctionReturn(0);
    }();
    if (error) exit_code = 1;
  } catch (const std::exception &e) {
    std::fprintf(stderr, "tendril: %s\n", e.what());
    exit_code = 1;
  }
  (void)PetscOptionsSetValue(nullptr, "-options_left", "no"); // checked before the first step, with better words
  (void)PetscFinalize();
  return exit_code;
}

} // namespace tendril
