/// Checkpoints hold every field of the state and of the time loop, whatever fields these have; and runs go on from them
/// to the same bits.
#include "support/fields.hpp"
#include "support/files.hpp"
#include "support/rods.hpp"

#include "tendril/io/checkpoint.hpp"

#include <fstream>
#include <iterator>
#include <map>
#include <random>

namespace tendril::test {
namespace {

/// Writes another number, never zero, into everything.
class Filler {
public:
  explicit Filler(const Elements &elements) : elements_(elements) {}
  void operator()(double &v) { v = 2 + std::sin(++count_); } // no two alike, and no rod of them is straight
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
  void operator()(std::vector<std::vector<ContactMemory>> &all) {
    all.resize(elements_.rods.size());
    for (auto &of_rod : all) {
      of_rod.resize(std::size_t(2 + count_ % 3));
      for (ContactMemory &m : of_rod) m = {++count_, ++count_, ++count_, Vec3(1, ++count_, 2), Vec3(++count_, 3, 4)};
    }
  }
  void operator()(std::vector<std::vector<PairMemory>> &all) {
    all.resize(elements_.rods.size());
    for (auto &of_rod : all) {
      of_rod.resize(std::size_t(2 + count_ % 3));
      for (PairMemory &m : of_rod)
        m = {++count_, ++count_, ++count_, ++count_, Vec3(1, ++count_, 2), Vec3(++count_, 3, 4)};
    }
  }
  void operator()(std::vector<std::array<Vec3, 2>> &axes) { // of junctions, as many as there are
    for (auto &of_group : axes)
      for (Vec3 &axis : of_group)
        for (double &x : axis) (*this)(x);
  }
  void operator()(std::vector<BodyRate> &rates) { // as many as there are bodies
    for (BodyRate &rate : rates)
      for (Vec3 *v : {&rate.translation, &rate.spin, &rate.momentum})
        for (double &x : *v) (*this)(x);
  }
  void operator()(std::vector<JointState> &joints) {
    for (JointState &joint : joints) {
      for (double &x : joint.force) (*this)(x);
      (*this)(joint.coordinate);
    }
  }
  void operator()(std::vector<Rates> &all) {
    all.resize(2);
    for (Rates &rates : all) {
      rates.edge.resize(elements_.edges());
      rates.body.resize(elements_.bodyCount());
      (*this)(rates.body);
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
  scene.forces = {{0, edges - 3, Vec3(0, 1, 0)}};
  return scene;
}

/// The same with a body on the ring.
Scene sceneWithBody() {
  Scene scene = turnedScene();
  Body body;
  body.own = boxMass({0.1, 0.2, 0.3}, 100).moved(Mat3::Identity(), {0, 2, 0});
  scene.bodies = {body};
  Joint joint{};
  joint.name = "hinge";
  joint.type = Joint::Type::hinge;
  joint.point = Vec3::Zero();
  joint.axes = Mat3::Identity();
  scene.joints = {joint};
  scene.attachments = {{"tie", 1, 2, 0, true, frameAtVertex(scene.rods[1], 2)}};
  scene.hostBodies();
  return scene;
}

LoopSettings settingsOf(const std::string &integrator) {
  LoopSettings settings = dynamics(0.01, 1);
  settings.integrator.name = integrator;
  return settings;
}

void prepare(Simulation &sim, const Scene &scene, const LoopSettings &settings) {
  EXPECT_PETSC(sim.setUp(scene, settings));
}

/// A run with another number in every field of its state, and the control of its loop.
struct Filled {
  Simulation sim;
  StepControl control;
  RunFacts facts;
  explicit Filled(const Scene &scene = turnedScene(), const LoopSettings &settings = settingsOf("bdf2"))
      : facts(scene, settings) {
    prepare(sim, scene, settings);
    Filler fill(*sim.elements);
    eachField(sim.state, fill);
    for (auto *places : {&sim.state.body_position, &sim.state.body_position_low}) places->resize(scene.bodies.size());
    eachField(control, fill);
  }
  void write(const std::string &path) const { writeCheckpoint(path, sim, control, facts); }
};

/// What another scene or other settings make of a checkpoint.
struct Taken {
  Simulation sim;
  StepControl control;
  std::vector<std::string> told;
  bool changed = false;
  Taken(const std::string &path, const Scene &scene, const LoopSettings &settings) {
    prepare(sim, scene, settings);
    changed = readCheckpoint(path, &sim, &control, RunFacts(scene, settings), &told);
  }
  std::string all() const {
    std::string text;
    for (const std::string &line : told) text += line + "\n";
    return text;
  }
};

TEST(Checkpoint, HoldsEveryField) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Scene scene = sceneWithBody();
  scene.junctions = {{"corner", {{0, 2, 0}}, 1}};
  const Filled written(scene);
  written.write(path);
  const Taken read(path, scene, settingsOf("bdf2"));
  EXPECT_TRUE(read.sim.state == written.sim.state);
  EXPECT_EQ(numbersOf(read.control), numbersOf(written.control));
  EXPECT_EQ(read.all(), "");
  EXPECT_FALSE(read.changed);
}

TEST(Checkpoint, LeavesOutWhatAnotherIntegratorRemembers) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  const Filled written;
  const State &state = written.sim.state;
  written.write(path);
  for (const std::string &name : integratorNames()) {
    const Taken taken(path, turnedScene(), settingsOf(name));
    const State &read = taken.sim.state;
    EXPECT_EQ(read == state, name == "bdf2") << name;
    EXPECT_EQ(read.memory.empty() && read.strains.empty() && read.last_dt == 0, name != "bdf2") << name;
    EXPECT_TRUE(read.position == state.position && read.winding == state.winding && read.time == state.time) << name;
    if (name != "bdf2") EXPECT_TRUE(says(taken.all(), "integrator: bdf2 -> " + name));
  }
}

TEST(Checkpoint, OfAnotherTopologyIsRefused) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Filled().write(path);
  Scene open = turnedScene();
  open.rods[1].closed = false;
  open.rods[1].director.pop_back();
  for (const Scene &scene : {turnedScene(9), open}) {
    const std::string message = messageOf([&] { Taken(path, scene, settingsOf("bdf2")); });
    EXPECT_TRUE(says(message, "another topology")) << message;
    EXPECT_TRUE(says(message, "restart with the scene that wrote the checkpoint"));
  }
}

/// Where a bit is flipped, the file is refused, or what is read is what was written: the bit was one that says nothing.
TEST(Checkpoint, EveryFlippedBitIsFound) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5"), flipped = folder.path("flipped.h5");
  const Filled written;
  written.write(path);
  std::ifstream in(path, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), {});
  // The data themselves, found by their first number, and 200 places anywhere.
  std::vector<std::size_t> bits;
  std::minstd_rand random(1);
  auto inside = [&](const void *data, std::size_t bytes) {
    const std::size_t at = whole.find(std::string_view(static_cast<const char *>(data), bytes));
    ASSERT_NE(at, std::string::npos);
    for (int k = 0; k < 20; ++k) bits.push_back(8 * at + random() % (8 * bytes));
  };
  const State &s = written.sim.state;
  inside(s.position.data(), s.position.size() * sizeof(Vec3));
  inside(s.position_low.data(), s.position_low.size() * sizeof(Vec3));
  inside(s.director.data(), s.director.size() * sizeof(Vec3));
  inside(s.velocity.data(), s.velocity.size() * sizeof(Vec3));
  inside(s.twist_rate.data(), s.twist_rate.size() * sizeof(double));
  inside(s.axial_force.data(), s.axial_force.size() * sizeof(double));
  inside(s.winding.data(), s.winding.size() * sizeof(double));
  inside(s.memory[1].vertex.data(), s.memory[1].vertex.size() * sizeof(Vec3));
  inside(s.strains.data(), s.strains.size() * sizeof(double));
  inside(&s.time, sizeof s.time);
  const std::size_t in_data = bits.size();
  for (int k = 0; k < 200; ++k) bits.push_back(random() % (8 * whole.size()));
  int refused = 0;
  Simulation sim;
  EXPECT_PETSC(sim.setUp(turnedScene(), settingsOf("bdf2")));
  const State initial = sim.state;
  for (std::size_t k = 0; k < bits.size(); ++k) {
    std::string other = whole;
    other[bits[k] / 8] = char(other[bits[k] / 8] ^ (1 << bits[k] % 8));
    folder.write("flipped.h5", other);
    StepControl control;
    std::vector<std::string> told;
    sim.state = initial;
    try {
      readCheckpoint(flipped, &sim, &control, written.facts, &told);
      EXPECT_GE(k, in_data) << "bit " << bits[k];
      EXPECT_TRUE(sim.state == s && numbersOf(control) == numbersOf(written.control)) << "bit " << bits[k];
      EXPECT_TRUE(told.empty()) << told[0];
    } catch (const SceneError &) {
      ++refused;
      EXPECT_TRUE(sim.state == initial);
    }
  }
  EXPECT_GE(refused, int(in_data));
}

/// Sizes that the scene does not have are refused before there is memory for them: these would take more than any
/// machine has.
TEST(Checkpoint, SizesOfAnotherSceneTakeNoMemory) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Filled().write(path);
  {
    Hdf5File file = Hdf5File::reopen(path);
    H5Ldelete(file.id(), "velocity", H5P_DEFAULT);
    const hsize_t shape[] = {hsize_t(1) << 50, 3};
    const Hdf5Space space = H5Screate_simple(2, shape, nullptr);
    const Hdf5Properties create = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk[] = {1, 3};
    H5Pset_chunk(create, 2, chunk);
    const Hdf5Dataset data = H5Dcreate2(file.id(), "velocity", H5T_IEEE_F64LE, space, H5P_DEFAULT, create, H5P_DEFAULT);
    ASSERT_GE(hid_t(data), 0);
  }
  EXPECT_TRUE(says(messageOf([&] { Taken(path, turnedScene(), settingsOf("bdf2")); }),
                   "'velocity' has 1125899906842624 entries"));
}

TEST(Checkpoint, TellsWhatHasChanged) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Filled().write(path);
  Scene scene = turnedScene();
  scene.gravity = Vec3(0, 0, -1);
  scene.rods[0].material.linear_density = 3;
  scene.rods[1].measure = Measure::tan;
  scene.forces.push_back({0, 4, Vec3(0, 2, 0)});
  scene.supports.pop_back(); // the pin of the ring
  scene.supports[1].motion = {};
  LoopSettings settings = settingsOf("bdf2");
  settings.dt = 0.02;
  const Taken taken(path, scene, settings);
  EXPECT_TRUE(taken.changed);
  for (const char *part :
       {"gravity: [0, -9.81, 0] -> [0, 0, -1]", "material of rod",
        "law of rod 'ring': measure angle, energy seed -> measure tan",
        "new since the checkpoint: force on vertex 4 of rod", "no longer there: support at vertex 5 of rod 'ring': pin",
        "support at vertex 8 of rod", "dt: 0.01 -> 0.02"})
    EXPECT_TRUE(says(taken.all(), part)) << taken.all();
  EXPECT_TRUE(says(taken.all(), "rod 'ring' loses its whole turns"));
  EXPECT_TRUE(says(taken.all(), "the support at vertex 8 of rod '" + scene.rods[0].name +
                                    "' is ")); // every number of this state is another
  EXPECT_EQ(taken.control.dt, 0) << "the step asked for now";
  EXPECT_TRUE(taken.sim.state.memory.empty());
}

/// With other loads and options alone the integrator goes on.
TEST(Checkpoint, OtherLoadsLeaveTheStateAlone) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  const Filled written;
  written.write(path);
  Scene scene = turnedScene();
  scene.forces.push_back({0, 4, Vec3(0, 2, 0)});
  const Taken taken(path, scene, settingsOf("bdf2"));
  EXPECT_TRUE(taken.sim.state == written.sim.state);
  EXPECT_TRUE(taken.changed);
  EXPECT_EQ(taken.told.size(), 1U) << taken.all();
}

/// A clamp in the middle of a rod goes: its half cells become a whole one, of the same twist, whole turns included; and
/// it comes back.
TEST(Checkpoint, TurnsStayWhereSupportsComeAndGo) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5"), back = folder.path("back.h5");
  Scene held = turnedScene(), free = held;
  for (Support &s : held.supports) s.motion = {};
  held.supports.push_back(hold(held, 0, 4, Support::Kind::clamp));
  free.supports = {held.supports[0], held.supports[1], held.supports[2]};
  const LoopSettings settings = settingsOf("bdf2");
  Simulation sim;
  EXPECT_PETSC(sim.setUp(held, settings));
  for (double &t : sim.state.winding) t = 2 * pi;
  writeCheckpoint(path, sim, {}, RunFacts(held, settings));
  const Taken taken(path, free, settings);
  const std::vector<double> &turns = taken.sim.state.winding;
  EXPECT_EQ(turns.size() + 1, sim.state.winding.size());
  EXPECT_EQ(std::count(turns.begin(), turns.end(), 4 * pi), 1);
  EXPECT_EQ(std::count(turns.begin(), turns.end(), 2 * pi), std::ptrdiff_t(turns.size()) - 1);
  writeCheckpoint(back, taken.sim, taken.control, RunFacts(free, settings));
  const Taken again(back, free, settings);
  EXPECT_TRUE(again.sim.state == taken.sim.state);
}

TEST(Checkpoint, StaticsAndDynamicsFollowEachOther) {
  const Folder folder;
  const std::string path = folder.path("checkpoint.h5");
  Scene scene = turnedScene();
  for (Support &s : scene.supports) s.motion = {};
  LoopSettings statics = settingsOf("euler");
  statics.dynamic = false;
  for (const bool to_dynamics : {true, false}) {
    const LoopSettings &from = to_dynamics ? statics : settingsOf("bdf2"),
                       to = to_dynamics ? settingsOf("bdf2") : statics;
    const Filled written(scene, from);
    written.write(path);
    const Taken taken(path, scene, to);
    EXPECT_TRUE(taken.changed);
    const State &s = taken.sim.state;
    EXPECT_EQ(s.time, 0);
    EXPECT_EQ(s.step, 0);
    EXPECT_TRUE(s.position == written.sim.state.position && s.director == written.sim.state.director &&
                s.winding == written.sim.state.winding);
    for (const Vec3 &v : s.velocity) EXPECT_EQ(v.norm(), 0);
    for (const double w : s.twist_rate) EXPECT_EQ(w, 0);
    EXPECT_TRUE(s.memory.empty());
    EXPECT_EQ(taken.control.dt, 0);
    EXPECT_TRUE(says(taken.all(), to_dynamics ? "the start of dynamics" : "the start of statics"));
  }
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
      std::map<std::int64_t, std::vector<double>> balance; // by step, of both runs
      auto run = [&](Simulation &sim, TimeLoop &loop, bool writes) {
        bool finished = false;
        const auto observe = [&](const State &state, const Diagnostics &row) {
          for (const double value : {row.dissipated, row.work.supports, row.work.loads})
            balance[state.step].push_back(value);
          if (writes && state.time > 0.07) {
            writeCheckpoint(path, sim, loop.control, RunFacts(sim.scene, settings));
            writes = false;
            EXPECT_TRUE(std::any_of(state.winding.begin(), state.winding.begin() + sim.elements->rod_cells[1],
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
      std::vector<std::string> told;
      EXPECT_FALSE(readCheckpoint(path, &second, &second_loop.control, RunFacts(second.scene, settings), &told));
      EXPECT_TRUE(told.empty());
      EXPECT_GT(second.state.time, 0.07);
      EXPECT_LT(second.state.time, 0.1);
      run(second, second_loop, false);
      EXPECT_TRUE(second.state == whole.state);
      EXPECT_EQ(numbersOf(second_loop.control), numbersOf(whole_loop.control));
      int both = 0;
      for (const auto &[step, values] : balance)
        if (values.size() == 6) {
          ++both;
          EXPECT_NE(values[1], 0);
          EXPECT_NE(values[2], 0);
          for (int k = 0; k < 3; ++k) EXPECT_EQ(values[k], values[k + 3]) << "balance " << k << " of step " << step;
        }
      EXPECT_GT(both, 3);
    }
}

} // namespace
} // namespace tendril::test
