#pragma once
/// \file elimination.hpp
/// The kernel of `banded` and `condensed`: LDL^T of one rod's matrix over edge variables, or of a pack of rods of one
/// shape, one to a lane (docs/theory.md, Rounding).

#include "tendril/solver/pivots.hpp"

#include <algorithm>

namespace tendril {

/// The elimination of one rod, or of a pack of rods of one shape. `Read`: read(plane, i) gives an entry of the blocks
/// at local slot i, shift included; those of positions with edges where it `joins`.
template <class T, Border border, bool joins, class Read> class Elimination {
public:
  Elimination(const RunRange &run, const std::vector<char> &held, const Read &read, T *records)
      : begin_(run.begin), n_(run.end), last_(ring ? n_ - 1 : n_), keeps_first_(run.keeps_first), held_(held),
        read_(read), records_(records) {}

  /// \param first receives L and inverse pivots of the first vertex
  [[gnu::flatten]] void run(T *first) {
    toFirstEdge();
    factorVertex(first);
    first[border_begin] = T(double(bordered_from_));
  }

  /// A run that begins without a separator. \param far what it does to the one at its end
  [[gnu::flatten]] void run(T (&far)[state_size][state_size], T *first) {
    run(first);
    if (bordered) eliminateVertex(first);
    corner(far);
  }

  /// A run that begins in a separator. \param near what it does to that one, to both, and to the one at its end
  [[gnu::flatten]] void runTo(T (&near)[state_size][state_size], T (&between)[state_size][state_size],
                              T (&far)[state_size][state_size], T *first) {
    toFirstEdge();
    for (int r = 0; r < state_size; ++r)
      for (int c = 0; c < state_size; ++c) {
        near[r][c] = state_[r][c];
        between[r][c] = mixed_[r][c];
      }
    corner(far);
    first[border_begin] = T(double(bordered_from_));
  }

  T negative{0.0}, zero{0.0};

private:
  /// What comes once to a run. Packs live in memory anyway; in one function with the loop they take minutes to compile.
  template <class Do> void rarely(const Do &act) {
    if constexpr (std::is_same_v<T, double>)
      act();
    else
      apart(act);
  }
  template <class Do> [[gnu::noinline]] static void apart(const Do &act) { act(); }
  void corner(T (&far)[state_size][state_size]) const {
    for (int r = 0; r < state_size; ++r)
      for (int c = 0; c < state_size; ++c) far[r][c] = corner_[std::min(r, c)][std::max(r, c)];
  }
  void toFirstEdge() {
    if (border == Border::none && !held_[last_]) addVertex(last_, state_);
    for (int i = n_ - 1; i > begin_; --i) {
      if (bordered && i == n_ - 1)
        rarely([&] { closeRing(); });
      else
        step(i, nextHeld(i));
    }
    rarely([&] { keeps_first_ ? keepFirst() : firstEdge(); });
  }

  /// The state becomes that of the first edge with its vertex, and what these have by themselves is added.
  void keepFirst() {
    moveBack(false);
    addVertex(begin_, state_);
    for (int r = 0; r < edge_size; ++r) {
      for (int c = 0; c < edge_size; ++c)
        state_[edge_at + r].set(edge_at + c, state_[edge_at + r][edge_at + c] + own(r, c, begin_));
      for (int c = 0; c < 3 && joins; ++c) {
        const T v = state_[c][edge_at + r] + joined(c, r, begin_);
        state_[c].set(edge_at + r, v);
        state_[edge_at + r].set(c, v);
      }
    }
  }

  void factorVertex(T *first) {
    using std::abs;
    T a[3][3], scale[3];
    for (int r = 0; r < 3; ++r) {
      for (int c = r; c < 3; ++c) a[r][c] = state_[r][c];
      scale[r] = abs(a[r][r]);
    }
    if (!held_[begin_])
      factorSmall<3>(a, scale, first, first + 3, negative, zero);
    else
      std::fill_n(first, 6, T(0.0));
  }

  /// The first vertex with the border, whose rows of A^-1 B come behind the record of the vertex.
  void eliminateVertex(T *first) {
    for (int c = 0; c < state_size; ++c) {
      T z[3];
      for (int r = 0; r < 3; ++r) z[r] = held_[begin_] ? T(0.0) : mixed_[r][c];
      if (!held_[begin_]) solveSmall<3>(first, first + 3, z);
      for (int k = 0; k <= c; ++k) {
        T share(0.0);
        for (int r = 0; r < 3; ++r) share += mixed_[r][k] * z[r];
        corner_[k].set(c, corner_[k][c] - share);
      }
      for (int r = 0; r < 3; ++r) first[vertex_record + r * state_size + c] = z[r];
    }
  }

  static constexpr bool ring = border == Border::ring, bordered = border != Border::none;
  static constexpr int width = Record<T>::width;
  const int begin_, n_, last_;
  const bool keeps_first_;
  const std::vector<char> &held_;
  const Read &read_;
  T *const records_;
  Square<T> state_;
  Square<T> mixed_, corner_; ///< of a border: with the state, and with itself
  T first_mixed_{0.0};       ///< its largest entry so far
  int bordered_from_ = 0;    ///< edges before it have no border any more

  T *record(int i) const {
    return records_ + std::size_t(i - begin_) * (bordered ? Record<T>::bordered : Record<T>::plain);
  }
  bool nextHeld(int i) const { return held_[ring && i == last_ ? 0 : i + 1]; }
  T joined(int r, int c, int i) const { return read_(EdgeBlocks::joined(r, c), i); }
  T own(int r, int c, int i) const { return read_(EdgeBlocks::own(std::min(r, c), std::max(r, c)), i); }
  /// Couplings of the edge before with variable c of edge i, as a row over the state.
  Row<T> across(int c, int i) const {
    Row<T> row;
#pragma GCC unroll 4
    for (int r = 0; r < edge_size; ++r) row.set(edge_at + r, read_(EdgeBlocks::across(r, c), i));
    return row;
  }
  void addVertex(int i, Square<T> &to) const {
#pragma GCC unroll 3
    for (int r = 0; r < 3; ++r)
#pragma GCC unroll 3
      for (int c = r; c < 3; ++c) {
        const T v = to[r][c] + read_(EdgeBlocks::vertex(r, c), i);
        to[r].set(c, v);
        to[c].set(r, v);
      }
  }

  /// From the far vertex of an edge to its near one: x_{i+1} = x_i + e_i, or zero where it is held.
  void moveBack(bool held) {
    if (held) {
#pragma GCC unroll 7
      for (int r = 0; r < state_size; ++r) state_[r].dropPosition();
#pragma GCC unroll 3
      for (int r = 0; r < 3; ++r) state_[r] = {};
    } else {
#pragma GCC unroll 7
      for (int r = 0; r < state_size; ++r) state_[r].addPositionToEdge();
#pragma GCC unroll 3
      for (int r = 0; r < 3; ++r) state_[edge_at + r].add(state_[r]);
    }
    if (!bordered || bordered_from_ > 0) return;
    for (int r = 0; r < 3; ++r)
      if (held)
        mixed_[r] = {};
      else
        mixed_[edge_at + r].add(mixed_[r]);
  }

  /// Eliminates edge i from the state beyond its far vertex; leaves that beyond its near one.
  void step(int i, bool held) {
    moveBack(held);
    if (held)
      rarely([&] { substitute(i); });
    else
      eliminate(i);
  }

  void eliminate(int i) {
    using std::abs;
    T a[edge_size][edge_size], scale[edge_size];
    Row<T> b[edge_size];
#pragma GCC unroll 4
    for (int r = 0; r < edge_size; ++r) {
#pragma GCC unroll 4
      for (int c = r; c < edge_size; ++c) {
        const T here = own(r, c, i), beyond = state_[edge_at + r][edge_at + c];
        a[r][c] = beyond + here;
        if (c == r) scale[r] = abs(beyond) + abs(here);
      }
      b[r] = across(r, i);
#pragma GCC unroll 3
      for (int c = 0; c < 3; ++c) b[r].set(c, state_[edge_at + r][c]);
    }
    if constexpr (joins)
      for (int r = 0; r < edge_size; ++r)
        for (int c = 0; c < 3; ++c) b[r].set(c, b[r][c] + joined(c, r, i));
    T *const out = record(i), *const lower = out + Record<T>::lower, *const inverse = out + Record<T>::pivots;
    T l[6], d[edge_size];
    factorSmall<edge_size>(a, scale, l, d, negative, zero);
    std::copy_n(l, 6, lower);
    std::copy_n(d, edge_size, inverse);
    reduce(b, l);
    Square<T> next;
#pragma GCC unroll 3
    for (int r = 0; r < 3; ++r) {
      next[r] = state_[r];
      for (int c = edge_at; c < state_size; ++c) next[r].set(c, T(0.0));
    }
    addVertex(i, next);
    T y[edge_size][width]; // the rows of L^-1 B as scalars
    Row<T> z[edge_size];
#pragma GCC unroll 4
    for (int p = 0; p < edge_size; ++p) {
      b[p].store(y[p]);
      z[p] = b[p].scaled(d[p]);
    }
#pragma GCC unroll 4
    for (int p = 0; p < edge_size; ++p)
#pragma GCC unroll 7
      for (int k = 0; k < state_size; ++k) next[k].subtract(y[p][k], z[p], k);
    Row<T>::symmetrise(next);
    if (bordered && bordered_from_ == 0) {
      Row<T> bs[edge_size];
      for (int r = 0; r < edge_size; ++r) {
        bs[r] = mixed_[edge_at + r];
        mixed_[edge_at + r] = {};
      }
      reduce(bs, l);
      addBorder(y, bs, d, l, out);
      if (i % 8 == 0) dropBorder(i);
    }
    complete(z, l, out);
#pragma GCC unroll 7
    for (int k = 0; k < state_size; ++k) state_[k] = next[k];
  }

  /// rows = L^-1 rows
  static void reduce(Row<T> (&rows)[edge_size], const T *l) {
#pragma GCC unroll 4
    for (int r = 1; r < edge_size; ++r)
#pragma GCC unroll 4
      for (int c = 0; c < r; ++c) rows[r].subtract(l[below(r, c)], rows[c]);
  }

  /// Stores rows = L^-T rows.
  static void complete(Row<T> (&rows)[edge_size], const T *l, T *out) {
#pragma GCC unroll 4
    for (int r = edge_size - 1; r >= 0; --r) {
#pragma GCC unroll 4
      for (int c = r + 1; c < edge_size; ++c) rows[r].subtract(l[below(c, r)], rows[c]);
      rows[r].store(out + r * width);
    }
  }

  /// What the elimination of an edge does to the border, given the reduced rows of the state and of the border.
  void addBorder(const T (&y)[edge_size][width], const Row<T> (&bs)[edge_size], const T *d, const T *l, T *out) {
    Row<T> z[edge_size];
    for (int p = 0; p < edge_size; ++p) {
      T ys[width];
      bs[p].store(ys);
      z[p] = bs[p].scaled(d[p]);
      for (int k = 0; k < state_size; ++k) {
        mixed_[k].subtract(y[p][k], z[p]);
        corner_[k].subtract(ys[k], z[p]);
      }
    }
    complete(z, l, out + Record<T>::plain);
  }

  /// In dynamics a border falls off along the rod: left to itself it would end in denormal numbers, which are slow.
  void dropBorder(int i) {
    using std::abs, std::max;
    constexpr double none = 1e-20; // of its beginning: what it would add is its square
    T most(0.0);
    for (const Row<T> &row : mixed_)
      for (int c = 0; c < state_size; ++c) most = max(most, T(abs(row[c])));
    first_mixed_ = max(first_mixed_, most);
    if (!allOf(most <= T(none) * first_mixed_)) return;
    for (Row<T> &row : mixed_) row = {};
    bordered_from_ = i;
  }

  /// Edge i between vertex i and a held one: e = -x. Only its twist is eliminated.
  void substitute(int i) {
    Square<T> next;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        next[r].set(c, (state_[r][c] - state_[r][edge_at + c]) -
                           (state_[edge_at + r][c] - (state_[edge_at + r][edge_at + c] + own(r, c, i))));
      const Row<T> before = across(r, i);
      for (int c = edge_at; c < state_size; ++c) {
        next[r].set(c, -before[c]);
        next[c].set(r, -before[c]);
      }
    }
    addVertex(i, next);
    constexpr int twist = state_size - 1;
    Row<T> b = across(3, i);
    for (int c = 0; c < 3; ++c) b.set(c, state_[twist][c] - (state_[twist][edge_at + c] + own(c, 3, i)));
    if constexpr (joins) joinSubstituted(i, next, b);
    if constexpr (bordered) {
      for (int r = 0; r < 3; ++r) mixed_[r].subtract(T(1.0), mixed_[edge_at + r]);
      for (int r = 0; r < 3; ++r) mixed_[edge_at + r] = {};
      const Row<T> bs = mixed_[twist];
      mixed_[twist] = {};
      eliminateTwist(i, next, b, bs);
    } else
      eliminateTwist(i, next, b, {});
  }

  /// What the position of vertex i has with edge i, e = -x.
  void joinSubstituted(int i, Square<T> &next, Row<T> &b) const {
    for (int r = 0; r < 3; ++r) b.set(r, b[r] + joined(r, 3, i));
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) next[r].set(c, next[r][c] - (joined(r, c, i) + joined(c, r, i)));
  }

  void eliminateTwist(int i, Square<T> &next, const Row<T> &b, const Row<T> &bs) {
    using std::abs;
    constexpr int twist = state_size - 1;
    const T scale = abs(state_[twist][twist]) + abs(own(3, 3, i));
    T *const out = record(i);
    std::fill_n(out, Record<T>::plain, T(0.0));
    const T inverse = inversePivot(T(state_[twist][twist] + own(3, 3, i)), scale, negative, zero);
    const Row<T> z = b.scaled(inverse);
    for (int k = 0; k < state_size; ++k) next[k].subtract(b[k], z);
    for (int r = 0; r < 3; ++r) out[r * width + r] = T(1.0);
    z.store(out + 3 * width);
    out[Record<T>::pivots + 3] = inverse;
    if constexpr (bordered) {
      const Row<T> zs = bs.scaled(inverse);
      for (int k = 0; k < state_size; ++k) {
        mixed_[k].subtract(b[k], zs);
        corner_[k].subtract(bs[k], zs);
      }
      std::fill_n(out + Record<T>::plain, 3 * width, T(0.0));
      zs.store(out + Record<T>::plain + 3 * width);
    }
    for (int k = 0; k < state_size; ++k) state_[k] = next[k];
  }

  /// The last edge of a ring ends where the first begins, e = x_0 - x, and meets it in the cell behind the ring; that
  /// of a run ends in a separator.
  void closeRing() {
    const int i = n_ - 1;
    Square<T> next;
    Row<T> b = across(3, i), bs;
    for (int r = 0; r < 3; ++r) {
      const Row<T> before = across(r, i);
      for (int c = 0; c < 3; ++c) {
        next[r].set(c, own(r, c, i));
        mixed_[r].set(c, -own(r, c, i));
        corner_[r].set(c, own(r, c, i));
      }
      for (int c = edge_at; c < state_size; ++c) {
        next[r].set(c, -before[c]);
        next[c].set(r, -before[c]);
        mixed_[c].set(r, before[c]);
      }
      for (int p = 0; p < edge_size; ++p) {
        const T o = read_(EdgeBlocks::across(r, p), i + 1);
        mixed_[r].set(edge_at + p, -o);
        corner_[r].set(edge_at + p, o); // of the corner only the upper triangle counts
      }
      b.set(r, -own(r, 3, i));
      bs.set(r, own(r, 3, i));
    }
    for (int p = 0; p < edge_size; ++p) bs.set(edge_at + p, read_(EdgeBlocks::across(3, p), i + 1));
    addVertex(i, next);
    if constexpr (joins) {
      joinSubstituted(i, next, b);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) mixed_[r].set(c, mixed_[r][c] + joined(r, c, i));
    }
    eliminateTwist(i, next, b, bs);
    for (int r = 0; r < 3; ++r) record(i)[Record<T>::plain + r * width + r] = T(-1.0);
  }

  /// Behind it there is no edge, but in a ring the border joins in: it is this edge and its near vertex.
  void firstEdge() {
    if (border == Border::separator && n_ - 1 == begin_) return closeRing();
    moveBack(nextHeld(begin_));
    if constexpr (ring) {
      for (int r = 0; r < state_size; ++r)
        for (int c = r; c < state_size; ++c) {
          const T v = state_[r][c] + (mixed_[r][c] + mixed_[c][r]) + corner_[r][c];
          state_[r].set(c, v);
          state_[c].set(r, v);
        }
      for (Row<T> &row : mixed_) row = {};
    }
    nextHeld(begin_) ? substitute(begin_) : eliminate(begin_);
  }
};

} // namespace tendril
