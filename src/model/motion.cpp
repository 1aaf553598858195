#include "tendril/model/motion.hpp"

#include <algorithm>
#include <utility>

namespace tendril {
namespace {

/// Fraction of the way through the interval that holds `time`, and the interval's left end.
std::pair<std::size_t, double> locate(const std::vector<Motion::Key> &table, double time) {
  if (time <= table.front().time) return {0, 0.0};
  if (time >= table.back().time) return {table.size() - 1, 0.0};
  const auto right =
      std::upper_bound(table.begin(), table.end(), time, [](double t, const Motion::Key &k) { return t < k.time; });
  const std::size_t i = std::size_t(right - table.begin()) - 1;
  return {i, (time - table[i].time) / (table[i + 1].time - table[i].time)};
}

Vec3 interpolate(const std::vector<Motion::Key> &table, double time, Vec3 Motion::Key::*member) {
  const auto [i, s] = locate(table, time);
  return s == 0 ? table[i].*member : Vec3((1 - s) * (table[i].*member) + s * (table[i + 1].*member));
}

/// How fast a member changes between the two rows around `time`, the one before where they meet; zero outside.
Vec3 slope(const std::vector<Motion::Key> &table, double time, Vec3 Motion::Key::*member) {
  for (std::size_t k = 1; k < table.size(); ++k)
    if (table[k - 1].time < time && time <= table[k].time)
      return (table[k].*member - table[k - 1].*member) / (table[k].time - table[k - 1].time);
  return Vec3::Zero();
}

} // namespace

Vec3 Motion::displacementAt(double time) const {
  Vec3 moved = table.empty() ? Vec3(velocity * time) : interpolate(table, time, &Key::displacement);
  if (!amplitude.isZero(0)) moved += 0.5 * (1 - std::cos(2 * pi * time / period)) * amplitude;
  return arm.isZero(0) ? moved : Vec3(moved + rotationAt(time) * arm - arm);
}

Vec3 Motion::velocityAt(double time) const {
  Vec3 moving = table.empty() ? velocity : slope(table, time, &Key::displacement);
  if (!amplitude.isZero(0)) moving += pi / period * std::sin(2 * pi * time / period) * amplitude;
  return arm.isZero(0) ? moving : Vec3(moving + angularVelocityAt(time).cross(rotationAt(time) * arm));
}

Vec3 Motion::rotationVectorAt(double time) const {
  return table.empty() ? Vec3(angular_velocity * time) : interpolate(table, time, &Key::rotation);
}

Mat3 Motion::rotationAt(double time) const {
  const Vec3 r = rotationVectorAt(time);
  const double angle = r.norm();
  if (angle == 0) return Mat3::Identity();
  return Eigen::AngleAxisd(angle, r / angle).toRotationMatrix();
}

/// Jl(r) dr/dt of the rotation vector r, Jl the left Jacobian of the exponential map.
Vec3 Motion::angularVelocityAt(double time) const {
  if (table.empty()) return angular_velocity;
  const Vec3 r = rotationVectorAt(time), rate = slope(table, time, &Key::rotation);
  const double angle = r.norm();
  if (angle < 1e-8) return rate;
  const Vec3 axis = r / angle;
  const double sine = std::sin(angle) / angle, cosine = (1 - std::cos(angle)) / angle;
  return sine * rate + (1 - sine) * axis * axis.dot(rate) + cosine * axis.cross(rate);
}

double Motion::evenUntil(double from, double to) const {
  constexpr double turn = 0.5;
  const auto row =
      std::upper_bound(table.begin(), table.end(), from, [](double t, const Motion::Key &k) { return t < k.time; });
  const double part = amplitude.isZero(0) ? HUGE_VAL : from + period / 32,
               next = std::min(part, row == table.end() ? to : std::min(to, row->time)),
               turned = (rotationVectorAt(next) - rotationVectorAt(from)).norm();
  return turned > turn ? from + (next - from) * turn / turned : next;
}

std::vector<double> Motion::stopsBetween(double from, double to) const {
  std::vector<double> corners, stops;
  for (const Key &row : table)
    if (std::min(from, to) < row.time && row.time < std::max(from, to)) corners.push_back(row.time);
  if (to < from) std::reverse(corners.begin(), corners.end());
  corners.push_back(to);
  for (const double corner : corners) {
    const int parts = 1 + int(2 * (rotationVectorAt(corner) - rotationVectorAt(from)).norm());
    for (int k = 1; k < parts; ++k) stops.push_back(from + (corner - from) * k / parts);
    stops.push_back(corner);
    from = corner;
  }
  return stops;
}

Vec3 Motion::turnBetween(double from, double to) const {
  Vec3 sum = Vec3::Zero();
  Mat3 before = rotationAt(from);
  for (const double time : stopsBetween(from, to)) {
    const Mat3 now = rotationAt(time);
    const Eigen::AngleAxisd turn(Mat3(now * before.transpose()));
    sum += turn.angle() * turn.axis();
    before = now;
  }
  return sum;
}

} // namespace tendril
