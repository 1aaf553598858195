#pragma once
/// \file collider_reader.hpp
/// Obstacles, and how rods touch them. \throws SceneError

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Turns the axis of a shape, z, to a unit vector.
Mat3 turnTo(const Vec3 &axis);
/// The axis that a key gives, of unit length.
Vec3 axisOf(YamlMap &map, KeyOf<KeyType::vector> key);

/// The block of the scene; what it does not say is NaN.
ContactSettings readContact(YamlMap &scene);
/// What the block of a rod says.
void readContact(YamlMap &rod, ContactSettings &settings);
void readCollider(const YamlValue &value, Scene &scene);
/// Which rods pass which colliders, when both are there.
void readIgnored(YamlMap &scene, SceneFile &out);
/// What no key says, and what options say instead. \param colliders for messages
void completeContact(const YamlValue &colliders, const Overrides &overrides, Scene &scene);

} // namespace tendril
