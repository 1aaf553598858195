#include "tendril/io/estimate.hpp"

#include "tendril/dynamics/simulation.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace tendril {
namespace {

/// Above this part of the largest displacement, a difference is not an error of discretisation.
constexpr double most_difference = 0.3;
/// Differences below this part of the length are rounding, whatever the displacement.
constexpr double least_difference = 1e-6;

constexpr std::pair<const char *, double EnergyBudget::*> energies[] = {
    {"stretch", &EnergyBudget::stretch}, {"bend", &EnergyBudget::bend}, {"twist", &EnergyBudget::twist}, {"gravity", &EnergyBudget::gravity}};

template <class... Parts> std::string text(const Parts &...parts) {
  std::ostringstream s;
  s << std::setprecision(3);
  (s << ... << parts);
  return s.str();
}

std::string exactly(double value) {
  std::ostringstream s;
  s << std::setprecision(8) << value;
  return s.str();
}

} // namespace

PetscErrorCode solveStatics(Scene scene, const LoopSettings &settings, Answer *answer) {
  PetscFunctionBeginUser;
  Simulation run;
  PetscCall(run.setUp(std::move(scene), settings));
  TimeLoop loop(run.solver, settings);
  loop.on_critical = [&](const CriticalPoint &point) {
    answer->critical.push_back(point.load_factor);
    return PetscErrorCode(0);
  };
  PetscCall(loop.run(
      run.state, [](const State &, const Diagnostics &) { return PetscErrorCode(0); }, &answer->found));
  answer->failure = loop.failure();
  answer->load_factor = run.state.time;
  answer->energy = energyBudget(run.scene, *run.elements, run.state, run.state.time);
  answer->position = std::move(run.state.position);
  PetscFunctionReturn(0);
}

int Estimate::worstRod() const {
  return int(std::max_element(rods.begin(), rods.end(), [](const RodEstimate &a, const RodEstimate &b) { return a.error / a.length < b.error / b.length; }) -
             rods.begin());
}

Estimate richardson(const Scene &scene, const Answer &coarse, const Answer &fine) {
  Estimate out;
  std::size_t first = 0, fine_first = 0; // vertices of the rod
  for (const Rod &rod : scene.rods) {
    RodEstimate &r = out.rods.emplace_back();
    out.tan = out.tan || rod.measure == Measure::tan;
    for (int i = 0; i < rod.edges(); ++i) r.length += rod.edge(i).norm();
    for (int v = 0; v < rod.vertices(); ++v) {
      const Vec3 &a = coarse.position[first + v], &b = fine.position[fine_first + 2 * v];
      const double error = (b - a).norm() * 4 / 3;
      out.position.push_back(b + (b - a) / 3);
      out.error.push_back(error);
      r.displacement = std::max(r.displacement, (a - rod.position[v]).norm());
      if (error > r.error) r.vertex = v;
      r.error = std::max(r.error, error);
      r.tip = error;
    }
    if (out.none.empty() && r.error > std::max(most_difference * r.displacement, least_difference * r.length))
      out.none = text("rod '", rod.name, "' differs between ", rod.edges(), " and ", 2 * rod.edges(), " edges by ", r.error * 3 / 4, " m where its largest displacement is ",
                      r.displacement, " m: the two answers are on different branches of equilibria, or the edges are too long");
    first += rod.vertices();
    fine_first += rod.vertices() + rod.edges();
  }
  if (coarse.load_factor != fine.load_factor)
    out.none = text("the two answers end at different load factors, ", exactly(coarse.load_factor), " and ", exactly(fine.load_factor));
  out.energy = coarse.energy;
  for (const auto &[name, member] : energies) out.energy_error.*member = (coarse.energy.*member - fine.energy.*member) * 4 / 3;
  return out;
}

std::vector<std::string> describe(const Estimate &e, const Scene &scene) {
  if (!e.none.empty()) return {"no estimate: " + e.none};
  const RodEstimate &worst = e.rods[e.worstRod()];
  std::vector<std::string> lines{text("estimated error: position ", worst.error, " m, ", worst.error / worst.length, " of the length of rod '", scene.rods[e.worstRod()].name,
                                      "' (vertex ", worst.vertex, ")")};
  std::string line;
  for (const auto &[name, member] : energies)
    if (e.energy.*member != 0)
      line += (line.empty() ? "" : ", ") + std::string(name) + " energy " + text(std::abs(e.energy_error.*member), " of ") + exactly(e.energy.*member) + " J";
  if (!line.empty()) lines.push_back("estimated error: " + line);
  if (e.tan) lines.push_back("measure tan: the estimate holds, but its series has more terms than that of measure angle, with which the extrapolated positions are much closer");
  return lines;
}

std::vector<std::string> describeCritical(const std::vector<double> &coarse, const std::vector<double> &fine) {
  if (coarse.size() != fine.size()) return {text("no estimate of critical load factors: ", coarse.size(), " were found, and ", fine.size(), " with half the edges' lengths")};
  std::vector<std::string> lines;
  for (std::size_t k = 0; k < coarse.size(); ++k)
    lines.push_back(text("estimated error: critical load factor ", std::abs(fine[k] - coarse[k]) * 4 / 3, ", extrapolated ", exactly(fine[k] + (fine[k] - coarse[k]) / 3)));
  return lines;
}

void writeEstimate(const std::string &path, const Estimate &e) {
  Hdf5File file = Hdf5File::reopen(path);
  file.createGroup("estimate");
  file.writeAttribute("estimate", "valid", int(e.none.empty()));
  if (!e.none.empty()) return file.writeAttribute("estimate", "reason", e.none);
  const hsize_t n = e.position.size();
  file.write("estimate/position", {n, 3}, e.position[0].data());
  file.write("estimate/error", {n}, e.error.data());
  const RodEstimate &worst = e.rods[e.worstRod()];
  file.writeAttribute("estimate", "position_error", worst.error);
  file.writeAttribute("estimate", "relative_position_error", worst.error / worst.length);
  for (const auto &[name, member] : energies) file.writeAttribute("estimate", std::string(name) + "_energy_error", std::abs(e.energy_error.*member));
}

std::optional<double> accumulatedTimeError(const Diagnostics &row) {
  const auto &names = Diagnostics::names();
  const auto found = std::find(names.begin(), names.end(), "error_estimate");
  if (found == names.end()) return std::nullopt;
  return row.values()[std::size_t(found - names.begin())];
}

void writeTimeError(const std::string &path, double error) {
  Hdf5File file = Hdf5File::reopen(path);
  file.createGroup("estimate");
  file.writeAttribute("estimate", "time_error", error);
}

} // namespace tendril
