#include "tendril/contact/segments.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {

Projection project(const Vec3 &point, const Vec3 &a, const Vec3 &b) {
  const Vec3 along = b - a;
  const double part = std::clamp((point - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
  const Vec3 from = point - a - part * along;
  return {part, from.norm(), from};
}

Closest closest(const Vec3 &a0, const Vec3 &a1, const Vec3 &b0, const Vec3 &b1) {
  Closest best{0, 0, HUGE_VAL, Vec3::Zero()};
  auto take = [&](double part, double other, const Vec3 &from) {
    if (const double d = from.norm(); d < best.distance) best = {part, other, d, from};
  };
  for (const double end : {0.0, 1.0}) {
    const Projection of_a = project(end == 0 ? a0 : a1, b0, b1), of_b = project(end == 0 ? b0 : b1, a0, a1);
    take(end, of_a.part, of_a.from);
    take(of_b.part, end, -of_b.from);
  }
  const Vec3 u = a1 - a0, v = b1 - b0, w = a0 - b0;
  const double uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm(), uw = u.dot(w), vw = v.dot(w),
               size = uu * vv - uv * uv;
  if (!(size > 0)) return best;
  const double part = (uv * vw - vv * uw) / size, other = (uu * vw - uv * uw) / size;
  if (part > 0 && part < 1 && other > 0 && other < 1) take(part, other, w + part * u - other * v);
  return best;
}

double freePart(const std::array<Vec3, 4> &from, const std::array<Vec3, 4> &way, double wall, double stop) {
  constexpr int most_steps = 200;
  constexpr double safety = 0.9;
  const Vec3 mean = 0.25 * (way[0] + way[1] + way[2] + way[3]);
  const double closing = std::max((way[0] - mean).norm(), (way[1] - mean).norm()) +
                         std::max((way[2] - mean).norm(), (way[3] - mean).norm());
  double done = 0;
  for (int step = 0; step < most_steps && closing > 0; ++step) {
    std::array<Vec3, 4> x;
    for (std::size_t k = 0; k < 4; ++k) x[k] = from[k] + done * way[k];
    const double gap = closest(x[0], x[1], x[2], x[3]).distance - wall;
    if (gap - closing * (1 - done) > stop) return 1;
    if (gap <= stop && step > 0) return done;
    done += safety * std::max(gap, 0.0) / closing;
    if (done >= 1) return 1;
  }
  return closing > 0 ? done : 1;
}

} // namespace tendril
