#pragma once
/// \file grading.hpp
/// Where the vertices of a rod stand on the curve it was drawn along: close where it bends strongly, by one map for any number of edges.

#include "tendril/io/polyline_reader.hpp"
#include "tendril/model/scene.hpp"

namespace tendril {

/// Vertex i of n stands at place i/n. Twice the edges halve every edge in the place, so errors keep their series in h^2.
///
/// Source of the density: an edge of length h is off its arc by h^3 x'''/24, and |x'''| is kappa^2 on an arc. The sum of h^2 kappa^2 over the length is
/// least, for a given number of edges, where their density goes with kappa^(2/3) (Euler-Lagrange; equidistribution after de Boor 1973). What a load bends
/// the drawing does not tell: (kappa^2 + (12/L)^2)^(1/3), so that a straight part has edges too. Edge lengths then grow by at most 1.2 from one to the
/// next at the first number of edges (Borouchaki, Hecht, Frey 1998), or more where places that stay leave no other choice.
struct Grading {
  std::vector<double> place;              ///< rising from 0 to 1; linear between
  std::vector<double> parameter;          ///< of the curve there, 0 to 1; vertex i of the rod as written is at i/edges
  std::vector<double> length;             ///< along the curve [m]
  std::vector<std::pair<int, int>> stays; ///< vertices as written that are vertices again, with their place as a part of `multiple`
  int multiple = 1;                       ///< of which the number of edges must be one
  double turning = 0;                     ///< of the tangent from end to end, corners left out [rad]
  bool uniform = false;                   ///< in the parameter, to 1 %, were it not for the places that stay

  double parameterAt(double place) const;
  double placeOf(double parameter) const;
  double lengthOf(double parameter) const;
  double parameterOf(double length) const;
  /// Length along the curve up to the middle of edge i of n; those of closed rods may be counted on beyond either end.
  double middle(int edge, int edges) const;
};

/// The polyline turns by more than 30 degrees at this vertex.
bool isCorner(const Rod &rod, int vertex);

/// Grading by the curvature of a rod as drawn.
/// \param curve that it was drawn along; empty: through its points, whose curvature is that of the polyline
/// \param named vertices that stay vertices besides ends and corners, in any order
Grading gradingByCurvature(const Rod &rod, const Curve &curve, const std::vector<int> &named);

} // namespace tendril
