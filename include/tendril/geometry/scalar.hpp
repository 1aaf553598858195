#pragma once
/// \file scalar.hpp
/// The scalar types the physics kernels are written for: `double`, a SIMD `Pack` of doubles (one element per lane),
/// and, in the tests, an automatic-differentiation type. Kernels use only arithmetic and the functions below, found for
/// every type by argument-dependent lookup.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <experimental/simd>
#include <limits>
#include <numbers>

#if defined(__x86_64__) && defined(__GLIBC__)
#if __GLIBC_PREREQ(2, 35)
#define TENDRIL_LIBMVEC 1
#include <immintrin.h>
#endif
#endif

namespace tendril {

using Pack = std::experimental::native_simd<double>;
inline constexpr int lanes = int(Pack::size());

inline constexpr double pi = std::numbers::pi;
/// Of rounding, relative to one.
inline constexpr double epsilon = std::numeric_limits<double>::epsilon();

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

/// A scalar from memory, to memory, and added to memory: one number, or as many neighbours as a pack has lanes.
template <class T> T read(const double *p) {
  if constexpr (std::is_same_v<T, Pack>)
    return Pack(p, std::experimental::element_aligned);
  else
    return *p;
}
inline void write(double *p, double v) { *p = v; }
inline void write(double *p, const Pack &v) { v.copy_to(p, std::experimental::element_aligned); }
template <class T> void addTo(double *p, const T &v) { write(p, read<T>(p) + v); }

/// Adds `d` to the unevaluated sum high + low, of which `high` stays the rounded value (TwoSum: Knuth, The Art of
/// Computer Programming 2, 4.2.2).
template <class T> void addTwoWords(T &high, T &low, const T &d) {
  const T sum = high + d, added = sum - high;
  const T rest = low + ((high - (sum - added)) + (d - added));
  high = sum + rest;
  low = rest - (high - sum);
}

/// Lanes below `count`.
inline Pack::mask_type firstLanes(int count) {
  return Pack([](auto lane) { return double(lane); }) < Pack(double(count));
}

inline double sum(double v) { return v; }
inline double sum(const Pack &v) { return reduce(v); }

// Transcendental functions: the C library's, for packs its vector versions (libmvec, errors below 4 ulp) where there
// are some.
template <class T> T arcTangent(const T &x) {
  using std::atan;
  return atan(x);
}
template <class T> T arcTangent2(const T &y, const T &x) {
  using std::atan2;
  return atan2(y, x);
}
template <class T> T sine(const T &x) {
  using std::sin;
  return sin(x);
}
template <class T> T cosine(const T &x) {
  using std::cos;
  return cos(x);
}

#ifdef TENDRIL_LIBMVEC
#if defined(__AVX512F__)
#define TENDRIL_MVEC(arguments, function) _ZGVeN8##arguments##_##function
using Register = __m512d;
#elif defined(__AVX2__)
#define TENDRIL_MVEC(arguments, function) _ZGVdN4##arguments##_##function
using Register = __m256d;
#else
#define TENDRIL_MVEC(arguments, function) _ZGVbN2##arguments##_##function
using Register = __m128d;
#endif
extern "C" {
Register TENDRIL_MVEC(v, atan)(Register);
Register TENDRIL_MVEC(vv, atan2)(Register, Register);
Register TENDRIL_MVEC(v, sin)(Register);
Register TENDRIL_MVEC(v, cos)(Register);
}
inline Pack arcTangent(const Pack &x) { return Pack(TENDRIL_MVEC(v, atan)(static_cast<Register>(x))); }
inline Pack arcTangent2(const Pack &y, const Pack &x) {
  return Pack(TENDRIL_MVEC(vv, atan2)(static_cast<Register>(y), static_cast<Register>(x)));
}
inline Pack sine(const Pack &x) { return Pack(TENDRIL_MVEC(v, sin)(static_cast<Register>(x))); }
inline Pack cosine(const Pack &x) { return Pack(TENDRIL_MVEC(v, cos)(static_cast<Register>(x))); }
#undef TENDRIL_MVEC
#endif

} // namespace tendril

/// What Eigen must know of a pack to use it as the scalar of its fixed-size vectors.
template <> struct Eigen::NumTraits<tendril::Pack> : Eigen::NumTraits<double> {
  using Real = tendril::Pack;
  using NonInteger = tendril::Pack;
  using Nested = tendril::Pack;
  using Literal = double;
};
