#include "tendril/layout/edge_blocks.hpp"

namespace tendril {

void EdgeBlocks::clear(const RodRange &rod) { std::fill_n(entry(rod, 0) - 1, std::size_t(entries_) * rod.slots, 0.0); }

void EdgeBlocks::subtractFrom(const EdgeBlocks &other) {
  for (std::size_t k = 0; k < data_.size(); ++k) data_[k] = other.data_[k] - data_[k];
  for (std::size_t k = 0; k < touching_.size(); ++k) touching_[k] = other.touching_[k] - touching_[k];
}

/// What the last edge has with the first stays behind the ring.
void EdgeBlocks::fold(const RodRange &rod) {
  if (!rod.closed) return;
  for (int k = 0; k < entries_; ++k) {
    if (k >= edge_pairs && k < across(0, 0) + edge_size * edge_size) continue;
    double *plane = entry(rod, k);
    plane[0] += plane[rod.vertices];
    plane[rod.vertices] = 0;
  }
}

namespace {

/// A product y += A x under way, for one rod.
struct Product {
  const EdgeBlocks &blocks;
  const RodRange &rod;
  const Planes &x;
  Planes &y;
};
using EdgeVector = std::array<double, edge_size>;

inline double entryOf(const Product &p, int plane, int i) { return p.blocks.entry(p.rod, plane)[i]; }

/// Plane of an entry of a symmetric block of positions or spins.
inline int vertexPlane(int r, int c) { return EdgeBlocks::vertex(std::min(r, c), std::max(r, c)); }

/// Of x, in the variables of an edge.
inline EdgeVector edgeOf(const Product &p, int i) {
  EdgeVector d{0, 0, 0, p.x[3][p.rod.slot(i)]};
  for (int a = 0; a < 3; ++a) d[a] = p.x[a][p.rod.slot(i + 1)] - p.x[a][p.rod.slot(i)];
  return d;
}

/// Adds what is conjugate to the variables of an edge to y.
inline void addToEdge(const Product &p, int i, const EdgeVector &force) {
  for (int a = 0; a < 3; ++a) {
    p.y[a][p.rod.slot(i)] -= force[a];
    p.y[a][p.rod.slot(i + 1)] += force[a];
  }
  p.y[3][p.rod.slot(i)] += force[3];
}

/// What vertices have with themselves, and with the edges behind them.
inline void multiplyVertices(const Product &p) {
  const RodRange &rod = p.rod;
  for (int i = 0; i < rod.vertices; ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) p.y[r][rod.slot(i)] += entryOf(p, vertexPlane(r, c), i) * p.x[c][rod.slot(i)];
  for (int i = 0; i < rod.edges && p.blocks.joins(); ++i) {
    const EdgeVector here = edgeOf(p, i);
    EdgeVector force{};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < edge_size; ++c) {
        const double v = entryOf(p, EdgeBlocks::joined(r, c), i);
        p.y[r][rod.slot(i)] += v * here[c];
        force[c] += v * p.x[r][rod.slot(i)];
      }
    addToEdge(p, i, force);
  }
}

/// What edges have with themselves and with the edges before them.
inline void multiplyEdges(const Product &p) {
  const RodRange &rod = p.rod;
  EdgeVector before{};
  for (int i = 0; i < rod.edges + (rod.closed ? 1 : 0); ++i) {
    const int at = i == rod.vertices ? 0 : i;
    const EdgeVector here = edgeOf(p, at);
    EdgeVector force{}, force_before{};
    for (int r = 0; r < edge_size; ++r)
      for (int c = 0; c < edge_size; ++c) {
        if (i < rod.edges) force[r] += entryOf(p, EdgeBlocks::own(std::min(r, c), std::max(r, c)), i) * here[c];
        force_before[r] += entryOf(p, EdgeBlocks::across(r, c), i) * here[c];
        force[c] += entryOf(p, EdgeBlocks::across(r, c), i) * before[r];
      }
    addToEdge(p, at, force);
    if (i > 0) addToEdge(p, i - 1, force_before);
    before = here;
  }
}

/// What the spin of a joined frame has with itself, and with the edge that is tied to it.
inline void multiplyJoined(const Product &p, const JoinedEdge &j) {
  const EdgeVector here = edgeOf(p, j.edge);
  EdgeVector force{};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c)
      p.y[r][j.frame] += entryOf(p, vertexPlane(r, c), j.frame - p.rod.first_slot) * p.x[c][j.frame];
    for (int c = 0; c < edge_size; ++c) {
      const double v = entryOf(p, EdgeBlocks::across(r, c), j.cell - p.rod.first_slot);
      p.y[r][j.frame] += v * here[c];
      force[c] += v * p.x[r][j.frame];
    }
  }
  addToEdge(p, j.edge, force);
}

inline void multiplyBody(const Product &p, const JoinedBody &b) {
  for (const int s : {b.position, b.rotation})
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) p.y[r][s] += entryOf(p, vertexPlane(r, c), s - p.rod.first_slot) * p.x[c][s];
}

inline void multiplyPair(const Product &p, const BodyPair &of) {
  for (int r = 0; r < of.variables(); ++r)
    for (int c = 0; c < of.variables(); ++c) {
      const auto [plane, slot] = EdgeBlocks::pair(std::min(r, c), std::max(r, c));
      const auto [to, row] = of.place(r, true);
      const auto [from, column] = of.place(c);
      p.y[row][to] += entryOf(p, plane, of.first + slot - p.rod.first_slot) * p.x[column][from];
    }
}

inline void multiplyTie(const Product &p, const Tie &t) {
  const Vec3 moved = p.x.vector(0, t.slot) - p.x.vector(0, t.copy);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      const double force = entryOf(p, vertexPlane(r, c), t.copy - p.rod.first_slot) * moved[c];
      p.y[r][t.slot] += force;
      p.y[r][t.copy] -= force;
    }
}

inline void multiplyTouching(const Product &p, const TouchingPair &of) {
  for (int r = 0; r < TouchingPair::variables; ++r)
    for (int c = 0; c < TouchingPair::variables; ++c) {
      const double v = p.blocks.touching(of.number)[TouchingPair::variables * r + c];
      const auto [row, a] = of.place(0, r);
      const auto [column, b] = of.place(1, c);
      p.y[a][row] += v * p.x[b][column];
      p.y[b][column] += v * p.x[a][row];
    }
}

} // namespace

void EdgeBlocks::multiply(const RodRange &rod, const Joins &of, const Planes &x, Planes &y) const {
  const Product product{*this, rod, x, y};
  multiplyVertices(product);
  multiplyEdges(product);
  for (const JoinedEdge &j : of.edges) multiplyJoined(product, j);
  for (const JoinedBody &b : of.bodies) multiplyBody(product, b);
  for (const BodyPair &p : of.pairs) multiplyPair(product, p);
  for (const Tie &t : of.ties) multiplyTie(product, t);
  for (const TouchingPair &p : of.touching) multiplyTouching(product, p);
}

double EdgeBlocks::magnitude(const RodRange &rod, const Joins &of, const Planes &x) const {
  double sum = 0;
  std::array<double, edge_size> before{};
  for (int i = 0; i < rod.vertices; ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = r; c < 3; ++c)
        sum += std::pow((r == c ? 1 : 2) * entry(rod, vertex(r, c))[i] * x[r][rod.slot(i)] * x[c][rod.slot(i)], 2);
  for (int i = 0; i < rod.edges; ++i) {
    std::array<double, edge_size> here{0, 0, 0, x[3][rod.slot(i)]};
    for (int a = 0; a < 3; ++a) here[a] = x[a][rod.slot(i + 1)] - x[a][rod.slot(i)];
    for (int r = 0; r < edge_size; ++r)
      for (int c = 0; c < edge_size; ++c) {
        if (c >= r) sum += std::pow((r == c ? 1 : 2) * entry(rod, own(r, c))[i] * here[r] * here[c], 2);
        sum += std::pow(2 * entry(rod, across(r, c))[i] * before[r] * here[c], 2);
        if (joins() && r < 3) sum += std::pow(2 * entry(rod, joined(r, c))[i] * x[r][rod.slot(i)] * here[c], 2);
      }
    before = here;
  }
  for (const JoinedEdge &j : of.edges)
    for (int r = 0; r < 3; ++r) {
      for (int c = r; c < 3; ++c)
        sum += std::pow(
            (r == c ? 1 : 2) * entry(rod, vertex(r, c))[j.frame - rod.first_slot] * x[r][j.frame] * x[c][j.frame], 2);
      for (int c = 0; c < edge_size; ++c) {
        const double d = c == 3 ? x[3][rod.slot(j.edge)] : x[c][rod.slot(j.edge + 1)] - x[c][rod.slot(j.edge)];
        sum += std::pow(2 * entry(rod, across(r, c))[j.cell - rod.first_slot] * x[r][j.frame] * d, 2);
      }
    }
  for (const JoinedBody &b : of.bodies)
    for (const int s : {b.position, b.rotation})
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c)
          sum += std::pow((r == c ? 1 : 2) * entry(rod, vertex(r, c))[s - rod.first_slot] * x[r][s] * x[c][s], 2);
  for (const BodyPair &p : of.pairs)
    for (int r = 0; r < p.variables(); ++r)
      for (int c = r; c < p.variables(); ++c) {
        const auto [plane, slot] = pair(r, c);
        const auto [first, row] = p.place(r);
        const auto [second, column] = p.place(c);
        sum += std::pow((r == c ? 1 : 2) * entry(rod, plane)[p.first + slot - rod.first_slot] * x[row][first] *
                            x[column][second],
                        2);
      }
  for (const Tie &t : of.ties) {
    const Vec3 moved = x.vector(0, t.slot) - x.vector(0, t.copy);
    for (int r = 0; r < 3; ++r)
      for (int c = r; c < 3; ++c)
        sum += std::pow((r == c ? 1 : 2) * entry(rod, vertex(r, c))[t.copy - rod.first_slot] * moved[r] * moved[c], 2);
  }
  for (const TouchingPair &p : of.touching)
    for (int r = 0; r < TouchingPair::variables; ++r)
      for (int c = 0; c < TouchingPair::variables; ++c) {
        const auto [row, a] = p.place(0, r);
        const auto [column, b] = p.place(1, c);
        sum += std::pow(2 * touching(p.number)[TouchingPair::variables * r + c] * x[a][row] * x[b][column], 2);
      }
  return std::sqrt(sum);
}

} // namespace tendril
