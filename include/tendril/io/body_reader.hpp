#pragma once
/// \file body_reader.hpp
/// Rigid bodies, what ties rods to them, and joints between them, from a scene file. \throws SceneError

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// Adds what a block of `bodies` says to the scene. \param contact of the scene
void readBody(const YamlValue &value, const ContactSettings &contact, SceneFile &out);
/// The body that the key of a constraint names.
SceneFile::BodyPlace findBody(const YamlValue &value, const SceneFile &file);
/// Adds what a block of `joints` says to the scene, whose bodies are there.
void readJoint(const YamlValue &value, SceneFile &out);
/// Adds the exact ties that a block of `constraints` says: it has a `body` and no stiffness, or is of `type: weld`.
/// Bodies and supports are there. \param name of the block
void readAttachments(YamlMap &map, const std::string &name, SceneFile &out);

} // namespace tendril
