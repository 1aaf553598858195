#pragma once
/// \file substitution.hpp
/// Solutions with the factors of `banded` and `condensed` (elimination.hpp).

#include "tendril/solver/pivots.hpp"

#include <algorithm>

namespace tendril {

/// Solutions for the edges of one rod, or of a pack of rods of one shape, by the records of their factor.
template <class T, Border border> class Substitution {
public:
  /// \param first record of the first vertex
  Substitution(const RunRange &run, const std::vector<char> &held, const T *records, const T *first)
      : begin_(run.begin), end_(run.end), first_(run.keeps_first ? begin_ + 1 : begin_), last_(ring ? end_ - 1 : end_),
        border_end_(bordered ? std::max(ring ? begin_ + 1 : begin_, int(firstLane(first[border_begin]))) : 0),
        held_(held), records_(records) {}

  /// Of the right-hand side in `values`, four numbers a slot of the rod, leaves what the first vertex and the edge
  /// before it get in `near`, and what the border gets in `far`.
  void toFirst(T *values, T (&near)[state_size], T (&far)[state_size]) const {
    T *const q = near;
    std::fill_n(q, state_size, T(0.0));
    std::fill_n(far, state_size, T(0.0));
    if (!bordered)
      for (int a = 0; a < 3; ++a) q[a] = values[slot_size * last_ + a];
    for (int i = end_ - 1; i >= first_; --i) {
      const T *g = record(i);
      T *here = values + slot_size * i;
      T r[edge_size];
      const bool drops = nextHeld(i) || (bordered && i == end_ - 1);
#pragma GCC unroll 3
      for (int a = 0; a < 3; ++a) {
        if (drops) q[a] = T(0.0);
        if (ring && i == 0) {
          r[a] = (q[edge_at + a] + q[a]) + far[edge_at + a];
          q[a] += far[a];
        } else
          r[a] = q[edge_at + a] + q[a];
      }
      r[3] = q[edge_at + 3] + here[3];
      if (ring && i == 0) r[3] += far[edge_at + 3];
      T next[state_size];
#pragma GCC unroll 7
      for (int c = 0; c < state_size; ++c) {
        T share = g[c] * r[0];
#pragma GCC unroll 4
        for (int p = 1; p < edge_size; ++p) share += g[p * w + c] * r[p];
        next[c] = (c < 3 ? q[c] + here[c] : T(0.0)) - share;
        if (reachesBorder(i)) {
          const T *gs = g + Record<T>::plain;
          T beyond = gs[c] * r[0];
          for (int p = 1; p < edge_size; ++p) beyond += gs[p * w + c] * r[p];
          far[c] -= beyond;
        }
      }
#pragma GCC unroll 4
      for (int p = 0; p < edge_size; ++p) here[p] = r[p];
#pragma GCC unroll 7
      for (int c = 0; c < state_size; ++c) q[c] = next[c];
    }
    for (int a = 0; a < 3 && first_ > begin_; ++a) q[edge_at + a] += q[a]; // from the vertex behind the first edge
  }

  /// Then, with the solution there, all others.
  void fromFirst(T (&near)[state_size], T (&far)[state_size], T *values) const {
    T *const u = near;
    for (int a = 0; a < 3 && first_ > begin_; ++a) u[a] += u[edge_at + a];
    for (int i = first_; i < end_; ++i) {
      const T *g = record(i);
      T *here = values + slot_size * i;
      T v[edge_size];
      std::copy_n(here, edge_size, v);
      solveSmall<edge_size>(g + Record<T>::lower, g + Record<T>::pivots, v);
      if (reachesBorder(i)) {
        const T *gs = g + Record<T>::plain;
        for (int p = 0; p < edge_size; ++p)
          for (int c = 0; c < state_size; ++c) v[p] -= gs[p * w + c] * far[c];
      }
#pragma GCC unroll 4
      for (int p = 0; p < edge_size; ++p) {
        // Two sums: the position before the edge is known earlier than the edge before.
        T share = g[p * w] * u[0];
#pragma GCC unroll 3
        for (int c = 1; c < 3; ++c) share += g[p * w + c] * u[c];
        T turn = g[p * w + edge_at] * u[edge_at];
#pragma GCC unroll 4
        for (int c = edge_at + 1; c < state_size; ++c) turn += g[p * w + c] * u[c];
        v[p] = (v[p] - share) - turn;
      }
      if (ring && i == 0)
        for (int p = 0; p < edge_size; ++p) far[edge_at + p] = v[p];
      const bool drops = nextHeld(i);
#pragma GCC unroll 3
      for (int a = 0; a < 3; ++a) {
        here[a] = u[a];
        u[a] = drops ? T(0.0) : u[a] + v[a];
      }
      here[3] = v[3];
#pragma GCC unroll 4
      for (int p = 0; p < edge_size; ++p) u[edge_at + p] = v[p];
    }
    if (bordered) return;
    for (int a = 0; a < 3; ++a) values[slot_size * last_ + a] = u[a];
    values[slot_size * last_ + 3] = T(0.0);
  }

private:
  static constexpr bool ring = border == Border::ring, bordered = border != Border::none;
  static constexpr int w = Record<T>::width;
  static constexpr std::size_t size = bordered ? Record<T>::bordered : Record<T>::plain;
  const int begin_, end_, first_, last_, border_end_;
  const std::vector<char> &held_;
  const T *const records_;

  const T *record(int i) const { return records_ + size * std::size_t(i - begin_); }
  bool nextHeld(int i) const { return held_[ring && i == last_ ? 0 : i + 1]; }
  /// In a ring the first edge is part of the border.
  bool reachesBorder(int i) const { return bordered && i >= border_end_; }
};

/// Values of the slots of a rod by itself, right-hand side to solution.
template <class T, bool ring>
[[gnu::flatten]] void substituteAll(const RodRange &rod, const std::vector<char> &held, const T *records,
                                    const T *first, T *values) {
  const Substitution<T, ring ? Border::ring : Border::none> substitution({0, rod.edges}, held, records, first);
  T u[state_size], far[state_size];
  substitution.toFirst(values, u, far);
  if (held[0])
    std::fill_n(u, 3, T(0.0));
  else
    solveSmall<3>(first, first + 3, u);
  std::fill_n(u + edge_at, edge_size, T(0.0));
  std::copy_n(u, 3, far);
  substitution.fromFirst(u, far, values);
}

} // namespace tendril
