#pragma once
/// \file tendon_reader.hpp
/// Tendons and their actuators from a scene file. \throws SceneError

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Adds what a block of `tendons` says to the scene, whose rods, bodies and joints are there.
void readTendon(const YamlValue &value, SceneFile &out);
/// Rows of time and value as the displacement along x of a motion.
Motion readProfile(const YamlValue &table);

} // namespace tendril
