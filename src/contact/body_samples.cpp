#include "tendril/contact/body_samples.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {
namespace {

constexpr int parts = 4, around = 48; ///< of the longest side; of a rim

/// Even parts from -1/2 to 1/2, none longer than a quarter of the longest side.
std::vector<double> divided(double side, double longest) {
  const int n = std::max(1, int(std::ceil(parts * side / longest - 1e-9)));
  std::vector<double> out;
  for (int k = 0; k <= n; ++k) out.push_back((double(k) / n - 0.5) * side);
  return out;
}

void addBox(const Vec3 &size, std::vector<BodySample> &out) {
  const double longest = size.maxCoeff();
  const std::vector<double> x = divided(size[0], longest), y = divided(size[1], longest), z = divided(size[2], longest);
  for (std::size_t i = 0; i < x.size(); ++i)
    for (std::size_t j = 0; j < y.size(); ++j)
      for (std::size_t k = 0; k < z.size(); ++k)
        if (i % (x.size() - 1) == 0 || j % (y.size() - 1) == 0 || k % (z.size() - 1) == 0)
          out.push_back({{x[i], y[j], z[k]}});
}

void addCylinder(double radius, double length, std::vector<BodySample> &out) {
  for (const double z : divided(length, std::max(length, 2 * radius)))
    for (int k = 0; k < around; ++k) {
      const double angle = 2 * pi * k / around;
      out.push_back({{radius * std::cos(angle), radius * std::sin(angle), z}});
    }
  for (const double end : {-0.5, 0.5}) { // flat ends
    out.push_back({{0, 0, end * length}});
    for (int ring = 1; ring < parts; ++ring)
      for (int k = 0; k < around / 2; ++k) {
        const double angle = 4 * pi * k / around, r = radius * ring / parts;
        out.push_back({{r * std::cos(angle), r * std::sin(angle), end * length}});
      }
  }
}

void addMesh(const TriangleMesh &mesh, std::vector<BodySample> &out) {
  for (const Vec3 &x : mesh.vertices) out.push_back({x});
  for (const auto &t : mesh.triangles) {
    Vec3 middle = Vec3::Zero();
    for (const int v : t) middle += mesh.vertices[std::size_t(v)] / 3;
    out.push_back({middle});
  }
}

} // namespace

std::vector<BodySample> surfaceSamples(const Body &body, const Vec3 &centre) {
  std::vector<BodySample> samples; // in its own axes
  if (body.shape == "sphere") samples = {{Vec3::Zero(), body.size[0]}};
  if (body.shape == "capsule")
    for (const double z : divided(body.size[1], std::min(body.size[1], 2 * body.size[0])))
      samples.push_back({{0, 0, z}, body.size[0]});
  if (body.shape == "box") addBox(body.size, samples);
  if (body.shape == "cylinder") addCylinder(body.size[0], body.size[1], samples);
  if (body.mesh) addMesh(*body.mesh, samples);
  for (BodySample &s : samples) s.arm = body.position + body.rotation * s.arm - centre;
  return samples;
}

std::shared_ptr<const Shape> solidOf(const Body &body) {
  if (body.solid) return body.solid;
  if (body.shape == "sphere") return makeSphere(body.size[0]);
  if (body.shape == "capsule") return makeCapsule(body.size[0], body.size[1]);
  if (body.shape == "cylinder") return makeCylinder(body.size[0], body.size[1]);
  if (body.shape == "box") return makeBox(body.size);
  if (body.mesh) return makeMesh(*body.mesh, body.cell);
  return nullptr;
}

double loadOn(const Scene &scene, const Elements &elements, int b) {
  const Body &body = scene.bodies[std::size_t(b)];
  return (body.gravity ? elements.bodyMass(b).mass * scene.gravity.norm() : 0) + body.force.norm() +
         body.torque.norm() / elements.bodySize(b);
}

/// Of a point so far from what a motion turns about.
static double fastest(const Motion &motion, double arm) {
  double most =
      motion.velocity.norm() + arm * motion.angular_velocity.norm() + pi / motion.period * motion.amplitude.norm();
  for (const Motion::Key &k : motion.table)
    most = std::max(most, motion.velocityAt(k.time).norm() + arm * motion.angularVelocityAt(k.time).norm());
  return most;
}

double pressOn(const Scene &scene, const Elements &elements, int b) {
  const Body &body = scene.bodies[std::size_t(b)];
  const double mass = elements.bodyMass(b).mass, size = elements.bodySize(b);
  if (body.contact.stiffness > 0) return body.contact.stiffness;
  double speed = body.velocity.norm() + size * body.angular_velocity.norm();
  for (const Collider &c : scene.colliders) speed = std::max(speed, fastest(c.motion, size + c.size.norm()));
  constexpr double part = 0.1; // of what stops it within the barrier
  return std::max(
      {loadOn(scene, elements, b), part * mass * speed * speed / body.contact.distance, 1e-3 * mass * size});
}

} // namespace tendril
