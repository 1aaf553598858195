#pragma once
/// \file embedding.hpp
/// How surfaces go with rods: tubes about them, and meshes whose points are carried by the edges beside them
/// (docs/theory.md, Skins).

#include "tendril/model/scene.hpp"

namespace tendril {

/// A tube about a rod as drawn: of n edges and S sides, S (n + 2) + 2 points and 2 S (n + 2) triangles with its caps,
/// or S n and 2 S n about a ring.
Skin tubeAbout(const Rod &rod, const SkinRecipe::Tube &tube);
/// A mesh about a rod as drawn. A point is at a part of the nearest edge, between the planes that halve the angles with
/// its neighbours. It is carried by that edge (1), by the two whose middles are on both sides of it, linear from one to
/// the other (2), or by three with the weights of a quadratic B-spline; beyond the ends by the last edge alone. Near in
/// space counts once only: the rest goes along the rod.
Skin embedded(const Rod &rod, const TriangleMesh &mesh, int edges);
/// All of a rod; nothing where it has none.
Skin skinOf(const Rod &rod);

/// Where a point of a skin is on the rod as drawn [m].
Vec3 placeOf(const Rod &rod, const SkinPoint &point);

/// A point of a surface with its part of the area.
struct SkinSample {
  SkinPoint point; ///< carried by no more than two edges
  double area;     ///< as drawn [m^2]
};
/// Points of the triangles by which a surface is integrated, each carried by itself by those edges that carry the
/// corners: 1 (the middle), 3 (of degree 2) or 6 of each (of degree 4; D. A. Dunavant, High degree efficient
/// symmetrical Gaussian quadrature rules for the triangle, Int. J. Numer. Meth. Eng. 21, 1985). Or the corners as they
/// are, each with a third of its triangles. In the order of their first edges.
/// \param points of a triangle, or ContactSettings::corners \param edges most that carry a point, 1 or 2
std::vector<SkinSample> skinSamples(const Rod &rod, const Skin &skin, int points, int edges);

/// Area [m^2] of a skin as drawn, the volume in it where it is closed [m^3], and the longest side of a triangle [m].
struct SkinMeasure {
  double area = 0, volume = 0, side = 0;
};
SkinMeasure measureOf(const Rod &rod, const Skin &skin);
/// Area over the length of the rod: the mean of its perimeters [m].
double perimeterOf(const Rod &rod, const Skin &skin);
/// Throws std::invalid_argument that says what is wrong with a surface that is not closed, or inside out.
void checkClosed(const Rod &rod, const Skin &skin);
/// Which of some places are in a closed skin as drawn.
std::vector<bool> isInside(const Rod &rod, const Skin &skin, const std::vector<Vec3> &places);
/// Largest turn of the tangents of two edges that carry one point, as drawn [rad]; linear weights shrink the section
/// there by the cosine of its half.
double widestTurn(const Rod &rod, const Skin &skin);
/// Largest distance of points from the axis, across it, over the middle one.
double farthestOverMedian(const Skin &skin);

} // namespace tendril
