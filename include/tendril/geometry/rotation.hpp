#pragma once
/// \file rotation.hpp
/// Rotations between frames.

#include "tendril/geometry/frame.hpp"

namespace tendril {

/// Columns tangent, director, second director.
inline Mat3 matrixOf(const Frame &f) {
  Mat3 m;
  m << f.tangent, f.director, f.secondDirector();
  return m;
}

/// Rotation by a vector, axis times angle: Exp of docs/theory.md.
inline Mat3 rotationBy(const Vec3 &turn) {
  const double angle = turn.norm();
  return angle > 0 ? Mat3(Eigen::AngleAxisd(angle, turn / angle)) : Mat3(Mat3::Identity());
}

/// Rotation vector, of length up to pi, that turns one frame into the other, in space: g of docs/theory.md, 16.
inline Vec3 rotationBetween(const Frame &from, const Frame &to) {
  const Eigen::Quaterniond q(Mat3(matrixOf(to) * matrixOf(from).transpose()));
  const double sine = q.vec().norm();
  if (sine == 0) return Vec3::Zero();
  return q.vec() * ((q.w() < 0 ? -2 : 2) * std::atan2(sine, std::abs(q.w())) / sine);
}

/// Whether rotation vectors of two neighbours on a path are on different sides of half a turn, where they jump.
inline bool jumpsBetween(const Vec3 &a, const Vec3 &b) {
  constexpr double far = pi * pi / 4;
  return a.squaredNorm() > far && b.squaredNorm() > far && a.dot(b) < 0;
}

} // namespace tendril
