#pragma once
/// \file redraw.hpp
/// The same scene with another number of edges: what is compared to estimate an error must be one problem, at two resolutions. Everything keeps its
/// place up to terms that go with the square of the edge length, by the same law at every resolution, so that the error does too.

#include "tendril/io/polyline_reader.hpp"
#include "tendril/model/scene.hpp"

namespace tendril {

/// How a rod was drawn, so that it can be drawn again.
struct Drawing {
  Curve curve;                  ///< of `line`, `ring` and `helix`; empty: the curve through its points
  bool directors_given = false; ///< one for each edge; otherwise they are Bishop frames
};

/// A curve through the vertices of a rod, where the vertices are those of i/edges: on each edge the cubic through four neighbouring points over the
/// length along the polyline. Midpoints on it are off a smooth curve by the fourth power of the edge length, those on straight edges by the second,
/// the size of the error that is to be estimated. Vertices where the polyline turns by more than 30 degrees are corners, which stay: no cubic passes
/// them, and an edge between two is straight.
Curve curveThrough(const Rod &rod);

/// The number of edges of a rod must be a multiple of this for every vertex that a support or load names, and every point, to be a vertex again.
int edgeMultiple(const Scene &scene, const Drawing &drawing, int rod);

/// The scene with rods of other numbers of edges.
/// - Vertex i of n moves to i m/n of m, with its supports and forces; frames of supports that the scene did not give are those of the new rod.
/// - Bishop frames begin with the director of the scene's first edge, carried to the new one; given directors turn evenly between edges.
/// - A couple on the end edge of an end that is free to turn is an end couple and stays on the end edge. Others act at the middle of their edge: four
///   edges share them by cubic weights. Fewer edges, or positive weights, would spread them, which shifts a rod by the square of the edge length anew.
/// \param edges per rod, multiples of edgeMultiple
/// \throws SceneError naming the rod that cannot be drawn so
Scene redraw(const Scene &scene, const std::vector<Drawing> &drawings, const std::vector<int> &edges);

/// `factor` times the edges of a scene.
std::vector<int> edgesOf(const Scene &scene, int factor = 1);

} // namespace tendril
