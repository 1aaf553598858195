#pragma once
/// \file accuracy.hpp
/// The edges, and in dynamics the steps, that a scene needs for its estimated error to be below a tolerance.

#include "tendril/accuracy/estimate.hpp"

#include <functional>

namespace tendril {

/// Whose error: of the tip of each rod, over its length; of any vertex, over its rod's length; of the elastic energy,
/// relative. In dynamics root mean squares over the time of the run; the energy's over the largest it comes to.
enum class Quantity { tip, position, energy };
std::string nameOf(Quantity quantity);

struct Accuracy {
  double tolerance;
  Quantity of = Quantity::position;
};

/// What was chosen, with what was tried on the way, for the user.
struct Choice {
  std::vector<int> edges;    ///< per rod
  std::vector<int> count;    ///< how many rods each stands for; one where empty
  std::vector<double> error; ///< estimated, per rod; of the energy that of all rods
  std::vector<double> edge_error,
      step_error;    ///< in dynamics those of the edges and the steps, per rod, that together make it
  LoopSettings loop; ///< settings of the run; in dynamics with the steps chosen
  std::vector<std::string> lines;
  std::function<void(const std::string &)> tell; ///< told of each line at once, where set

  void say(const std::string &line);
  /// Says the edges and errors chosen; rods of the same share a line.
  void sayEdges(const Scene &scene, const Accuracy &accuracy);
  /// How many rods this one stands for.
  int countOf(std::size_t rod) const { return count.empty() ? 1 : count[rod]; }
};

constexpr double aim = 0.8;        ///< of the tolerance: an estimate is a few percent off itself
constexpr double most_edges = 2e4; ///< of a rod: rounding grows with the fourth power of their number
int roundedUp(double edges, int multiple);
/// "option -accuracy: an error of the tip below 0.001"
std::string askedFor(const Accuracy &accuracy);
/// 8 edges of each rod, or as many as make no vertex turn by more than 30 degrees, as drawn and at rest. \param
/// multiple edgeMultiple of each
std::vector<int> firstEdges(const Scene &scene, const std::vector<Drawing> &drawings, const std::vector<int> &multiple);
std::vector<int> edgeMultiples(const Scene &scene, const std::vector<Drawing> &drawings);

/// Chooses for a scene in statics or dynamics; what holds for one rod holds for its copies, which are not solved again.
/// \throws SceneError when the tolerance is not reached
PetscErrorCode chooseResolution(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings,
                                const Accuracy &accuracy, Choice *choice);

/// Statics: begins with firstEdges, predicts from the second order of the error how many are needed, and confirms it by
/// another estimate; rods are chosen for one by one, unless the energy of all is asked for. \throws SceneError when the
/// tolerance is not reached
PetscErrorCode chooseEdges(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings,
                           const Accuracy &accuracy, Choice *choice);

/// Dynamics: also chooses `dt`, or `dt_rtol` and `dt_atol` of adapted steps. Runs the scene to its end at three numbers
/// of steps, doubled each time, and at three of edges; from the errors and the orders seen, predicts the cheapest pair
/// that meets the tolerance; and repeats that closer to it until the prediction is within the reach of the runs that it
/// rests on. \throws SceneError when the tolerance is not reached or the runs do not converge
PetscErrorCode chooseEdgesAndSteps(const Scene &scene, const std::vector<Drawing> &drawings,
                                   const LoopSettings &settings, const Accuracy &accuracy, Choice *choice);

} // namespace tendril
