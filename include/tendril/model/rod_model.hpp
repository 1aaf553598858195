#pragma once
/// \file rod_model.hpp
/// How much of a rod is modelled: unknowns that a scene does not need are left out, and nothing else changes.

#include <string>
#include <vector>

namespace tendril {

struct Rod;
struct Scene;

/// Unknowns of a rod, from few to all.
///   cable         positions alone; it neither bends nor twists
///   planar        positions in a coordinate plane: two for a vertex, no twist
///   torsion_free  positions and bending; no twist: of an isotropic rod, straight when stress-free, that nothing twists
///   full          positions and twist
enum class RodModel { cable, planar, torsion_free, full };
inline constexpr const char *rod_model_names[] = {"cable", "planar", "torsion_free", "full"};
inline const char *nameOf(RodModel model) { return rod_model_names[int(model)]; }

/// Gives every rod that asks for it the smallest model that is proven, refuses models that are not, and lays planar
/// rods into their planes to the last bit. \param dynamic whether inertia counts \param watched whether planar rods
/// that chose to be so are watched (PlaneWatch); else none does \param notes what was chosen, and why
/// \throws SceneError
void settleModels(Scene &scene, bool dynamic, bool watched, std::vector<std::string> *notes);
/// Makes a rod a full one, with what its model left out.
void giveAllUnknowns(Rod &rod);
/// Lays a planar rod into its plane.
void flatten(Rod &rod);

} // namespace tendril
