#include "tendril/accuracy/estimate.hpp"

#include "tendril/dynamics/prolong.hpp"
#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace tendril {
namespace {

/// Above this part of the largest displacement, a difference is not an error of discretisation.
constexpr double most_difference = 0.3;
/// Differences below this part of the length tell nothing about branches, whatever the displacement: Newton's tolerance
/// may leave as much.
constexpr double least_difference = 1e-6;

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

double lengthOf(const Rod &rod) {
  double length = 0;
  for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
  return length;
}

Answer answerOf(const Simulation &run, double rounding_error, std::vector<double> critical) {
  return {true,
          "",
          run.state.time,
          run.state.position,
          energyBudget(run.scene, *run.elements, run.state, run.state.time),
          std::move(critical),
          rounding_error};
}

PetscErrorCode solveStatics(Simulation &run, Scene scene, const LoopSettings &settings, Answer *answer) {
  PetscFunctionBeginUser;
  PetscCall(run.setUp(std::move(scene), settings));
  TimeLoop loop(run.solver, settings);
  std::vector<double> critical;
  loop.on_critical = [&](const CriticalPoint &point) {
    critical.push_back(point.load_factor);
    return PetscErrorCode(0);
  };
  bool found;
  double rounding_error = 0;
  PetscCall(loop.run(
      run.state,
      [&](const State &, const Diagnostics &row) {
        rounding_error = row.rounding_error;
        return PetscErrorCode(0);
      },
      &found));
  *answer = answerOf(run, rounding_error, std::move(critical));
  answer->found = found;
  answer->failure = loop.failure();
  PetscFunctionReturn(0);
}

/// One step without a load step, from the answer of `run` on its edges cut in two.
static PetscErrorCode solveFrom(const Simulation &run, const Scene &scene, const LoopSettings &settings,
                                Answer *answer) {
  Simulation fine;
  NewtonReport report;
  PetscFunctionBeginUser;
  PetscCall(fine.setUp(scene, settings));
  fine.state = prolonged(run.state, run.scene, *run.elements, fine.scene, *fine.elements);
  PetscCall(fine.solver.solve(fine.state, TimeLoop::stepOf(settings, fine.state, 0), &report));
  if (report.converged) {
    fine.potential->commit(fine.state);
    *answer = answerOf(fine, report.rounding_error);
  } else
    answer->failure = report.reason;
  PetscFunctionReturn(0);
}

PetscErrorCode estimateError(const Simulation &run, double rounding_error, const std::vector<double> &critical,
                             const Scene &scene, const LoopSettings &settings, Estimate *estimate) {
  PetscFunctionBeginUser;
  const Answer coarse = answerOf(run, rounding_error, critical);
  Answer fine;
  const Doing here([](std::ostream &out) { out << "error estimate, with half the edges' lengths"; });
  estimate->none = "the run ended before its full load";
  if (coarse.load_factor == settings.t_end) {
    PetscCall(solveFrom(run, scene, settings, &fine));
    estimate->none = fine.failure;
    if (fine.found) *estimate = richardson(run.scene, coarse, fine);
    if (estimate->none.empty() && critical.empty()) PetscFunctionReturn(0);
  }
  Simulation path;
  PetscCall(solveStatics(path, scene, settings, &fine));
  if (!fine.found) {
    (estimate->none.empty() ? estimate->no_critical : estimate->none) = "with half the edges' lengths, " + fine.failure;
    PetscFunctionReturn(0);
  }
  if (!estimate->none.empty()) *estimate = richardson(run.scene, coarse, fine);
  if (fine.critical.size() != critical.size())
    estimate->no_critical =
        text(critical.size(), " were found, ", fine.critical.size(), " with half the edges' lengths");
  else
    for (std::size_t k = 0; k < critical.size(); ++k) {
      estimate->critical.push_back(fine.critical[k] + (fine.critical[k] - critical[k]) / 3);
      estimate->critical_error.push_back(std::abs(fine.critical[k] - critical[k]) * 4 / 3);
    }
  PetscFunctionReturn(0);
}

int Estimate::worstRod() const {
  return int(std::max_element(
                 rods.begin(), rods.end(),
                 [](const RodEstimate &a, const RodEstimate &b) { return a.error / a.length < b.error / b.length; }) -
             rods.begin());
}

Estimate richardson(const Scene &scene, const Answer &coarse, const Answer &fine) {
  Estimate out;
  std::size_t first = 0, fine_first = 0; // vertices of the rod
  const double rounding_error = coarse.rounding_error + fine.rounding_error;
  for (const Rod &rod : scene.rods) {
    RodEstimate &r = out.rods.emplace_back();
    out.tan = out.tan || rod.measure == Measure::tan;
    r.length = lengthOf(rod);
    for (int v = 0; v < rod.vertices(); ++v) {
      const Vec3 &a = coarse.position[first + v], &b = fine.position[fine_first + 2 * v];
      const double error = std::max((b - a).norm() * 4 / 3, rounding_error * r.length);
      out.position.push_back(b + (b - a) / 3);
      out.error.push_back(error);
      r.displacement = std::max(r.displacement, (a - rod.position[v]).norm());
      if (error > r.error) r.vertex = v;
      r.error = std::max(r.error, error);
      r.tip = error;
    }
    if (out.none.empty() && r.error > std::max(most_difference * r.displacement, least_difference * r.length))
      out.none = text("rod '", rod.name, "' differs between ", rod.edges(), " and ", 2 * rod.edges(), " edges by ",
                      r.error * 3 / 4, " m where its largest displacement is ", r.displacement,
                      " m: the two answers are on different branches of equilibria, or the edges are too long");
    first += rod.vertices();
    fine_first += rod.vertices() + rod.edges();
  }
  if (coarse.load_factor != fine.load_factor)
    out.none = text("the two answers end at different load factors, ", exactly(coarse.load_factor), " and ",
                    exactly(fine.load_factor));
  out.energy = coarse.energy;
  for (const auto &[name, member] : estimated_energies)
    out.energy_error.*member = (coarse.energy.*member - fine.energy.*member) * 4 / 3;
  return out;
}

std::vector<std::string> describe(const Estimate &e, const Scene &scene) {
  std::vector<std::string> lines;
  if (e.none.empty()) {
    const RodEstimate &worst = e.rods[e.worstRod()];
    lines.push_back(text("estimated error: position ", worst.error, " m, ", worst.error / worst.length,
                         " of the length of rod '", scene.rods[e.worstRod()].name, "' (vertex ", worst.vertex, ")"));
    std::string line;
    for (const auto &[name, member] : estimated_energies)
      if (e.energy.*member != 0)
        line += (line.empty() ? "" : ", ") + text(name, " energy ", std::abs(e.energy_error.*member), " of ") +
                exactly(e.energy.*member) + " J";
    if (!line.empty()) lines.push_back("estimated error: " + line);
    if (e.tan)
      lines.push_back("measure tan: the estimate holds, but its series has more terms than that of measure angle, with "
                      "which the extrapolated positions are closer");
  } else
    lines.push_back("no estimate: " + e.none);
  for (std::size_t k = 0; k < e.critical.size(); ++k)
    lines.push_back(text("estimated error: critical load factor ", e.critical_error[k], ", extrapolated ") +
                    exactly(e.critical[k]));
  if (!e.no_critical.empty()) lines.push_back("no estimate of critical load factors: " + e.no_critical);
  return lines;
}

} // namespace tendril
