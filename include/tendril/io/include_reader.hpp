#pragma once
/// \file include_reader.hpp
/// Scenes within scenes.

#include "tendril/io/scene_reader.hpp"

namespace tendril {

/// Turns a scene about the origin and moves it; gravity stays.
void place(Scene &scene, std::vector<Drawing> &drawings, const Mat3 &rotation, const Vec3 &translation);
/// Adds all of a scene behind another, its names behind a prefix.
/// \param where for messages \throws SceneError where both have the same name
void append(SceneFile part, const std::string &prefix, const YamlValue &where, SceneFile &out);

/// Adds rods for bodies that joints and tendons join, but no rod, and where there are no rods at all for every other:
/// bodies are solved with rods. Each is one edge without weight, which is held.
void carryBodies(SceneFile &out);

} // namespace tendril
