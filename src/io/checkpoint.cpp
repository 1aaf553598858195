#include "tendril/io/checkpoint.hpp"

#include "tendril/io/hdf5.hpp"

#include <cmath>
#include <filesystem>
#include <iterator>

namespace tendril {
namespace {

/// Applies `visit(name, values, columns)` to every array of a state: one list for writing and reading.
template <class AnyState, class Visit> void eachArray(AnyState &s, Visit visit) {
  visit("position", s.position, 3);
  visit("position_low", s.position_low, 3);
  visit("director", s.director, 3);
  visit("velocity", s.velocity, 3);
  visit("twist_rate", s.twist_rate, 1);
  visit("axial_force", s.axial_force, 1);
  visit("turns", s.turns, 1);
}

/// A number that stands for the name of an integrator.
double code(const std::string &integrator) {
  double sum = 0;
  for (const char c : integrator) sum = std::fmod(31 * sum + c, 1e9 + 7);
  return sum;
}

} // namespace

void writeCheckpoint(const std::string &path, const State &state, const StepControl &control, const std::string &integrator) {
  const std::string part = path + ".part";
  {
    Hdf5File file = Hdf5File::create(part);
    eachArray(state, [&](const char *name, const auto &values, hsize_t columns) {
      std::vector<hsize_t> shape{values.size()};
      if (columns > 1) shape.push_back(columns);
      file.write(name, shape, reinterpret_cast<const double *>(values.data()));
    });
    for (std::size_t k = 0; k < state.memory.size(); ++k) {
      file.write("memory_vertex_" + std::to_string(k), {state.memory[k].vertex.size(), 3}, reinterpret_cast<const double *>(state.memory[k].vertex.data()));
      file.write("memory_edge_" + std::to_string(k), {state.memory[k].edge.size()}, state.memory[k].edge.data());
    }
    if (!state.strains.empty()) file.write("strains", {state.strains.size()}, state.strains.data());
    const double loop[] = {state.time,    double(state.step), control.dt,    double(control.good), double(control.stable),
                           control.error, control.error_sum,  state.last_dt, code(integrator),     control.rounding_sum, state.dt_before};
    file.write("loop", {std::size(loop)}, loop);
  }
  std::error_code error;
  std::filesystem::rename(part, path, error);
  if (error) throw SceneError(path + ": cannot be written");
}

void readCheckpoint(const std::string &path, State *state, StepControl *control, const std::string &integrator) {
  const Hdf5File file = Hdf5File::open(path);
  eachArray(*state, [&](const char *name, auto &values, hsize_t columns) {
    const std::vector<double> read = file.read(name, columns);
    if (read.size() != values.size() * columns)
      throw SceneError(path + ": '" + name + "' has " + std::to_string(read.size() / columns) + " entries, but the scene needs " +
                       std::to_string(values.size()) + "; restart with the scene that wrote the checkpoint");
    std::copy(read.begin(), read.end(), reinterpret_cast<double *>(values.data()));
  });
  const std::vector<double> loop = file.read("loop", 1);
  if (loop.size() != 10 && loop.size() != 11) throw SceneError(path + ": 'loop' is not that of a checkpoint");
  state->time = loop[0];
  state->step = std::int64_t(loop[1]);
  *control = {loop[2], int(loop[3]), loop[4] != 0, loop[5], loop[6], loop[9]};
  state->memory.clear();
  state->strains.clear();
  state->last_dt = state->dt_before = 0;
  if (loop[8] != code(integrator)) return; // what another method remembers is of no use: this one begins anew
  state->last_dt = loop[7];
  if (loop.size() > 10) state->dt_before = loop[10]; // files of before there was bdf3 have none
  auto readInto = [&](const std::string &name, auto &values, std::size_t size, hsize_t columns) {
    const std::vector<double> read = file.read(name, columns);
    if (read.size() != size * columns) throw SceneError(path + ": '" + name + "' does not fit the scene; restart with the scene that wrote the checkpoint");
    values.resize(size);
    std::copy(read.begin(), read.end(), reinterpret_cast<double *>(values.data()));
  };
  for (int k = 0; file.has("memory_vertex_" + std::to_string(k)); ++k) {
    Rates &rates = state->memory.emplace_back();
    readInto("memory_vertex_" + std::to_string(k), rates.vertex, state->position.size(), 3);
    readInto("memory_edge_" + std::to_string(k), rates.edge, state->director.size(), 1);
  }
  if (file.has("strains")) state->strains = file.read("strains", 1);
}

} // namespace tendril
