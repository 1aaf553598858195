#pragma once
/// \file scalar.hpp
/// The scalar types the physics kernels are written for: `double`, a SIMD `Pack` of doubles (one element per lane), and, in the tests, an
/// automatic-differentiation type. Kernels use only arithmetic and the functions below, found for every type by argument-dependent lookup.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <experimental/simd>
#include <numbers>

namespace tendril {

using Pack = std::experimental::native_simd<double>;

inline constexpr double pi = std::numbers::pi;

template <class T> using Vector3 = Eigen::Matrix<T, 3, 1>;
template <class T> using Matrix3 = Eigen::Matrix<T, 3, 3>;
using Vec3 = Vector3<double>;
using Mat3 = Matrix3<double>;

/// `condition ? a : b`, without a branch for packs: both sides are evaluated.
inline double select(bool condition, double a, double b) { return condition ? a : b; }
inline Pack select(Pack::mask_type condition, const Pack &a, const Pack &b) {
  Pack r = b;
  where(condition, r) = a;
  return r;
}

} // namespace tendril

/// What Eigen must know of a pack to use it as the scalar of its fixed-size vectors.
template <> struct Eigen::NumTraits<tendril::Pack> : Eigen::NumTraits<double> {
  using Real = tendril::Pack;
  using NonInteger = tendril::Pack;
  using Nested = tendril::Pack;
  using Literal = double;
};
