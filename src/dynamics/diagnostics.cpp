#include "tendril/dynamics/diagnostics.hpp"

namespace tendril {

const std::vector<DiagnosticsColumn> &diagnosticsColumns() {
  using D = Diagnostics;
  static const std::vector<DiagnosticsColumn> columns{
      {"time", "s", [](const D &d) { return d.time; }},
      {"dt", "s", [](const D &d) { return d.dt; }},
      {"kinetic", "J", [](const D &d) { return d.energy.kinetic; }},
      {"stretch", "J", [](const D &d) { return d.energy.stretch; }},
      {"bend", "J", [](const D &d) { return d.energy.bend; }},
      {"twist", "J", [](const D &d) { return d.energy.twist; }},
      {"gravity", "J", [](const D &d) { return d.energy.gravity; }},
      {"dissipated", "J", [](const D &d) { return d.dissipated; }},
      {"newton_iterations", "1", [](const D &d) { return double(d.newton_iterations); }},
      {"line_search_trials", "1", [](const D &d) { return double(d.line_search_trials); }},
      {"negative_pivots", "1", [](const D &d) { return double(d.negative_pivots); }},
      {"rejected_steps", "1", [](const D &d) { return double(d.rejected_steps); }},
      {"wall_seconds", "s", [](const D &d) { return d.wall_seconds; }},
      {"error_estimate", "1", [](const D &d) { return d.error_estimate; }},
      {"rejected_iterations", "1", [](const D &d) { return double(d.rejected_iterations); }},
      {"rounding_error", "1", [](const D &d) { return d.rounding_error; }},
      {"work_loads", "J", [](const D &d) { return d.work.loads; }},
      {"work_supports", "J", [](const D &d) { return d.work.supports + d.work.obstacles; }},
      {"constraint", "J", [](const D &d) { return d.energy.constraint; }},
      {"contact", "J", [](const D &d) { return d.energy.contact; }},
      {"body_kinetic", "J", [](const D &d) { return d.energy.body_kinetic; }},
      {"contact_gap_min", "m", [](const D &d) { return d.contact_gap_min; }}};
  return columns;
}

} // namespace tendril
