#include "tendril/embedding/embedding.hpp"

#include <algorithm>
#include <stdexcept>

namespace tendril {
namespace {

/// The edge of a rod as drawn that is nearest to a point, by chunks with balls about them.
class Nearest {
public:
  explicit Nearest(const Rod &rod) : rod_(rod) {
    for (int first = 0; first < rod.edges(); first += chunk) {
      Ball &ball = balls_.emplace_back();
      const int last = std::min(first + chunk, rod.edges());
      ball.middle = rod.position[std::size_t(first)];
      for (int e = first; e < last; ++e)
        for (const int v : {e, rod.next(e)})
          ball.radius = std::max(ball.radius, (rod.position[std::size_t(v)] - ball.middle).norm());
    }
  }
  int to(const Vec3 &y) const {
    Found best;
    for (int k = 0; k < int(balls_.size()); ++k) {
      const double apart = (y - balls_[std::size_t(k)].middle).norm() - balls_[std::size_t(k)].radius;
      if (apart > 0 && apart * apart > best.squared) continue;
      for (int e = k * chunk; e < std::min((k + 1) * chunk, rod_.edges()); ++e) take(y, e, best);
    }
    return best.edge;
  }
  /// Among so many edges from one on.
  int to(const Vec3 &y, int first, int count) const {
    Found best;
    for (int k = 0; k < count; ++k) take(y, (first + k) % rod_.edges(), best);
    return best.edge;
  }

private:
  static constexpr int chunk = 16;
  struct Ball {
    Vec3 middle;
    double radius = 0;
  };
  struct Found {
    int edge = 0;
    double squared = HUGE_VAL;
  };
  const Rod &rod_;
  std::vector<Ball> balls_;

  void take(const Vec3 &y, int edge, Found &best) const {
    const Vec3 &from = rod_.position[std::size_t(edge)], e = rod_.edge(edge);
    const double part = std::clamp((y - from).dot(e) / e.squaredNorm(), 0.0, 1.0);
    const double squared = (y - from - part * e).squaredNorm();
    if (squared < best.squared) best = {edge, squared};
  }
};

/// Some of the edges of a rod: so many from one on, of a ring over its end.
struct Window {
  const Rod &rod;
  int first, count;
  int wrapped(int edge) const { return (edge + rod.edges()) % rod.edges(); }
  bool has(int edge) const {
    return (rod.closed || (edge >= 0 && edge < rod.edges())) && wrapped(wrapped(edge) - first) < count;
  }
};

/// Part of an edge at which a point is, between the planes that halve the angles with its neighbours: it goes over from
/// edge to edge without a jump. Less than 0 or more than 1 where the point is beyond one of them.
double partOf(const Rod &rod, int edge, const Vec3 &y) {
  const int before = rod.edgeBefore(edge), after = rod.edgeAfter(rod.next(edge));
  const Vec3 own = rod.edge(edge).normalized();
  auto beyond = [&](int neighbour, int vertex) {
    const Vec3 across = neighbour < 0 ? own : Vec3(own + rod.edge(neighbour).normalized());
    return (y - rod.position[std::size_t(vertex)]).dot(across.normalized());
  };
  const double from = beyond(before, edge), to = -beyond(after, rod.next(edge));
  return from <= 0 ? std::min(from, -1e-300) : to <= 0 ? 1 - std::min(to, -1e-15) : from / (from + to);
}

/// Carried by no more than so many edges of a window. \param edge the nearest
SkinPoint carried(const Window &window, const Vec3 &y, int edge, int edges) {
  const Rod &rod = window.rod;
  double part = partOf(rod, edge, y);
  // Outside a bend the vertex is nearest, which both edges have: the plane between them decides.
  if (const int other = edge + (part < 0 ? -1 : 1); (part < 0 || part > 1) && window.has(other)) {
    edge = window.wrapped(other);
    part = partOf(rod, edge, y);
  }
  part = std::clamp(part, 0.0, 1.0);
  SkinPoint point;
  auto add = [&](int to, double weight) {
    if (!(weight > 0)) return;
    to = window.wrapped(to);
    const Frame f = referenceFrame(rod, to);
    const Vec3 from = y - (rod.position[std::size_t(to)] + 0.5 * rod.edge(to));
    point.add(to, weight, {from.dot(f.tangent), from.dot(f.director), from.dot(f.secondDirector())});
  };
  const int step = part < 0.5 ? -1 : 1, other = edge + step;
  const bool ends = !window.has(edge - 1) || !window.has(edge + 1);
  if (edges == 1 || !window.has(other))
    add(edge, 1);
  else if (edges == 2 || ends) { // from middle to middle
    const double own = rod.edge(edge).norm(), next = rod.edge(window.wrapped(other)).norm();
    const double weight = std::abs(part - 0.5) * own / (0.5 * (own + next));
    if (step < 0) add(other, weight);
    add(edge, 1 - weight);
    if (step > 0) add(other, weight);
  } else {
    add(edge - 1, 0.5 * (1 - part) * (1 - part));
    add(edge, 0.5 + part - part * part);
    add(edge + 1, 0.5 * part * part);
  }
  return point;
}

/// Barycentric coordinates of the points of a rule, with weights that sum to one.
struct RulePoint {
  double weight;
  std::array<double, 3> at;
};
std::vector<RulePoint> triangleRule(int points) {
  if (points == 1) return {{1, {1.0 / 3, 1.0 / 3, 1.0 / 3}}};
  std::vector<RulePoint> rule;
  auto add = [&](double weight, double two) {
    for (std::size_t k = 0; k < 3; ++k) {
      RulePoint &p = rule.emplace_back(RulePoint{weight, {two, two, two}});
      p.at[k] = 1 - 2 * two;
    }
  };
  if (points == 3)
    add(1.0 / 3, 1.0 / 6);
  else {
    add(0.223381589678011, 0.445948490915965);
    add(1.0 / 3 - 0.223381589678011, 0.091576213509771);
  }
  return rule;
}

void sortByEdges(std::vector<SkinSample> &samples) {
  std::stable_sort(samples.begin(), samples.end(),
                   [](const SkinSample &a, const SkinSample &b) { return a.point.edge[0] < b.point.edge[0]; });
}

double areaOf(const Vec3 &a, const Vec3 &b, const Vec3 &c) { return 0.5 * (b - a).cross(c - a).norm(); }

std::vector<SkinSample> cornerSamples(const std::vector<Vec3> &places, const Skin &skin) {
  std::vector<SkinSample> samples;
  for (const SkinPoint &point : skin.points) samples.push_back({point, 0});
  for (const auto &[a, b, c] : skin.triangles) {
    const double area = areaOf(places[std::size_t(a)], places[std::size_t(b)], places[std::size_t(c)]);
    for (const int corner : {a, b, c}) samples[std::size_t(corner)].area += area / 3;
  }
  std::erase_if(samples, [](const SkinSample &s) { return s.area == 0; }); // of no triangle
  sortByEdges(samples);
  return samples;
}

std::vector<Vec3> placesOf(const Rod &rod, const Skin &skin) {
  std::vector<Vec3> places;
  for (const SkinPoint &point : skin.points) places.push_back(placeOf(rod, point));
  return places;
}

} // namespace

Vec3 placeOf(const Rod &rod, const SkinPoint &point) {
  Vec3 y = Vec3::Zero();
  for (std::size_t k = 0; k < std::size_t(point.edges); ++k) {
    const Frame f = referenceFrame(rod, point.edge[k]);
    const Vec3 &at = point.local[k];
    const Vec3 middle = rod.position[std::size_t(point.edge[k])] + 0.5 * rod.edge(point.edge[k]);
    y += point.weight[k] * (middle + at[0] * f.tangent + at[1] * f.director + at[2] * f.secondDirector());
  }
  return y;
}

Skin embedded(const Rod &rod, const TriangleMesh &mesh, int edges) {
  const Nearest nearest(rod);
  Skin skin;
  skin.triangles = mesh.triangles;
  for (const Vec3 &y : mesh.vertices) skin.points.push_back(carried({rod, 0, rod.edges()}, y, nearest.to(y), edges));
  return skin;
}

Skin skinOf(const Rod &rod) {
  Skin skin;
  if (!rod.skin) return skin;
  const SkinRecipe &recipe = *rod.skin;
  if (recipe.tube.sides > 0) skin = tubeAbout(rod, recipe.tube);
  if (!recipe.mesh) return skin;
  const bool given = recipe.given && recipe.given_edges == rod.edges();
  const Skin more = given ? *recipe.given : embedded(rod, *recipe.mesh, recipe.edges);
  const int before = int(skin.points.size());
  skin.points.insert(skin.points.end(), more.points.begin(), more.points.end());
  for (std::array<int, 3> triangle : more.triangles) {
    for (int &corner : triangle) corner += before;
    skin.triangles.push_back(triangle);
  }
  return skin;
}

std::vector<SkinSample> skinSamples(const Rod &rod, const Skin &skin, int points, int edges) {
  const std::vector<Vec3> places = placesOf(rod, skin);
  if (points == ContactSettings::corners) return cornerSamples(places, skin);
  const std::vector<RulePoint> rule = triangleRule(points);
  const Nearest nearest(rod);
  const int n = rod.edges();
  std::vector<SkinSample> samples;
  for (const std::array<int, 3> &triangle : skin.triangles) {
    std::array<Vec3, 3> x;
    // Edges that carry the corners, counted from one of them, the short way round a ring.
    const int from = skin.points[std::size_t(triangle[0])].edge[0];
    int first = 0, last = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const SkinPoint &p = skin.points[std::size_t(triangle[k])];
      x[k] = places[std::size_t(triangle[k])];
      for (std::size_t j = 0; j < std::size_t(p.edges); ++j) {
        int away = p.edge[j] - from;
        if (rod.closed) away = (away + n + n / 2) % n - n / 2;
        first = std::min(first, away);
        last = std::max(last, away);
      }
    }
    const int count = std::min(last - first + 1, n);
    first = (from + first + n) % n;
    const double area = areaOf(x[0], x[1], x[2]);
    for (const RulePoint &p : rule) {
      const Vec3 y = p.at[0] * x[0] + p.at[1] * x[1] + p.at[2] * x[2];
      samples.push_back({carried({rod, first, count}, y, nearest.to(y, first, count), edges), p.weight * area});
    }
  }
  sortByEdges(samples);
  return samples;
}

SkinMeasure measureOf(const Rod &rod, const Skin &skin) {
  const std::vector<Vec3> x = placesOf(rod, skin);
  SkinMeasure sum;
  for (const auto &[a, b, c] : skin.triangles) {
    const Vec3 from = x[std::size_t(a)] - x[0], to = x[std::size_t(b)] - x[0], last = x[std::size_t(c)] - x[0];
    sum.area += areaOf(from, to, last);
    sum.volume += from.dot(to.cross(last)) / 6;
    sum.side = std::max({sum.side, (to - from).norm(), (last - to).norm(), (from - last).norm()});
  }
  return sum;
}

double perimeterOf(const Rod &rod, const Skin &skin) { return measureOf(rod, skin).area / rod.length(); }

void checkClosed(const Rod &rod, const Skin &skin) { (void)MeshDistance({placesOf(rod, skin), skin.triangles}); }

std::vector<bool> isInside(const Rod &rod, const Skin &skin, const std::vector<Vec3> &places) {
  const MeshDistance distance({placesOf(rod, skin), skin.triangles});
  std::vector<bool> inside;
  for (const Vec3 &y : places) inside.push_back(distance.nearest(y).value < 0);
  return inside;
}

double widestTurn(const Rod &rod, const Skin &skin) {
  double least = 1;
  for (const SkinPoint &p : skin.points)
    for (std::size_t k = 1; k < std::size_t(p.edges); ++k)
      least = std::min(least, rod.edge(p.edge[k - 1]).normalized().dot(rod.edge(p.edge[k]).normalized()));
  return std::acos(std::clamp(least, -1.0, 1.0));
}

double farthestOverMedian(const Skin &skin) {
  std::vector<double> away;
  for (const SkinPoint &p : skin.points) away.push_back(p.local[0].tail<2>().norm());
  if (away.empty()) return 0;
  const auto middle = away.begin() + std::ptrdiff_t(away.size() / 2);
  const double most = *std::max_element(away.begin(), away.end());
  std::nth_element(away.begin(), middle, away.end());
  return *middle > 0 ? most / *middle : 1;
}

} // namespace tendril
