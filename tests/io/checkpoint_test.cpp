/// Checkpoints hold every field of the state and of the time loop, whatever fields these have; and runs go on from them
/// to the same bits.
#include "support/fields.hpp"
#include "support/files.hpp"
#include "support/rods.hpp"

#include "tendril/io/checkpoint.hpp"

namespace tendril::test {
namespace {

/// Writes another number, never zero, into everything.
class Filler {
public:
  explicit Filler(const Elements &elements) : elements_(elements) {}
  void operator()(double &v) { v = ++count_ + 1.0 / 3; }
  void operator()(int &v) { v = ++count_; }
  void operator()(std::int64_t &v) { v = ++count_; }
  void operator()(bool &v) { v = !v; }
  void operator()(std::vector<Vec3> &values) {
    if (values.empty()) values.resize(elements_.vertices());
    for (Vec3 &v : values)
      for (double &x : v) (*this)(x);
  }
  void operator()(std::vector<double> &values) {
    if (values.empty()) values.resize(4 * strainRow(elements_));
    for (double &v : values) (*this)(v);
  }
  void operator()(std::vector<Rates> &all) {
    all.resize(2);
    for (Rates &rates : all) {
      rates.edge.resize(elements_.edges());
      (*this)(rates.vertex);
      (*this)(rates.edge);
    }
  }

private:
  const Elements &elements_;
  int count_ = 0;
};

std::vector<double> numbersOf(StepControl control) {
  std::vector<double> numbers;
  eachField(control, [&](auto v) { numbers.push_back(double(v)); });
  return numbers;
}

/// An open rod that counts whole turns, and a ring beside it.
Scene turnedScene(int edges = 8) {
  Rod bar = straightRod(edges, Measure::angle), ring = bar;
  bar.material.axial_stiffness = 1e3;
  bar.material.flexural_stiffness = {40, 60};
  bar.material.linear_density = 1;
  bar.material.linear_rotational_inertia = 1e-2;
  bar.material.mass_damping_coefficient = 0.1;
  bar.material.stiffness_damping_coefficient = 0.02;
  ring.name = "ring";
  const Polyline shape = ringShape(Vec3(0, 2, 0), Vec3(0, 0.3, 1).normalized(), 0.3, 12);
  ring.position = shape.points;
  ring.closed = shape.closed;
  ring.material = bar.material;
  ring.initial_turns = 0.5;
  setBishopDirectors(ring);
  Scene scene;
  scene.rods = {bar, ring};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 0, edges, Support::Kind::clamp),
                    hold(scene, 1, 5, Support::Kind::pin)};
  scene.supports[0].motion.velocity = Vec3(0.1, 0, 0.2);
  scene.supports[1].motion.angular_velocity = Vec3(240, 0, 0);
  return scene;
}

TEST(Checkpoint, HoldsEveryField) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Simulation sim;
  EXPECT_PETSC(sim.setUp(turnedScene(), dynamics(0.01, 1)));
  State state = sim.state;
  StepControl control;
  Filler fill(*sim.elements);
  eachField(state, fill);
  eachField(control, fill);
  writeCheckpoint(path, state, control, "bdf2");
  State read = sim.state;
  StepControl read_control;
  readCheckpoint(path, &read, &read_control, "bdf2");
  EXPECT_TRUE(read == state);
  EXPECT_EQ(numbersOf(read_control), numbersOf(control));
}

TEST(Checkpoint, LeavesOutWhatAnotherIntegratorRemembers) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Simulation sim;
  EXPECT_PETSC(sim.setUp(turnedScene(), dynamics(0.01, 1)));
  State state = sim.state;
  eachField(state, Filler(*sim.elements));
  writeCheckpoint(path, state, {}, "bdf2");
  State read = sim.state;
  StepControl control;
  for (const std::string &name : integratorNames()) {
    readCheckpoint(path, &read, &control, name);
    EXPECT_EQ(read == state, name == "bdf2") << name;
    EXPECT_EQ(read.memory.empty() && read.strains.empty() && read.last_dt == 0, name != "bdf2") << name;
    EXPECT_TRUE(read.position == state.position && read.turns == state.turns && read.time == state.time) << name;
  }
}

TEST(Checkpoint, OfAnotherSceneIsRefused) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Simulation sim, other;
  EXPECT_PETSC(sim.setUp(turnedScene(8), dynamics(0.01, 1)));
  EXPECT_PETSC(other.setUp(turnedScene(9), dynamics(0.01, 1)));
  writeCheckpoint(path, sim.state, {}, "euler");
  StepControl control;
  EXPECT_TRUE(says(messageOf([&] { readCheckpoint(path, &other.state, &control, "euler"); }),
                   "restart with the scene that wrote the checkpoint"));
}

/// Every integrator, with steps as given and adapted ones. What it remembers, strains and whole turns are there where
/// the checkpoint is written.
TEST(Checkpoint, RunsGoOnToTheSameBits) {
  const Folder folder;
  for (const std::string &name : integratorNames())
    for (const Adaptation adapt : {Adaptation::none, Adaptation::error}) {
      SCOPED_TRACE(name + (adapt == Adaptation::none ? "" : ", adapted"));
      LoopSettings settings = dynamics(0.004, 0.16);
      settings.integrator.name = name;
      settings.adapt = adapt;
      settings.dt_rtol = 0.02;
      settings.output_interval = 0.02;
      settings.estimate_error = true;
      const std::string path = folder.path(name + ".h5");
      auto run = [&](Simulation &sim, TimeLoop &loop, bool writes) {
        bool finished = false;
        const auto observe = [&](const State &state, const Diagnostics &) {
          if (writes && state.time > 0.07) {
            writeCheckpoint(path, state, loop.control, name);
            writes = false;
            EXPECT_TRUE(std::any_of(state.turns.begin(), state.turns.begin() + sim.elements->rod_cells[1],
                                    [](double t) { return t != 0; }));
            const bool forgets = name == "euler" || name == "sdirk2" || name == "symplectic2";
            EXPECT_EQ(state.memory.empty(), forgets);
            EXPECT_EQ(state.strains.empty(), forgets || name == "sdirk23" || name == "sdirk33");
            EXPECT_GT(loop.control.error_sum, 0);
          }
          return PetscErrorCode(0);
        };
        EXPECT_EQ(loop.run(sim.state, observe, &finished), PetscErrorCode(0));
        EXPECT_TRUE(finished) << loop.failure();
      };
      Simulation whole, second;
      EXPECT_PETSC(whole.setUp(turnedScene(), settings));
      TimeLoop whole_loop(whole.solver, settings), second_loop(second.solver, settings);
      run(whole, whole_loop, true);
      EXPECT_PETSC(second.setUp(turnedScene(), settings));
      readCheckpoint(path, &second.state, &second_loop.control, name);
      EXPECT_GT(second.state.time, 0.07);
      EXPECT_LT(second.state.time, 0.1);
      run(second, second_loop, false);
      EXPECT_TRUE(second.state == whole.state);
      EXPECT_EQ(numbersOf(second_loop.control), numbersOf(whole_loop.control));
    }
}

} // namespace
} // namespace tendril::test
