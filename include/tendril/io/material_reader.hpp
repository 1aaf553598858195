#pragma once
/// \file material_reader.hpp
/// The material of a rod from its block in the scene and from -rod_<parameter>.

#include "tendril/io/yaml.hpp"

#include <map>

namespace tendril {

/// Parameter name -> text, from the command line; they replace what the scene says of every rod.
using Overrides = std::map<std::string, std::string>;

/// Keys that an option -rod_<key> may override.
std::vector<const Key *> rodOverrides();

struct MaterialRead {
  Material material;
  std::string
      defaults; ///< a line that tells the parameters that nobody gave, with their values; empty where there are none
};

/// \param rod its block, which must have a material, or the word `default`, unless options give one
/// \throws SceneError
MaterialRead readMaterial(YamlMap &rod, const Overrides &overrides);

} // namespace tendril
