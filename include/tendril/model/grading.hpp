#pragma once
/// \file grading.hpp
/// Where the vertices of a rod stand on the curve it was drawn along: close where it bends strongly, by one map for any
/// number of edges.

#include "tendril/model/polyline.hpp"
#include "tendril/model/scene.hpp"

namespace tendril {

/// Vertex i of n stands at place i/n. Twice the edges halve every edge in the place, so errors keep their series in
/// h^2.
///
/// An edge of length h is off its arc by h^3 x'''/24, and |x'''| is kappa^2 on an arc. The sum of h^2 kappa^2 over the
/// length is least, for a given number of edges, where their density goes with kappa^(2/3): then every edge has the
/// same part of it (de Boor, *Good approximation by splines with variable knots*, 1973). What a load bends the drawing
/// does not tell: (kappa^2 + (10/L)^2)^(1/3), so that a straight part of a rod of length L has edges too. From one to
/// the next, edges grow by at most 1.5 at the first number of edges (Borouchaki, Hecht, Frey, *Mesh gradation control*,
/// 1998), and the less the more there are; across places that stay by 1.2 more, or whatever whole numbers leave.
struct Grading {
  std::vector<double> place;     ///< rising from 0 to 1; linear between
  std::vector<double> parameter; ///< of the curve there, 0 to 1; vertex i of the rod as written is at i/edges
  std::vector<double> length;    ///< along the curve [m]
  std::vector<std::pair<int, int>>
      stays;            ///< vertices as written that are vertices again, with their place as a part of `multiple`
  int multiple = 1;     ///< of which the number of edges must be one
  double turning = 0;   ///< of the tangent from end to end, corners left out, or of given directors [rad]
  bool uniform = false; ///< in the parameter, to 1 %, were it not for the places that stay

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
