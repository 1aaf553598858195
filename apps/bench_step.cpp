/// bench_step: what whole Newton steps cost, without output.
///
/// Runs the time loop of tendril, several times from the same state, and prints one row: microseconds per edge and
/// Newton iteration, milliseconds per step, memory per edge, an iteration in units of LAPACK's dpbtrf and dpbtrs on
/// bands of as many edges, in turn with the runs; then how the time divides among the parts of a step. Without -scene,
/// straight cantilevers let go under gravity:
///
///     clamp |=====o=====o=====o ... o   -bench_rods of them side by side, -bench_edges of 1 cm each
///
/// Sample runs:
///   bench_step -bench_edges 400
///   bench_step -bench_edges 100 -bench_rods 1000 -bench_steps 5 -bench_csv out/bench.csv
///   bench_step -scene data/scenes/helix.yaml -bench_steps 120
#include "bench.hpp"

#include "tendril/io/options.hpp"
#include "tendril/layout/launch.hpp"
#include "tendril/solver/events.hpp"

#include <filesystem>
#include <fstream>
#include <unistd.h>

namespace tendril::bench {
namespace {

struct Request {
  PetscInt edges = 400, rods = 1, steps = 20, repeats = 5;
  PetscReal dt = 0; ///< [s]; 0: of the scene
  std::string scene, csv;
  PetscInt model = PetscInt(RodModel::full);
};

PetscErrorCode readRequest(Request *r) {
  char scene[PETSC_MAX_PATH_LEN] = "", csv[PETSC_MAX_PATH_LEN] = "";
  PetscFunctionBeginUser;
  PetscOptionsBegin(PETSC_COMM_WORLD, "", "Options of bench_step", "docs/performance.md");
  PetscCall(PetscOptionsString("-scene", "scene file (dynamics); otherwise straight cantilevers", "", scene, scene,
                               sizeof scene, nullptr));
  PetscCall(PetscOptionsRangeInt("-bench_edges", "edges of a rod", "", r->edges, &r->edges, nullptr, 1, 100000000));
  PetscCall(PetscOptionsRangeInt("-bench_rods", "number of rods", "", r->rods, &r->rods, nullptr, 1, 10000000));
  PetscCall(PetscOptionsRangeInt("-bench_steps", "steps of a run", "", r->steps, &r->steps, nullptr, 1, 100000000));
  PetscCall(PetscOptionsRangeInt("-bench_repeats", "runs, of which the fastest and the median are shown", "",
                                 r->repeats, &r->repeats, nullptr, 1, 1000));
  PetscCall(PetscOptionsReal("-dt", "time step, 0: that of the scene, or 0.005 [s]", "", r->dt, &r->dt, nullptr));
  PetscCall(PetscOptionsString("-bench_csv", "file to which the row is added", "", csv, csv, sizeof csv, nullptr));
  PetscCall(PetscOptionsEList("-model", "unknowns of all rods; torsion_free: without rotational inertia", "",
                              rod_model_names, std::size(rod_model_names), rod_model_names[r->model], &r->model,
                              nullptr));
  PetscOptionsEnd();
  for (const char *size : {"-bench_edges", "-bench_rods"}) {
    PetscBool given;
    PetscCall(PetscOptionsHasName(nullptr, nullptr, size, &given));
    if (given && scene[0]) throw SceneError(std::string("option ") + size + ": has no meaning with -scene");
  }
  r->scene = scene;
  r->csv = csv;
  PetscFunctionReturn(0);
}

/// Bytes of this process that are in memory.
double residentBytes() {
  std::ifstream statm("/proc/self/statm");
  double size = 0, resident = 0;
  statm >> size >> resident;
  return resident * double(sysconf(_SC_PAGESIZE));
}

/// A part of the time of a run.
struct Part {
  std::string name;
  double seconds;
};

PetscErrorCode eventSeconds(PetscLogEvent event, double *seconds) {
  PetscEventPerfInfo info;
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventGetPerfInfo(events().run, event, &info));
  *seconds = info.time;
  PetscFunctionReturn(0);
}

/// Of PETSc's own events, by name.
PetscErrorCode eventSeconds(const char *name, double *seconds) {
  PetscLogEvent event;
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventGetId(name, &event));
  *seconds = 0;
  if (event >= 0) PetscCall(eventSeconds(event, seconds));
  PetscFunctionReturn(0);
}

/// What PETSc's log has of the time since it began, in parts that do not overlap; the last is all of Newton, negative,
/// so that adding the time of the whole loop leaves the rest of the step.
PetscErrorCode readLog(std::vector<Part> *parts) {
  double derivatives = 0, fill = 0, factor = 0, solve = 0, configuration = 0, energy = 0, search = 0, newton = 0;
  PetscFunctionBeginUser;
  PetscCall(eventSeconds(events().derivatives, &derivatives));
  PetscCall(eventSeconds(events().fill, &fill));
  PetscCall(eventSeconds("MatCholFctrNum", &factor));
  PetscCall(eventSeconds("MatSolve", &solve));
  PetscCall(eventSeconds(events().configuration, &configuration));
  PetscCall(eventSeconds(events().energy, &energy));
  PetscCall(eventSeconds(events().line_search, &search));
  PetscCall(eventSeconds("SNESSolve", &newton));
  const double named = derivatives + fill + factor + solve + search;
  *parts = {{"derivatives", derivatives},
            {"fill", fill},
            {"factor", factor},
            {"solve", solve},
            {"configuration", configuration},
            {"energy", energy},
            {"line_search_other", search - configuration - energy},
            {"newton_other", newton - named},
            {"step_other", -newton}};
  PetscFunctionReturn(0);
}

/// Divides the time of a run by PETSc's log; of several runs the fastest.
PetscErrorCode split(Simulation &simulation, const LoopSettings &settings, PetscInt repeats, std::vector<Part> *parts) {
  double fastest = HUGE_VAL;
  PetscFunctionBeginUser;
  PetscCall(PetscLogDefaultBegin());
  PetscCall(PetscLogStagePush(events().run));
  for (PetscInt k = 0; k < repeats; ++k) {
    std::vector<Part> before, after;
    StepsTaken taken;
    PetscCall(readLog(&before));
    PetscCall(takeSteps(simulation, settings, &taken));
    PetscCall(readLog(&after));
    if (taken.seconds >= fastest) continue;
    fastest = taken.seconds;
    for (std::size_t p = 0; p < after.size(); ++p) after[p].seconds -= before[p].seconds;
    after.back().seconds += taken.seconds;
    *parts = std::move(after);
  }
  PetscCall(PetscLogStagePop());
  PetscFunctionReturn(0);
}

PetscErrorCode makeScene(const Request &request, Scene *scene, LoopSettings *settings) {
  PetscFunctionBeginUser;
  settings->dt = 5e-3;
  if (request.scene.empty())
    *scene = cantilevers(int(request.rods), int(request.edges));
  else {
    SceneFile file = readScene(request.scene);
    if (file.run.mode != "dynamic")
      throw SceneError("option -scene: bench_step runs dynamics; '" + request.scene + "' asks for " + file.run.mode);
    *scene = std::move(file.scene);
    settings->dt = file.run.dt;
  }
  for (Rod &rod : scene->rods) {
    rod.model = RodModel(request.model);
    if (rod.model == RodModel::cable) rod.material.flexural_stiffness = {0, 0};
    if (rod.model == RodModel::torsion_free) rod.material.linear_rotational_inertia = 0;
  }
  std::vector<std::string> notes;
  settleModels(*scene, true, true, &notes);
  if (request.dt < 0) throw SceneError("option -dt: must be greater than zero");
  if (request.dt > 0) settings->dt = request.dt;
  settings->t_end = settings->dt * double(request.steps);
  PetscFunctionReturn(0);
}

struct Measured {
  int rods, edges;
  StepsTaken taken;         ///< steps and iterations; they are the same in every run
  double fastest, median;   ///< seconds of a run
  double lapack = HUGE_VAL; ///< seconds of dpbtrf and dpbtrs for all edges, fastest
  double bytes_per_edge;
  std::vector<Part> parts;

  double perEdge(double seconds) const { return 1e6 * seconds / (double(edges) * taken.newton_iterations); }
  double perLapack() const { return fastest / (taken.newton_iterations * lapack); }
  double perStep(double seconds) const { return 1e3 * seconds / taken.steps; }
};

PetscErrorCode measure(const Request &request, Measured *m) {
  Simulation simulation;
  LoopSettings settings;
  Scene scene;
  PetscFunctionBeginUser;
  const double before = residentBytes();
  PetscCall(makeScene(request, &scene, &settings));
  PetscCall(simulation.setUp(std::move(scene), settings));
  PetscCall(simulation.solver.rehearse(simulation.state, TimeLoop::stepOf(settings, simulation.state, settings.dt)));
  std::vector<std::string> unused;
  PetscCall(unusedOptions(false, &unused));
  if (!unused.empty()) refuseUnused(unused.front());
  m->rods = int(simulation.scene.rods.size());
  m->edges = 0;
  int longest = 0;
  for (const Rod &rod : simulation.scene.rods) {
    m->edges += rod.edges();
    longest = std::max(longest, rod.edges());
  }
  LapackBand band(longest);
  LoopSettings first = settings;
  first.t_end = settings.dt;
  PetscCall(takeSteps(simulation, first, &m->taken));
  m->bytes_per_edge = (residentBytes() - before) / m->edges;
  std::vector<double> seconds;
  for (PetscInt k = 0; k < request.repeats; ++k) {
    PetscCall(takeSteps(simulation, settings, &m->taken));
    seconds.push_back(m->taken.seconds);
    const double lapack = band.factorAndSolve();
    PetscCheck(lapack > 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "dpbtrf or dpbtrs failed");
    m->lapack = std::min(m->lapack, lapack * m->edges / longest);
  }
  std::sort(seconds.begin(), seconds.end());
  m->fastest = seconds.front();
  m->median = seconds[seconds.size() / 2];
  if (m->taken.newton_iterations == 0) throw SceneError("no step needed a Newton iteration: nothing to measure");
  PetscCall(split(simulation, settings, request.repeats, &m->parts));
  PetscFunctionReturn(0);
}

void print(const Measured &m) {
  std::printf("%8s %9s %7s %11s %9s | us per edge and iteration | ms per step       | bytes per\n", "rods", "edges",
              "steps", "iterations", "rejected");
  std::printf("%8s %9s %7s %11s %9s | %10s %14s | %8s %8s | edge\n", "", "", "", "", "", "fastest", "median", "fastest",
              "median");
  std::printf("%8d %9d %7d %11d %9d | %10.3f %14.3f | %8.4g %8.4g | %.0f\n\n", m.rods, m.edges, m.taken.steps,
              m.taken.newton_iterations, m.taken.rejected, m.perEdge(m.fastest), m.perEdge(m.median),
              m.perStep(m.fastest), m.perStep(m.median), m.bytes_per_edge);
  std::printf("an iteration is %.3f times dpbtrf and dpbtrs\n\n", m.perLapack());
  double total = 0;
  for (const Part &part : m.parts) total += part.seconds;
  std::printf("parts of the fastest of as many runs with PETSc's log:\n");
  for (const Part &part : m.parts)
    std::printf("  %-18s %5.1f %%  %8.3f us per edge and iteration\n", part.name.c_str(), 100 * part.seconds / total,
                m.perEdge(part.seconds));
  std::printf("memory: resident set before the scene is built, to after the first step\n");
}

void addRow(const std::string &path, const std::string &scene, const Measured &m) {
  const bool fresh = !std::filesystem::exists(path);
  std::ofstream file(path, std::ios::app);
  if (!file) throw SceneError("option -bench_csv: '" + path + "' cannot be written");
  if (fresh) {
    file << "scene,rods,edges,steps,newton_iterations,rejected_steps,us_fastest,us_median,step_ms_fastest,step_ms_"
            "median,bytes_per_edge,per_lapack";
    for (const Part &part : m.parts) file << ",us_" << part.name;
    file << '\n';
  }
  file << scene << ',' << m.rods << ',' << m.edges << ',' << m.taken.steps << ',' << m.taken.newton_iterations << ','
       << m.taken.rejected << ',' << m.perEdge(m.fastest) << ',' << m.perEdge(m.median) << ',' << m.perStep(m.fastest)
       << ',' << m.perStep(m.median) << ',' << m.bytes_per_edge << ',' << m.perLapack();
  for (const Part &part : m.parts) file << ',' << m.perEdge(part.seconds);
  file << '\n';
}

PetscErrorCode execute() {
  Request request;
  Measured measured;
  PetscBool help;
  PetscFunctionBeginUser;
  PetscCall(readRequest(&request));
  PetscCall(PetscOptionsHasName(nullptr, nullptr, "-help", &help));
  if (help) PetscFunctionReturn(0);
  PetscCall(measure(request, &measured));
  print(measured);
  if (!request.csv.empty()) addRow(request.csv, request.scene, measured);
  PetscFunctionReturn(0);
}

} // namespace
} // namespace tendril::bench

int main(int argc, char **argv) {
  tendril::prepareMpi();
  if (PetscInitialize(&argc, &argv, nullptr,
                      "bench_step: what whole Newton steps cost, without output (docs/performance.md).\n"))
    return 1;
  int exit_code = 1;
  try {
    if (!tendril::registerEvents() && !tendril::registerSolvers() && !tendril::bench::execute()) exit_code = 0;
  } catch (const std::exception &e) {
    std::fprintf(stderr, "bench_step: %s\n", e.what());
  }
  (void)PetscOptionsSetValue(nullptr, "-options_left", "no");
  (void)PetscFinalize();
  return exit_code;
}
