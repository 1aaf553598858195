#pragma once
/// \file spin_stage.hpp
/// The spin of a rigid body in a stage of a time step: a balance of its angular momentum in axes fixed in space, for
/// which no potential stands (docs/theory.md, Rigid bodies).

#include "tendril/geometry/rotation.hpp"
#include "tendril/state/stage.hpp"

namespace tendril {

/// Rotation by a vector (Rodrigues), for any scalar.
template <class T> Matrix3<T> exponential(const Vector3<T> &f) {
  using std::sqrt;
  const T square = f.squaredNorm();
  T first(1.0), second(0.5); // sin t/t and (1 - cos t)/t^2
  if (square < T(1e-6)) {
    first = T(1.0) - square * T(1.0 / 6) + square * square * T(1.0 / 120);
    second = T(0.5) - square * T(1.0 / 24) + square * square * T(1.0 / 720);
  } else {
    const T angle = sqrt(square), half = sine(T(T(0.5) * angle));
    first = sine(angle) / angle;
    second = T(2.0) * half * half / square;
  }
  const Matrix3<T> r = crossMatrix<T>(f), r2 = r * r;
  return Matrix3<T>::Identity() + r * first + r2 * second;
}

/// Second derivative by a spin of the energy of a force: that of g.(exp(d) arm) at d = 0, which no first derivative
/// has; docs/theory.md (9.1).
inline Mat3 curvatureOfArm(const Vec3 &g, const Vec3 &arm) {
  return 0.5 * (g * arm.transpose() + arm * g.transpose()) - g.dot(arm) * Mat3::Identity();
}

/// By how much a rotation vector f grows, by a further small rotation d in space: f + inverseTangent(f) d (inverse of
/// the left Jacobian of the exponential map, Bullo and Murray 1995). Singular at 2 pi.
inline Mat3 inverseTangent(const Vec3 &f) {
  const double square = f.squaredNorm(), angle = std::sqrt(square);
  const double eta = square < 1e-4 ? 1.0 / 12 + square / 720 : (1 - 0.5 * angle / std::tan(0.5 * angle)) / square;
  const Mat3 h = crossMatrix<double>(f);
  return Mat3::Identity() - 0.5 * h + eta * h * h;
}
/// And the other way: the rotation in space by which exp(f) is behind when f grows by df is tangentMap(f) df.
inline Mat3 tangentMap(const Vec3 &f) {
  const double square = f.squaredNorm(), angle = std::sqrt(square), half = std::sin(0.5 * angle);
  const double first = square < 1e-4 ? 0.5 - square / 24 : 2 * half * half / square,
               second = square < 1e-4 ? 1.0 / 6 - square / 120 : (angle - std::sin(angle)) / (square * angle);
  const Mat3 h = crossMatrix<double>(f);
  return Mat3::Identity() + first * h + second * h * h;
}

/// With f the rotation vector since the start of the step, R = exp(f) R_n, and a stage rule: the spin is omega = f/dt +
/// past_spin, the momentum pi = I(R) omega, its rate (mass pi + past_momentum)/dt: docs/theory.md (9.2). With
/// `keeps_energy`, in the middle of a step (9.3): omega = tan|f|/|f| f/dt, the momentum at the end R' (2 I R_n' omega -
/// Pi_n) with R' = exp(2 f) R_n, and pi the mean of that and the momentum at the start (J. C. Simo, K. K. Wong,
/// *Unconditionally stable algorithms for rigid body dynamics that exactly preserve energy and momentum*, Int. J. Num.
/// Meth. Eng. 31, 1991).
struct SpinStage {
  Mat3 inertia; ///< as drawn [kg m^2]
  Mat3 start;   ///< rotation at the start of the step since it was drawn
  double dt, mass;
  Vec3 past_spin, past_momentum;
  bool keeps_energy;

  /// tan t/t for the square of t.
  template <class T> static T tangentRatio(const T &square) {
    using std::sqrt;
    if (square < T(1e-4)) return T(1.0) + square * T(1.0 / 3) + square * square * T(2.0 / 15);
    const T angle = sqrt(square);
    return sine(angle) / (cosine(angle) * angle);
  }
  template <class T> Vector3<T> spin(const Vector3<T> &f) const {
    if (keeps_energy) return f * (tangentRatio<T>(f.squaredNorm()) / T(dt));
    return f / T(dt) + past_spin.cast<T>();
  }
  template <class T> Vector3<T> momentum(const Vector3<T> &f) const {
    const Matrix3<T> before = start.cast<T>(), i = inertia.cast<T>();
    const Vector3<T> w = spin<T>(f);
    if (!keeps_energy) {
      const Matrix3<T> now = exponential<T>(f) * before;
      const Vector3<T> body = now.transpose() * w, turned = i * body;
      return now * turned;
    }
    const Vector3<T> first = -past_momentum.cast<T>(), body = before.transpose() * w;
    const Vector3<T> last = i * body * T(2.0) - before.transpose() * first;
    const Vector3<T> twice = f * T(2.0), carried = before * last;
    const Vector3<T> end = exponential<T>(twice) * carried;
    return (end + first) * T(0.5);
  }
  Vec3 momentum(const Vec3 &f) const { return momentum<double>(f); }
  /// Rate of the momentum [N m].
  Vec3 rate(const Vec3 &f) const { return (mass * momentum(f) + past_momentum) / dt; }
  /// Its derivative by a further small rotation d in space [N m].
  Mat3 derivative(const Vec3 &f) const {
    const Vec3 w = spin<double>(f);
    if (!keeps_energy) {
      const Mat3 now = exponential<double>(f) * start, i = now * inertia * now.transpose();
      return mass / dt * (i * inverseTangent(f) / dt - crossMatrix<double>(i * w) + i * crossMatrix<double>(w));
    }
    const double square = f.squaredNorm(), ratio = tangentRatio<double>(square);
    // d(tan t/t)/d(t^2) = (1 + tan^2 - tan/t)/(2 t^2)
    const double slope =
        square < 1e-4 ? 1.0 / 3 + 4.0 / 15 * square : (1 + ratio * ratio * square - ratio) / (2 * square);
    const Mat3 spin_by_f = (ratio * Mat3::Identity() + 2 * slope * f * f.transpose()) / dt;
    const Mat3 behind = exponential<double>(Vec3(2 * f)) * start;
    const Vec3 end = 2 * momentum(f) + past_momentum;
    const Mat3 by_f =
        -crossMatrix<double>(end) * tangentMap(2 * f) * 2 + 2 * behind * inertia * start.transpose() * spin_by_f;
    return 0.5 * mass / dt * by_f * inverseTangent(f);
  }
};

/// Of a body by a rule.
inline SpinStage spinStage(const Mat3 &inertia, const Mat3 &start, const StageRule &rule, int body) {
  return {inertia,
          start,
          rule.dt,
          rule.mass,
          rule.velocity.ofBody(body).spin,
          rule.acceleration.ofBody(body).momentum,
          rule.keeps_energy};
}

/// Rotation vector of a body from one configuration to another of the same step; whole turns by what it was turned by
/// bit by bit.
inline Vec3 turnOf(const JoinedBody &body, const Configuration &from, const Configuration &to) {
  const Vec3 sum = to.positionAt(body.rotation) - from.positionAt(body.rotation);
  Vec3 turn = rotationBetween(from.frameAt(body.rotation), to.frameAt(body.rotation));
  if (const double angle = turn.norm(); sum.squaredNorm() > 4 && angle > 0) {
    const Vec3 axis = turn / angle;
    turn += 2 * pi * std::round((sum.dot(axis) - angle) / (2 * pi)) * axis;
  }
  return turn;
}

} // namespace tendril
