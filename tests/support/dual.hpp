#pragma once
/// Second-order forward automatic differentiation in N variables: the oracle for the closed-form derivatives.
#include <Eigen/Core>
#include <cmath>

namespace tendril::test {

template <int N> struct Dual {
  using Gradient = Eigen::Matrix<double, N, 1>;
  using Hessian = Eigen::Matrix<double, N, N>;
  double v = 0;
  Gradient g = Gradient::Zero();
  Hessian h = Hessian::Zero();

  Dual() = default;
  Dual(double value) : v(value) {}
  static Dual variable(double value, int index) {
    Dual d(value);
    d.g[index] = 1;
    return d;
  }
  /// f(x) with f', f'' at x.v
  static Dual chain(const Dual &x, double f, double f1, double f2) {
    Dual r(f);
    r.g = f1 * x.g;
    r.h = f1 * x.h + f2 * x.g * x.g.transpose();
    return r;
  }
  friend Dual operator+(const Dual &a, const Dual &b) { return combine(a, b, a.v + b.v, 1, 1, 0, 0, 0); }
  friend Dual operator-(const Dual &a, const Dual &b) { return combine(a, b, a.v - b.v, 1, -1, 0, 0, 0); }
  friend Dual operator*(const Dual &a, const Dual &b) { return combine(a, b, a.v * b.v, b.v, a.v, 0, 1, 0); }
  friend Dual operator/(const Dual &a, const Dual &b) {
    const double i = 1 / b.v;
    return combine(a, b, a.v * i, i, -a.v * i * i, 0, -i * i, 2 * a.v * i * i * i);
  }
  Dual operator-() const { return Dual(0.0) - *this; }
  Dual &operator+=(const Dual &b) { return *this = *this + b; }
  Dual &operator-=(const Dual &b) { return *this = *this - b; }
  Dual &operator*=(const Dual &b) { return *this = *this * b; }
  Dual &operator/=(const Dual &b) { return *this = *this / b; }
  friend bool operator<(const Dual &a, const Dual &b) { return a.v < b.v; }
  friend bool operator>(const Dual &a, const Dual &b) { return a.v > b.v; }

private:
  static Dual combine(const Dual &a, const Dual &b, double f, double fa, double fb, double faa, double fab,
                      double fbb) {
    Dual r(f);
    r.g = fa * a.g + fb * b.g;
    r.h = fa * a.h + fb * b.h + faa * a.g * a.g.transpose() + fbb * b.g * b.g.transpose() +
          fab * (a.g * b.g.transpose() + b.g * a.g.transpose());
    return r;
  }
};

template <int N> Dual<N> sqrt(const Dual<N> &x) {
  const double s = std::sqrt(x.v);
  return Dual<N>::chain(x, s, 0.5 / s, -0.25 / (s * x.v));
}
template <int N> Dual<N> sin(const Dual<N> &x) {
  return Dual<N>::chain(x, std::sin(x.v), std::cos(x.v), -std::sin(x.v));
}
template <int N> Dual<N> cos(const Dual<N> &x) {
  return Dual<N>::chain(x, std::cos(x.v), -std::sin(x.v), -std::cos(x.v));
}
template <int N> Dual<N> atan(const Dual<N> &x) {
  const double d = 1 / (1 + x.v * x.v);
  return Dual<N>::chain(x, std::atan(x.v), d, -2 * x.v * d * d);
}
template <int N> Dual<N> atan2(const Dual<N> &y, const Dual<N> &x) {
  // Through the quotient that is well defined here; the value from the two-argument function.
  Dual<N> r = std::abs(x.v) > std::abs(y.v) ? atan(y / x) : Dual<N>(0.0) - atan(x / y);
  r.v = std::atan2(y.v, x.v);
  return r;
}
template <int N> Dual<N> select(bool condition, const Dual<N> &a, const Dual<N> &b) { return condition ? a : b; }

} // namespace tendril::test

template <int N> struct Eigen::NumTraits<tendril::test::Dual<N>> : Eigen::NumTraits<double> {
  using Real = tendril::test::Dual<N>;
  using NonInteger = tendril::test::Dual<N>;
  using Nested = tendril::test::Dual<N>;
  enum { RequireInitialization = 1 };
};
