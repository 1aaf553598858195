#pragma once
/// \file support_reader.hpp
/// What holds and pulls rods, from a scene file.

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Of length one. \throws SceneError for zero
Vec3 unit(const YamlValue &value);
/// Adds what a block of `supports`, `constraints` or `loads` says to the scene, whose rods are there; constraints come
/// behind supports. \throws SceneError
void readSupport(const YamlValue &value, SceneFile &out);
void readConstraint(const YamlValue &value, SceneFile &out);
void readLoad(const YamlValue &value, SceneFile &out);

/// A name of one line.
std::string readName(const YamlValue &value);
/// Rods that a block speaks of: a name, a number, or `all`.
std::vector<int> readTargets(YamlMap &map, KeyOf<KeyType::rod> key, const RodNames &rods);
/// \param count of vertices or edges of the rod
int readIndex(YamlMap &map, KeyOf<KeyType::index> key, int count, const std::string &rod);
struct MotionKeys {
  KeyOf<KeyType::map, KeyType::list, KeyType::word_or_map> motion;
  KeyOf<KeyType::vector> velocity, angular_velocity, amplitude;
  KeyOf<KeyType::number> period;
  KeyOf<KeyType::rows> table;
};
Motion readMotion(const YamlValue &value, const MotionKeys &keys);
/// Refuses what a thing that only moves, or only turns, cannot follow. \param advice what to write instead
void refuseTurning(const YamlValue &motion, const Motion &m, const std::string &advice);
void refuseTravel(const YamlValue &motion, const Motion &m, const std::string &advice);

} // namespace tendril
