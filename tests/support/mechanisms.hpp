#pragma once
/// Bodies in joints, and what tendons do to them.
#include "support/touching.hpp"
#include "tendril/energy/joint.hpp"
#include "tendril/energy/tendon.hpp"

namespace tendril::test {

inline Waypoint ofBody(int body, const Vec3 &point) {
  Waypoint p;
  p.body = body;
  p.point = point;
  return p;
}
inline Waypoint ofWorld(const Vec3 &point) {
  Waypoint p;
  p.point = point;
  return p;
}

/// Beside a rod that is held, which carries its bodies.
inline Scene carried(Scene scene) {
  Rod carrier = wire("carrier", {0, 1, 0}, {0.1, 1, 0}, 1);
  carrier.contact.on = carrier.gravity = false;
  scene.rods = {carrier};
  scene.supports = {hold(scene, 0, 0, Support::Kind::pin), hold(scene, 0, 1, Support::Kind::pin)};
  scene.hostBodies();
  return scene;
}

inline constexpr double finger_stiffness = 9817.477042468; ///< [N/m]

/// Three bones with an eyelet each beside a held one, three hinges with springs, and a slider; see
/// data/reference/bodies_finger_equilibria.csv. \param pulled by which the slider goes until t = 1
inline Scene finger(bool spatial, double gravity, double pulled) {
  Scene scene;
  scene.gravity = {0, -gravity, 0};
  for (int k = 1; k < 4; ++k) {
    Body bone;
    bone.name = "bone" + std::to_string(k);
    const double middle = 0.1 + 0.2 * k, lift = 0.05 * 0.01 / 0.11;
    bone.own = {0.11, {middle, lift, 0}, Vec3(3e-5, 3e-4, 3.3e-4).asDiagonal()};
    bone.position = {middle, 0, 0};
    scene.bodies.push_back(bone);
    Joint hinge{};
    hinge.name = "hinge" + std::to_string(k);
    hinge.type = Joint::Type::hinge;
    hinge.child = k - 1;
    hinge.parent = k - 2;
    hinge.point = {0.2 * k, 0, 0};
    hinge.axes = Mat3::Identity();
    hinge.driven = true;
    hinge.drive_stiffness = 0.5;
    scene.joints.push_back(hinge);
  }
  Tendon t;
  t.name = "flexor";
  Waypoint slider, first;
  slider.point = {-0.1, 0.05, 0};
  slider.motion.table = {{0, Vec3::Zero(), Vec3::Zero()}, {1, Vec3(-pulled, 0, 0), Vec3::Zero()}};
  first.point = {0.1, 0.05, 0};
  t.points = {slider, first};
  t.segments = {{0, 1}};
  for (int k = 0; k < 3; ++k)
    if (spatial) {
      Waypoint eyelet;
      eyelet.body = k;
      eyelet.point = {0.3 + 0.2 * k, 0.05, 0};
      t.points.push_back(eyelet);
      t.segments.push_back({k + 1, k + 2});
    } else
      t.joints.push_back({k, -0.05});
  t.actuator.kind = Actuator::Kind::displacement;
  t.actuator.stiffness = finger_stiffness;
  scene.tendons = {t};
  return carried(scene);
}

inline TendonReading readingOf(const Simulation &run, bool dynamic = false) {
  const Configuration c = configurationOf(run.state, run.scene, *run.elements, run.state.time);
  return readTendon(run.scene, *run.elements, 0, run.state, c, dynamic);
}
inline double angleOf(const Simulation &run, int k) { return run.state.joints[std::size_t(k)].coordinate; }

} // namespace tendril::test
