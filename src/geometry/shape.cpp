#include "tendril/geometry/solids.hpp"

namespace tendril {
namespace {

/// Of the distance from a point or an axis, by what is between.
Distance fromCentre(const Vec3 &between, const Mat3 &across, double radius) {
  const double d = between.norm();
  const Vec3 n = d > 0 ? Vec3(between / d) : Vec3::UnitX();
  if (d == 0) return {-radius, n, Mat3::Zero()};
  return {d - radius, n, (across - n * n.transpose()) / d};
}

/// With the distances a from one family of faces and b from another: docs/theory.md (17.10), (17.11).
Distance outsideBoth(const Distance &a, const Distance &b) {
  if (a.value <= 0 || b.value <= 0) return a.value >= b.value ? a : b;
  const double d = std::hypot(a.value, b.value), x = a.value / d, y = b.value / d;
  const Vec3 along = x * a.gradient + y * b.gradient, across = y * a.gradient - x * b.gradient;
  return {d, along, x * a.hessian + y * b.hessian + across * across.transpose() / d};
}

template <class Solid> class ShapeOf final : public Shape {
public:
  explicit ShapeOf(const Solid &solid) : solid_(solid) {}
  void distances(const double *const point[3], int count, double *out) const override {
    const int whole = count - count % lanes;
    for (int i = 0; i < whole; i += lanes)
      write(out + i, solid_.distance(
                         Vector3<Pack>(read<Pack>(point[0] + i), read<Pack>(point[1] + i), read<Pack>(point[2] + i))));
    for (int i = whole; i < count; ++i) out[i] = solid_.distance(Vec3(point[0][i], point[1][i], point[2][i]));
  }
  Distance at(const Vec3 &point) const override { return solid_.at(point); }
  double curvatureRadius() const override { return solid_.curvatureRadius(); }
  double depth() const override { return solid_.depth(); }
  bool isConvex() const override { return solid_.isConvex(); }

private:
  Solid solid_;
};

template <class Solid> std::shared_ptr<const Shape> make(const Solid &solid) {
  return std::make_shared<ShapeOf<Solid>>(solid);
}

} // namespace

Distance CapsuleSolid::at(const Vec3 &x) const {
  const double foot = std::clamp(x[2], -half, half);
  Mat3 across = Mat3::Identity();
  if (std::abs(x[2]) < half) across(2, 2) = 0; // the foot goes along
  return fromCentre(x - foot * Vec3::UnitZ(), across, radius);
}

Distance TubeSolid::at(const Vec3 &x) const {
  Mat3 plane = Mat3::Identity();
  plane(2, 2) = 0;
  Distance walls = fromCentre(Vec3(x[0], x[1], 0), plane, 0);
  const bool inward = bore >= 0 && (outer == HUGE_VAL || walls.value < 0.5 * (bore + outer));
  if (inward) walls = {walls.value, -walls.gradient, -walls.hessian};
  walls.value = fromWalls(walls.value);
  if (half == HUGE_VAL) return walls;
  return outsideBoth(walls, {std::abs(x[2]) - half, std::copysign(1.0, x[2]) * Vec3::UnitZ(), Mat3::Zero()});
}

Distance BoxSolid::at(const Vec3 &x) const {
  Distance d{-HUGE_VAL, Vec3::Zero(), Mat3::Zero()};
  for (int k = 0; k < 3; ++k)
    d = outsideBoth(d, {std::abs(x[k]) - half[k], std::copysign(1.0, x[k]) * Vec3::Unit(k), Mat3::Zero()});
  return d;
}

std::shared_ptr<const Shape> makeHalfSpace() { return make(HalfSpaceSolid{}); }
std::shared_ptr<const Shape> makeSphere(double radius) { return make(CapsuleSolid{radius, 0}); }
std::shared_ptr<const Shape> makeCapsule(double radius, double length) {
  return make(CapsuleSolid{radius, 0.5 * length});
}
std::shared_ptr<const Shape> makeCylinder(double radius, double length) {
  return make(TubeSolid{-1, radius, 0.5 * length});
}
std::shared_ptr<const Shape> makeBox(const Vec3 &size) { return make(BoxSolid{0.5 * size}); }
std::shared_ptr<const Shape> makeTube(double bore, double outer, double length) {
  return make(TubeSolid{bore, outer, 0.5 * length});
}

} // namespace tendril
