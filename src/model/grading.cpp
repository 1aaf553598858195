#include "tendril/model/grading.hpp"

#include <algorithm>

namespace tendril {
namespace {

constexpr double corner =
    30 * pi / 180; ///< turning of a corner [rad]; where a smooth rod turns so much, its strains are 10 % off
constexpr double power = 1.0 / 3;      ///< of the squared curvature
constexpr double least_curvature = 10; ///< over the length; with less, hooks whose straight part bends under its load
                                       ///< need more edges than uniform ones
constexpr double most_growth = 1.5;    ///< of edges from one to the next; with 1.2, hooks need up to 9 % more edges
constexpr double most_step = 1.2;      ///< of edges across a place that stays
constexpr int least_samples = 1024;    ///< along a rod
constexpr int first_edges =
    8; ///< of a rod, or as many as turn by `corner` a vertex: those at which the growth is bounded

double interpolate(const std::vector<double> &x, const std::vector<double> &y, double at) {
  const auto above = std::upper_bound(x.begin(), x.end(), at);
  if (above == x.begin()) return y.front();
  if (above == x.end()) return y.back();
  const std::size_t k = std::size_t(above - x.begin()) - 1;
  return at == x[k] ? y[k] : y[k] + (at - x[k]) / (x[k + 1] - x[k]) * (y[k + 1] - y[k]);
}

double angleBetween(const Vec3 &a, const Vec3 &b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

double turningAt(const Rod &rod, int vertex) {
  const int a = rod.edgeBefore(vertex), b = rod.edgeAfter(vertex);
  return a < 0 || b < 0 ? 0 : angleBetween(rod.edge(a), rod.edge(b));
}

/// A rod as drawn, at samples `parameter` that hold all its vertices.
struct Samples {
  std::vector<double> parameter, length, curvature;
  double turning = 0;
};

/// Curvatures at the vertices of a polyline [1/m]; corners and ends take that of a neighbour.
std::vector<double> curvatures(const Rod &rod, double &turning) {
  const int n = rod.vertices();
  std::vector<double> out(n, -1);
  for (int v = 0; v < n; ++v) {
    const int a = rod.edgeBefore(v), b = rod.edgeAfter(v);
    if (a < 0 || b < 0 || isCorner(rod, v)) continue;
    turning += turningAt(rod, v);
    out[v] = turningAt(rod, v) / (0.5 * (rod.edge(a).norm() + rod.edge(b).norm()));
  }
  std::vector<double> filled = out;
  for (int v = 0; v < n; ++v)
    if (out[v] < 0) {
      const double before = v > 0        ? out[v - 1]
                            : rod.closed ? out[n - 1]
                                         : -1,
                   after = v + 1 < n    ? out[v + 1]
                           : rod.closed ? out[0]
                                        : -1;
      filled[v] = std::max({0.0, before, after});
    }
  return filled;
}

Samples sample(const Rod &rod, const Curve &curve) {
  constexpr int most_samples = 1 << 20;
  const int n = rod.edges();
  int each = (least_samples + n - 1) / n;
  Rod fine = rod;
  auto isCoarse = [&] {
    for (int v = 0; v < fine.vertices(); ++v)
      if (isCorner(fine, v)) return true;
    return false;
  };
  for (; curve; each *= 2) {
    fine.position.clear();
    for (int j = 0; j < n * each + (rod.closed ? 0 : 1); ++j) fine.position.push_back(curve(double(j) / (n * each)));
    if (!isCoarse() || n * each > most_samples) break;
  }
  Samples out;
  const std::vector<double> at_vertices = curvatures(fine, out.turning);
  const int inner = curve ? 1 : each; // samples of an edge of `fine`
  double along = 0;
  for (int e = 0; e < fine.edges(); ++e) {
    const double h = fine.edge(e).norm() / inner;
    for (int j = 0; j < inner; ++j) {
      out.parameter.push_back((double(e) * inner + j) / (n * each));
      out.length.push_back(along);
      out.curvature.push_back(at_vertices[e] + double(j) / inner * (at_vertices[fine.next(e)] - at_vertices[e]));
      along += h;
    }
  }
  out.parameter.push_back(1);
  out.length.push_back(along);
  out.curvature.push_back(at_vertices[fine.closed ? 0 : fine.vertices() - 1]);
  return out;
}

std::vector<double> integral(const std::vector<double> &density, const std::vector<double> &length) {
  std::vector<double> out{0};
  for (std::size_t j = 1; j < length.size(); ++j)
    out.push_back(out.back() + 0.5 * (density[j] + density[j - 1]) * (length[j] - length[j - 1]));
  return out;
}

/// Raises a density so that edges grow by at most `most_growth` from one to the next when there are `edges` of them.
void boundGrowth(std::vector<double> &density, const std::vector<double> &length, bool closed, int edges) {
  for (int repeat = 0; repeat < 4; ++repeat) { // raised somewhere, it falls elsewhere
    const double slope = edges * std::log(most_growth) / integral(density, length).back();
    std::vector<double> h(density.size());
    std::transform(density.begin(), density.end(), h.begin(), [](double d) { return 1 / d; });
    for (int round = 0; round < (closed ? 2 : 1); ++round) {
      if (closed) h.front() = h.back() = std::min(h.front(), h.back());
      for (std::size_t j = 1; j < h.size(); ++j) h[j] = std::min(h[j], h[j - 1] + slope * (length[j] - length[j - 1]));
      if (closed) h.front() = h.back();
      for (std::size_t j = h.size() - 1; j > 0; --j)
        h[j - 1] = std::min(h[j - 1], h[j] + slope * (length[j] - length[j - 1]));
    }
    std::transform(h.begin(), h.end(), density.begin(), [](double x) { return 1 / x; });
  }
}

/// Whole numbers of edges up to each end of segments, when there are `multiple` in all. `worst` is the largest ratio by
/// which that changes edge lengths from a segment to the next.
std::vector<int> wholeEdges(const std::vector<double> &ends, int multiple, bool closed, double &worst) {
  std::vector<int> out{0};
  const int segments = int(ends.size()) - 1;
  for (int k = 1; k <= segments; ++k)
    out.push_back(std::clamp(int(std::lround(ends[k] * multiple)), out.back() + 1, multiple - (segments - k)));
  worst = 1;
  auto change = [&](int k) { return (ends[k + 1] - ends[k]) * multiple / (out[k + 1] - out[k]); };
  for (int k = closed ? 0 : 1; k < segments; ++k) {
    const double ratio = change(k) / change(k > 0 ? k - 1 : segments - 1);
    worst = std::max({worst, ratio, 1 / ratio});
  }
  return out;
}

/// The fewest edges that put the ends of segments on vertices without large steps of the edge length. Where those take
/// more than `cheap`, larger steps do; beyond `most`, the smallest there are.
std::vector<int> fewestEdges(const std::vector<double> &ends, int cheap, int most, bool closed) {
  constexpr double large_step = 2;
  constexpr int most_tries = 500;
  const int segments = int(ends.size()) - 1;
  std::vector<int> best, good;
  double least = 0;
  for (int m = segments; m <= std::max(most, segments); m += 1 + std::max(most - segments, 0) / most_tries) {
    double worst;
    if (m > cheap && !good.empty()) break;
    const std::vector<int> counts = wholeEdges(ends, m, closed, worst);
    if (worst <= most_step && m <= cheap) return counts;
    if (worst <= large_step && good.empty()) good = counts;
    if (best.empty() || worst < least) {
      best = counts;
      least = worst;
    }
  }
  return good.empty() ? best : good;
}

} // namespace

double Grading::parameterAt(double at) const { return interpolate(place, parameter, at); }
double Grading::placeOf(double at) const { return interpolate(parameter, place, at); }
double Grading::lengthOf(double at) const { return interpolate(parameter, length, at); }
double Grading::parameterOf(double at) const { return interpolate(length, parameter, at); }

double Grading::middle(int edge, int edges) const {
  auto lengthAt = [&](int vertex) {
    const double round = std::floor(double(vertex) / edges);
    return interpolate(place, length, vertex / double(edges) - round) + round * length.back();
  };
  return 0.5 * (lengthAt(edge) + lengthAt(edge + 1));
}

bool isCorner(const Rod &rod, int vertex) { return turningAt(rod, vertex) > corner; }

Grading gradingByCurvature(const Rod &rod, const Curve &curve, const std::vector<int> &named) {
  Samples s = sample(rod, curve);
  Grading out{{}, std::move(s.parameter), std::move(s.length), {}, 1, s.turning, true};
  const int edges = std::max(first_edges, int(std::ceil(s.turning / corner)));
  std::vector<double> density;
  const double least = least_curvature / out.length.back();
  for (const double k : s.curvature) density.push_back(std::pow(k * k + least * least, power));
  boundGrowth(density, out.length, rod.closed, edges);
  std::vector<double> count = integral(density, out.length);
  const double all = count.back();
  for (double &c : count) c /= all;
  for (std::size_t j = 1; j < count.size(); ++j)
    out.uniform = out.uniform && std::abs((count[j] - count[j - 1]) * double(count.size() - 1) - 1) < 0.01;

  const int n = rod.edges();
  std::vector<int> vertices{0, n};
  for (const int v : named) vertices.push_back(v);
  for (int v = 0; v < rod.vertices() && !curve; ++v)
    if (isCorner(rod, v)) vertices.push_back(v);
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  const std::size_t each = (count.size() - 1) / n;
  std::vector<double> ends;
  for (const int v : vertices) ends.push_back(count[v * each]);
  const std::vector<int> whole = fewestEdges(ends, edges, std::max(edges, n), rod.closed);
  out.multiple = whole.back();
  out.place.resize(count.size());
  for (std::size_t k = 0; k + 1 < vertices.size(); ++k) {
    const double begin = double(whole[k]) / out.multiple, end = double(whole[k + 1]) / out.multiple;
    for (std::size_t j = vertices[k] * each; j < vertices[k + 1] * each; ++j)
      out.place[j] = begin + (count[j] - ends[k]) / (ends[k + 1] - ends[k]) * (end - begin);
  }
  out.place.back() = 1;
  for (std::size_t k = 0; k < vertices.size(); ++k) out.stays.emplace_back(vertices[k], whole[k]);
  return out;
}

} // namespace tendril
