#include "tendril/model/redraw.hpp"

#include <algorithm>
#include <numeric>

namespace tendril {
namespace {

constexpr double corner = 30 * pi / 180; ///< turning of a corner [rad]; where a smooth rod turns so much, its strains are 10 % off

/// Weights by which values at `nodes` give the value at `x` of the polynomial through them.
std::vector<double> lagrangeWeights(const std::vector<double> &nodes, double x) {
  std::vector<double> weights(nodes.size(), 1.0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < nodes.size(); ++j)
      if (j != i) weights[i] *= (x - nodes[j]) / (nodes[i] - nodes[j]);
  return weights;
}

int wrapped(int i, int n) { return ((i % n) + n) % n; }

double turningAt(const Rod &rod, int vertex) {
  const int a = rod.edgeBefore(vertex), b = rod.edgeAfter(vertex);
  if (a < 0 || b < 0) return 0;
  const Vec3 e0 = rod.edge(a), e1 = rod.edge(b);
  return std::atan2(e0.cross(e1).norm(), e0.dot(e1));
}

/// A director of the scene, or between two of them, on an edge of the redrawn rod. `place` counts the scene's edges from the middle of the first.
Vec3 directorBetween(const Rod &written, double place, const Vec3 &tangent) {
  const int n = written.edges();
  int k = int(std::floor(place));
  if (!written.closed) k = std::clamp(k, 0, std::max(n - 2, 0));
  auto carried = [&](int edge) {
    const Frame f = referenceFrame(written, edge);
    return orthonormalised(transport<double>(f.director, f.tangent, tangent), tangent);
  };
  const Vec3 a = carried(wrapped(k, n));
  if (n == 1) return a;
  const Vec3 b = carried(wrapped(k + 1, n));
  const double angle = std::atan2(a.cross(b).dot(tangent), a.dot(b));
  return rotateAbout<double>(a, tangent, (place - k) * angle);
}

Rod redrawn(const Rod &written, const Drawing &drawing, int edges) {
  Rod rod = written;
  const Curve curve = drawing.curve ? drawing.curve : curveThrough(written);
  rod.position.clear();
  for (int i = 0; i < edges + (rod.closed ? 0 : 1); ++i) rod.position.push_back(curve(double(i) / edges));
  checkRod(rod);
  const double ratio = double(written.edges()) / edges;
  if (drawing.directors_given) {
    rod.director.resize(edges);
    for (int i = 0; i < edges; ++i) rod.director[i] = directorBetween(written, (i + 0.5) * ratio - 0.5, rod.edge(i).normalized());
  } else
    setBishopDirectors(rod, transport<double>(written.director[0], written.edge(0).normalized(), rod.edge(0).normalized()));
  return rod;
}

int movedVertex(const Rod &written, int vertex, int edges) {
  const std::int64_t place = std::int64_t(vertex) * edges;
  if (place % written.edges() != 0)
    throw SceneError("rod '" + written.name + "': its vertex " + std::to_string(vertex) + " of " + std::to_string(written.edges()) + " edges is no vertex of " +
                     std::to_string(edges));
  return int(place / written.edges());
}

/// Whether the end of an open rod at a vertex is free to turn, tangent and director.
bool isFreeEnd(const Scene &scene, int rod, int vertex) {
  return std::none_of(scene.supports.begin(), scene.supports.end(), [&](const Support &s) { return s.rod == rod && s.vertex == vertex && s.holdsTwist(); });
}

void addCouple(const Scene &written, const EdgeMoment &couple, int edges, std::vector<EdgeMoment> &out) {
  const Rod &rod = written.rods[couple.rod];
  const int last = rod.edges() - 1;
  auto add = [&](int edge, double weight) { out.push_back({couple.rod, edge, weight * couple.torque, weight * couple.moment}); };
  if (!rod.closed && couple.edge == last && isFreeEnd(written, couple.rod, rod.vertices() - 1)) return add(edges - 1, 1);
  if (!rod.closed && couple.edge == 0 && isFreeEnd(written, couple.rod, 0)) return add(0, 1);
  const double place = (couple.edge + 0.5) * edges / rod.edges() - 0.5;
  const int count = std::min(4, edges);
  int first = int(std::floor(place)) - 1;
  if (!rod.closed) first = std::clamp(first, 0, edges - count);
  std::vector<double> nodes(count);
  std::iota(nodes.begin(), nodes.end(), double(first));
  const std::vector<double> weights = lagrangeWeights(nodes, place);
  for (int k = 0; k < count; ++k)
    if (weights[k] != 0) add(wrapped(first + k, edges), weights[k]);
}

} // namespace

Curve curveThrough(const Rod &rod) {
  const int n = rod.edges();
  std::vector<bool> ends_cubics(rod.vertices());
  for (int v = 0; v < rod.vertices(); ++v) ends_cubics[v] = rod.edgeBefore(v) < 0 || rod.edgeAfter(v) < 0 || turningAt(rod, v) > corner;
  return [rod, n, ends_cubics](double s) {
    const double place = s * n;
    const int edge = std::clamp(int(std::floor(place)), 0, n - 1);
    const double fraction = place - edge;
    if (fraction == 0) return rod.position[edge];
    if (fraction == 1) return rod.position[rod.next(edge)];
    auto at = [&](int v) { return rod.closed ? wrapped(v, n) : v; };
    // The edge, one more on either side; where one side has a corner, two on the other.
    int low = edge, high = edge + 1;
    auto canLower = [&] { return high - low < n && !ends_cubics[at(low)]; };
    auto canRaise = [&] { return high - low < n && !ends_cubics[at(high)]; };
    if (canLower()) --low;
    if (canRaise()) ++high;
    while (high - low < 3 && (canLower() || canRaise())) canLower() ? --low : ++high;
    std::vector<double> nodes{0};
    for (int v = low; v < high; ++v) nodes.push_back(nodes.back() + rod.edge(at(v)).norm());
    const int k = edge - low;
    const std::vector<double> weights = lagrangeWeights(nodes, nodes[k] + fraction * (nodes[k + 1] - nodes[k]));
    Vec3 x = Vec3::Zero();
    for (int v = low; v <= high; ++v) x += weights[v - low] * rod.position[at(v)];
    return x;
  };
}

int edgeMultiple(const Scene &scene, const Drawing &drawing, int r) {
  const int n = scene.rods[r].edges();
  if (!drawing.curve) return n;
  int common = n;
  for (const Support &s : scene.supports)
    if (s.rod == r) common = std::gcd(common, s.vertex);
  for (const NodalForce &f : scene.forces)
    if (f.rod == r) common = std::gcd(common, f.vertex);
  return n / common;
}

Scene redraw(const Scene &written, const std::vector<Drawing> &drawings, const std::vector<int> &edges) {
  Scene scene;
  scene.gravity = written.gravity;
  scene.rotation = written.rotation;
  for (std::size_t r = 0; r < written.rods.size(); ++r)
    scene.rods.push_back(edges[r] == written.rods[r].edges() ? written.rods[r] : redrawn(written.rods[r], drawings[r], edges[r]));
  for (const Support &support : written.supports) {
    Support &s = scene.supports.emplace_back(support);
    if (edges[s.rod] == written.rods[s.rod].edges()) continue;
    s.vertex = movedVertex(written.rods[s.rod], support.vertex, edges[s.rod]);
    const Frame f = frameAtVertex(scene.rods[s.rod], s.vertex);
    if (!s.tangent_given) s.frame.tangent = f.tangent;
    if (!s.director_given) s.frame.director = f.director;
    s.frame.director = orthonormalised(s.frame.director, s.frame.tangent);
  }
  for (const NodalForce &f : written.forces) scene.forces.push_back({f.rod, movedVertex(written.rods[f.rod], f.vertex, edges[f.rod]), f.force});
  for (const EdgeMoment &m : written.moments) addCouple(written, m, edges[m.rod], scene.moments);
  return scene;
}

std::vector<int> edgesOf(const Scene &scene, int factor) {
  std::vector<int> edges;
  for (const Rod &rod : scene.rods) edges.push_back(factor * rod.edges());
  return edges;
}

} // namespace tendril
