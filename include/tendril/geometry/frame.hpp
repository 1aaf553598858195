#pragma once
/// \file frame.hpp
/// The orthonormal frame of an edge, its transport by minimal rotation, and the angle between two frames. Numbers in
/// brackets are of docs/theory.md.

#include "tendril/geometry/scalar.hpp"

namespace tendril {

/// Frame of an edge. `tangent` and `director` (the first director) are unit vectors, normal to each other; the second
/// director is tangent x director. `length` [m] is the current length of the edge.
template <class T> struct FrameOf {
  Vector3<T> tangent;
  Vector3<T> director;
  T length;
  Vector3<T> secondDirector() const { return tangent.cross(director); }
};
using Frame = FrameOf<double>;

/// Carries `v`, a vector normal to the unit vector `from`, by the minimal rotation (1.1) that takes `from` to the unit
/// vector `to`. Singular when the two are opposite (the division gives inf or nan).
template <class T> Vector3<T> transport(const Vector3<T> &v, const Vector3<T> &from, const Vector3<T> &to) {
  const T s = v.dot(to) / (T(1.0) + from.dot(to));
  return v - (from + to) * s;
}

/// Matrix of the cross product with a vector.
template <class T> Matrix3<T> crossMatrix(const Vector3<T> &v) {
  Matrix3<T> m;
  m << T(0.0), -v[2], v[1], v[2], T(0.0), -v[0], -v[1], v[0], T(0.0);
  return m;
}

/// Rotates `v`, normal to the unit vector `axis`, by `angle` [rad] about it, as in (1.3).
template <class T> Vector3<T> rotateAbout(const Vector3<T> &v, const Vector3<T> &axis, const T &angle) {
  return v * cosine(angle) + axis.cross(v) * sine(angle);
}

/// Angle (1.2) from one frame to another about the second's tangent after minimal rotation, given by the cosine and
/// sine of its half. Well conditioned for every angle in (-pi, pi).
template <class T> struct HalfAngle {
  T cosine, sine;
  T angle() const { return T(2.0) * arcTangent2(sine, cosine); }
};

/// Half of the angle from `a` to `b` (see HalfAngle). Undefined when the tangents are opposite.
template <class T> HalfAngle<T> halfAngleBetween(const FrameOf<T> &a, const FrameOf<T> &b) {
  using std::sqrt;
  const Vector3<T> moved = transport<T>(a.director, a.tangent, b.tangent);
  const T c = moved.dot(b.director), s = -moved.dot(b.secondDirector());
  // The larger of the two halves comes from a square root, the other from s = 2 sin cos: no cancellation on either
  // side.
  const T root = sqrt(T(0.5) * (T(1.0) + select(c > T(0.0), c, -c)));
  const T other = s / (T(2.0) * root);
  HalfAngle<T> h{select(c > T(0.0), root, other), select(c > T(0.0), other, root)};
  const T sign = select(h.cosine < T(0.0), T(-1.0), T(1.0));
  h.cosine = h.cosine * sign;
  h.sine = h.sine * sign;
  return h;
}

/// Orthonormal director for an edge: `director` made normal to `tangent` and of unit length.
template <class T> Vector3<T> orthonormalised(const Vector3<T> &director, const Vector3<T> &tangent) {
  using std::sqrt;
  const Vector3<T> d = director - tangent * director.dot(tangent);
  return d / sqrt(d.squaredNorm());
}
inline Vec3 orthonormalised(const Vec3 &director, const Vec3 &tangent) {
  return orthonormalised<double>(director, tangent);
}

/// Some unit vector normal to the unit vector `t`, chosen continuously almost everywhere and the same on every machine.
inline Vec3 anyNormal(const Vec3 &t) {
  Eigen::Index smallest;
  t.cwiseAbs().minCoeff(&smallest);
  return orthonormalised(Vec3::Unit(smallest), t);
}

} // namespace tendril
