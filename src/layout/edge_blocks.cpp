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

void EdgeBlocks::multiply(const RodRange &rod, const Joins &of, const Planes &x, Planes &y) const {
  using Four = std::array<double, edge_size>;
  auto edge = [&](int i) {
    Four d{0, 0, 0, x[3][rod.slot(i)]};
    for (int a = 0; a < 3; ++a) d[a] = x[a][rod.slot(i + 1)] - x[a][rod.slot(i)];
    return d;
  };
  auto add = [&](int i, const Four &force) {
    for (int a = 0; a < 3; ++a) {
      y[a][rod.slot(i)] -= force[a];
      y[a][rod.slot(i + 1)] += force[a];
    }
    y[3][rod.slot(i)] += force[3];
  };
  auto value = [&](int plane, int i) { return entry(rod, plane)[i]; };
  for (int i = 0; i < rod.vertices; ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        y[r][rod.slot(i)] += value(vertex(std::min(r, c), std::max(r, c)), i) * x[c][rod.slot(i)];
  for (int i = 0; i < rod.edges && joins(); ++i) {
    const Four here = edge(i);
    Four force{};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < edge_size; ++c) {
        y[r][rod.slot(i)] += value(joined(r, c), i) * here[c];
        force[c] += value(joined(r, c), i) * x[r][rod.slot(i)];
      }
    add(i, force);
  }
  Four before{};
  for (int i = 0; i < rod.edges + (rod.closed ? 1 : 0); ++i) {
    const Four here = edge(i == rod.vertices ? 0 : i);
    Four force{}, force_before{};
    for (int r = 0; r < edge_size; ++r)
      for (int c = 0; c < edge_size; ++c) {
        if (i < rod.edges) force[r] += value(own(std::min(r, c), std::max(r, c)), i) * here[c];
        force_before[r] += value(across(r, c), i) * here[c];
        force[c] += value(across(r, c), i) * before[r];
      }
    add(i == rod.vertices ? 0 : i, force);
    if (i > 0) add(i - 1, force_before);
    before = here;
  }
  for (const JoinedEdge &j : of.edges) {
    const Four here = edge(j.edge);
    Four force{};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        y[r][j.frame] += value(vertex(std::min(r, c), std::max(r, c)), j.frame - rod.first_slot) * x[c][j.frame];
      for (int c = 0; c < edge_size; ++c) {
        const double v = value(across(r, c), j.cell - rod.first_slot);
        y[r][j.frame] += v * here[c];
        force[c] += v * x[r][j.frame];
      }
    }
    add(j.edge, force);
  }
  for (const JoinedBody &b : of.bodies)
    for (const int s : {b.position, b.rotation})
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          y[r][s] += value(vertex(std::min(r, c), std::max(r, c)), s - rod.first_slot) * x[c][s];
  for (const BodyPair &p : of.pairs)
    for (int r = 0; r < p.variables(); ++r)
      for (int c = 0; c < p.variables(); ++c) {
        const auto [plane, slot] = pair(std::min(r, c), std::max(r, c));
        const auto [to, row] = p.place(r, true);
        const auto [from, column] = p.place(c);
        y[row][to] += value(plane, p.first + slot - rod.first_slot) * x[column][from];
      }
  for (const Tie &t : of.ties) {
    const Vec3 moved = x.vector(0, t.slot) - x.vector(0, t.copy);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        const double force = value(vertex(std::min(r, c), std::max(r, c)), t.copy - rod.first_slot) * moved[c];
        y[r][t.slot] += force;
        y[r][t.copy] -= force;
      }
  }
  for (const TouchingPair &p : of.touching)
    for (int r = 0; r < TouchingPair::variables; ++r)
      for (int c = 0; c < TouchingPair::variables; ++c) {
        const double v = touching(p.number)[TouchingPair::variables * r + c];
        const auto [row, a] = p.place(0, r);
        const auto [column, b] = p.place(1, c);
        y[a][row] += v * x[b][column];
        y[b][column] += v * x[a][row];
      }
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
