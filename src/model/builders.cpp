#include "tendril/model/builders.hpp"

#include <algorithm>

namespace tendril {

Polyline lineShape(const Vec3 &from, const Vec3 &to, int edges) {
  Polyline p;
  for (int i = 0; i <= edges; ++i) p.points.push_back(from + (to - from) * (double(i) / edges));
  return p;
}

Polyline ringShape(const Vec3 &center, const Vec3 &normal, double radius, int edges) {
  Polyline p;
  p.closed = true;
  const Vec3 a = anyNormal(normal), b = normal.cross(a);
  for (int i = 0; i < edges; ++i) {
    const double angle = 2 * pi * i / edges;
    p.points.push_back(center + radius * (std::cos(angle) * a + std::sin(angle) * b));
  }
  return p;
}

Polyline helixShape(const HelixShape &h) {
  Polyline p;
  const Vec3 other = h.axis.cross(h.start);
  for (int i = 0; i <= h.edges; ++i) {
    const double s = double(i) / h.edges, angle = 2 * pi * h.turns * s;
    const double q = h.taper > 0 ? std::clamp(std::min(s, 1 - s) / h.taper, 0.0, 1.0) : 1;
    const double radius = h.radius * q * q * (3 - 2 * q);
    p.points.push_back(h.origin + h.length * s * h.axis + radius * (std::cos(angle) * h.start + std::sin(angle) * other));
  }
  return p;
}

} // namespace tendril
