#pragma once
/// \file accuracy.hpp
/// The edges that a static answer needs for its estimated error to be below a tolerance.

#include "tendril/io/estimate.hpp"

namespace tendril {

/// Whose error: of the tip of each rod, over its length; of any vertex, over its rod's length; of the elastic energy, relative.
enum class Quantity { tip, position, energy };

struct Accuracy {
  double tolerance;
  Quantity of = Quantity::position;
};

struct Choice {
  std::vector<int> edges;         ///< per rod
  std::vector<double> error;      ///< estimated, per rod; of the energy that of all rods
  std::vector<std::string> lines; ///< what was tried and chosen, for the user
};

/// Begins with 8 edges, or as many as make no vertex turn by more than 30 degrees, predicts from the second order of the error how many are needed,
/// and confirms it by another estimate; rods are chosen for one by one, unless the energy of all is asked for.
/// \throws SceneError when the tolerance is not reached
PetscErrorCode chooseEdges(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings, const Accuracy &accuracy, Choice *choice);

} // namespace tendril
