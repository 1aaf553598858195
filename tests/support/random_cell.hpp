#pragma once
/// Random numbers that are the same on every machine, and random cells for the derivative tests.
#include "support/dual.hpp"

#include "tendril/energy/bend_twist.hpp"

#include <cstdint>

namespace tendril::test {

/// Uniform numbers in (-1, 1) from a multiplicative congruence: standard distributions differ between libraries.
class Random {
public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ull + 1) {}
  double operator()() {
    state_ = state_ * 6364136223846793005ull + 1442695040888963407ull;
    return double(state_ >> 11) / double(1ull << 52) - 1.0;
  }
  Vec3 vector() { return {(*this)(), (*this)(), (*this)()}; }
  Vec3 direction() {
    for (;;) {
      const Vec3 v = vector();
      if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
    }
  }

private:
  std::uint64_t state_;
};

struct RandomCell {
  Frame f0, f1;
  CellOf<double> cell;
};

/// A cell of random directions, stiffness, rest strain and twist whose edges turn by `fold` [rad].
inline RandomCell randomCell(Random &random, double fold) {
  RandomCell c;
  c.f0.tangent = random.direction();
  c.f0.director = orthonormalised(random.direction(), c.f0.tangent);
  const Vec3 axis = orthonormalised(random.direction(), c.f0.tangent);
  c.f1.tangent = rotateAbout<double>(c.f0.tangent, axis, fold);
  c.f1.director =
      rotateAbout<double>(transport<double>(c.f0.director, c.f0.tangent, c.f1.tangent), c.f1.tangent, 2 * random());
  c.f0.length = 1 + 0.5 * random();
  c.f1.length = 1 + 0.5 * random();
  for (int k = 0; k < 3; ++k) {
    c.cell.stiffness[k] = 1.5 + random();
    c.cell.rest[k] = random();
  }
  c.cell.base = 0;
  c.cell.weight = {0.5 + 0.1 * random(), 0.5 + 0.1 * random()};
  c.cell.free = {1, 1};
  c.cell.winding = 0;
  c.cell.sign = 1;
  return c;
}

/// The same cell under the law `classical`.
inline RandomCell classical(RandomCell c) {
  c.cell.base = 1;
  c.cell.weight = {0, 0};
  return c;
}

template <class T> CellOf<T> cast(const CellOf<double> &c) {
  CellOf<T> r;
  for (int k = 0; k < 3; ++k) {
    r.stiffness[k] = T(c.stiffness[k]);
    r.rest[k] = T(c.rest[k]);
  }
  for (int k = 0; k < 2; ++k) {
    r.weight[k] = T(c.weight[k]);
    r.free[k] = T(c.free[k]);
  }
  r.base = T(c.base);
  r.winding = T(c.winding);
  r.sign = T(c.sign);
  return r;
}

/// A vector turned by three variables, from `first` on, as a rotation vector, up to second order.
template <int N> Vector3<Dual<N>> turnedBy(const Vec3 &v, int first) {
  using D = Dual<N>;
  const Vector3<D> spin(D::variable(0, first), D::variable(0, first + 1), D::variable(0, first + 2));
  const Vector3<D> start{D(v[0]), D(v[1]), D(v[2])}, once = spin.cross(start), twice = spin.cross(once);
  return start + once + twice * D(0.5);
}

} // namespace tendril::test
