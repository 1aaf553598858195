#pragma once
/// \file substitution.hpp
/// Solutions with the factors of `banded` (elimination.hpp).

#include "tendril/solver/pivots.hpp"

#include <algorithm>

namespace tendril {

/// Values of the slots of a rod, right-hand side to solution, by the records of its factor.
template <class T, bool ring>
[[gnu::flatten]] void substituteAll(const RodRange &rod, const std::vector<char> &held, const T *records,
                                    const T *first, T *values) {
  constexpr int w = Record<T>::width;
  constexpr std::size_t size = ring ? Record<T>::bordered : Record<T>::plain;
  const int last = rod.vertices - 1, border_end = ring ? std::max(1, int(firstLane(first[border_begin]))) : 0;
  auto nextHeld = [&](int i) { return held[ring && i == last ? 0 : i + 1]; };
  T q[state_size], border[state_size];
  std::fill_n(q, state_size, T(0.0));
  std::fill_n(border, state_size, T(0.0));
  if (!ring)
    for (int a = 0; a < 3; ++a) q[a] = values[slot_size * last + a];
  for (int i = rod.edges - 1; i >= 0; --i) {
    const T *g = records + size * i;
    T *here = values + slot_size * i;
    T r[edge_size];
    const bool drops = nextHeld(i) || (ring && i == last);
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a) {
      if (drops) q[a] = T(0.0);
      if (ring && i == 0) {
        r[a] = (q[edge_at + a] + q[a]) + border[edge_at + a];
        q[a] += border[a];
      } else
        r[a] = q[edge_at + a] + q[a];
    }
    r[3] = q[edge_at + 3] + here[3];
    if (ring && i == 0) r[3] += border[edge_at + 3];
    T next[state_size];
#pragma GCC unroll 7
    for (int c = 0; c < state_size; ++c) {
      T share = g[c] * r[0];
#pragma GCC unroll 4
      for (int p = 1; p < edge_size; ++p) share += g[p * w + c] * r[p];
      next[c] = (c < 3 ? q[c] + here[c] : T(0.0)) - share;
      if (ring && i >= border_end) {
        const T *gs = g + Record<T>::plain;
        T far = gs[c] * r[0];
        for (int p = 1; p < edge_size; ++p) far += gs[p * w + c] * r[p];
        border[c] -= far;
      }
    }
#pragma GCC unroll 4
    for (int p = 0; p < edge_size; ++p) here[p] = r[p];
#pragma GCC unroll 7
    for (int c = 0; c < state_size; ++c) q[c] = next[c];
  }
  T u[state_size];
  std::fill_n(u, state_size, T(0.0));
  if (!held[0]) {
    std::copy_n(q, 3, u);
    solveSmall<3>(first, first + 3, u);
  }
  std::copy_n(u, 3, border);
  for (int i = 0; i < rod.edges; ++i) {
    const T *g = records + size * i;
    T *here = values + slot_size * i;
    T v[edge_size];
    std::copy_n(here, edge_size, v);
    solveSmall<edge_size>(g + Record<T>::lower, g + Record<T>::pivots, v);
    if (ring && i >= border_end) {
      const T *gs = g + Record<T>::plain;
      for (int p = 0; p < edge_size; ++p)
        for (int c = 0; c < state_size; ++c) v[p] -= gs[p * w + c] * border[c];
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
      for (int p = 0; p < edge_size; ++p) border[edge_at + p] = v[p];
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
  if (ring) return;
  for (int a = 0; a < 3; ++a) values[slot_size * last + a] = u[a];
  values[slot_size * last + 3] = T(0.0);
}

} // namespace tendril
