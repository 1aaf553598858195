#pragma once
/// \file edge.hpp
/// Energies of one edge: stretch, of either law, and the inertia of its twist over a step. Numbers in brackets are of
/// docs/theory.md.

#include "tendril/model/strain.hpp"

namespace tendril {

/// Derivatives (2.2) of the stretch energy over the edge vector e = l t: gradient = force q with q = slope e
/// (strainSlope), Hessian = (stiffness/L) q q' + tension slope I, for `classical` I - t t'. In the primal form tension
/// = force = k (strain - rest).
template <class T> Vector3<T> stretchGradient(const FrameOf<T> &f, const T &force, const T &slope) {
  return f.tangent * (force * f.length * slope);
}
template <class T>
Matrix3<T> stretchHessian(Energy energy, const FrameOf<T> &f, const T &stiffness, const T &tension,
                          const T &inverse_rest_length, const T &slope) {
  const T r = f.length * slope;
  T along = stiffness * inverse_rest_length * r * r;
  if (energy == Energy::classical) along = along - tension * slope;
  Matrix3<T> h = (f.tangent * along) * f.tangent.transpose();
  for (int k = 0; k < 3; ++k) h(k, k) = h(k, k) + tension * slope;
  return h;
}

/// Twist of an edge since the beginning of the step: the angle (1.2) from the frame it had then, transported directly
/// to the present tangent, to its present director. It depends on the end points of the step only, not on the iterates
/// between.
template <class T> T twistIncrement(const FrameOf<T> &start, const FrameOf<T> &now) {
  return halfAngleBetween(start, now).angle();
}

/// Gradient (4) over (e, theta) and Hessian (upper triangle of 4x4, row by row) of weight/2 (twist increment -
/// target)^2, given that difference, by (14.3).
template <class T> struct TwistInertiaDerivatives {
  std::array<T, 4> gradient;
  std::array<T, 10> hessian;
};
template <class T>
TwistInertiaDerivatives<T> twistInertia(const FrameOf<T> &start, const FrameOf<T> &now, const T &weight,
                                        const T &difference) {
  const T chi = T(1.0) + start.tangent.dot(now.tangent), inverse = T(1.0) / now.length;
  const Vector3<T> b = start.tangent.cross(now.tangent) * (T(2.0) / chi);
  const Vector3<T> mean = (start.tangent + now.tangent) / chi;
  const T force = weight * difference;
  const Vector3<T> g = b * (T(0.5) * inverse);
  const Vector3<T> q = (now.tangent + mean) * (T(-0.25) * inverse * inverse * force);
  TwistInertiaDerivatives<T> d;
  int k = 0;
  for (int r = 0; r < 3; ++r) {
    d.gradient[r] = force * g[r];
    for (int c = r; c < 3; ++c) d.hessian[k++] = weight * g[r] * g[c] + b[r] * q[c] + q[r] * b[c];
    d.hessian[k++] = weight * g[r];
  }
  d.gradient[3] = force;
  d.hessian[9] = weight;
  return d;
}

} // namespace tendril
