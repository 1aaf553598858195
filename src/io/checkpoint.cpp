#include "tendril/io/checkpoint.hpp"

#include "tendril/io/hdf5.hpp"

#include <filesystem>

namespace tendril {
namespace {

/// Applies `visit(name, values, columns)` to every array of a state: one list for writing and reading.
template <class AnyState, class Visit> void eachArray(AnyState &s, Visit visit) {
  visit("position", s.position, 3);
  visit("director", s.director, 3);
  visit("velocity", s.velocity, 3);
  visit("twist_rate", s.twist_rate, 1);
  visit("axial_force", s.axial_force, 1);
  visit("turns", s.turns, 1);
}

} // namespace

void writeCheckpoint(const std::string &path, const State &state, const StepControl &control) {
  const std::string part = path + ".part";
  {
    Hdf5File file = Hdf5File::create(part);
    eachArray(state, [&](const char *name, const auto &values, hsize_t columns) {
      std::vector<hsize_t> shape{values.size()};
      if (columns > 1) shape.push_back(columns);
      file.write(name, shape, reinterpret_cast<const double *>(values.data()));
    });
    const double loop[5] = {state.time, double(state.step), control.dt, double(control.good), double(control.stable)};
    file.write("loop", {5}, loop);
  }
  std::error_code error;
  std::filesystem::rename(part, path, error);
  if (error) throw SceneError(path + ": cannot be written");
}

void readCheckpoint(const std::string &path, State *state, StepControl *control) {
  const Hdf5File file = Hdf5File::open(path);
  eachArray(*state, [&](const char *name, auto &values, hsize_t columns) {
    const std::vector<double> read = file.read(name, columns);
    if (read.size() != values.size() * columns)
      throw SceneError(path + ": '" + name + "' has " + std::to_string(read.size() / columns) + " entries, but the scene needs " + std::to_string(values.size()) +
                       "; restart with the scene that wrote the checkpoint");
    std::copy(read.begin(), read.end(), reinterpret_cast<double *>(values.data()));
  });
  const std::vector<double> loop = file.read("loop", 1);
  if (loop.size() != 5) throw SceneError(path + ": 'loop' is not that of a checkpoint");
  state->time = loop[0];
  state->step = std::int64_t(loop[1]);
  *control = {loop[2], int(loop[3]), loop[4] != 0};
}

} // namespace tendril
