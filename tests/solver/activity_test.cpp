/// What takes long is told, what is fast is not.
#include "support/rods.hpp"

#include "tendril/accuracy/estimate.hpp"
#include "tendril/dynamics/arc_length.hpp"
#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <thread>

namespace tendril::test {
namespace {

/// Collects what is told while it lives.
struct Listener {
  std::vector<std::string> lines;
  explicit Listener(double wait) {
    watch().restart();
    watch().wait = wait;
    watch().tell = [this](const std::string &line) { lines.push_back(line); };
  }
  ~Listener() {
    watch().tell = nullptr;
    watch().wait = Watch().wait;
  }
  bool heard(const std::vector<std::string> &words) const {
    return std::any_of(lines.begin(), lines.end(), [&](const std::string &line) {
      std::size_t at = 0;
      for (const std::string &w : words)
        if ((at = line.find(w, at)) == std::string::npos) return false;
      return true;
    });
  }
};

TEST(Watch, TellsNothingOfWhatIsFast) {
  Listener listener(600); // far longer than the run
  Simulation sim;
  Scene scene = clampedScene(straightRod(16));
  scene.forces.push_back({0, 16, Vec3(0, 1, 0)});
  runTo(sim, scene, statics(4));
  EXPECT_TRUE(listener.lines.empty()) << listener.lines[0];
}

TEST(Watch, WaitsBetweenLines) {
  Listener listener(0.05);
  const auto begin = Watch::Clock::now();
  const Doing here([](std::ostream &out) { out << "outside"; });
  while (Watch::Clock::now() - begin < std::chrono::milliseconds(30)) watch().beat();
  watch().restart(); // a step is done
  const auto again = Watch::Clock::now();
  const Doing within([](std::ostream &out) { out << "inside"; });
  while (Watch::Clock::now() - again < std::chrono::milliseconds(30)) watch().beat();
  if (Watch::Clock::now() - again < std::chrono::milliseconds(45))
    EXPECT_TRUE(listener.lines.empty()); // unless the machine held the test up
  while (Watch::Clock::now() - again < std::chrono::milliseconds(220)) watch().beat();
  EXPECT_GE(listener.lines.size(), 1u);
  EXPECT_LE(listener.lines.size(), 1 + std::size_t((Watch::Clock::now() - again) / std::chrono::milliseconds(50)));
  EXPECT_EQ(listener.lines[0], "working for 0 s: outside; inside");
}

TEST(Watch, TellsWhatIsGoingOn) {
  const std::string newton = "Newton iteration ";
  { // a column past its critical load of pi^2/4, found and left
    Listener listener(0);
    Simulation sim;
    Scene scene = clampedScene(straightRod(16));
    scene.forces.push_back({0, 16, Vec3(-5, 0, 0)});
    runTo(sim, scene, statics(10));
    EXPECT_TRUE(listener.heard({"load step at factor 0 of 1, increment 0.1", newton, "times what is asked for"}));
    EXPECT_TRUE(listener.heard({"load step at factor ", "a critical load is searched for; " + newton}));
    EXPECT_TRUE(
        listener.heard({"load step at factor ", newton, "a way down from an unstable equilibrium is looked for"}));
    EXPECT_EQ(Activity::all(), "");
  }
  { // coarse levels of fine rods
    Listener listener(0);
    Simulation sim;
    Scene scene = clampedScene(straightRod(2000));
    scene.forces.push_back({0, 2000, Vec3(0, 100, 0)});
    EXPECT_PETSC(sim.setUp(scene, statics()));
    sim.solver.coarse_first = true;
    TimeLoop loop(sim.solver, statics());
    bool finished;
    EXPECT_PETSC(loop.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_TRUE(listener.heard({"load step at factor 0 of 1", "with fewer edges, ", " of rod 'rod'", newton}));
  }
  { // steps that are halved
    Listener listener(0);
    Simulation sim;
    Scene scene = clampedScene(straightRod(16));
    scene.forces.push_back({0, 16, Vec3(0, 20, 0)});
    LoopSettings settings = statics(1);
    settings.dt_min = 1e-3;
    EXPECT_PETSC(sim.setUp(scene, settings));
    EXPECT_PETSC(SNESSetTolerances(sim.solver.snes(), 0, 1e-6, 0, 4, PETSC_MAX_INT));
    TimeLoop loop(sim.solver, settings);
    bool finished;
    EXPECT_PETSC(loop.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_TRUE(listener.heard({"load step at factor 0 of 1, increment 0.5, after 1 that failed; " + newton}));
  }
  { // paths of equilibria, and error estimates
    Listener listener(0);
    Simulation sim;
    Scene scene = clampedScene(straightRod(16));
    scene.forces.push_back({0, 16, Vec3(0, 1, 0)});
    LoopSettings settings = statics(10);
    settings.continuation = Continuation::arclength;
    EXPECT_PETSC(sim.setUp(scene, settings));
    ArcLength path(sim.solver, settings);
    bool finished;
    EXPECT_PETSC(path.run(
        sim.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &finished));
    EXPECT_TRUE(finished) << path.failure();
    EXPECT_TRUE(listener.heard({"step along the path at load factor ", ", length "}));
    Scene fine = clampedScene(straightRod(32));
    fine.forces.push_back({0, 32, Vec3(0, 1, 0)});
    Estimate estimate;
    EXPECT_PETSC(estimateError(sim, 0, {}, fine, statics(10), &estimate));
    EXPECT_TRUE(listener.heard({"error estimate, with half the edges' lengths", newton}));
  }
}

} // namespace
} // namespace tendril::test
