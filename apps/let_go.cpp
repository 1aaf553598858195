/// let_go: a cantilever sags under its weight, gravity is switched off, and it swings. Shows the library
/// (docs/library.md): one scene is solved in statics, its answer is written into the state of another, which runs in
/// time.
///
///     clamp |=====o-----o-----o-----o   statics: down to where it hangs;  dynamics without gravity: up and down about
///     straight
///
/// Sample run, from the root of the repository; it is a test:
///   let_go data/scenes/cantilever.yaml
#include "tendril/dynamics/state_access.hpp"
#include "tendril/io/scene_reader.hpp"
#include "tendril/layout/launch.hpp"
#include "tendril/solver/events.hpp"

#include <cstdio>

namespace {

/// Runs a simulation to the end of its settings; `seen` after each step.
PetscErrorCode run(tendril::Simulation &simulation, const tendril::LoopSettings &settings,
                   const std::function<void(const tendril::State &)> &seen) {
  PetscFunctionBeginUser;
  tendril::TimeLoop loop(simulation.solver, settings);
  auto observe = [&](const tendril::State &state, const tendril::Diagnostics &) -> PetscErrorCode {
    seen(state);
    return 0;
  };
  bool finished;
  PetscCall(loop.run(simulation.state, observe, &finished));
  if (!finished) throw std::runtime_error(loop.failure());
  PetscFunctionReturn(0);
}

PetscErrorCode letGo(const char *file) {
  PetscFunctionBeginUser;
  tendril::Scene scene = tendril::readScene(file).scene;
  for (tendril::Rod &rod : scene.rods)
    rod.material = tendril::homogeneousMaterial({tendril::SectionShape::circle, {0.005, 0.005}}, 1e10, 4e9, 1200);

  tendril::LoopSettings statics;
  statics.dynamic = false;
  statics.dt = 1; // the whole load at once
  tendril::Simulation hanging;
  PetscCall(hanging.setUp(scene, statics));
  PetscCall(run(hanging, statics, [](const tendril::State &) {}));

  scene.gravity.setZero();
  tendril::LoopSettings dynamics;
  dynamics.integrator.name = "midpoint";
  dynamics.dt = 1e-3;
  dynamics.t_end = 1.1;
  tendril::Simulation swinging;
  PetscCall(swinging.setUp(scene, dynamics));
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    const tendril::RodAccess from(hanging, r);
    tendril::RodAccess to(swinging, r);
    to.setPositions(from.positions());
    to.setDirectors(from.directors());
  }

  std::vector<double> crossings; // of the tip, upwards [s]
  double last = swinging.state.position.back()[1], time = 0;
  std::printf("sag %.5f m\n", -last);
  PetscCall(run(swinging, dynamics, [&](const tendril::State &state) {
    const double now = state.position.back()[1];
    if (last < 0 && now >= 0) crossings.push_back(time + (state.time - time) * last / (last - now));
    last = now;
    time = state.time;
  }));
  if (crossings.size() < 2) throw std::runtime_error("the rod does not swing");
  std::printf("period %.5f s over %zu swings\n", (crossings.back() - crossings.front()) / double(crossings.size() - 1),
              crossings.size() - 1);
  PetscFunctionReturn(0);
}

} // namespace

int main(int argc, char **argv) {
  tendril::prepareMpi();
  if (PetscInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  int exit_code = 1;
  if (argc < 2)
    std::fprintf(stderr, "let_go: wants a scene: let_go data/scenes/cantilever.yaml\n");
  else if (!tendril::registerEvents() && !tendril::registerSolvers())
    try {
      if (!letGo(argv[1])) exit_code = 0;
    } catch (const std::exception &e) {
      std::fprintf(stderr, "let_go: %s\n", e.what());
    }
  (void)PetscFinalize();
  return exit_code;
}
