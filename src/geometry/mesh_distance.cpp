#include "tendril/geometry/mesh_distance.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cstdint>
#include <sstream>
#include <stdexcept>

namespace tendril {
namespace {

template <class... Parts> [[noreturn]] void fail(const Parts &...parts) {
  std::ostringstream out;
  (out << ... << parts);
  throw std::invalid_argument(out.str());
}

const Eigen::IOFormat as_place(6, Eigen::DontAlignCols, ", ", ", ", "", "", "(", ")");

/// Twice the area, along the outward normal.
Vec3 areaVector(const TriangleMesh &m, int t) {
  const auto &[a, b, c] = m.triangles[t];
  return (m.vertices[b] - m.vertices[a]).cross(m.vertices[c] - m.vertices[a]);
}

// Side 3 t + k of a mesh leads from vertex k of triangle t to the next.
int nextSide(int side) { return side % 3 == 2 ? side - 2 : side + 1; }
int startOf(const TriangleMesh &m, int side) { return m.triangles[side / 3][side % 3]; }

/// Vertices and triangles, each for itself.
void checkParts(const TriangleMesh &m) {
  if (m.triangles.empty()) fail("the mesh has no triangles");
  const int vertices = int(m.vertices.size());
  for (int v = 0; v < vertices; ++v)
    if (!m.vertices[v].allFinite()) fail("vertex ", v, " of the mesh is at ", m.vertices[v].format(as_place));
  for (int t = 0; t < int(m.triangles.size()); ++t) {
    const auto [a, b, c] = m.triangles[t];
    for (const int v : {a, b, c})
      if (v < 0 || v >= vertices) fail("triangle ", t, " of the mesh has vertex ", v, " of ", vertices);
    const Vec3 &x = m.vertices[a], &y = m.vertices[b], &z = m.vertices[c];
    const double longest = std::max({(y - x).squaredNorm(), (z - y).squaredNorm(), (x - z).squaredNorm()});
    // Thinner than this, its normal is mostly rounding of the vertices.
    if (!(areaVector(m, t).norm() > 1e-10 * longest))
      fail("triangle ", t, " (", a, ", ", b, ", ", c, ") of the mesh has no area");
  }
}

/// The side of the neighbour along each side, in the opposite sense: each has exactly one.
std::vector<int> pairSides(const TriangleMesh &m) {
  auto keyOf = [](int from, int to) { return std::uint64_t(from) << 32 | std::uint32_t(to); };
  const int count = 3 * int(m.triangles.size());
  std::vector<std::pair<std::uint64_t, int>> sides(count);
  for (int s = 0; s < count; ++s) sides[s] = {keyOf(startOf(m, s), startOf(m, nextSide(s))), s};
  std::sort(sides.begin(), sides.end());
  const auto twice =
      std::adjacent_find(sides.begin(), sides.end(), [](auto &a, auto &b) { return a.first == b.first; });
  if (twice != sides.end())
    fail("edge (", startOf(m, twice->second), ", ", startOf(m, nextSide(twice->second)),
         ") of the mesh runs the same way in triangles ", twice->second / 3, " and ", twice[1].second / 3,
         ": one of them is turned over, or more than two meet there");
  std::vector<int> opposite(count);
  for (int i = 0; i < count; ++i) {
    const int s = sides[i].second, from = startOf(m, s), to = startOf(m, nextSide(s));
    const auto other = std::lower_bound(sides.begin(), sides.end(), std::pair(keyOf(to, from), 0));
    if (other == sides.end() || other->first != keyOf(to, from))
      fail("edge (", from, ", ", to, ") of the mesh has triangle ", s / 3,
           " on one side and none on the other: the surface is not closed");
    opposite[s] = other->second;
  }
  return opposite;
}

/// No vertex joins sheets which nothing else joins.
void checkSheets(const TriangleMesh &m, const std::vector<int> &opposite) {
  std::vector<int> sheet_of(m.vertices.size(), -1);
  std::vector<bool> seen(opposite.size());
  for (int s = 0; s < int(opposite.size()); ++s) {
    if (seen[s]) continue;
    int &sheet = sheet_of[startOf(m, s)];
    if (sheet >= 0)
      fail("vertex ", startOf(m, s), " of the mesh joins sheets at triangles ", sheet, " and ", s / 3,
           " which share no edge there: give each a vertex of its own");
    sheet = s / 3;
    for (int turn = s; !seen[turn]; turn = nextSide(opposite[turn])) seen[turn] = true; // about the vertex
  }
}

/// Pieces of the surface have a positive volume, or are hollows: lie in one that has (their boxes do).
void checkSenses(const TriangleMesh &m, const std::vector<int> &opposite) {
  struct Piece {
    double volume;
    Eigen::AlignedBox3d box;
    int triangle;
  };
  std::vector<Piece> pieces;
  std::vector<bool> seen(m.triangles.size());
  for (int start = 0; start < int(m.triangles.size()); ++start) {
    if (seen[start]) continue;
    Piece piece{0, {}, start};
    std::vector<int> todo{start};
    seen[start] = true;
    for (std::size_t i = 0; i < todo.size(); ++i) {
      const int t = todo[i];
      const Vec3 &origin = m.vertices[m.triangles[start][0]];
      piece.volume += areaVector(m, t).dot(m.vertices[m.triangles[t][0]] - origin) / 6;
      for (int k = 0; k < 3; ++k) {
        piece.box.extend(m.vertices[m.triangles[t][k]]);
        const int next = opposite[3 * t + k] / 3;
        if (!seen[next]) todo.push_back(next);
        seen[next] = true;
      }
    }
    pieces.push_back(piece);
  }
  for (const Piece &p : pieces)
    if (!(p.volume > 0) && std::none_of(pieces.begin(), pieces.end(), [&](const Piece &around) {
          return around.volume > 0 && around.box.contains(p.box);
        }))
      fail("the mesh is inside out at triangle ", p.triangle, ": its piece has the volume ", p.volume, " m^3");
}

} // namespace

MeshDistance::MeshDistance(const TriangleMesh &m) {
  checkParts(m);
  const std::vector<int> opposite = pairSides(m);
  checkSheets(m, opposite);
  checkSenses(m, opposite);
  const int count = int(m.triangles.size());
  std::vector<Vec3> at_vertex(m.vertices.size(), Vec3::Zero());
  normals_.resize(count);
  for (int t = 0; t < count; ++t) {
    Face face{{}, {}, areaVector(m, t).normalized(), t};
    for (int k = 0; k < 3; ++k) face.corners[k] = m.vertices[m.triangles[t][k]];
    for (int k = 0; k < 3; ++k) {
      const Vec3 a = face.corners[(k + 1) % 3] - face.corners[k];
      const Vec3 b = face.corners[(k + 2) % 3] - face.corners[k];
      face.inward[k] = face.normal.cross(a);
      at_vertex[m.triangles[t][k]] += std::atan2(a.cross(b).norm(), a.dot(b)) * face.normal;
    }
    normals_[t][6] = face.normal;
    faces_.push_back(face);
  }
  for (int t = 0; t < count; ++t)
    for (int k = 0; k < 3; ++k) {
      normals_[t][k] = at_vertex[m.triangles[t][k]].normalized();
      normals_[t][3 + k] = (normals_[t][6] + normals_[opposite[3 * t + k] / 3][6]).normalized();
    }
  nodes_.resize(1);
  split(0, 0, count);
  face_of_.resize(count);
  for (int f = 0; f < count; ++f) face_of_[faces_[f].triangle] = f;
}

/// Makes a node of the faces from `first` to before `last`, and those below it: halves along the longest side.
void MeshDistance::split(int node, int first, int last) {
  Eigen::AlignedBox3d box, centres;
  auto centre = [](const Face &f) { return Vec3(f.corners[0] + f.corners[1] + f.corners[2]); };
  for (int f = first; f < last; ++f) {
    for (const Vec3 &corner : faces_[f].corners) box.extend(corner);
    centres.extend(centre(faces_[f]));
  }
  const bool leaf = last - first <= 4;
  const int middle = (first + last) / 2, below = int(nodes_.size());
  nodes_[node] = {box.min(), box.max(), leaf ? first : below, leaf ? last - first : 0};
  if (leaf) return;
  Eigen::Index axis;
  centres.sizes().maxCoeff(&axis);
  std::nth_element(faces_.begin() + first, faces_.begin() + middle, faces_.begin() + last,
                   [&](const Face &a, const Face &b) { return centre(a)[axis] < centre(b)[axis]; });
  nodes_.resize(below + 2);
  split(below, first, middle);
  split(below + 1, middle, last);
}

/// Keeps the nearest point of a face, if it is nearer than `best`: above the face, or on a side beyond which p is.
void MeshDistance::consider(const Vec3 &p, int face, Candidate &best) const {
  const Face &f = faces_[face];
  bool above = true;
  for (int k = 0; k < 3; ++k) {
    const Vec3 &start = f.corners[k];
    const Vec3 along = f.corners[(k + 1) % 3] - start, from = p - start;
    if (f.inward[k].dot(from) >= 0) continue;
    above = false;
    const double t = along.dot(from) / along.squaredNorm();
    const Vec3 q = t <= 0 ? start : t >= 1 ? f.corners[(k + 1) % 3] : Vec3(start + t * along);
    const double squared = (p - q).squaredNorm();
    if (squared < best.squared) best = {squared, q, face, t <= 0 ? k : t >= 1 ? (k + 1) % 3 : 3 + k};
  }
  const double height = f.normal.dot(p - f.corners[0]);
  if (above && height * height < best.squared) best = {height * height, p - height * f.normal, face, 6};
}

MeshDistance::Nearest MeshDistance::nearest(const Vec3 &p, int guess) const {
  Candidate best{HUGE_VAL, p, face_of_[guess], 6};
  consider(p, face_of_[guess], best);
  std::pair<double, int> stack[64]; // squared distances and nodes, as deep as the tree, which is halved to its leaves
  int height = 0;
  auto push = [&](int node) {
    const Node &n = nodes_[node];
    const double squared = (n.lower - p).cwiseMax(p - n.upper).cwiseMax(0.0).squaredNorm();
    if (squared < best.squared) stack[height++] = {squared, node};
  };
  push(0);
  while (height > 0) {
    const auto [squared, node] = stack[--height];
    if (squared >= best.squared) continue;
    const Node &n = nodes_[node];
    for (int f = n.first; f < n.first + n.faces; ++f) consider(p, f, best);
    if (n.faces > 0) continue;
    const int before = height;
    push(n.first);
    push(n.first + 1);
    if (height == before + 2 && stack[before].first < stack[before + 1].first) // the nearer one on top
      std::swap(stack[before], stack[before + 1]);
  }
  const int triangle = faces_[best.face].triangle;
  const Vec3 &normal = normals_[triangle][best.feature];
  return {std::copysign(std::sqrt(best.squared), normal.dot(p - best.point)), best.point, normal, triangle};
}

namespace {

constexpr int margin = 4;              ///< cells around the mesh: what the end of the spline does has died away
constexpr double most_nodes = 1 << 23; ///< 64 MB

using Row = Eigen::Array4d;

/// Weights of four neighbouring coefficients a part t of the way between the middle two; their derivatives over t.
Row weights(double t) {
  const double u = 1 - t;
  return Row(u * u * u, 4 - 3 * t * t * (1 + u), 4 - 3 * u * u * (1 + t), t * t * t) / 6;
}
Row slopes(double t) { return Row((t - 1) * (1 - t), t * (3 * t - 4), (1 - t) * (1 + 3 * t), t * t) / 2; }
Row bends(double t) { return Row(1 - t, 3 * t - 2, 1 - 3 * t, t); }

} // namespace

MeshShape::MeshShape(const MeshDistance &exact, double cell, bool fine) : cell_(cell) {
  const Vec3 sides = exact.upper() - exact.lower();
  auto nodesOf = [&](double c) { return Vec3((sides / c).array().ceil() + 2 * margin + 1); };
  if (const double n = nodesOf(cell).prod(); !(n <= most_nodes)) {
    double least = sides.maxCoeff() / 64;
    while (nodesOf(0.95 * least).prod() <= most_nodes) least *= 0.95;
    fail("a cell of ", cell, " m divides the mesh by ", n, " nodes: use one of ", least, " m or more, which has ",
         nodesOf(least).prod());
  }
  for (int a = 0; a < 3; ++a) nodes_[a] = int(nodesOf(cell)[a]);
  first_ = (exact.lower() + exact.upper() - cell * (nodesOf(cell) - Vec3::Ones())) / 2;
  step_[1] = nodes_[2] + 2;
  step_[0] = step_[1] * (nodes_[1] + 2);
  spline_.assign(step_[0] * (nodes_[0] + 2), 0.0);
  // Far from the surface, distances of a grid of four times the cell do.
  const auto coarse = fine ? std::make_unique<MeshShape>(exact, 4 * cell, false) : nullptr;
  int near = 0;
  for (int i = 0; i < nodes_[0]; ++i)
    for (int j = 0; j < nodes_[1]; ++j)
      for (int k = 0; k < nodes_[2]; ++k) {
        const Vec3 p = first_ + cell * Vec3(i, j, k);
        double &node = spline_[(i + 1) * step_[0] + (j + 1) * step_[1] + k + 1];
        if (coarse && std::abs(node = coarse->value(p)) > 6 * cell) continue;
        const MeshDistance::Nearest n = exact.nearest(p, near);
        node = n.value;
        near = n.triangle;
      }
  interpolate(1, nodes_[0], step_[0]);
  interpolate(nodes_[0] + 2, nodes_[1], step_[1]);
  interpolate(step_[0] * (nodes_[0] + 2) / step_[1], nodes_[2], 1);
  if (fine) inspect(exact);
}

/// From values to coefficients along one axis, without curvature at the ends: c[i-1] + 4 c[i] + c[i+1] = 6 f[i].
void MeshShape::interpolate(std::ptrdiff_t outer, int nodes, std::ptrdiff_t inner) {
  std::vector<double> upper(nodes + 1, 0.0); // of the eliminated rows; the first and the last node keep their value
  for (int i = 2; i < nodes; ++i) upper[i] = 1 / (4 - upper[i - 1]);
  for (std::ptrdiff_t o = 0; o < outer; ++o) {
    double *c = spline_.data() + o * (nodes + 2) * inner;
    auto row = [&](int i) { return Eigen::Map<Eigen::ArrayXd>(c + i * inner, inner); };
    for (int i = 2; i < nodes; ++i) row(i) = (6 * row(i) - row(i - 1)) * upper[i];
    for (int i = nodes - 1; i > 1; --i) row(i) -= upper[i] * row(i + 1);
    row(0) = 2 * row(1) - row(2);
    row(nodes + 1) = 2 * row(nodes) - row(nodes - 1);
  }
}

MeshShape::Spot MeshShape::find(const Vec3 &p) const {
  Spot s{spline_.data(), {}, {}};
  for (int a = 0; a < 3; ++a) {
    const double at = (p[a] - first_[a]) / cell_, last = nodes_[a] - 1;
    const double inside = at > 0 ? std::min(at, last) : 0; // of NaN, too
    const int i = std::min(int(inside), nodes_[a] - 2);
    s.first += i * (a < 2 ? step_[a] : 1);
    s.part[a] = inside - i;
    s.away[a] = (at - inside) * cell_;
  }
  return s;
}

double MeshShape::sum(const double *first, const Row &x, const Row &y, const Row &z) const {
  Row along = Row::Zero();
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) along += x[i] * y[j] * Eigen::Map<const Row>(first + i * step_[0] + j * step_[1]);
  return (along * z).sum();
}

double MeshShape::value(const Vec3 &p) const {
  const Spot s = find(p);
  const double d = sum(s.first, weights(s.part[0]), weights(s.part[1]), weights(s.part[2]));
  return s.away.isZero(0) ? d : std::sqrt(d * d + s.away.squaredNorm());
}

void MeshShape::distances(const double *const point[3], int count, double *out) const {
  for (int i = 0; i < count; ++i) out[i] = value({point[0][i], point[1][i], point[2][i]});
}

Distance MeshShape::at(const Vec3 &p) const {
  const Spot s = find(p);
  Row w[3][3]; // by order of the derivative and axis
  for (int a = 0; a < 3; ++a) {
    w[0][a] = weights(s.part[a]);
    w[1][a] = slopes(s.part[a]) / cell_;
    w[2][a] = bends(s.part[a]) / (cell_ * cell_);
  }
  auto derivative = [&](int x, int y, int z) { return sum(s.first, w[x][0], w[y][1], w[z][2]); };
  Distance d{derivative(0, 0, 0), {derivative(1, 0, 0), derivative(0, 1, 0), derivative(0, 0, 1)}, {}};
  const double xy = derivative(1, 1, 0), xz = derivative(1, 0, 1), yz = derivative(0, 1, 1);
  d.hessian << derivative(2, 0, 0), xy, xz, xy, derivative(0, 2, 0), yz, xz, yz, derivative(0, 0, 2);
  if (s.away.isZero(0)) return d;
  // Outside, of sqrt(d^2 + away^2): d changes along the axes that are within the grid, away along the others.
  const double value = std::sqrt(d.value * d.value + s.away.squaredNorm());
  const Vec3 out = (s.away.array() != 0).select(Vec3::Ones(), Vec3::Zero()), in = Vec3::Ones() - out;
  const Vec3 g = in.cwiseProduct(d.gradient), gradient = (s.away + d.value * g) / value;
  const Mat3 bent = g * g.transpose() + d.value * (in.asDiagonal() * d.hessian * in.asDiagonal());
  return {value, gradient, (Mat3(out.asDiagonal()) + bent - gradient * gradient.transpose()) / value};
}

double MeshDistance::innerRadius(const Nearest &at, double most) const {
  double radius = most;
  for (int i = 0; i < 50; ++i) {
    const Vec3 away = at.point - nearest(at.point - radius * at.normal, at.triangle).point;
    const double ahead = 2 * at.normal.dot(away), smaller = away.squaredNorm() / ahead;
    if (!(ahead > 0) || smaller > (1 - 1e-6) * radius) break;
    radius = smaller;
  }
  return radius;
}

/// Measures error, curvature and thickness where the surface passes. A place is as thick as the thickest within four
/// cells along the surface and the solid: towards edges every solid gets thin.
void MeshShape::inspect(const MeshDistance &exact) {
  struct Place {
    int cell;
    float radius;
    Vec3 point;
  };
  std::vector<Place> places;
  const int cells[3] = {nodes_[0] - 1, nodes_[1] - 1, nodes_[2] - 1};
  const int step[3] = {cells[1] * cells[2], cells[2], 1};
  std::vector<float> radius_at(std::size_t(cells[0]) * step[0], -1.0F);
  double bend = 0;
  for (int c = 0, near = 0; c < int(radius_at.size()); ++c) {
    const int i = c / step[0], j = c / step[1] % cells[1], k = c % cells[2];
    const Vec3 p = first_ + cell_ * Vec3(i + 0.5, j + 0.5, k + 0.5);
    const double around = std::sqrt(0.75) * cell_, d = value(p); // to the corners
    if (std::abs(d) > 1.5 * around) continue;
    const MeshDistance::Nearest n = exact.nearest(p, near);
    near = n.triangle;
    if (std::abs(n.value) > around) continue;
    error_ = std::max(error_, std::abs(d - n.value));
    if (std::abs(n.value) < 0.51 * cell_) // half where planes of nodes and faces agree
      bend = std::max(bend, Eigen::SelfAdjointEigenSolver<Mat3>(at(p).hessian, Eigen::EigenvaluesOnly)
                                .eigenvalues()
                                .cwiseAbs()
                                .maxCoeff());
    radius_at[c] = float(exact.innerRadius(n, cell_));
    places.push_back({c, radius_at[c], n.point});
  }
  curvature_radius_ = 1 / bend;
  for (int pass = 0; pass < 4; ++pass) {
    for (Place &place : places)
      for (int n = 0; n < 27; ++n) {
        const int other = place.cell + (n / 9 - 1) * step[0] + (n / 3 % 3 - 1) * step[1] + n % 3 - 1;
        place.radius = std::max(place.radius, radius_at[other]); // the margin has no places: all are there
      }
    for (const Place &place : places) radius_at[place.cell] = place.radius;
  }
  const auto thinnest =
      std::min_element(places.begin(), places.end(), [](auto &a, auto &b) { return a.radius < b.radius; });
  if (thinnest != places.end() && thinnest->radius < 0.95 * cell_) // balls of faceted surfaces are a little small
    fail("the mesh is ", 2 * thinnest->radius, " m thick near ", thinnest->point.format(as_place),
         ", less than two cells of ", cell_, " m: use a cell of ", thinnest->radius, " m");
}

std::shared_ptr<const MeshShape> makeMesh(const TriangleMesh &mesh, double cell) {
  const MeshDistance exact(mesh);
  if (!(cell >= 0 && std::isfinite(cell))) fail("the cell of a mesh is ", cell, " m");
  return std::make_shared<MeshShape>(exact, cell > 0 ? cell : (exact.upper() - exact.lower()).maxCoeff() / 64);
}

} // namespace tendril
