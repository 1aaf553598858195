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

} // namespace tendril
