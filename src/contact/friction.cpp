#include "tendril/contact/friction.hpp"

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
  return placeOf(point.rod, c) - pose.fromLocal(point.touched) - point.start;
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

} // namespace tendril
