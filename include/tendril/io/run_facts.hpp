#pragma once
/// \file run_facts.hpp
/// What a restart compares with the run that wrote the checkpoint.

#include "tendril/dynamics/simulation.hpp"

#include <map>

namespace tendril {

/// A run by what a restart compares: what is other is told, and another topology is refused.
struct RunFacts {
  enum class Kind { option, load, scene, start };
  struct Fact {
    Kind kind;
    std::string name, value; ///< a value that begins with # stands for something long, by its hash
  };
  bool dynamic = true;
  std::string integrator;
  double dt = 0;           ///< as asked for [s, or load factor]
  std::vector<Fact> facts; ///< options, loads, supports, materials, laws and shapes
  std::string topology_hash,
      scene_hash; ///< of vertices, edges and closedness of all rods; of the text of the scene and its files

  RunFacts() = default;
  /// \param text of the scene and the files it names
  RunFacts(const Scene &scene, const LoopSettings &settings, const std::string &text = "");
};

/// Facts as lines of a text, as checkpoints keep them.
std::string textOf(const std::vector<RunFacts::Fact> &facts);
using FactValues = std::map<std::pair<std::string, std::string>, std::string>; ///< by kind and name
FactValues factsOf(const std::string &text);
/// Whether both have the same rods, but not in the same order.
bool areInAnotherOrder(const FactValues &before, const FactValues &now);
/// Lines on what is other; the furthest kind of it: 0 for options and nothing, 1 for loads, 2 for anything else.
int compareFacts(const FactValues &before, const FactValues &now, bool options, std::vector<std::string> *told);

} // namespace tendril
