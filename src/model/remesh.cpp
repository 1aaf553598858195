#include "tendril/model/remesh.hpp"

#include "tendril/geometry/spline.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace tendril {
namespace {

/// Weights by which values at `nodes` give the value at `x` of the polynomial through them.
std::vector<double> lagrangeWeights(const std::vector<double> &nodes, double x) {
  std::vector<double> weights(nodes.size(), 1.0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < nodes.size(); ++j)
      if (j != i) weights[i] *= (x - nodes[j]) / (nodes[i] - nodes[j]);
  return weights;
}

int wrapped(int i, int n) { return ((i % n) + n) % n; }

/// A director of the scene, or between two of them, on an edge of the remeshed rod. `place` counts the scene's edges
/// from the middle of the first.
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

/// Vertices stay as they are written where nothing asks for others.
bool isRemeshed(const Rod &written, const Drawing &drawing, int edges) {
  return drawing.grading || edges != written.edges();
}

Rod remeshed(const Rod &written, const Drawing &drawing, int edges) {
  if (edges < drawing.least_edges)
    throw SceneError("rod '" + written.name + "': its turns need at least " + shortText(drawing.least_edges) +
                     " edges, found " + std::to_string(edges));
  Rod rod = written;
  const Grading *grading = drawing.grading.get();
  const Curve curve = drawing.curve ? drawing.curve : grading ? splineThrough(written) : curveThrough(written);
  if (!drawing.curve && !grading)
    for (std::int64_t v = 0; v < written.vertices(); ++v)
      if (v * edges % written.edges() != 0 && isCorner(written, int(v)))
        throw SceneError("rod '" + written.name + "': the corner at its vertex " + std::to_string(v) + " of " +
                         std::to_string(written.edges()) + " edges is no vertex of " + std::to_string(edges));
  rod.position.clear();
  for (int i = 0; i < edges + (rod.closed ? 0 : 1); ++i)
    rod.position.push_back(curve(grading ? grading->parameterAt(double(i) / edges) : double(i) / edges));
  checkRod(rod);
  if (drawing.directors_given) {
    auto middle = [&](int i) {
      return grading ? grading->parameterOf(grading->middle(i, edges)) * written.edges()
                     : (i + 0.5) * written.edges() / edges;
    };
    rod.director.resize(edges);
    for (int i = 0; i < edges; ++i)
      rod.director[i] = directorBetween(written, middle(i) - 0.5, rod.edge(i).normalized());
  } else
    setBishopDirectors(rod,
                       transport<double>(written.director[0], written.edge(0).normalized(), rod.edge(0).normalized()));
  return rod;
}

int movedVertex(const Rod &written, const Drawing &drawing, int vertex, int edges) {
  std::int64_t place = vertex, whole = written.edges(); // the place is their quotient
  if (drawing.grading) {
    const auto &stays = drawing.grading->stays;
    const auto found = std::lower_bound(stays.begin(), stays.end(), std::pair(vertex, 0));
    if (found == stays.end() || found->first != vertex)
      throw SceneError("rod '" + written.name + "': its vertex " + std::to_string(vertex) +
                       " is not among those that its grading keeps");
    place = found->second;
    whole = drawing.grading->multiple;
  }
  if (place * edges % whole != 0)
    throw SceneError("rod '" + written.name + "': its vertex " + std::to_string(vertex) + " of " +
                     std::to_string(written.edges()) + " edges is no vertex of " + std::to_string(edges));
  return int(place * edges / whole);
}

/// frameAtVertex of second order where the edges on either side differ: the tangent is theirs, each by the length of
/// the other.
Frame frameBetween(const Rod &rod, int vertex) {
  const int a = rod.edgeBefore(vertex), b = rod.edgeAfter(vertex);
  if (a < 0 || b < 0) return frameAtVertex(rod, vertex);
  const Frame f0 = referenceFrame(rod, a), f1 = referenceFrame(rod, b);
  const Vec3 t = (f1.length * f0.tangent + f0.length * f1.tangent).normalized();
  const Vec3 d = f1.length * transport<double>(f0.director, f0.tangent, t) +
                 f0.length * transport<double>(f1.director, f1.tangent, t);
  return {t, orthonormalised(d, t), 1};
}

/// Whether the end of an open rod at a vertex is free to turn, tangent and director.
bool isFreeEnd(const Scene &scene, int rod, int vertex) {
  return std::none_of(scene.supports.begin(), scene.supports.end(),
                      [&](const Support &s) { return s.rod == rod && s.vertex == vertex && s.holdsTwist(); }) &&
         std::none_of(scene.attachments.begin(), scene.attachments.end(),
                      [&](const Attachment &a) { return a.rod == rod && a.vertex == vertex && a.weld; });
}

void addCouple(const Scene &written, const Drawing &drawing, const EdgeMoment &couple, int edges,
               std::vector<EdgeMoment> &out) {
  const Rod &rod = written.rods[couple.rod];
  const Grading *grading = drawing.grading.get();
  const int last = rod.edges() - 1;
  auto add = [&](int edge, double weight) {
    out.push_back({couple.rod, edge, weight * couple.torque, weight * couple.moment});
  };
  if (!rod.closed && couple.edge == last && isFreeEnd(written, couple.rod, rod.vertices() - 1))
    return add(edges - 1, 1);
  if (!rod.closed && couple.edge == 0 && isFreeEnd(written, couple.rod, 0)) return add(0, 1);
  const double parameter = (couple.edge + 0.5) / rod.edges();
  const double place =
      (grading ? grading->placeOf(parameter) * edges : (couple.edge + 0.5) * edges / rod.edges()) - 0.5;
  const int count = std::min(4, edges);
  int first = int(std::floor(place)) - 1;
  if (!rod.closed) first = std::clamp(first, 0, edges - count);
  std::vector<double> nodes;
  for (int e = first; e < first + count; ++e) nodes.push_back(grading ? grading->middle(e, edges) : e);
  const std::vector<double> weights = lagrangeWeights(nodes, grading ? grading->lengthOf(parameter) : place);
  for (int k = 0; k < count; ++k)
    if (weights[k] != 0) add(wrapped(first + k, edges), weights[k]);
}

/// Edge on whose middle that of an edge of the scene lies; the last edges of an open rod are those at its ends.
int movedEdge(const Rod &written, const Drawing &drawing, int edge, int edges) {
  if (!written.closed && edge == 0) return 0;
  if (!written.closed && edge + 1 == written.edges()) return edges - 1;
  const double parameter = (edge + 0.5) / written.edges(),
               place = (drawing.grading ? drawing.grading->placeOf(parameter) : parameter) * edges - 0.5;
  const int found = int(std::lround(place));
  if (std::abs(place - found) > 1e-6)
    throw SceneError("rod '" + written.name + "': a constraint turns its edge " + std::to_string(edge) + " of " +
                     std::to_string(written.edges()) + ", whose middle is no middle of " + std::to_string(edges) +
                     " edges; take an odd multiple of " + std::to_string(written.edges()) +
                     ", or constrain an edge at an end");
  return found;
}

/// Vertices that supports, constraints, junctions and loads name, without the ends of a rod and the first of a closed
/// one: those are vertices of any number of edges.
std::vector<int> namedVertices(const Scene &scene, int r) {
  std::vector<int> named;
  auto add = [&](int rod, int vertex) {
    if (rod == r && vertex > 0 && vertex < scene.rods[r].edges()) named.push_back(vertex);
  };
  for (const Support &s : scene.supports) add(s.rod, s.vertex);
  for (const Constraint &c : scene.constraints)
    if (c.isPin()) add(c.rod, c.at);
  for (const Constraint &c : scene.constraints)
    if (c.isTie()) add(c.to_rod, c.to_vertex);
  for (const Junction &j : scene.junctions)
    for (const Junction::Member &m : j.members) add(m.rod, m.vertex);
  for (const Attachment &a : scene.attachments) add(a.rod, a.vertex);
  for (const NodalForce &f : scene.forces) add(f.rod, f.vertex);
  for (const FollowerForce &f : scene.followers) add(f.rod, f.vertex);
  return named;
}

/// Twist of the directors from end to end [rad].
double twistOf(const Rod &rod) {
  double sum = 0;
  for (int v = 0; v < rod.vertices(); ++v)
    if (const int a = rod.edgeBefore(v), b = rod.edgeAfter(v); a >= 0 && b >= 0)
      sum += std::abs(halfAngleBetween(referenceFrame(rod, a), referenceFrame(rod, b)).angle());
  return sum;
}

/// The drawings of two rods differ by a translation, as copies do.
bool areAlike(const Scene &scene, const std::vector<Drawing> &drawings, int a, int b) {
  const Rod &one = scene.rods[a], &two = scene.rods[b];
  if (one.closed != two.closed || one.vertices() != two.vertices() ||
      bool(drawings[a].curve) != bool(drawings[b].curve))
    return false;
  if (drawings[a].directors_given != drawings[b].directors_given ||
      (drawings[a].directors_given && one.director != two.director))
    return false;
  const Vec3 shift = two.position[0] - one.position[0];
  const double rounding = 1e-12 * ((one.position.back() - one.position[0]).norm() + shift.norm());
  auto near = [&](const Vec3 &x, const Vec3 &y) { return (x + shift - y).norm() <= rounding; };
  for (int v = 0; v < one.vertices(); ++v)
    if (!near(one.position[v], two.position[v])) return false;
  for (const double s : {0.123, 0.456, 0.789})
    if (drawings[a].curve && !near(drawings[a].curve(s), drawings[b].curve(s))) return false;
  return namedVertices(scene, a) == namedVertices(scene, b);
}

/// A scene on its way from what is written to other numbers of edges.
struct Remeshing {
  const Scene &written;
  const std::vector<Drawing> &drawings;
  const std::vector<int> &edges;
  Scene scene;

  bool changes(int rod) const { return isRemeshed(written.rods[rod], drawings[rod], edges[rod]); }
  int vertex(int rod, int vertex) const { return movedVertex(written.rods[rod], drawings[rod], vertex, edges[rod]); }
  int edge(int rod, int edge) const { return movedEdge(written.rods[rod], drawings[rod], edge, edges[rod]); }
  /// As drawn at a vertex of the remeshed rod.
  Frame frame(int rod, int vertex) const {
    return drawings[rod].grading ? frameBetween(scene.rods[rod], vertex) : frameAtVertex(scene.rods[rod], vertex);
  }
  void move(Support &s) const;
  void move(Constraint &c) const;
  void move(Waypoint &p) const;
  void move(Attachment &a) const;
  void move(Junction &j);
};

void Remeshing::move(Support &s) const {
  if (!changes(s.rod)) return;
  s.vertex = vertex(s.rod, s.vertex);
  const Frame f = frame(s.rod, s.vertex);
  if (!s.tangent_given) s.frame.tangent = f.tangent;
  if (!s.director_given) s.frame.director = f.director;
  s.frame.director = orthonormalised(s.frame.director, s.frame.tangent);
}

void Remeshing::move(Constraint &c) const {
  if (c.isTie() && changes(c.to_rod)) c.to_vertex = vertex(c.to_rod, c.to_vertex);
  if (!changes(c.rod)) return;
  c.at = c.isPin() ? vertex(c.rod, c.at) : edge(c.rod, c.at);
  const Rod &rod = scene.rods[c.rod];
  if (c.isPin()) {
    if (!c.point_given) c.point = rod.position[c.at];
    return;
  }
  const Frame drawn = referenceFrame(rod, c.at);
  if (!c.director_given) // goes with the edge, or with the tangent that is given
    c.frame.director =
        c.tangent_given ? transport<double>(drawn.director, drawn.tangent, c.frame.tangent) : drawn.director;
  if (!c.tangent_given) c.frame.tangent = drawn.tangent;
  c.frame.director = orthonormalised(c.frame.director, c.frame.tangent);
}

void Remeshing::move(Waypoint &p) const {
  if (p.isTold() || p.body >= 0 || !changes(p.rod)) return;
  if (p.isVertex())
    p.setVertex(vertex(p.rod, p.vertex()), scene.rods[p.rod].edges());
  else
    p.edge = edge(p.rod, p.edge);
}

void Remeshing::move(Attachment &a) const {
  if (!changes(a.rod)) return;
  a.vertex = vertex(a.rod, a.vertex);
  const Frame f = frame(a.rod, a.vertex);
  const Vec3 tangent = a.tangent_given ? a.frame.tangent : f.tangent;
  if (!a.director_given) a.frame.director = transport<double>(f.director, f.tangent, tangent);
  a.frame.tangent = tangent;
  a.frame.director = orthonormalised(a.frame.director, tangent);
}

/// Its vertices are in one place, to the bit.
void Remeshing::move(Junction &j) {
  for (Junction::Member &m : j.members) {
    m.vertex = vertex(m.rod, m.vertex);
    scene.rods[m.rod].position[m.vertex] = scene.rods[j.members[0].rod].position[j.members[0].vertex];
  }
}

} // namespace

Curve curveThrough(const Rod &rod) {
  const int n = rod.edges();
  std::vector<bool> ends_cubics(rod.vertices());
  for (int v = 0; v < rod.vertices(); ++v)
    ends_cubics[v] = rod.edgeBefore(v) < 0 || rod.edgeAfter(v) < 0 || isCorner(rod, v);
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

Curve splineThrough(const Rod &rod) {
  constexpr int overlap = 40; // where nothing ends a spline: an end is felt by a quarter less at each point
  const int n = rod.edges();
  std::vector<int> ends;
  for (int v = 0; v < rod.vertices(); ++v)
    if (rod.edgeBefore(v) < 0 || rod.edgeAfter(v) < 0 || isCorner(rod, v)) ends.push_back(v);
  auto at = [&](int v) { return rod.closed ? wrapped(v, n) : v; };
  struct Piece {
    Vec3 x0, x1, m0, m1;
    double length;
  };
  std::vector<Piece> pieces(n);
  auto add = [&](int begin, int end, int margin) { // edges begin to end, from a spline that goes on by `margin` points
    std::vector<Vec3> points;
    for (int v = begin - margin; v <= end + margin; ++v) points.push_back(rod.position[at(v)]);
    const std::vector<Vec3> slopes = splineSlopes(points);
    for (int v = begin; v < end; ++v) {
      const int k = v - begin + margin;
      pieces[wrapped(v, n)] = {points[k], points[k + 1], slopes[k], slopes[k + 1], (points[k + 1] - points[k]).norm()};
    }
  };
  for (std::size_t k = 0; k + 1 < ends.size(); ++k) add(ends[k], ends[k + 1], 0);
  if (rod.closed) ends.empty() ? add(0, n, overlap) : add(ends.back(), ends.front() + n, 0);
  return [pieces, n](double s) {
    const double place = s * n;
    const int edge = std::clamp(int(std::floor(place)), 0, n - 1);
    const Piece &p = pieces[edge];
    return hermite(p.x0, p.x1, p.m0, p.m1, p.length, place - edge);
  };
}

void grade(const Scene &scene, std::vector<Drawing> &drawings) {
  constexpr int dear = 8; // multiples above this are worth edges that are not quite uniform
  for (int r = 0; r < int(drawings.size()); ++r) {
    if (r > 0 && areAlike(scene, drawings, r - 1, r)) {
      drawings[r].grading = drawings[r - 1].grading;
      continue;
    }
    drawings[r].grading = nullptr;
    Grading grading = gradingByCurvature(scene.rods[r], drawings[r].curve, namedVertices(scene, r));
    if (drawings[r].curve && grading.uniform && edgeMultiple(scene, drawings[r], r) <= dear) continue;
    if (drawings[r].directors_given) grading.turning = std::max(grading.turning, twistOf(scene.rods[r]));
    drawings[r].grading = std::make_shared<Grading>(grading);
  }
}

int edgeMultiple(const Scene &scene, const Drawing &drawing, int r) {
  if (drawing.grading) return drawing.grading->multiple;
  const int n = scene.rods[r].edges();
  if (!drawing.curve) return n;
  int common = n;
  for (const int v : namedVertices(scene, r)) common = std::gcd(common, v);
  return n / common;
}

Scene remesh(const Scene &written, const std::vector<Drawing> &drawings, const std::vector<int> &edges) {
  Remeshing remeshing{written, drawings, edges, {}};
  Scene &scene = remeshing.scene;
  scene.gravity = written.gravity;
  scene.rotation = written.rotation;
  scene.colliders = written.colliders;
  for (std::size_t r = 0; r < written.rods.size(); ++r)
    scene.rods.push_back(remeshing.changes(int(r)) ? remeshed(written.rods[r], drawings[r], edges[r])
                                                   : written.rods[r]);
  for (Rod &rod : scene.rods)
    if (rod.flat >= 0) flatten(rod);
  for (const Support &s : written.supports) remeshing.move(scene.supports.emplace_back(s));
  for (const Constraint &c : written.constraints) remeshing.move(scene.constraints.emplace_back(c));
  scene.bodies = written.bodies;
  scene.held_bodies = written.held_bodies;
  scene.joints = written.joints;
  scene.tendons = written.tendons;
  for (Tendon &tendon : scene.tendons)
    for (Waypoint &p : tendon.points) remeshing.move(p);
  for (const Attachment &a : written.attachments) remeshing.move(scene.attachments.emplace_back(a));
  for (const Junction &j : written.junctions) remeshing.move(scene.junctions.emplace_back(j));
  for (const NodalForce &f : written.forces)
    scene.forces.push_back({f.rod, remeshing.vertex(f.rod, f.vertex), f.force, f.mass});
  for (const FollowerForce &f : written.followers)
    scene.followers.push_back({f.rod, remeshing.vertex(f.rod, f.vertex), f.force});
  for (const EdgeMoment &m : written.moments) addCouple(written, drawings[m.rod], m, edges[m.rod], scene.moments);
  return std::move(remeshing.scene);
}

std::vector<int> edgesOf(const Scene &scene, int factor) {
  std::vector<int> edges;
  for (const Rod &rod : scene.rods) edges.push_back(factor * rod.edges());
  return edges;
}

} // namespace tendril
