#pragma once
/// Visits every field of a plain struct, also those that a test does not know of.
#include <cstddef>

namespace tendril::test {

struct Anything {
  template <class T> operator T() const;
};

/// Fields of an aggregate: of how many things it can be made.
template <class T, class... Made> constexpr std::size_t fieldCount() {
  if constexpr (requires { T{Made{}..., Anything{}}; })
    return fieldCount<T, Made..., Anything>();
  else
    return sizeof...(Made);
}

/// Calls visit(field) for each; further numbers of fields need further lines here.
template <class T, class Visit> void eachField(T &s, Visit visit) {
  constexpr std::size_t n = fieldCount<T>();
  auto all = [&](auto &...fields) { (visit(fields), ...); };
  static_assert(n == 5 || n == 6 || n == 7 || (n >= 11 && n <= 24), "add a line for this number of fields");
  if constexpr (n == 5) {
    auto &[a, b, c, d, e] = s;
    all(a, b, c, d, e);
  } else if constexpr (n == 6) {
    auto &[a, b, c, d, e, f] = s;
    all(a, b, c, d, e, f);
  } else if constexpr (n == 7) {
    auto &[a, b, c, d, e, f, g] = s;
    all(a, b, c, d, e, f, g);
  } else if constexpr (n == 11) {
    auto &[a, b, c, d, e, f, g, h, i, j, k] = s;
    all(a, b, c, d, e, f, g, h, i, j, k);
  } else if constexpr (n == 12) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l);
  } else if constexpr (n == 13) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m);
  } else if constexpr (n == 14) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o);
  } else if constexpr (n == 15) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p);
  } else if constexpr (n == 16) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q);
  } else if constexpr (n == 17) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r);
  } else if constexpr (n == 18) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t);
  } else if constexpr (n == 19) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u);
  } else if constexpr (n == 20) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v);
  } else if constexpr (n == 21) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w);
  } else if constexpr (n == 22) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w, x] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w, x);
  } else if constexpr (n == 23) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w, x, y] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w, x, y);
  } else if constexpr (n == 24) {
    auto &[a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w, x, y, z] = s;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, t, u, v, w, x, y, z);
  }
}

} // namespace tendril::test
