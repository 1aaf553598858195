#pragma once
/// \file rod_names.hpp
/// Words of scenes and options that mean rods.

#include "tendril/model/scene.hpp"

#include <unordered_map>

namespace tendril {

/// Finds rods by a name, which is also that of all rods of its block, a number from 0, or `all`.
class RodNames {
public:
  RodNames() = default;
  explicit RodNames(const std::vector<Rod> &rods) {
    for (const Rod &rod : rods) add(rod.name);
  }
  /// Adds the next rod. Rods of one block of the scene share its name and add a number, behind a point or a `#`.
  void add(const std::string &name);
  int count() const { return count_; }
  /// Whether a rod or a block has this name.
  bool isTaken(const std::string &name) const { return rods_.count(name) > 0; }
  /// Empty where the word means none.
  std::vector<int> find(const std::string &word) const;

private:
  int count_ = 0;
  std::unordered_map<std::string, std::vector<int>> rods_; ///< by their names and those of their blocks
};

} // namespace tendril
