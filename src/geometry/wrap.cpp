#include "tendril/geometry/wrap.hpp"

#include "tendril/geometry/rotation.hpp"

#include <cmath>

namespace tendril {
namespace {

using Vec2 = Eigen::Vector2d;
using Mat2 = Eigen::Matrix2d;

Vec2 turned(const Vec2 &v, double angle) { return Eigen::Rotation2Dd(angle) * v; }

/// How a way in the plane winds round a circle about the origin.
struct Winding {
  double angle;    ///< of the arc, not positive where the way is straight [rad]
  double from, to; ///< from the ends' own directions to where they meet the circle [rad]
  int sense;       ///< 1 anticlockwise
  bool lost;       ///< by which side it goes cannot be told
};

Winding windingOf(const Vec2 &p, const Vec2 &q, double radius, int side) {
  Winding w;
  double between = std::atan2(p[0] * q[1] - p[1] * q[0], p.dot(q));
  w.sense = side != 0 ? side : between < 0 ? -1 : 1;
  between *= w.sense;
  constexpr double margin = 0.05; // about where both sides are alike
  if (side != 0 && between < -0.5 * pi) between += 2 * pi;
  w.lost = side != 0 && (between > 1.5 * pi - margin || between < -0.5 * pi + margin);
  w.from = std::acos(std::min(radius / p.norm(), 1.0));
  w.to = std::acos(std::min(radius / q.norm(), 1.0));
  w.angle = between - w.from - w.to;
  w.lost = w.lost || (side != 0 && -between > w.from + w.to); // straight it would go through
  return w;
}

} // namespace

WayLength straightWay(const Vec3 &way) {
  WayLength out;
  out.value = way.norm();
  if (!(out.value > 0)) {
    out.value = HUGE_VAL;
    return out;
  }
  const Vec3 s = way / out.value;
  const Mat3 across = (Mat3::Identity() - s * s.transpose()) / out.value;
  out.gradient << -s, s;
  out.hessian << across, -across, -across, across;
  return out;
}

WayLength wayRoundCylinder(const Vec3 &from, const Vec3 &to, double radius, int side) {
  const Vec2 p = from.head<2>(), q = to.head<2>();
  if (!(p.norm() >= radius && q.norm() >= radius)) {
    WayLength out;
    out.value = HUGE_VAL;
    return out;
  }
  const Winding w = windingOf(p, q, radius, side);
  if (w.angle <= 0 && !w.lost) return straightWay(to - from);
  WayLength out;
  const double free_from = std::sqrt(p.squaredNorm() - radius * radius),
               free_to = std::sqrt(q.squaredNorm() - radius * radius), h = free_from + free_to + radius * w.angle,
               dz = to[2] - from[2];
  if (w.lost || !(free_from > 0 && free_to > 0)) {
    out.value = HUGE_VAL;
    return out;
  }
  out.angle = w.angle;
  out.value = std::hypot(h, dz);
  out.turning = w.angle * h / out.value;
  Eigen::Matrix<double, 6, 1> by_h = Eigen::Matrix<double, 6, 1>::Zero(), by_z = by_h;
  Eigen::Matrix<double, 6, 6> bent = Eigen::Matrix<double, 6, 6>::Zero();
  auto add = [&](int first, const Vec2 &end, double free, double angle) {
    const Vec2 normal = turned(end.normalized(), angle), along = (end - radius * normal) / free;
    by_h.segment<2>(first) = along;
    bent.block<2, 2>(first, first) = normal * normal.transpose() / free;
  };
  add(0, p, free_from, w.sense * w.from);
  add(3, q, free_to, -w.sense * w.to);
  by_z[2] = -1;
  by_z[5] = 1;
  out.gradient = (h * by_h + dz * by_z) / out.value;
  out.hessian =
      (by_h * by_h.transpose() + by_z * by_z.transpose() + h * bent - out.gradient * out.gradient.transpose()) /
      out.value;
  return out;
}

WayLength wayRoundSphere(const Vec3 &from, const Vec3 &to, double radius) {
  WayLength out;
  const double a = from.norm(), b = to.norm();
  out.value = HUGE_VAL;
  if (!(a >= radius && b >= radius)) return out;
  const Vec3 p = from / a, q = to / b, normal = p.cross(q);
  const double sine = normal.norm(), cosine = p.dot(q), between = std::atan2(sine, cosine),
               angle = between - std::acos(radius / a) - std::acos(radius / b);
  if (angle <= 0) return straightWay(to - from);
  const double free_from = std::sqrt(a * a - radius * radius), free_to = std::sqrt(b * b - radius * radius);
  if (!(free_from > 0 && free_to > 0 && sine > 1e-6)) return out; // straight through the middle all planes are alike
  out.angle = out.turning = angle;
  out.value = free_from + free_to + radius * angle;
  const Vec3 m = normal / sine;
  auto add = [&](int first, const Vec3 &end, const Vec3 &other, double distance, double free) {
    const Vec3 towards = (other - cosine * end) / sine;
    const double slope = free / distance, curvature = radius * radius / (distance * distance * free),
                 square = distance * distance;
    out.gradient.segment<3>(first) = slope * end - radius / distance * towards;
    out.hessian.block<3, 3>(first, first) = curvature * end * end.transpose() +
                                            slope / distance * (Mat3::Identity() - end * end.transpose()) +
                                            radius / square * (end * towards.transpose() + towards * end.transpose()) +
                                            radius * cosine / (sine * square) * m * m.transpose();
  };
  add(0, p, q, a, free_from);
  add(3, q, p, b, free_to);
  const Mat3 mixed = -radius / (a * b * sine) * m * m.transpose();
  out.hessian.block<3, 3>(0, 3) = mixed;
  out.hessian.block<3, 3>(3, 0) = mixed;
  return out;
}

std::vector<Vec3> drawnRoundCylinder(const Vec3 &from, const Vec3 &to, double radius, int side, int points) {
  const Vec2 p = from.head<2>(), q = to.head<2>();
  const Winding w = windingOf(p, q, radius, side);
  std::vector<Vec3> drawn;
  if (w.angle <= 0) return drawn;
  const double free_from = std::sqrt(p.squaredNorm() - radius * radius),
               free_to = std::sqrt(q.squaredNorm() - radius * radius), h = free_from + free_to + radius * w.angle;
  for (int k = 0; k < points; ++k) {
    const double part = w.angle * k / (points - 1), along = (free_from + radius * part) / h;
    const Vec2 on = radius * turned(p.normalized(), w.sense * (w.from + part));
    drawn.emplace_back(on[0], on[1], from[2] + along * (to[2] - from[2]));
  }
  return drawn;
}

std::vector<Vec3> drawnRoundSphere(const Vec3 &from, const Vec3 &to, double radius, int points) {
  std::vector<Vec3> drawn;
  const WayLength way = wayRoundSphere(from, to, radius);
  if (!(way.angle > 0)) return drawn;
  const Vec3 axis = from.cross(to).normalized(), start = from.normalized();
  const double first = std::acos(radius / from.norm());
  for (int k = 0; k < points; ++k)
    drawn.push_back(radius * (Eigen::AngleAxisd(first + way.angle * k / (points - 1), axis) * start));
  return drawn;
}

} // namespace tendril
