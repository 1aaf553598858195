#pragma once
/// \file junction_reader.hpp
/// Junctions of rods, from a scene file.

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Adds what a block of `junctions` says to the scene, whose rods and supports are there. \throws SceneError
void readJunction(const YamlValue &value, SceneFile &out);

} // namespace tendril
