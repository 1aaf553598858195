#pragma once
/// \file pivots.hpp
/// Pieces of the elimination: rows in registers, records of the factors, small matrices.

#include "tendril/layout/edge_blocks.hpp"

#include <limits>

namespace tendril {

/// Variables of what a rod beyond a vertex stores: the vertex' position and the vector and twist of the edge before it.
inline constexpr int state_size = 7, edge_at = 3;

/// Inverse of the pivot of a row, its sign counted. What rounding has left of the numbers that were added to it,
/// `scale`, is a zero pivot: its variable is left out, as if held, with the inverse zero.
template <class T> T inversePivot(const T &d, const T &scale, T &negative, T &zero) {
  using std::abs;
  const auto lost = abs(d) <= T(16 * std::numeric_limits<double>::epsilon()) * scale;
  zero += select(lost, T(1.0), T(0.0));
  negative += select(!lost && d < T(0.0), T(1.0), T(0.0));
  return select(lost, T(0.0), T(1.0) / d);
}

inline double firstLane(double x) { return x; }
inline double firstLane(const Pack &x) { return x[0]; }
inline bool allOf(bool condition) { return condition; }
inline bool allOf(const Pack::mask_type &condition) { return all_of(condition); }

/// A row over the variables of the state: of one rod in a register, of a pack of rods as so many packs.
typedef double Octet __attribute__((vector_size(64), aligned(8)));
template <class T> struct Row;
template <> struct Row<double> {
  static constexpr int size = 8;
  Octet v{};
  void store(double *p) const { *reinterpret_cast<Octet *>(p) = v; }
  double operator[](int c) const { return v[c]; }
  void set(int c, double x) { v[c] = x; }
  /// What comes before column `first` may be left out.
  void subtract(double a, const Row &b, int /*first*/ = 0) { v -= a * b.v; }
  static void symmetrise(Row *) {}
  Row scaled(double a) const { return {a * v}; }
  void add(const Row &b) { v += b.v; }
  /// What belongs to the position is the edge's, too.
  void addPositionToEdge() { v += __builtin_shufflevector(v, Octet{}, 8, 8, 8, 0, 1, 2, 8, 8); }
  void dropPosition() { v = __builtin_shufflevector(v, Octet{}, 8, 8, 8, 3, 4, 5, 6, 8); }
};
template <> struct Row<Pack> {
  static constexpr int size = state_size;
  Pack v[state_size] = {};
  void store(Pack *p) const { std::copy_n(v, size, p); }
  Pack operator[](int c) const { return v[c]; }
  void set(int c, const Pack &x) { v[c] = x; }
  void subtract(const Pack &a, const Row &b, int first = 0) {
#pragma GCC unroll 7
    for (int c = first; c < size; ++c) v[c] -= a * b.v[c];
  }
  /// The lower triangle from the upper one.
  static void symmetrise(Row *rows) {
#pragma GCC unroll 7
    for (int r = 1; r < size; ++r)
#pragma GCC unroll 7
      for (int c = 0; c < r; ++c) rows[r].v[c] = rows[c].v[r];
  }
  Row scaled(const Pack &a) const {
    Row r;
#pragma GCC unroll 7
    for (int c = 0; c < size; ++c) r.v[c] = a * v[c];
    return r;
  }
  void add(const Row &b) {
#pragma GCC unroll 7
    for (int c = 0; c < size; ++c) v[c] += b.v[c];
  }
  void addPositionToEdge() {
    for (int c = 0; c < 3; ++c) v[edge_at + c] += v[c];
  }
  void dropPosition() {
    for (int c = 0; c < 3; ++c) v[c] = Pack(0.0);
  }
};

/// A symmetric matrix over the state, or one of the state against a ring's border.
template <class T> using Square = Row<T>[state_size];

/// What the elimination of edges goes towards at their far end: nothing, the first vertex and edge of the same ring, or
/// the vertex and the frame of a junction.
enum class Border { none, ring, separator };
/// Edges of a rod that are eliminated together, [begin, end); but the first where it is kept, for a separator that the
/// rod runs through: with the vertex where it begins, and its twist.
struct RunRange {
  int begin, end;
  bool keeps_first = false;
};

/// What is kept of an edge to solve with: G = A^-1 B, where A is the edge's own matrix and B what it has with the
/// state; L and the inverse pivots of A = L D L'. An edge whose far vertex is held is known from the position, e = -x:
/// its pivots are zero and its rows of G say so.
template <class T> struct Record {
  static constexpr int width = Row<T>::size, lower = edge_size * width, pivots = lower + 6;
  static constexpr int plain = (pivots + edge_size + 7) / 8 * 8; ///< numbers of an edge
  static constexpr int bordered =
      plain + edge_size * width; ///< ... of a ring, with the rows of G for the border behind
  static constexpr std::size_t of(const RodRange &rod) { return rod.closed ? bordered : plain; }
};

/// Numbers kept of the first vertex: L and inverse pivots of its position. Where a run begins there and ends in a
/// separator, A^-1 B for that comes behind.
inline constexpr std::size_t vertex_record = 8, bordered_vertex_record = vertex_record + 24;
/// ... and, of a ring, at which edge its border begins: those before have none.
inline constexpr std::size_t border_begin = 6;

/// L below the diagonal, row by row.
inline constexpr int below(int r, int c) { return r * (r - 1) / 2 + c; }

/// LDL^T of a small matrix: L, the inverse pivots and their signs. `scale`: of what was added to each diagonal.
template <int n, class T> void factorSmall(T (&a)[n][n], const T *scale, T *lower, T *inverse, T &negative, T &zero) {
#pragma GCC unroll 4
  for (int p = 0; p < n; ++p) {
    inverse[p] = inversePivot(a[p][p], scale[p], negative, zero);
#pragma GCC unroll 4
    for (int r = p + 1; r < n; ++r) {
      const T l = a[p][r] * inverse[p];
#pragma GCC unroll 4
      for (int c = r; c < n; ++c) a[r][c] -= l * a[p][c];
      lower[below(r, p)] = l;
    }
  }
}

/// x = A^-1 x.
template <int n, class T> void solveSmall(const T *lower, const T *inverse, T *x) {
#pragma GCC unroll 4
  for (int r = 1; r < n; ++r)
#pragma GCC unroll 4
    for (int c = 0; c < r; ++c) x[r] -= lower[below(r, c)] * x[c];
#pragma GCC unroll 4
  for (int r = n - 1; r >= 0; --r) {
    x[r] *= inverse[r];
#pragma GCC unroll 4
    for (int c = r + 1; c < n; ++c) x[r] -= lower[below(c, r)] * x[c];
  }
}

} // namespace tendril
