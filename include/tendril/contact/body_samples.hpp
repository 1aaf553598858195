#pragma once
/// \file body_samples.hpp
/// Surfaces of rigid bodies: samples of them, the solid within, and what presses on them.

#include "tendril/layout/elements.hpp"

namespace tendril {

/// A ball that is part of the body, or a point of its surface where the radius is zero.
struct BodySample {
  Vec3 arm; ///< from the centre of mass to its middle, as drawn [m]
  double radius = 0;
};

/// Of a sphere one, of a capsule a row of them along its axis; corners, edges and faces of a box, rims, flanks and ends
/// of a cylinder, vertices and middles of the triangles of a mesh. Between them less than a quarter of the longest
/// side, or of a rim a 48th; obstacles that are smaller may pass. \param centre of mass [m]
std::vector<BodySample> surfaceSamples(const Body &body, const Vec3 &centre);
/// In the axes of the body; null where it has no shape.
std::shared_ptr<const Shape> solidOf(const Body &body);
/// Loads on a body [N]: its weight, force, and couple over its size.
double loadOn(const Scene &scene, const Elements &elements, int body);
/// What a sample of its surface bears where surfaces touch [N]: what is given, or its loads, or a part of what stops it
/// at its first velocity or that of an obstacle.
double pressOn(const Scene &scene, const Elements &elements, int body);

} // namespace tendril
