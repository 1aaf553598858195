#pragma once
/// \file bend.hpp
/// Bending energy of one cell of a rod without twists (RodModel): a function of the angle between two edges alone, in a
/// plane, where it has a sign and a rest, or in space, where the rod is isotropic and straight at rest. The strains are
/// those of strain.hpp; numbers in brackets are of docs/theory.md, 5.

#include "tendril/model/strain.hpp"

namespace tendril {

template <class T, int n> using VectorOf = Eigen::Matrix<T, n, 1>;

/// Constants of a cell: its energy is 1/2 stiffness (strain - rest)^2 [N m], [rad]; the others as in CellOf.
template <class T> struct BendOf {
  T stiffness, rest, base;
  std::array<T, 2> weight, free;
};

/// Two edges that meet: their tangents and lengths.
template <class T, int n> struct EdgePair {
  VectorOf<T, n> t0, t1;
  T l0, l1;
};

/// The strain of a cell, stretch x measure of the angle, and what its derivatives need.
template <class T> T stretchOf(const BendOf<T> &cell, const T &l0, const T &l1) {
  return (cell.weight[0] * l0 + cell.weight[1] * l1) + cell.base;
}

/// 2 tan(angle/2) or the angle, with its sign, from t0 to t1 in their plane: y of (5.1); and derivatives by the angle.
template <Measure measure, class T> std::array<T, 3> planarAngle(const VectorOf<T, 2> &t0, const VectorOf<T, 2> &t1) {
  const T tangent = (t0[0] * t1[1] - t0[1] * t1[0]) / (T(1.0) + t0.dot(t1)); // of half the angle
  if constexpr (measure == Measure::tan) {
    const T slope = T(1.0) + tangent * tangent;
    return {T(2.0) * tangent, slope, slope * tangent};
  } else
    return {T(2.0) * tangent * angleFactor<T>(tangent * tangent).value, T(1.0), T(0.0)};
}

/// w of (5.4), half the square of 2 tan(angle/2) or of the angle, and two derivatives by the cosine c of the angle.
/// With z = tan^2(angle/2): dz/dc = -2/(1 + c)^2.
template <Measure measure, class T> std::array<T, 3> halfSquare(const VectorOf<T, 3> &t0, const VectorOf<T, 3> &t1) {
  const T inverse = T(1.0) / (T(1.0) + t0.dot(t1)), z = t0.cross(t1).squaredNorm() * inverse * inverse;
  std::array<T, 3> w{T(2.0) * z, T(2.0), T(0.0)}; // by z
  if constexpr (measure == Measure::angle) {
    const AngleFactor<T> a = angleFactor<T>(z);
    w = {T(2.0) * z * a.value * a.value, T(2.0) * a.value * (a.value + T(2.0) * z * a.first),
         T(8.0) * a.value * a.first + T(4.0) * z * (a.first * a.first + a.value * a.second)};
  }
  const T slope = T(-2.0) * inverse * inverse;
  return {w[0], w[1] * slope, w[2] * slope * slope - T(2.0) * w[1] * slope * inverse};
}

/// Energy of a cell [J]: (5.1) in a plane, stiffness stretch^2 w in space.
template <Measure measure, class T, int n> T bendEnergy(const EdgePair<T, n> &e, const BendOf<T> &cell) {
  const T stretch = stretchOf(cell, e.l0, e.l1);
  if constexpr (n == 2) {
    const T s = stretch * planarAngle<measure, T>(e.t0, e.t1)[0] - cell.rest;
    return T(0.5) * cell.stiffness * s * s;
  } else
    return cell.stiffness * stretch * stretch * halfSquare<measure, T>(e.t0, e.t1)[0];
}

/// Adds the projection factor (I - t t') to a block.
template <class T, int n> void addAcross(Eigen::Matrix<T, n, n> &h, const VectorOf<T, n> &t, const T &factor) {
#pragma GCC unroll 3
  for (int r = 0; r < n; ++r) {
#pragma GCC unroll 3
    for (int c = r; c < n; ++c) h(r, c) = h(r, c) - t[r] * t[c] * factor;
    h(r, r) = h(r, r) + factor;
  }
}

template <class T, int n> struct BendDerivatives {
  VectorOf<T, n> first, second;             ///< gradient by the two edges
  Eigen::Matrix<T, n, n> own0, own1, mixed; ///< Hessian; of own0 and own1 the upper triangles; mixed: first by second
};

/// Derivatives of a cell's energy over its two edge vectors by (5.2) or (5.3), exact; where not `exact`, a Hessian that
/// is never indefinite: without second derivatives of the strains, but of what turns edges.
template <Measure measure, bool exact = true, class T>
BendDerivatives<T, 2> bendDerivatives(const EdgePair<T, 2> &e, const BendOf<T> &cell) {
  BendDerivatives<T, 2> d;
  const T i0 = cell.free[0] / e.l0, i1 = cell.free[1] / e.l1, stretch = stretchOf(cell, e.l0, e.l1);
  const std::array<T, 3> angle = planarAngle<measure, T>(e.t0, e.t1);
  const T force = cell.stiffness * (stretch * angle[0] - cell.rest);
  // The angle by the edges, (5.2): n x t / l with the signs - and +; the stretch: t.
  const VectorOf<T, 2> m0(e.t0[1] * i0, -e.t0[0] * i0), m1(-e.t1[1] * i1, e.t1[0] * i1);
  const T w0 = cell.weight[0] * cell.free[0], w1 = cell.weight[1] * cell.free[1];
  const T turning = stretch * angle[1];
  const VectorOf<T, 2> y0 = m0 * turning + e.t0 * (w0 * angle[0]), y1 = m1 * turning + e.t1 * (w1 * angle[0]);
  d.first = y0 * force;
  d.second = y1 * force;
#pragma GCC unroll 2
  for (int r = 0; r < 2; ++r)
#pragma GCC unroll 2
    for (int c = 0; c < 2; ++c) {
      const T k0 = cell.stiffness * y0[r], k1 = cell.stiffness * y1[r];
      if (c >= r) {
        d.own0(r, c) = k0 * y0[c];
        d.own1(r, c) = k1 * y1[c];
      }
      d.mixed(r, c) = k0 * y1[c];
    }
  if constexpr (!exact) return d;
  // y'' = stretch f'' a' a' + stretch f' a'' + f' (a' s' + s' a') + f s''; by one edge a'' = -(a' t' + t a'')/l (5.2).
  const T bent = force * stretch * angle[2], turned = force * turning, mixed = force * angle[1];
  const T c0 = mixed * w0 - turned * i0, c1 = mixed * w1 - turned * i1;
#pragma GCC unroll 2
  for (int r = 0; r < 2; ++r)
#pragma GCC unroll 2
    for (int c = 0; c < 2; ++c) {
      if (c >= r) {
        d.own0(r, c) = d.own0(r, c) + bent * m0[r] * m0[c] + c0 * (m0[r] * e.t0[c] + e.t0[r] * m0[c]);
        d.own1(r, c) = d.own1(r, c) + bent * m1[r] * m1[c] + c1 * (m1[r] * e.t1[c] + e.t1[r] * m1[c]);
      }
      d.mixed(r, c) = d.mixed(r, c) + bent * m0[r] * m1[c] + mixed * (w1 * m0[r] * e.t1[c] + w0 * e.t0[r] * m1[c]);
    }
  addAcross<T, 2>(d.own0, e.t0, force * angle[0] * w0 * i0);
  addAcross<T, 2>(d.own1, e.t1, force * angle[0] * w1 * i1);
  return d;
}

template <Measure measure, bool exact = true, class T>
BendDerivatives<T, 3> bendDerivatives(const EdgePair<T, 3> &e, const BendOf<T> &cell) {
  BendDerivatives<T, 3> d;
  const T i0 = cell.free[0] / e.l0, i1 = cell.free[1] / e.l1, stretch = stretchOf(cell, e.l0, e.l1);
  const std::array<T, 3> w = halfSquare<measure, T>(e.t0, e.t1);
  const T cosine = e.t0.dot(e.t1), twice = cell.stiffness * T(2.0) * stretch;
  const T first = cell.stiffness * stretch * stretch * w[1], second = cell.stiffness * stretch * stretch * w[2];
  const T w0 = cell.weight[0] * cell.free[0], w1 = cell.weight[1] * cell.free[1];
  // The cosine by the edges, (5.3).
  const VectorOf<T, 3> p0 = (e.t1 - e.t0 * cosine) * i0, p1 = (e.t0 - e.t1 * cosine) * i1;
  d.first = p0 * first + e.t0 * (twice * w[0] * w0);
  d.second = p1 * first + e.t1 * (twice * w[0] * w1);
  const T both = exact ? T(twice * w[1]) : T(0.0), squared = T(2.0) * cell.stiffness * w[0];
  const T s00 = both * w0 - (exact ? T(first * i0) : T(0.0)), s11 = both * w1 - (exact ? T(first * i1) : T(0.0));
  const T f01 = first * i0 * i1;
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r)
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) {
      if (c >= r) {
        d.own0(r, c) =
            second * p0[r] * p0[c] + s00 * (p0[r] * e.t0[c] + e.t0[r] * p0[c]) + squared * w0 * w0 * e.t0[r] * e.t0[c];
        d.own1(r, c) =
            second * p1[r] * p1[c] + s11 * (p1[r] * e.t1[c] + e.t1[r] * p1[c]) + squared * w1 * w1 * e.t1[r] * e.t1[c];
      }
      d.mixed(r, c) = second * p0[r] * p1[c] + both * (w1 * p0[r] * e.t1[c] + w0 * e.t0[r] * p1[c]) +
                      squared * w0 * w1 * e.t0[r] * e.t1[c] +
                      f01 * (cosine * e.t0[r] * e.t1[c] - e.t0[r] * e.t0[c] - e.t1[r] * e.t1[c]);
      if (r == c) d.mixed(r, c) = d.mixed(r, c) + f01;
    }
  // Turning an edge by itself lowers the cosine; without second derivatives it counts as on a straight rod.
  const T along = exact ? cosine : T(1.0);
  addAcross<T, 3>(d.own0, e.t0, (exact ? T(twice * w[0] * w0 * i0) : T(0.0)) - first * along * i0 * i0);
  addAcross<T, 3>(d.own1, e.t1, (exact ? T(twice * w[0] * w1 * i1) : T(0.0)) - first * along * i1 * i1);
  return d;
}

} // namespace tendril
