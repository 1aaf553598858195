#include "tendril/accuracy/samples.hpp"

#include <algorithm>
#include <numeric>

namespace tendril {

double RunSamples::work() const { return std::accumulate(edges.begin(), edges.end(), 0.0) * double(steps); }

PetscErrorCode sample(Scene scene, const LoopSettings &settings, const std::vector<double> &times, RunSamples *out) {
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
        out->rounding_error = row.rounding_error;
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

std::vector<Errors> difference(const Scene &scene, const RunSamples &run, const RunSamples &other,
                               const std::vector<int> &edges, Quantity of) {
  const std::size_t times = run.position.size();
  if (of == Quantity::energy) {
    const double largest = std::max(*std::max_element(other.elastic.begin(), other.elastic.end()), 1e-300);
    std::vector<Vec3> series;
    for (std::size_t k = 0; k < times; ++k) series.emplace_back((run.elastic[k] - other.elastic[k]) / largest, 0, 0);
    return std::vector<Errors>(scene.rods.size(), Errors{series});
  }
  std::vector<Errors> out(scene.rods.size());
  std::size_t first = 0, other_first = 0; // vertices of the rod
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const std::size_t ends = scene.rods[r].closed ? 0 : 1, vertices = edges[r] + ends;
    const std::size_t ratio = run.edges[r] / edges[r], other_ratio = other.edges[r] / edges[r];
    const double length = lengthOf(scene.rods[r]);
    for (std::size_t v = of == Quantity::tip ? vertices - 1 : 0; v < vertices; ++v) {
      std::vector<Vec3> &series = out[r].emplace_back();
      for (std::size_t k = 0; k < times; ++k)
        series.push_back((run.position[k][first + ratio * v] - other.position[k][other_first + other_ratio * v]) /
                         length);
    }
    first += run.edges[r] + ends;
    other_first += other.edges[r] + ends;
  }
  return out;
}

/// Mean in time.
static double product(const std::vector<Vec3> &a, const std::vector<Vec3> &b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0, std::plus<>(),
                            [](const Vec3 &x, const Vec3 &y) { return x.dot(y); }) /
         double(a.size());
}

double sizeOf(const Errors &errors) {
  double largest = 0;
  for (const std::vector<Vec3> &series : errors) largest = std::max(largest, product(series, series));
  return std::sqrt(largest);
}

double correlation(const Errors &a, const Errors &b) {
  const double size_a = sizeOf(a), size_b = sizeOf(b);
  double most = 0;
  for (std::size_t v = 0; v < a.size(); ++v) {
    const double here_a = std::sqrt(product(a[v], a[v])), here_b = std::sqrt(product(b[v], b[v]));
    if (here_a > 0.5 * size_a || here_b > 0.5 * size_b)
      most = std::max(most, product(a[v], b[v]) / std::max(here_a * here_b, 1e-300));
  }
  return std::min(most, 1.0);
}

} // namespace tendril
