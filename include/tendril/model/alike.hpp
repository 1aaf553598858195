#pragma once
/// \file alike.hpp
/// Rods that do the same, as copies do: what is found out for one of them holds for all.

#include "tendril/model/remesh.hpp"

namespace tendril {

/// For each rod the first one of which it is a shifted copy: with the same shape, material, supports and loads. In a
/// frame that turns, its own number.
std::vector<int> firstAlike(const Scene &scene, const std::vector<Drawing> &drawings);

} // namespace tendril
