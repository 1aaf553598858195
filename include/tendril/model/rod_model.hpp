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

/// Why a model would leave out what acts on a rod, or what it answers with, as the end of a sentence; empty where its
/// answers are those of `full`. A planar rod stays in its plane until it buckles out of it.
/// \param dynamic whether inertia counts
std::string whyNot(const Scene &scene, int rod, RodModel model, bool dynamic);

/// The coordinate in which all vertices of a rod agree, 0 to 2, of which most others are at rest; -1: none.
int flatCoordinate(const Scene &scene, int rod);

/// Gives every rod that asks for it the smallest model that is proven, refuses models that are not, and lays planar
/// rods into their planes to the last bit. \param watched whether planar rods that chose to be so are watched
/// (PlaneWatch); else none does \param notes what was chosen, and why \throws SceneError
void settleModels(Scene &scene, bool dynamic, bool watched, std::vector<std::string> *notes);
/// Lays a planar rod into its plane.
void flatten(Rod &rod);

} // namespace tendril
