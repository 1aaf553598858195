#include "tendril/io/samples.hpp"

#include <algorithm>
#include <numeric>

namespace tendril {

double Samples::work() const { return std::accumulate(edges.begin(), edges.end(), 0.0) * double(steps); }

PetscErrorCode sample(Scene scene, const LoopSettings &settings, const std::vector<double> &times, Samples *out) {
  PetscFunctionBeginUser;
  *out = {};
  out->edges = edgesOf(scene);
  Simulation run;
  PetscCall(run.setUp(std::move(scene), settings));
  TimeLoop loop(run.solver, settings);
  std::size_t next = 0;
  bool finished;
  PetscCall(loop.run(
      run.state,
      [&](const State &state, const Diagnostics &row) {
        ++out->steps;
        out->seconds = row.wall_seconds;
        if (next < times.size() && std::abs(state.time - times[next]) < 1e-6 * row.dt) {
          out->position.push_back(state.position);
          out->elastic.push_back(row.energy.stretch + row.energy.bend + row.energy.twist);
          ++next;
        }
        return PetscErrorCode(0);
      },
      &finished));
  out->failure = loop.failure();
  if (finished && next < times.size()) out->failure = "rejected steps shifted those behind them";
  PetscFunctionReturn(0);
}

std::vector<double> distances(const Scene &scene, const Samples &coarse, const Samples &fine, Quantity of) {
  const std::size_t times = coarse.position.size();
  if (of == Quantity::energy) {
    double sum = 0, largest = 0;
    for (std::size_t k = 0; k < times; ++k) {
      sum += std::pow(fine.elastic[k] - coarse.elastic[k], 2);
      largest = std::max(largest, fine.elastic[k]);
    }
    return std::vector<double>(scene.rods.size(), largest > 0 ? std::sqrt(sum / double(times)) / largest : 0);
  }
  std::vector<double> out;
  std::size_t first = 0, fine_first = 0; // vertices of the rod
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    const std::size_t ends = rod.closed ? 0 : 1, vertices = coarse.edges[r] + ends, ratio = fine.edges[r] / coarse.edges[r];
    double worst = 0;
    for (std::size_t v = of == Quantity::tip ? vertices - 1 : 0; v < vertices; ++v) {
      double sum = 0;
      for (std::size_t k = 0; k < times; ++k) sum += (fine.position[k][fine_first + ratio * v] - coarse.position[k][first + v]).squaredNorm();
      worst = std::max(worst, sum);
    }
    out.push_back(std::sqrt(worst / double(times)) / lengthOf(rod));
    first += vertices;
    fine_first += fine.edges[r] + ends;
  }
  return out;
}

} // namespace tendril
