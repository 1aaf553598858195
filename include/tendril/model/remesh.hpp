#pragma once
/// \file remesh.hpp
/// The same scene with another number of edges: what is compared to estimate an error must be one problem, at two
/// resolutions. Everything keeps its place up to terms that go with the square of the edge length, by the same law at
/// every resolution, so that the error does too.

#include "tendril/model/grading.hpp"

#include <memory>

namespace tendril {

/// How a rod was drawn, so that it can be drawn again.
struct Drawing {
  Curve curve;                  ///< of `line`, `ring` and `helix`; empty: the curve through its points
  bool directors_given = false; ///< one for each edge; otherwise they are Bishop frames
  std::shared_ptr<const Grading> grading =
      nullptr;            ///< of its vertices along the curve; empty: uniform in the parameter
  double least_edges = 1; ///< with fewer, it would be another curve
};

/// A curve through the vertices of a rod, where the vertices are those of i/edges: on each edge the cubic through four
/// neighbouring points over the length along the polyline. Midpoints on it are off a smooth curve by the fourth power
/// of the edge length, those on straight edges by the second, the size of the error that is to be estimated. Vertices
/// where the polyline turns by more than 30 degrees are corners, which stay: no cubic passes them, and an edge between
/// two is straight.
Curve curveThrough(const Rod &rod);

/// A curve through the vertices of a rod that has a curvature everywhere but at corners: the cubic spline between
/// corners (splineSlopes). On curves by curveThrough the tangent jumps at a point by the third power of the distance of
/// points; vertices that no longer stand on the points would see it.
Curve splineThrough(const Rod &rod);

/// Grades the rods by the curvature of their drawing (gradingByCurvature), named vertices and corners staying vertices.
/// What is straight or bends the same everywhere along its parameter stays uniform, unless named vertices ask there for
/// multiples of more than 8 edges.
void grade(const Scene &scene, std::vector<Drawing> &drawings);

/// The number of edges of a rod must be a multiple of this for every vertex that a support or load names, and every
/// corner (every point, where nothing is graded), to be a vertex again.
int edgeMultiple(const Scene &scene, const Drawing &drawing, int rod);

/// The scene with rods of other numbers of edges.
/// - Vertex i of n moves to i m/n of m, or where the grading has it, with its supports and forces; frames of supports
/// that the scene did not give are
///   those of the new rod.
/// - Bishop frames begin with the director of the scene's first edge, carried to the new one; given directors turn
/// evenly between edges.
/// - A couple on the end edge of an end that is free to turn is an end couple and stays on the end edge. Others act at
/// the middle of their edge: four
///   edges share them by cubic weights. Fewer edges, or positive weights, would spread them, which shifts a rod by the
///   square of the edge length anew.
/// \param edges per rod, multiples of edgeMultiple
/// \throws SceneError naming the rod that cannot be drawn so
Scene remesh(const Scene &scene, const std::vector<Drawing> &drawings, const std::vector<int> &edges);

/// `factor` times the edges of a scene.
std::vector<int> edgesOf(const Scene &scene, int factor = 1);

} // namespace tendril
