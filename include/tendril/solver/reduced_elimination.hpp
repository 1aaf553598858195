#pragma once
/// \file reduced_elimination.hpp
/// The kernel of `banded` for open rods with fewer unknowns (RodModel): as elimination.hpp and substitution.hpp, over
/// as many coordinates of edges and positions as there are, and without twists.

#include "tendril/solver/pivots.hpp"

#include <utility>

namespace tendril {

/// Of a planar rod in the plane normal to the coordinate `flat`, else -1; whether neighbouring edges have entries with
/// each other. What is kept of an edge is as in Record: G = A^-1 B row by row, L and inverse pivots of A; of the first
/// vertex L and inverse pivots.
template <bool bends_, int flat = -1> struct ReducedShape {
  static constexpr int size = flat < 0 ? 3 : 2; ///< coordinates of a vertex
  static constexpr bool bends = bends_;
  static constexpr int state = bends ? 2 * size : size; ///< position of a vertex, and the edge before it
  static constexpr bool known = state <= 4;             ///< see each
  static constexpr int triangle = size * (size - 1) / 2;
  static constexpr int lower = size * state, pivots = lower + triangle, record = pivots + size;
  /// Those of the matrix that count.
  static constexpr int coordinate(int k) { return flat >= 0 && k >= flat ? k + 1 : k; }
};

/// visit(k) for k from 0 to end - 1; where `known` each k is known when this is compiled, so that small matrices stay
/// in registers; else in loops, which pay for larger ones.
template <int end, bool known, class Visit> [[gnu::always_inline]] inline void each(const Visit &visit) {
  if constexpr (known) [&]<int... k>(std::integer_sequence<int, k...>) __attribute__((always_inline)) {
      (visit(std::integral_constant<int, k>()), ...);
    }
  (std::make_integer_sequence<int, end>());
  else
#pragma GCC unroll 3
      for (int k = 0; k < end; ++k) visit(k);
}

/// LDL^T of one rod, or of a pack of rods of one shape, from the last edge to the first. `Read` as of Elimination.
/// \param first receives L and inverse pivots of the first vertex \param records ... those of the edges
template <class Shape, class T, class Read>
[[gnu::flatten]] void eliminateReduced(int edges, const std::vector<char> &held, const Read &read, T *first, T *records,
                                       T &negative, T &zero) {
  using std::abs;
  constexpr int n = Shape::size, m = Shape::state;
  // Planes of entries: known when this is compiled.
  auto own = [](int r, int c) {
    return EdgeBlocks::own(Shape::coordinate(std::min(r, c)), Shape::coordinate(std::max(r, c)));
  };
  auto across = [](int r, int c) { return EdgeBlocks::across(Shape::coordinate(r), Shape::coordinate(c)); };
  auto vertex = [](int r, int c) { return EdgeBlocks::vertex(Shape::coordinate(r), Shape::coordinate(c)); }; // r <= c
  // What the rod beyond a vertex stores: by its position, by that and the edge before, and by that edge.
  T p[n][n] = {}, q[n][n] = {}, e[n][n] = {}; // of p and e the upper triangles
  auto addVertex = [&](int i) {
    each<n, Shape::known>([&](auto r) {
      each<n, Shape::known>([&](auto c) {
        if (c >= r) p[r][c] += read(vertex(r, c), i);
      });
    });
  };
  negative = zero = T(0.0);
  if (!held[edges]) addVertex(edges);
  for (int i = edges - 1; i >= 0; --i) {
    T *const out = records + std::size_t(Shape::record) * i;
    if (held[i + 1]) { // e = -x
      for (int r = 0; r < n; ++r)
        for (int c = r; c < n; ++c) p[r][c] = e[r][c] + read(own(r, c), i);
      for (int r = 0; r < n && Shape::bends; ++r)
        for (int c = 0; c < n; ++c) {
          q[r][c] = i > 0 ? -read(across(c, r), i) : T(0.0);
          e[r][c] = T(0.0);
        }
      std::fill_n(out, Shape::record, T(0.0));
      for (int r = 0; r < n; ++r) out[r * m + r] = T(1.0);
      addVertex(i);
      continue;
    }
    T a[n][n], b[n][m], g[n][m], scale[n], l[Shape::triangle], d[n];
    each<n, Shape::known>([&](auto r) {
      each<n, Shape::known>([&](auto c) {
        if (c < r) return;
        T beyond = p[r][c];
        if constexpr (Shape::bends) beyond += (q[r][c] + q[c][r]) + e[r][c];
        const T here = read(own(r, c), i);
        a[r][c] = beyond + here;
        if (r == c) scale[r] = abs(beyond) + abs(here);
      });
      each<n, Shape::known>([&](auto c) {
        b[r][c] = p[std::min<int>(r, c)][std::max<int>(r, c)];
        if constexpr (Shape::bends) {
          b[r][c] += q[c][r];
          b[r][n + c] = i > 0 ? read(across(c, r), i) : T(0.0);
        }
      });
    });
    factorSmall<n>(a, scale, l, d, negative, zero);
    // Rows of L^-1 B, what by them is left for the vertex before, and G.
    each<n, Shape::known>([&](auto r) {
      each<n, Shape::known>([&](auto s) {
        if (s < r) each<m, Shape::known>([&](auto c) { b[r][c] -= l[below(r, s)] * b[s][c]; });
      });
    });
    each<n, Shape::known>([&](auto r) { each<m, Shape::known>([&](auto c) { g[r][c] = b[r][c] * d[r]; }); });
    each<n, Shape::known>([&](auto r) {
      each<n, Shape::known>([&](auto c) {
        if (c >= r) each<n, Shape::known>([&](auto k) { p[r][c] -= b[k][r] * g[k][c]; });
        if constexpr (Shape::bends) {
          T across_both(0.0), of_edge(0.0);
          each<n, Shape::known>([&](auto k) {
            across_both -= b[k][r] * g[k][n + c];
            if (c >= r) of_edge -= b[k][n + r] * g[k][n + c];
          });
          q[r][c] = across_both;
          e[r][c] = of_edge;
        }
      });
    });
    addVertex(i);
    each<n, Shape::known>([&](auto up) {
      const int r = n - 1 - up;
      each<n, Shape::known>([&](auto s) {
        if (s > r) each<m, Shape::known>([&](auto c) { g[r][c] -= l[below(s, r)] * g[s][c]; });
      });
      each<m, Shape::known>([&](auto c) { out[r * m + c] = g[r][c]; });
    });
    each<Shape::triangle, Shape::known>([&](auto k) { out[Shape::lower + k] = l[k]; });
    each<n, Shape::known>([&](auto k) { out[Shape::pivots + k] = d[k]; });
  }
  std::fill_n(first, Shape::triangle + n, T(0.0));
  if (held[0]) return;
  T scale[n];
  for (int r = 0; r < n; ++r) scale[r] = abs(p[r][r]);
  factorSmall<n>(p, scale, first, first + Shape::triangle, negative, zero);
}

/// Of the right-hand side in `values`, slot_size numbers a slot of the rod with its coordinates first, makes the
/// solution.
template <class Shape, class T>
[[gnu::flatten]] void substituteReduced(int edges, const std::vector<char> &held, const T *first, const T *records,
                                        T *values) {
  constexpr int n = Shape::size, m = Shape::state;
  T x[n], e[n] = {}; // right-hand sides of a vertex and of the edge before it; then their solutions
  for (int r = 0; r < n; ++r) x[r] = values[std::size_t(slot_size) * edges + r];
  for (int i = edges - 1; i >= 0; --i) {
    const T *g = records + std::size_t(Shape::record) * i;
    T *here = values + std::size_t(slot_size) * i;
    const bool drops = held[i + 1];
    T b[n];
    each<n, Shape::known>([&](auto r) {
      if (drops) x[r] = T(0.0);
      b[r] = x[r] + e[r];
      x[r] += here[r];
      here[r] = b[r];
    });
    each<n, Shape::known>([&](auto c) {
      T at_vertex = g[c] * b[0], at_edge(0.0);
      each<n, Shape::known>([&](auto r) {
        if (r > 0) at_vertex += g[r * m + c] * b[r];
      });
      if constexpr (Shape::bends) each<n, Shape::known>([&](auto r) { at_edge += g[r * m + n + c] * b[r]; });
      x[c] -= at_vertex;
      e[c] = -at_edge;
    });
  }
  if (held[0])
    std::fill_n(x, n, T(0.0));
  else
    solveSmall<n>(first, first + Shape::triangle, x);
  std::fill_n(e, n, T(0.0));
  for (int i = 0; i < edges; ++i) {
    const T *g = records + std::size_t(Shape::record) * i;
    T *here = values + std::size_t(slot_size) * i;
    const bool drops = held[i + 1];
    T v[n];
    each<n, Shape::known>([&](auto r) { v[r] = here[r]; });
    solveSmall<n>(g + Shape::lower, g + Shape::pivots, v);
    each<n, Shape::known>([&](auto r) {
      each<n, Shape::known>([&](auto c) {
        v[r] -= g[r * m + c] * x[c];
        if constexpr (Shape::bends) v[r] -= g[r * m + n + c] * e[c];
      });
    });
    each<n, Shape::known>([&](auto r) {
      here[r] = x[r];
      x[r] = drops ? T(0.0) : x[r] + v[r];
      e[r] = v[r];
    });
  }
  for (int r = 0; r < n; ++r) values[std::size_t(slot_size) * edges + r] = x[r];
}

/// What the kernel for all unknowns finds in place of those that a rod has not: a diagonal of one.
class Missing {
public:
  explicit Missing(const RodRange &rod) : flat_(rod.flat) {
    for (int r = 0; r < edge_size; ++r)
      for (int c = 0; c < edge_size && flat_ >= 0; ++c) {
        const bool here = r == flat_ || c == flat_, one = r == c;
        if (!here) continue;
        if (r <= c) put(EdgeBlocks::own(r, c), one);
        put(EdgeBlocks::across(r, c), false);
        if (r <= c && c < 3) put(EdgeBlocks::vertex(r, c), one);
      }
  }
  bool any() const { return flat_ >= 0; }
  bool has(int plane) const { return value_[std::size_t(plane)] >= 0; }
  double operator[](int plane) const { return value_[std::size_t(plane)]; }

private:
  int flat_;
  std::array<signed char, joined_entries> value_ = [] {
    std::array<signed char, joined_entries> none{};
    none.fill(-1);
    return none;
  }();
  void put(int plane, bool one) { value_[std::size_t(plane)] = one; }
};

} // namespace tendril
