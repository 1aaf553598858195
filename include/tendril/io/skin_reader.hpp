#pragma once
/// \file skin_reader.hpp
/// The skins of rods. \throws SceneError

#include "tendril/io/scene_reader.hpp"
#include "tendril/io/yaml.hpp"

namespace tendril {

/// What a block of rods says of their skin; an empty recipe where it says nothing. \param shapes of the block
SkinRecipe readSkin(YamlMap &rod, int shapes, const Material &material);
/// Gives it to a rod that is drawn. \param shift of the rod from where its block has drawn it [m]
void putSkin(YamlMap &map, const SkinRecipe &skin, const Vec3 &shift, Rod &rod, SceneFile &out);
/// Gives it one that a file has for it as it is drawn.
void giveSkin(const YamlMap &map, const std::shared_ptr<const Skin> &skin, Rod &rod, SceneFile &out);

} // namespace tendril
