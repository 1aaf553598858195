#include "tendril/model/builders.hpp"

#include <algorithm>

namespace tendril {

namespace {

Polyline alongCurve(Curve curve, int edges, bool closed) {
  Polyline p;
  p.closed = closed;
  for (int i = 0; i < edges + (closed ? 0 : 1); ++i) p.points.push_back(curve(double(i) / edges));
  p.curve = std::move(curve);
  return p;
}

} // namespace

Polyline lineShape(const Vec3 &from, const Vec3 &to, int edges) {
  return alongCurve([=](double s) { return Vec3(from + (to - from) * s); }, edges, false);
}

Polyline ringShape(const Vec3 &center, const Vec3 &normal, double radius, int edges) {
  const Vec3 a = anyNormal(normal), b = normal.cross(a);
  return alongCurve(
      [=](double s) { return Vec3(center + radius * (std::cos(2 * pi * s) * a + std::sin(2 * pi * s) * b)); }, edges,
      true);
}

Polyline helixShape(const HelixShape &h) {
  const Vec3 other = h.axis.cross(h.start);
  return alongCurve(
      [=](double s) {
        const double angle = 2 * pi * h.turns * s;
        const double q = h.taper > 0 ? std::clamp(std::min(s, 1 - s) / h.taper, 0.0, 1.0) : 1;
        const double radius = h.radius * q * q * (3 - 2 * q);
        return Vec3(h.origin + h.length * s * h.axis + radius * (std::cos(angle) * h.start + std::sin(angle) * other));
      },
      h.edges, false);
}

} // namespace tendril
