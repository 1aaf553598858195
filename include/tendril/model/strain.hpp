#pragma once
/// \file strain.hpp
/// Strains of a rod: axial strain of an edge, bending and twist of a cell, which are the two edge frames that meet at a
/// vertex, or an edge and the fixed frame of a clamp (the half cell). Discrete curvature binormal after Bergou et al.,
/// "Discrete Elastic Rods" (2008), section 4.2. Numbers in brackets are of docs/theory.md.

#include "tendril/geometry/frame.hpp"

#include <array>

namespace tendril {

/// How an angle between neighbouring edges becomes a strain: `tan` is 2 tan(angle/2), a barrier at 180 degrees; `angle`
/// is the angle itself.
enum class Measure { tan, angle };

/// How stretch and bending go together: `seed` multiplies bending strains by the stretch, `classical` does not. Axial
/// strains: axialStrain.
enum class Energy { seed, classical };

/// Axial strain (2.1) of an edge: ((l/L)^2 - 1)/2 (`seed`; St. Venant-Kirchhoff in the Green-Lagrange strain) or l/L -
/// 1 (`classical`; Hooke), written so that small strains keep their digits. The stretch energy is 1/2 k strain^2 L.
template <class T> T axialStrain(Energy energy, const T &length, const T &inverse_rest_length) {
  if (energy == Energy::classical) return length * inverse_rest_length - T(1.0);
  return (length * inverse_rest_length - T(1.0)) * (length * inverse_rest_length + T(1.0)) * T(0.5);
}

/// L times the derivative of the axial strain by l^2/2 [1/m]: 1/L or 1/l.
template <class T> T strainSlope(Energy energy, const T &length, const T &inverse_rest_length) {
  return energy == Energy::classical ? T(T(1.0) / length) : inverse_rest_length;
}

/// Constants of one cell; `free[k]` is 1 where frame k belongs to an edge that moves and 0 for the frame of a clamp.
template <class T> struct CellOf {
  std::array<T, 3> stiffness; ///< (kb1, kb2, kt) / Lbar [N m]
  std::array<T, 3> rest;      ///< strains at which the energy vanishes, integrated over the cell [rad]
  T base; ///< factor of the bending strains = base + weight0 l0 + weight1 l1: lbar / Lbar (`seed`) or 1 (`classical`)
  std::array<T, 2> weight; ///< [1/m]
  std::array<T, 2> free;
  T winding; ///< 2 pi x whole turns in the twist angle (`angle` measure; 0 for `tan`) [rad]
  T sign;    ///< -1 when the number of whole turns is odd, else 1
};

/// phi(z) = atan(sqrt z)/sqrt z and two derivatives, z = tan^2 of half the turning angle: the factor between the two
/// measures of bending, (3.4).
template <class T> struct AngleFactor { T value, first, second; };
template <class T> AngleFactor<T> angleFactor(const T &z) {
  using std::sqrt;
  // Series below z = 0.02, closed form above: both are good to 1e-13 at the seam.
  const auto small = z < T(0.02);
  const T safe = select(small, T(1.0), z);
  const T root = sqrt(safe), value = arcTangent(root) / root;
  const T inverse = T(1.0) / (T(1.0) + safe);
  const T first = (inverse - value) / (T(2.0) * safe);
  const T second = (-inverse * inverse - T(3.0) * first) / (T(2.0) * safe);
  T v(0.0), d(0.0), dd(0.0);
  for (int k = 9; k >= 0; --k) {
    const double c = (k % 2 == 0 ? 1.0 : -1.0) / (2 * k + 1);
    v = v * z + T(c);
    if (k >= 1) d = d * z + T(k * c);
    if (k >= 2) dd = dd * z + T(k * (k - 1) * c);
  }
  return {select(small, v, value), select(small, d, first), select(small, dd, second)};
}

/// Geometry shared by the strain and its derivatives: (3.1), (3.3).
template <class T> struct CellGeometry {
  T chi;               ///< 1 + t0.t1
  Vector3<T> binormal; ///< curvature binormal 2 t0 x t1 / chi
  HalfAngle<T> half;   ///< of the twist angle, whole turns included in the signs
  Vector3<T> d1, d2;   ///< mean directors, carried back to the first tangent
  T kappa1, kappa2;    ///< binormal . d1, binormal . d2
  T stretch;           ///< factor of the bending strains
};

template <class T> CellGeometry<T> cellGeometry(const FrameOf<T> &f0, const FrameOf<T> &f1, const CellOf<T> &cell) {
  CellGeometry<T> g;
  g.chi = T(1.0) + f0.tangent.dot(f1.tangent);
  g.binormal = f0.tangent.cross(f1.tangent) * (T(2.0) / g.chi);
  g.half = halfAngleBetween(f0, f1);
  g.half.cosine = g.half.cosine * cell.sign; // a whole turn flips the sign of the half angle
  g.half.sine = g.half.sine * cell.sign;
  const Vector3<T> second = f0.secondDirector();
  g.d1 = f0.director * g.half.cosine + second * g.half.sine;
  g.d2 = second * g.half.cosine - f0.director * g.half.sine;
  g.kappa1 = g.binormal.dot(g.d1);
  g.kappa2 = g.binormal.dot(g.d2);
  g.stretch = (cell.weight[0] * f0.length + cell.weight[1] * f1.length) + cell.base;
  return g;
}

/// Twist strain and its two derivatives with respect to the twist angle.
template <Measure measure, class T> std::array<T, 3> twistMeasure(const HalfAngle<T> &half, const CellOf<T> &cell) {
  if constexpr (measure == Measure::tan) {
    const T tangent = half.sine / half.cosine, slope = T(1.0) + tangent * tangent;
    return {T(2.0) * tangent, slope, slope * tangent};
  } else {
    const HalfAngle<T> principal{half.cosine * cell.sign, half.sine * cell.sign};
    return {principal.angle() + cell.winding, T(1.0), T(0.0)};
  }
}

/// Strains (3.2) of a cell integrated over it (bending about d1 and d2, twist) [rad], before the rest strains are taken
/// off. kappa_alpha Lbar = stretch kbar.d_alpha, tau Lbar = 2 tan(angle/2).
template <Measure measure, class T>
std::array<T, 3> cellStrain(const FrameOf<T> &f0, const FrameOf<T> &f1, const CellOf<T> &cell) {
  const CellGeometry<T> g = cellGeometry(f0, f1, cell);
  T factor = g.stretch;
  if constexpr (measure == Measure::angle)
    factor = factor * angleFactor<T>((g.kappa1 * g.kappa1 + g.kappa2 * g.kappa2) * T(0.25)).value;
  return {factor * g.kappa1, factor * g.kappa2, twistMeasure<measure>(g.half, cell)[0]};
}

} // namespace tendril
