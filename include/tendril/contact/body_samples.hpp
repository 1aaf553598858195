#pragma once
/// \file body_samples.hpp
/// Samples of the surfaces of rigid bodies, where they touch obstacles.

#include "tendril/model/body.hpp"

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

} // namespace tendril
