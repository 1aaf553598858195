#include "tendril/contact/friction.hpp"

#include "tendril/coupling/stencil_term.hpp"
#include "tendril/energy/bend_twist.hpp"
#include "tendril/energy/constraint.hpp"

#include <algorithm>

namespace tendril {

const ContactMemory *find(const std::vector<ContactMemory> &memory, int edge, int collider, int point) {
  const auto key = std::tuple(edge, collider, point);
  const auto found = std::lower_bound(memory.begin(), memory.end(), key,
                                      [](const ContactMemory &m, const auto &k) { return m.key() < k; });
  return found != memory.end() && found->key() == key ? &*found : nullptr;
}

ContactSettings bothSlide(const ContactSettings &a, const ContactSettings &b) {
  ContactSettings both = a;
  for (double ContactSettings::*value :
       {&ContactSettings::friction, &ContactSettings::fall_off_velocity, &ContactSettings::tangential_damping,
        &ContactSettings::normal_damping, &ContactSettings::slip_length})
    both.*value = std::sqrt(a.*value * b.*value);
  return both;
}

Vec3 wayOf(const SlidingPoint &point, const Configuration &c, const Collider::Pose &pose) {
  const Vec3 from = c.positionAt(point.slot);
  const Vec3 axis = from + point.at * (c.positionAt(point.slot + 1) - from);
  return axis + matrixOf(c.frameAt(point.slot)) * point.arm - (pose.position + pose.rotation * point.touched) -
         point.start;
}

SlidingForce slidingForce(const SlidingPoint &point, const ContactSettings &settings, const Sliding &sliding,
                          const Vec3 &way) {
  SlidingForce force;
  const double along_normal = point.normal.dot(way), a = sliding.fall_off;
  const Vec3 across = way - along_normal * point.normal, drawn = across + point.stick;
  const Mat3 plane = Mat3::Identity() - point.normal * point.normal.transpose();
  if (sliding.holds) {
    const double stiffness = point.pressing / a;
    const Vec3 held = plane * point.held;
    return {0.5 * stiffness * across.squaredNorm() - held.dot(across), stiffness * across - held, stiffness * plane};
  }
  const double u = drawn.norm(), limit = point.pressing * point.coefficient;
  if (limit > 0) {
    const bool slides = u >= a;
    const double slope_over_u = slides ? 1 / u : 2 / a - u / (a * a);
    force.value = limit * (slides ? u - a / 3 : u * u / a - u * u * u / (3 * a * a));
    force.gradient = limit * slope_over_u * drawn;
    force.hessian = limit * slope_over_u * plane;
    if (u > 0) { // the force grows less along the way than its direction turns across it
      const Vec3 t = drawn / u;
      force.hessian -= limit * (slides ? slope_over_u : u / (a * a)) * t * t.transpose();
    }
  }
  if (sliding.time == 0) return force;
  const double tangential = point.pressing * settings.tangential_damping / sliding.time,
               normal = point.pressing * settings.normal_damping / sliding.time;
  force.value += 0.5 * (tangential * across.squaredNorm() + normal * along_normal * along_normal);
  force.gradient += tangential * across + normal * along_normal * point.normal;
  force.hessian += tangential * plane + normal * point.normal * point.normal.transpose();
  return force;
}

void addOnAxis(double at, int slot, const Vec3 &gradient, const Mat3 &hessian, const BlockPlanes *blocks,
               Derivatives &out) {
  spread(at, slot, gradient, out.equilibrium);
  for (int a = 0; blocks && a < 3; ++a)
    for (int b = a; b < 3; ++b) {
      blocks->vertex(a, b)[slot] += (1 - at) * hessian(a, b);
      blocks->vertex(a, b)[slot + 1] += at * hessian(a, b);
      blocks->own(a, b)[slot] -= at * (1 - at) * hessian(a, b);
    }
}

/// The point is y = x_i + s e + o, with the arm o turned by the spin of the edge. What joins x_i with the edge is
/// D2 dy/dspin.
void addSliding(const SlidingPoint &point, const SlidingForce &force, const Configuration &c, const BlockPlanes *blocks,
                Derivatives &out) {
  const double s = point.at;
  const int slot = point.slot;
  const Vec3 &g = force.gradient;
  const Mat3 &h = force.hessian;
  addOnAxis(s, slot, g, h, blocks, out);
  if (point.arm.isZero(0)) return;
  const Frame frame = c.frameAt(slot);
  const Vec3 o = matrixOf(frame) * point.arm;
  const Mat3 cross = crossMatrix(o);
  VectorDerivatives by_spin;
  by_spin.gradient = o.cross(g);
  by_spin.hessian =
      cross.transpose() * h * cross + 0.5 * (g * o.transpose() + o * g.transpose()) - g.dot(o) * Mat3::Identity();
  Local<edge_size> local;
  const EdgeDerivatives edge = overEdge(frame, by_spin, true);
  local.gradient = edge.gradient;
  local.hessian = edge.hessian;
  if (blocks) {
    Eigen::Matrix<double, 3, 4> spin; // of the edge, by its vector and twist
    spin << crossMatrix(frame.tangent) / frame.length, frame.tangent;
    const Eigen::Matrix<double, 3, 4> joined = -h * cross * spin;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < edge_size; ++b) {
        blocks->joined(a, b)[slot] += joined(a, b);
        local.hessian(a, b) += s * joined(a, b);
        local.hessian(b, a) += s * joined(a, b);
      }
  }
  addSite<SiteKind::edge>(local, 0, slot, blocks, out);
}

} // namespace tendril
