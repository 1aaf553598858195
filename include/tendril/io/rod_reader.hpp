#pragma once
/// \file rod_reader.hpp
/// Rods from a scene file. \throws SceneError

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Of all blocks of rods.
struct RodBlocks {
  double vertices = 0;
  ContactSettings contact; ///< what the scene says of it
  std::map<std::string, std::vector<std::string>>
      defaults; ///< names of the blocks that take the same parameters by default
};
/// Adds the rods of a block of `rods` to the scene.
void readRod(const YamlValue &value, const Overrides &overrides, SceneFile &out, RodBlocks &sums);

} // namespace tendril
