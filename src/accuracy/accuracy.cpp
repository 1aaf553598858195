#include "tendril/accuracy/accuracy.hpp"

#include "tendril/model/alike.hpp"
#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <iomanip>
#include <map>
#include <sstream>

namespace tendril {

int roundedUp(double edges, int multiple) {
  return multiple * std::max(1, int(std::ceil(edges / multiple * (1 - 1e-12))));
}

std::string nameOf(Quantity q) { return q == Quantity::tip ? "tip" : q == Quantity::energy ? "energy" : "position"; }

std::string askedFor(const Accuracy &accuracy) {
  return "option -accuracy: an error of the " + nameOf(accuracy.of) + " below " + shortText(accuracy.tolerance);
}

void Choice::say(const std::string &line) {
  lines.push_back(line);
  if (tell) tell(line);
}

void Choice::sayEdges(const Scene &scene, const Accuracy &accuracy) {
  constexpr std::size_t most_lines = 4;
  auto errors = [&](std::size_t r) {
    return shortText(error[r]) + (step_error.empty() ? ""
                                                     : " (" + shortText(edge_error[r]) + " by the edges, " +
                                                           shortText(step_error[r]) + " by the steps)");
  };
  std::map<std::pair<int, std::string>, int> alike;
  std::vector<std::size_t> first; // of those alike
  for (std::size_t r = 0; r < scene.rods.size(); ++r)
    if (int &rods = alike[{edges[r], errors(r)}]; (rods += countOf(r)) == countOf(r)) first.push_back(r);
  for (std::size_t k = 0; k < std::min(first.size(), most_lines); ++k) {
    const std::size_t r = first[k];
    const int others = alike[{edges[r], errors(r)}] - 1;
    say("accuracy: rod '" + scene.rods[r].name + "'" +
        (others > 0 ? " and " + std::to_string(others) + " like it" : "") + ": edges " + std::to_string(edges[r]) +
        " for " + shortText(accuracy.tolerance) + ": estimated error of the " + nameOf(accuracy.of) + " " + errors(r));
  }
  if (first.size() > most_lines)
    say("... and " + std::to_string(first.size() - most_lines) +
        " more kinds of rods; options.yaml has the edges of each");
}

namespace {

constexpr int first_edges = 8;
constexpr double largest_turning = 30 * pi / 180; ///< per vertex, at first [rad]
constexpr double accept = 0.95;                   ///< of the tolerance
constexpr int most_rounds = 8;

/// Edges enough to show the shape of a rod, as drawn and at rest.
int firstEdges(const Rod &rod, const Drawing &drawing, int multiple) {
  double turning = rod.natural == Rod::Natural::given ? rod.natural_strain.head<2>().norm() * lengthOf(rod) : 0;
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

/// What one round found.
struct Round {
  std::vector<double> error; ///< per rod
  std::string none;          ///< why there is no estimate
};

PetscErrorCode estimateAt(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings,
                          const std::vector<int> &edges, Quantity of, Round *round) {
  PetscFunctionBeginUser;
  std::vector<int> twice = edges;
  for (int &n : twice) n *= 2;
  Simulation run;
  Answer answer;
  PetscCall(solveStatics(run, remesh(scene, drawings, edges), settings, &answer));
  if (!answer.found) {
    round->none = answer.failure;
    PetscFunctionReturn(0);
  }
  Estimate e;
  PetscCall(estimateError(run, answer.rounding_error, {}, remesh(scene, drawings, twice), settings, &e));
  round->none = e.none;
  if (!e.none.empty()) PetscFunctionReturn(0);
  for (const RodEstimate &r : e.rods)
    round->error.push_back(of == Quantity::energy ? (e.elasticError() > 0 ? e.elasticError() / e.elasticEnergy() : 0)
                                                  : (of == Quantity::tip ? r.tip : r.error) / r.length);
  PetscFunctionReturn(0);
}

} // namespace

std::vector<int> edgeMultiples(const Scene &scene, const std::vector<Drawing> &drawings) {
  std::vector<int> multiple;
  for (std::size_t r = 0; r < scene.rods.size(); ++r) multiple.push_back(edgeMultiple(scene, drawings[r], int(r)));
  return multiple;
}

std::vector<int> firstEdges(const Scene &scene, const std::vector<Drawing> &drawings,
                            const std::vector<int> &multiple) {
  std::vector<int> edges;
  for (std::size_t r = 0; r < scene.rods.size(); ++r)
    edges.push_back(firstEdges(scene.rods[r], drawings[r], multiple[r]));
  return edges;
}

PetscErrorCode chooseEdges(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings,
                           const Accuracy &accuracy, Choice *choice) {
  PetscFunctionBeginUser;
  choice->loop = settings;
  const std::size_t rods = scene.rods.size();
  const std::vector<int> multiple = edgeMultiples(scene, drawings);
  std::vector<int> edges = firstEdges(scene, drawings, multiple);
  const std::string asked = askedFor(accuracy);
  for (int round = 0; round < most_rounds; ++round) {
    if (*std::max_element(edges.begin(), edges.end()) > most_edges)
      throw SceneError(asked + " needs more than " + shortText(most_edges) +
                       " edges a rod, which rounding forbids; write a larger tolerance");
    Round found;
    const Doing here([&](std::ostream &out) {
      out << "accuracy, with " << edges[0] << " edges of rod '" << scene.rods[0].name << "'";
    });
    PetscCall(estimateAt(scene, drawings, settings, edges, accuracy.of, &found));
    double worst = 0;
    std::size_t where = 0;
    for (std::size_t r = 0; r < found.error.size(); ++r)
      if (found.error[r] > worst) worst = found.error[where = r];
    if (found.none.empty() && worst <= accept * accuracy.tolerance) {
      choice->edges = edges;
      choice->error = found.error;
      choice->sayEdges(scene, accuracy);
      PetscFunctionReturn(0);
    }
    choice->say(
        "accuracy: tried " + std::to_string(edges[where]) + " edges of rod '" + scene.rods[where].name + "': " +
        (found.none.empty() ? "estimated error of the " + nameOf(accuracy.of) + " " + shortText(worst) : found.none));
    for (std::size_t r = 0; r < rods; ++r) {
      if (!found.none.empty()) {
        edges[r] *= 2;
        continue;
      }
      if (found.error[r] <= accept * accuracy.tolerance) continue;
      const double factor = std::sqrt(found.error[r] / (aim * accuracy.tolerance));
      if (edges[r] * factor > 10 * most_edges)
        throw SceneError(asked + " needs about " + shortText(edges[r] * factor) + " edges of rod '" +
                         scene.rods[r].name + "', more than rounding allows; write a larger tolerance");
      // A first estimate may be far off: not more than 16 times as many at once.
      edges[r] = std::max(roundedUp(edges[r] * std::min(factor, 16.0), multiple[r]), edges[r] + multiple[r]);
    }
  }
  throw SceneError(asked + " was not reached: " + choice->lines.back().substr(std::string("accuracy: ").size()) +
                   "; write a larger tolerance" + (accuracy.tolerance < 1e-6 ? " or a smaller -snes_rtol" : ""));
}

PetscErrorCode chooseResolution(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings,
                                const Accuracy &accuracy, Choice *choice) {
  PetscFunctionBeginUser;
  const std::vector<int> first = firstAlike(scene, drawings);
  std::vector<int> kinds, kind_of(first.size()); // rods solved; which of them stands for each
  std::vector<Drawing> kept;
  choice->count.clear();
  const bool together =
      accuracy.of == Quantity::energy && std::any_of(first.begin(), first.end(), [](int r) { return r != 0; });
  for (int r = 0; r < int(first.size()); ++r) {
    const bool own = first[r] == r || together;
    kind_of[r] = own ? int(kinds.size()) : kind_of[first[r]];
    if (!own) {
      ++choice->count[kind_of[r]];
      continue;
    }
    kinds.push_back(r);
    kept.push_back(drawings[r]);
    choice->count.push_back(1);
  }
  PetscCall(
      (settings.dynamic ? chooseEdgesAndSteps : chooseEdges)(withRods(scene, kinds), kept, settings, accuracy, choice));
  auto expand = [&](auto &values) {
    auto all = values;
    all.clear();
    for (std::size_t r = 0; r < first.size() && !values.empty(); ++r) all.push_back(values[kind_of[r]]);
    values = all;
  };
  expand(choice->edges);
  expand(choice->error);
  expand(choice->edge_error);
  expand(choice->step_error);
  choice->count.clear();
  PetscFunctionReturn(0);
}

} // namespace tendril
