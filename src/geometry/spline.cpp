#include "tendril/geometry/spline.hpp"

namespace tendril {

std::vector<Vec3> splineSlopes(const std::vector<Vec3> &x) {
  const std::size_t n = x.size() - 1;
  std::vector<double> h(n);
  std::vector<Vec3> d(n);
  for (std::size_t i = 0; i < n; ++i) {
    h[i] = (x[i + 1] - x[i]).norm();
    d[i] = (x[i + 1] - x[i]) / h[i];
  }
  if (n == 1) return {d[0], d[0]};
  if (n == 2) {
    const Vec3 c = (d[1] - d[0]) / (h[0] + h[1]);
    return {d[0] - h[0] * c, d[0] + h[0] * c, d[1] + h[1] * c};
  }
  // Rows lower m[i-1] + diagonal m[i] + upper m[i+1] = right, by elimination from the first to the last.
  std::vector<double> diagonal(n + 1), upper(n + 1, 0.0);
  std::vector<Vec3> m(n + 1);
  const double first = h[0] + h[1], last = h[n - 1] + h[n - 2];
  diagonal[0] = h[1];
  upper[0] = first;
  m[0] = ((h[0] + 2 * first) * h[1] * d[0] + h[0] * h[0] * d[1]) / first;
  for (std::size_t i = 1; i <= n; ++i) {
    const double lower = i < n ? h[i] : last;
    diagonal[i] = i < n ? 2 * (h[i - 1] + h[i]) : h[n - 2];
    if (i < n) upper[i] = h[i - 1];
    m[i] = i < n ? Vec3(3 * (h[i] * d[i - 1] + h[i - 1] * d[i]))
                 : Vec3(((h[n - 1] + 2 * last) * h[n - 2] * d[n - 1] + h[n - 1] * h[n - 1] * d[n - 2]) / last);
    const double factor = lower / diagonal[i - 1];
    diagonal[i] -= factor * upper[i - 1];
    m[i] -= factor * m[i - 1];
  }
  m[n] /= diagonal[n];
  for (std::size_t i = n; i-- > 0;) m[i] = (m[i] - upper[i] * m[i + 1]) / diagonal[i];
  return m;
}

} // namespace tendril
