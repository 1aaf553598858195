#pragma once
/// \file bend_twist.hpp
/// Bending and twisting energy of one cell: the two edge frames that meet at a vertex, or an edge and the fixed frame
/// of a clamp (the half cell). Discrete curvature binormal after Bergou et al., "Discrete Elastic Rods" (2008),
/// section 4.2; second derivatives built from those of Bergou et al., "Discrete Viscous Threads" (2010), appendix, for
/// the normalised mean director: docs/theory.md, 3 and 13. Numbers in brackets are of its formulas.

#include "tendril/model/strain.hpp"

#include <array>

namespace tendril {

/// Unknowns of a cell in the order x_{i-1}, theta_{i-1}, x_i, theta_i, x_{i+1}.
inline constexpr int cell_size = 11;
/// Edge variables of a cell in the order e_{i-1}, theta_{i-1}, e_i, theta_i, of which its energy is a function; entries
/// of the upper triangle of the Hessian over them, row by row.
inline constexpr int cell_variables = 8, cell_pairs = cell_variables * (cell_variables + 1) / 2;

template <class T> struct CellDerivatives {
  std::array<T, cell_size> gradient;
  std::array<T, cell_pairs> hessian; ///< upper triangle, row by row

  void putGradient(int r, const T &v) { gradient[r] = v; }
  void putHessian(int r, int c, const T &v) { hessian[r * cell_variables - r * (r - 1) / 2 + (c - r)] = v; }
};

/// Energy of a cell [J], (3.2): 1/2 sum_k stiffness_k (strain_k - rest_k)^2. Not finite where the two edges are
/// opposite.
template <Measure measure, class T> T cellEnergy(const FrameOf<T> &f0, const FrameOf<T> &f1, const CellOf<T> &cell) {
  const std::array<T, 3> strain = cellStrain<measure>(f0, f1, cell);
  T energy(0.0);
  for (int k = 0; k < 3; ++k) {
    const T s = strain[k] - cell.rest[k];
    energy = energy + T(0.5) * cell.stiffness[k] * s * s;
  }
  return energy;
}

/// Gradient of a cell's energy over its unknowns alone (see cellDerivatives), by (13.1) and (13.2).
template <Measure measure, class T>
std::array<T, cell_size> cellGradient(const FrameOf<T> &f0, const FrameOf<T> &f1, const CellOf<T> &cell) {
  const CellGeometry<T> g = cellGeometry(f0, f1, cell);
  const Vector3<T> &t0 = f0.tangent, &t1 = f1.tangent;
  const T i0 = cell.free[0] / f0.length, i1 = cell.free[1] / f1.length;
  AngleFactor<T> a{T(1.0), T(0.0), T(0.0)};
  if constexpr (measure == Measure::angle) a = angleFactor<T>((g.kappa1 * g.kappa1 + g.kappa2 * g.kappa2) * T(0.25));
  const T force1 = cell.stiffness[0] * (g.stretch * a.value * g.kappa1 - cell.rest[0]),
          force2 = cell.stiffness[1] * (g.stretch * a.value * g.kappa2 - cell.rest[1]);
  const T along = force1 * g.kappa1 + force2 * g.kappa2, turning = T(0.5) * a.first * along;
  const T f1st = g.stretch * (force1 * a.value + turning * g.kappa1),
          f2nd = g.stretch * (force2 * a.value + turning * g.kappa2);
  const std::array<T, 3> twist = twistMeasure<measure>(g.half, cell);
  const T f_twist = cell.stiffness[2] * (twist[0] - cell.rest[2]) * twist[1];
  // Moving the directors turns p = f1 d1 + f2 d2 with the first frame, and within it by half the twist.
  const Vector3<T> p = g.d1 * f1st + g.d2 * f2nd, mean = (t0 + t1) / g.chi;
  const T bp = g.binormal.dot(p), turn = f1st * g.kappa2 - f2nd * g.kappa1, two_over_chi = T(2.0) / g.chi,
          half_twist = T(0.5) * f_twist + T(0.25) * turn;
  const Vector3<T> e0 = (t1.cross(p) * two_over_chi - mean * bp) * i0 + g.binormal * (half_twist * i0) +
                        t0 * (a.value * along * cell.weight[0] * cell.free[0]);
  const Vector3<T> e1 = (t0.cross(p) * two_over_chi + mean * bp) * (-i1) + g.binormal * (half_twist * i1) +
                        t1 * (a.value * along * cell.weight[1] * cell.free[1]);
  const T theta0 = (T(0.5) * turn - f_twist) * cell.free[0], theta1 = (T(0.5) * turn + f_twist) * cell.free[1];
  return {-e0[0], -e0[1], -e0[2], theta0, e0[0] - e1[0], e0[1] - e1[1], e0[2] - e1[2], theta1, e1[0], e1[1], e1[2]};
}

/// Derivatives of the energy of a cell, (3.2), as a function of kappa_1, kappa_2, the stretch and the twist angle.
template <class T> struct CellSlopes {
  T kappa[2], kappa2[2][2], mixed[2]; ///< mixed: by kappa and the stretch
  T stretch, stretch2, twist, twist2;
};

template <Measure measure, class T>
[[gnu::always_inline]] inline CellSlopes<T> cellSlopes(const CellGeometry<T> &g, const CellOf<T> &cell) {
  CellSlopes<T> f;
  AngleFactor<T> a{T(1.0), T(0.0), T(0.0)};
  if constexpr (measure == Measure::angle) a = angleFactor<T>((g.kappa1 * g.kappa1 + g.kappa2 * g.kappa2) * T(0.25));
  const T kappa[2] = {g.kappa1, g.kappa2};
  T slope[2][2]; // d strain_i / d kappa_j, per unit stretch
  T force[2];
  for (int i = 0; i < 2; ++i) {
    force[i] = cell.stiffness[i] * (g.stretch * a.value * kappa[i] - cell.rest[i]);
    for (int j = 0; j < 2; ++j) slope[i][j] = T(0.5) * a.first * kappa[i] * kappa[j] + (i == j ? a.value : T(0.0));
  }
  const T along = force[0] * kappa[0] + force[1] * kappa[1];
  for (int j = 0; j < 2; ++j) {
    f.kappa[j] = g.stretch * (force[0] * slope[0][j] + force[1] * slope[1][j]);
    f.mixed[j] = force[0] * slope[0][j] + force[1] * slope[1][j];
    for (int i = 0; i < 2; ++i)
      f.mixed[j] = f.mixed[j] + cell.stiffness[i] * g.stretch * slope[i][j] * a.value * kappa[i];
    for (int k = 0; k < 2; ++k) {
      T v(0.0);
      for (int i = 0; i < 2; ++i) v = v + cell.stiffness[i] * slope[i][j] * slope[i][k];
      f.kappa2[j][k] = g.stretch * g.stretch * v;
    }
  }
  if constexpr (measure == Measure::angle)
    for (int j = 0; j < 2; ++j)
      for (int k = 0; k < 2; ++k) {
        T v = T(0.5) * a.first * (force[j] * kappa[k] + force[k] * kappa[j]) +
              T(0.25) * a.second * along * kappa[j] * kappa[k];
        if (j == k) v = v + T(0.5) * a.first * along;
        f.kappa2[j][k] = f.kappa2[j][k] + g.stretch * v;
      }
  f.stretch = a.value * along;
  f.stretch2 = a.value * a.value * (cell.stiffness[0] * kappa[0] * kappa[0] + cell.stiffness[1] * kappa[1] * kappa[1]);
  const std::array<T, 3> twist = twistMeasure<measure>(g.half, cell);
  const T twist_force = cell.stiffness[2] * (twist[0] - cell.rest[2]);
  f.twist = twist_force * twist[1];
  f.twist2 = cell.stiffness[2] * twist[1] * twist[1] + twist_force * twist[2];
  return f;
}

/// Directions of a cell, and what its derivatives have over and over: one over the lengths of edges that are free, the
/// mean tangent (t0 + t1)/chi, and the vector p = f_1 d1 + f_2 d2 that moves with the first frame, f_i the derivatives
/// of the energy by the curvatures.
template <class T> struct CellDirections {
  Vector3<T> t0, t1, b, mean, p;
  T i0, i1, chi, two_over_chi, bp, twist_weight;
};

/// Upper triangle of the Hessian of a cell over its edge variables.
template <class T> using CellHessian = T[cell_variables][cell_variables];

/// Adds the second derivatives of b . p by one edge and the same, with the turning of the first frame, and of the
/// stretch.
template <class T>
[[gnu::always_inline]] inline void addWithinEdges(const CellDirections<T> &d, const T &by_stretch,
                                                  const CellOf<T> &cell, CellHessian<T> &h) {
  const Vector3<T> m2 = d.p * d.two_over_chi, m0 = d.t0.cross(m2), m1 = d.t1.cross(m2);
  const Vector3<T> two_mean = d.mean * (T(2.0) * d.bp);
  const T &i0 = d.i0, &i1 = d.i1;
  const Vector3<T> w0 = (two_mean - m1) * (i0 * i0), w1 = (two_mean + m0) * (i1 * i1);
  const T shift = d.bp / d.chi;
  const T s0 = by_stretch * cell.weight[0] * i0 - shift * i0 * i0,
          s1 = by_stretch * cell.weight[1] * i1 - shift * i1 * i1;
  const Vector3<T> q0 = d.p * (T(0.5) * i0 * i0) - (d.t0 + d.mean) * (T(0.25) * i0 * i0 * d.twist_weight);
  const Vector3<T> q1 = (d.t1 + d.mean) * (T(-0.25) * i1 * i1 * d.twist_weight);
  const Vector3<T> v0 = m1 * (i0 * i0), v1 = m0 * (i1 * i1);
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r)
#pragma GCC unroll 3
    for (int c = r; c < 3; ++c) {
      // 2 bp mean mean' - m1 mean' - mean m1', and the like for the second edge; symmetric sums.
      h[r][c] =
          h[r][c] + w0[r] * d.mean[c] - d.mean[r] * v0[c] - d.t0[r] * d.t0[c] * s0 + d.b[r] * q0[c] + q0[r] * d.b[c];
      h[4 + r][4 + c] = h[4 + r][4 + c] + w1[r] * d.mean[c] + d.mean[r] * v1[c] - d.t1[r] * d.t1[c] * s1 +
                        d.b[r] * q1[c] + q1[r] * d.b[c];
    }
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r) {
    h[r][r] = h[r][r] + s0;
    h[4 + r][4 + r] = h[4 + r][4 + r] + s1;
  }
}

/// The same by both edges.
template <class T> [[gnu::always_inline]] inline void addBetweenEdges(const CellDirections<T> &d, CellHessian<T> &h) {
  const Vector3<T> m2 = d.p * d.two_over_chi, m0 = d.t0.cross(m2), m1 = d.t1.cross(m2);
  const T i01 = d.i0 * d.i1, shift = d.bp / d.chi;
  const Vector3<T> x0 = (d.mean * (T(2.0) * d.bp) - m1) * i01, x1 = m0 * i01;
  const Vector3<T> cross = d.t0 * (d.twist_weight / d.chi) - m2;
  const Matrix3<T> skew = crossMatrix<T>(cross);
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r)
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) {
      T v = x0[r] * d.mean[c] + d.mean[r] * x1[c] - d.t0[r] * d.t1[c] * (shift * i01) + skew(r, c) * i01 -
            d.b[r] * d.mean[c] * (T(0.5) * d.twist_weight * i01);
      if (r == c) v = v - shift * i01;
      h[r][4 + c] = h[r][4 + c] + v;
    }
}

/// First what belongs to the first vertex or edge, then what belongs to the second. Neighbouring cells meet in the same
/// memory a slot apart; in this order a store has left the pipeline before a load needs a part of it.
template <class T, class Out>
[[gnu::always_inline]] inline void putCell(const Eigen::Matrix<T, cell_variables, 1> &gradient, const CellHessian<T> &h,
                                           Out &out) {
#pragma GCC unroll 4
  for (int r = 0; r < 4; ++r) {
    out.putGradient(r, r < 3 ? -gradient[r] : gradient[r]);
#pragma GCC unroll 8
    for (int c = r; c < 8; ++c) out.putHessian(r, c, h[r][c]);
  }
#pragma GCC unroll 4
  for (int r = 0; r < 4; ++r) {
    out.putGradient(4 + r, r < 3 ? gradient[r] - gradient[4 + r] : gradient[4 + r]);
#pragma GCC unroll 4
    for (int c = r; c < 4; ++c) out.putHessian(4 + r, 4 + c, h[4 + r][4 + c]);
  }
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r) out.putGradient(8 + r, gradient[4 + r]);
}

/// Gradient over the unknowns of a cell, and Hessian over its edge variables, pulled back by the retraction at the
/// current frames: exact and symmetric. By the first derivatives (13.1) to (13.3), and the second ones of Bergou et al.
/// 2010, appendix, for the vector p. Each number goes to `out` once, by putGradient(r, value) or, for r <= c,
/// putHessian(r, c, value).
template <Measure measure, class T, class Out>
void cellDerivatives(const FrameOf<T> &f0, const FrameOf<T> &f1, const CellOf<T> &cell, Out &&out) {
  using Vector8 = Eigen::Matrix<T, cell_variables, 1>;
  const CellGeometry<T> g = cellGeometry(f0, f1, cell);
  const CellSlopes<T> f = cellSlopes<measure>(g, cell);
  CellDirections<T> d;
  d.t0 = f0.tangent;
  d.t1 = f1.tangent;
  d.b = g.binormal;
  d.i0 = cell.free[0] / f0.length;
  d.i1 = cell.free[1] / f1.length;
  d.chi = g.chi;
  d.two_over_chi = T(2.0) / g.chi;
  d.mean = (d.t0 + d.t1) / g.chi;

  // Gradients of the pieces over (e0, theta0, e1, theta1): twist and psi by (13.1), kappa by (13.3).
  Vector8 twist_g, psi_g, stretch_g, kappa_g[2];
  twist_g << d.b * (T(0.5) * d.i0), -cell.free[0], d.b * (T(0.5) * d.i1), cell.free[1];
  psi_g = twist_g * T(0.5);
  psi_g[3] = psi_g[3] + cell.free[0];
  stretch_g << d.t0 * (cell.weight[0] * cell.free[0]), T(0.0), d.t1 * (cell.weight[1] * cell.free[1]), T(0.0);
  // Gradient of binormal.p for a vector p that moves with the first frame, (13.2).
  auto directorGradient = [&](const Vector3<T> &p, const T &kp) {
    Vector8 v;
    v << (d.t1.cross(p) * d.two_over_chi - d.mean * kp) * d.i0, T(0.0),
        (d.t0.cross(p) * d.two_over_chi + d.mean * kp) * (-d.i1), T(0.0);
    return v;
  };
  kappa_g[0] = directorGradient(g.d1, g.kappa1) + psi_g * g.kappa2;
  kappa_g[1] = directorGradient(g.d2, g.kappa2) - psi_g * g.kappa1;
  const Vector8 gradient =
      kappa_g[0] * f.kappa[0] + kappa_g[1] * f.kappa[1] + twist_g * f.twist + stretch_g * f.stretch;

  // Curvature of the pieces: binormal.p with p frozen on the first frame, its turning with psi, twist and stretch.
  d.p = g.d1 * f.kappa[0] + g.d2 * f.kappa[1];
  const Vector3<T> dp = g.d2 * f.kappa[0] - g.d1 * f.kappa[1];
  d.bp = d.b.dot(d.p);
  const T bdp = d.b.dot(dp);
  d.twist_weight = f.twist + T(0.5) * bdp;
  const Vector8 dp_g = directorGradient(dp, bdp);
  const Vector8 u0 = kappa_g[0] * f.kappa2[0][0] + kappa_g[1] * f.kappa2[0][1] + stretch_g * f.mixed[0];
  const Vector8 u1 = kappa_g[0] * f.kappa2[0][1] + kappa_g[1] * f.kappa2[1][1] + stretch_g * f.mixed[1];
  const Vector8 us = kappa_g[0] * f.mixed[0] + kappa_g[1] * f.mixed[1] + stretch_g * f.stretch2;
  const Vector8 up = dp_g - psi_g * d.bp;
  const Vector8 ut = twist_g * f.twist2;
  CellHessian<T> h;
#pragma GCC unroll 8
  for (int r = 0; r < 8; ++r)
#pragma GCC unroll 8
    for (int c = r; c < 8; ++c)
      h[r][c] = kappa_g[0][r] * u0[c] + kappa_g[1][r] * u1[c] + stretch_g[r] * us[c] + twist_g[r] * ut[c] +
                psi_g[r] * up[c] + dp_g[r] * psi_g[c];
  addWithinEdges(d, f.stretch, cell, h);
  addBetweenEdges(d, h);
  putCell(gradient, h, out);
}

/// Derivative (26.2) of a cell's energy by turning its second frame against its first, in space [N m]: that
/// by turning the one that is free, as turning both costs nothing. \param d gradient of the cell
inline Vec3 cellMoment(const Frame &f0, const Frame &f1, const CellOf<double> &cell,
                       const std::array<double, cell_size> &d) {
  if (cell.free[1] != 0) return f1.length * f1.tangent.cross(Eigen::Map<const Vec3>(&d[8])) + d[7] * f1.tangent;
  return f0.length * f0.tangent.cross(Eigen::Map<const Vec3>(&d[0])) - d[3] * f0.tangent;
}

} // namespace tendril
