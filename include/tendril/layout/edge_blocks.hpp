#pragma once
/// \file edge_blocks.hpp
/// Symmetric matrices of all rods, such as the Hessian of the incremental potential, in edge variables: edge vectors
/// e_i = x_{i+1} - x_i, edge twists, and vertex positions. In vertex coordinates the same matrix has entries of the
/// order EI/h^3 that cancel, and a solve loses digits with the fourth power of length over edge length; here nothing
/// cancels (docs/theory.md, Rounding).

#include "tendril/layout/rod_range.hpp"

#include <span>

namespace tendril {

/// Variables of an edge: its vector and its twist. Couplings of an edge with itself, upper triangle.
inline constexpr int edge_size = 4, edge_pairs = edge_size * (edge_size + 1) / 2;
/// Numbers of a slot: edge i with itself (10), edge i - 1 with edge i (16), the position of vertex i with itself (6).
inline constexpr int slot_entries = edge_pairs + edge_size * edge_size + 6;
/// With the position of vertex i and edge i (12), which only what acts beside the axis of a rod has.
inline constexpr int joined_entries = slot_entries + 3 * edge_size;

/// The 32 or 44 entries of a slot are planes over the slots of a rod. Behind a ring, the copy of its first slot holds
/// what the last edge has with the first; the other copies are added to what they stand for (fold). Of an edge that is
/// joined to a frame, the frame's spin is the position at its slot, and what it has with the edge is `across` at the
/// slot of the half cell, spin by edge. What a tie has is `vertex` at the slot of its copy;
/// what a pair of bodies has stands at its own slots in rows. Two edges that touch have a block of their own for what
/// is between them.
class EdgeBlocks {
public:
  /// Planes of a slot's entries. Edge variables r, c in 0..3: e_x, e_y, e_z, twist.
  static constexpr int own(int r, int c) { return r * edge_size - r * (r - 1) / 2 + (c - r); } ///< r <= c
  static constexpr int across(int r, int c) {
    return edge_pairs + edge_size * r + c;
  } ///< r of the edge before, c of the edge
  static constexpr int vertex(int r, int c) {
    return edge_pairs + edge_size * edge_size + r * 3 - r * (r - 1) / 2 + (c - r);
  } ///< r <= c < 3
  static constexpr int joined(int r, int c) {
    return slot_entries + edge_size * r + c;
  } ///< r < 3 of the position of the vertex, c of the edge behind it

  /// Entry i, j of a pair of bodies, i <= j over its variables (BodyPair): plane, and slot behind its first.
  static constexpr std::pair<int, int> pair(int i, int j) {
    const int n = 12 * i + j;
    return {n % slot_entries, n / slot_entries};
  }

  EdgeBlocks() = default;
  /// Of all rods, or of as many neighbours as so many slots hold.
  /// \param joins whether positions have entries with edges
  explicit EdgeBlocks(int slots, bool joins = false)
      : entries_(joins ? joined_entries : slot_entries), data_(std::size_t(entries_) * slots + 4 * lanes, 0.0) {}
  /// Makes room for so many pairs of edges that touch.
  void setTouching(std::size_t pairs) { touching_.assign(touching_size * pairs, 0.0); }
  /// Entries of a pair, row by row: the variables of the edge by those of the other (TouchingPair::place).
  double *touching(int number) { return touching_.data() + std::size_t(touching_size) * number; }
  const double *touching(int number) const { return touching_.data() + std::size_t(touching_size) * number; }
  /// An entry by its place: in data(), or behind touching_place that of a pair.
  double at(std::ptrdiff_t place) const {
    return place < touching_place ? data_[std::size_t(place)] : touching_[std::size_t(place - touching_place)];
  }
  static constexpr int touching_size = TouchingPair::variables * TouchingPair::variables;
  static constexpr std::ptrdiff_t touching_place = std::ptrdiff_t(1) << 48;
  bool joins() const { return entries_ == joined_entries; }
  int entries() const { return entries_; }
  /// Moves the window to the rods from this slot on (see Planes).
  void setOrigin(int first_slot) { origin_ = first_slot; }
  double *entry(const RodRange &rod, int plane) { return data_.data() + offset(rod, plane); }
  const double *entry(const RodRange &rod, int plane) const { return data_.data() + offset(rod, plane); }
  const double *data() const { return data_.data(); }
  void clear(const RodRange &rod);
  /// Becomes other - this.
  void subtractFrom(const EdgeBlocks &other);
  /// Adds what was summed into the copies behind a ring to the slots they stand for.
  void fold(const RodRange &rod);
  /// y += A x for one rod in vertex coordinates (x, y, z, twist of each slot), copies behind a ring included in x and
  /// in y.
  void multiply(const RodRange &rod, const Joins &joins, const Planes &x, Planes &y) const;

  /// Root of the sum of (x_i A_ij x_j)^2 over the entries of one rod: rounding of the entries, each its own, changes
  /// x'A x by an epsilon of it.
  double magnitude(const RodRange &rod, const Joins &joins, const Planes &x) const;

  /// Where the plane of an entry begins in data().
  std::size_t offset(const RodRange &rod, int plane) const {
    return lanes + std::size_t(entries_) * (rod.first_slot - origin_) + std::size_t(plane) * rod.slots;
  }

private:
  int origin_ = 0, entries_ = slot_entries;
  AlignedVector data_;
  std::vector<double> touching_;
};

/// The planes of one rod's entries by slot of the scene, for element loops.
class BlockPlanes {
public:
  BlockPlanes(EdgeBlocks &blocks, const RodRange &rod) {
    for (int k = 0; k < blocks.entries(); ++k) plane_[k] = blocks.entry(rod, k) - rod.first_slot;
  }
  double *own(int r, int c) const { return plane_[EdgeBlocks::own(r, c)]; }
  double *across(int r, int c) const { return plane_[EdgeBlocks::across(r, c)]; }
  double *vertex(int r, int c) const { return plane_[EdgeBlocks::vertex(r, c)]; }
  double *joined(int r, int c) const { return plane_[EdgeBlocks::joined(r, c)]; }

private:
  std::array<double *, joined_entries> plane_;
};

} // namespace tendril
