#include "tendril/model/body.hpp"

#include <Eigen/Eigenvalues>

#include <sstream>

namespace tendril {
namespace {

/// Of a mass at a place: inertia about the origin [kg m^2].
Mat3 pointInertia(double mass, const Vec3 &x) {
  return mass * (x.squaredNorm() * Mat3::Identity() - x * x.transpose());
}

MassProperties ofRevolution(double mass, double along, double across) {
  return {mass, Vec3::Zero(), Vec3(across, across, along).asDiagonal()};
}

} // namespace

void MassProperties::add(const MassProperties &other) {
  const double both = mass + other.mass;
  if (!(both > 0)) return;
  const Vec3 common = (mass * centre + other.mass * other.centre) / both;
  inertia += pointInertia(mass, centre - common) + other.inertia + pointInertia(other.mass, other.centre - common);
  centre = common;
  mass = both;
}

MassProperties MassProperties::moved(const Mat3 &rotation, const Vec3 &translation) const {
  return {mass, rotation * centre + translation, rotation * inertia * rotation.transpose()};
}

MassProperties boxMass(const Vec3 &size, double density) {
  const double mass = density * size.prod();
  const Vec3 squares = size.cwiseAbs2();
  return {mass, Vec3::Zero(), (mass / 12 * (Vec3::Constant(squares.sum()) - squares)).asDiagonal()};
}

MassProperties sphereMass(double radius, double density) {
  const double mass = density * 4.0 / 3 * pi * std::pow(radius, 3), inertia = 0.4 * mass * radius * radius;
  return ofRevolution(mass, inertia, inertia);
}

MassProperties cylinderMass(double radius, double length, double density) {
  const double square = radius * radius, mass = density * pi * square * length;
  return ofRevolution(mass, 0.5 * mass * square, mass * (3 * square + length * length) / 12);
}

MassProperties capsuleMass(double radius, double length, double density) {
  const double square = radius * radius, tube = density * pi * square * length,
               ball = density * 4.0 / 3 * pi * square * radius;
  return ofRevolution(tube + ball, 0.5 * tube * square + 0.4 * ball * square,
                      tube * (length * length / 12 + 0.25 * square) +
                          ball * (0.4 * square + 0.25 * length * length + 0.375 * length * radius));
}

MassProperties meshMass(const TriangleMesh &mesh, double density) {
  double six_volumes = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  const Vec3 near = mesh.vertices.front(); // sums about a point of the surface keep their digits
  for (const auto &[i, j, k] : mesh.triangles) {
    const Vec3 a = mesh.vertices[i] - near, b = mesh.vertices[j] - near, c = mesh.vertices[k] - near, sum = a + b + c;
    const double six = a.dot(b.cross(c));
    six_volumes += six;
    first += six * sum;
    second += six * (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  const double volume = six_volumes / 6;
  const Vec3 centre = first / (24 * volume);
  const Mat3 about = second / 120 - volume * centre * centre.transpose();
  return {density * volume, near + centre, density * (about.trace() * Mat3::Identity() - about)};
}

std::string flawOf(const Mat3 &inertia) {
  constexpr double rounding = 1e-9;
  std::ostringstream text;
  const Vec3 moments = Eigen::SelfAdjointEigenSolver<Mat3>(inertia).eigenvalues(); // rising
  if (!inertia.allFinite() || !(moments[0] > 0))
    text << "its principal moments are " << moments.transpose() << ", and must be positive";
  else if (moments[2] > (moments[0] + moments[1]) * (1 + rounding))
    text << "of its principal moments " << moments.transpose() << " the largest is more than the sum of the others";
  return text.str();
}

} // namespace tendril
