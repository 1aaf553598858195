#pragma once
/// Rods, bodies and obstacles that touch each other.
#include "support/rods.hpp"

namespace tendril::test {

inline constexpr double earth = 9.81; ///< [m/s^2]

inline ContactSettings amongRods(double radius, ContactSettings::Rods rods = ContactSettings::Rods::others) {
  ContactSettings s;
  s.radius = radius;
  s.distance = 0.2 * radius;
  s.rods = rods;
  return s;
}

inline Rod wire(const std::string &name, const Vec3 &from, const Vec3 &to, int edges, double radius = 0.005,
                double young = 1e7) {
  Rod rod;
  rod.name = name;
  rod.position = lineShape(from, to, edges).points;
  rod.material = homogeneousMaterial({SectionShape::circle, {radius, 0}}, young, young / 2.6, 1000);
  rod.contact = amongRods(radius);
  setBishopDirectors(rod);
  return rod;
}

/// An obstacle that stands still.
inline Collider solid(std::shared_ptr<const Shape> shape, const Vec3 &position = Vec3::Zero()) {
  Collider c;
  c.name = "obstacle";
  c.shape = std::move(shape);
  c.position = position;
  return c;
}

inline Body shaped(const std::string &shape, const Vec3 &size, const Vec3 &at, const Mat3 &turn = Mat3::Identity()) {
  Body body;
  body.name = body.shape = shape;
  body.size = size;
  const MassProperties own = shape == "box"        ? boxMass(size, 1000)
                             : shape == "sphere"   ? sphereMass(size[0], 1000)
                             : shape == "cylinder" ? cylinderMass(size[0], size[1], 1000)
                                                   : capsuleMass(size[0], size[1], 1000);
  body.own = own.moved(turn, at);
  body.position = at;
  body.rotation = turn;
  body.contact.on = true;
  body.contact.distance = 0.02 * std::sqrt(own.inertia.trace() / own.mass);
  return body;
}

} // namespace tendril::test
