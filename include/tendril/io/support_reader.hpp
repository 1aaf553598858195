#pragma once
/// \file support_reader.hpp
/// What holds and pulls rods, from a scene file.

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Of length one. \throws SceneError for zero
Vec3 unit(const YamlValue &value);
/// Adds what a block of `supports` or `loads` says to the scene, whose rods are there. \throws SceneError
void readSupport(const YamlValue &value, SceneFile &out);
void readLoad(const YamlValue &value, SceneFile &out);

} // namespace tendril
