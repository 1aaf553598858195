#include "tendril/io/accuracy.hpp"

#include <algorithm>
#include <iomanip>
#include <map>
#include <sstream>

namespace tendril {
namespace {

constexpr int first_edges = 8;
constexpr double largest_turning = 30 * pi / 180; ///< per vertex, at first [rad]
constexpr double aim = 0.8, accept = 0.95;        ///< of the tolerance: an estimate is a few percent off itself
constexpr int most_rounds = 8;
constexpr double most_edges = 2e4; ///< of a rod: rounding grows with the fourth power of their number

std::string text(double value) {
  std::ostringstream s;
  s << std::setprecision(3) << value;
  return s.str();
}

int roundedUp(double edges, int multiple) { return multiple * std::max(1, int(std::ceil(edges / multiple * (1 - 1e-12)))); }

/// Edges enough to show the shape of a rod, as drawn and at rest.
int firstEdges(const Rod &rod, const Drawing &drawing, int multiple) {
  double length = 0;
  for (int i = 0; i < rod.edges(); ++i) length += rod.edge(i).norm();
  double turning = rod.natural == Rod::Natural::given ? rod.natural_strain.head<2>().norm() * length : 0;
  turning = std::max(turning, 2 * pi * std::abs(rod.initial_turns));
  if (drawing.grading)
    turning = std::max(turning, drawing.grading->turning);
  else if (drawing.curve) {
    const int samples = std::max(1000, 4 * rod.edges());
    double along = 0;
    Vec3 before = drawing.curve(1.0 / samples) - drawing.curve(0);
    for (int i = 1; i < samples; ++i) {
      const Vec3 e = drawing.curve((i + 1.0) / samples) - drawing.curve(double(i) / samples);
      along += std::atan2(before.cross(e).norm(), before.dot(e));
      before = e;
    }
    turning = std::max(turning, along);
  }
  return roundedUp(std::max<double>(first_edges, turning / largest_turning), multiple);
}

std::string nameOf(Quantity q) { return q == Quantity::tip ? "tip" : q == Quantity::energy ? "energy" : "position"; }

/// Rods of the same edges and errors, as copies are, share a line.
void tellChoice(const Scene &scene, const Accuracy &accuracy, Choice &choice) {
  constexpr std::size_t most_lines = 4;
  std::map<std::pair<int, std::string>, int> alike;
  std::vector<std::size_t> first; // of those alike
  for (std::size_t r = 0; r < scene.rods.size(); ++r)
    if (alike[{choice.edges[r], text(choice.error[r])}]++ == 0) first.push_back(r);
  for (std::size_t k = 0; k < std::min(first.size(), most_lines); ++k) {
    const std::size_t r = first[k];
    const int others = alike[{choice.edges[r], text(choice.error[r])}] - 1;
    choice.lines.push_back("accuracy: rod '" + scene.rods[r].name + "'" + (others > 0 ? " and " + std::to_string(others) + " like it" : "") + ": edges " +
                           std::to_string(choice.edges[r]) + " for " + text(accuracy.tolerance) + ": estimated error of the " + nameOf(accuracy.of) + " " +
                           text(choice.error[r]));
  }
  if (first.size() > most_lines)
    choice.lines.push_back("... and " + std::to_string(first.size() - most_lines) + " more kinds of rods; options.yaml has the edges of each");
}

/// What one round found.
struct Round {
  std::vector<double> error; ///< per rod
  std::string none;          ///< why there is no estimate
};

PetscErrorCode estimateAt(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings, const std::vector<int> &edges, Quantity of,
                          Round *round) {
  PetscFunctionBeginUser;
  std::vector<int> twice = edges;
  for (int &n : twice) n *= 2;
  Simulation run;
  Answer answer;
  PetscCall(solveStatics(run, redraw(scene, drawings, edges), settings, &answer));
  if (!answer.found) {
    round->none = answer.failure;
    PetscFunctionReturn(0);
  }
  Estimate e;
  PetscCall(estimateError(run, {}, redraw(scene, drawings, twice), settings, &e));
  round->none = e.none;
  if (!e.none.empty()) PetscFunctionReturn(0);
  for (const RodEstimate &r : e.rods)
    round->error.push_back(of == Quantity::energy ? (e.elasticError() > 0 ? e.elasticError() / e.elasticEnergy() : 0)
                                                  : (of == Quantity::tip ? r.tip : r.error) / r.length);
  PetscFunctionReturn(0);
}

} // namespace

PetscErrorCode chooseEdges(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings, const Accuracy &accuracy, Choice *choice) {
  PetscFunctionBeginUser;
  const std::size_t rods = scene.rods.size();
  std::vector<int> edges, multiple;
  for (std::size_t r = 0; r < rods; ++r) {
    multiple.push_back(edgeMultiple(scene, drawings[r], int(r)));
    edges.push_back(firstEdges(scene.rods[r], drawings[r], multiple[r]));
  }
  const std::string asked = "option -accuracy: an error of the " + nameOf(accuracy.of) + " below " + text(accuracy.tolerance);
  for (int round = 0; round < most_rounds; ++round) {
    if (*std::max_element(edges.begin(), edges.end()) > most_edges)
      throw SceneError(asked + " needs more than " + text(most_edges) + " edges a rod, which rounding forbids; write a larger tolerance");
    Round found;
    PetscCall(estimateAt(scene, drawings, settings, edges, accuracy.of, &found));
    double worst = 0;
    std::size_t where = 0;
    for (std::size_t r = 0; r < found.error.size(); ++r)
      if (found.error[r] > worst) worst = found.error[where = r];
    if (found.none.empty() && worst <= accept * accuracy.tolerance) {
      choice->edges = edges;
      choice->error = found.error;
      tellChoice(scene, accuracy, *choice);
      PetscFunctionReturn(0);
    }
    choice->lines.push_back("accuracy: tried " + std::to_string(edges[where]) + " edges of rod '" + scene.rods[where].name +
                            "': " + (found.none.empty() ? "estimated error of the " + nameOf(accuracy.of) + " " + text(worst) : found.none));
    for (std::size_t r = 0; r < rods; ++r) {
      if (!found.none.empty()) {
        edges[r] *= 2;
        continue;
      }
      if (found.error[r] <= accept * accuracy.tolerance) continue;
      const double factor = std::sqrt(found.error[r] / (aim * accuracy.tolerance));
      if (edges[r] * factor > 10 * most_edges)
        throw SceneError(asked + " needs about " + text(edges[r] * factor) + " edges of rod '" + scene.rods[r].name +
                         "', more than rounding allows; write a larger tolerance");
      // A first estimate may be far off: not more than 16 times as many at once.
      edges[r] = std::max(roundedUp(edges[r] * std::min(factor, 16.0), multiple[r]), edges[r] + multiple[r]);
    }
  }
  throw SceneError(asked + " was not reached: " + choice->lines.back().substr(std::string("accuracy: ").size()) + "; write a larger tolerance" +
                   (accuracy.tolerance < 1e-6 ? " or a smaller -snes_rtol" : ""));
}

} // namespace tendril
