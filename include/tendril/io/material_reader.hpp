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

/// \throws SceneError
Material readMaterial(YamlMap &map, const Overrides &overrides);

} // namespace tendril
