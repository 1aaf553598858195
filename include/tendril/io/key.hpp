#pragma once
/// \file key.hpp
/// A row of the table of keys.

#include <limits>
#include <string_view>

namespace tendril {

enum class KeyType {
  number,
  integer,
  flag, ///< true or false; an option alone is true
  word, ///< one of the choices
  text,
  file,
  vector,  ///< three numbers
  pair,    ///< two numbers, or one for both
  vectors, ///< a list of vectors
  inertia, ///< three numbers, or six of a symmetric matrix
  index,   ///< a whole number from 0, or `last`
  rod,     ///< a name, a number from 0, or `all`
  rows,    ///< rows of a table
  range,   ///< lower and upper bound
  profile, ///< rows of time and value
  list,    ///< of maps
  map,
  word_or_map
};

struct Bounds {
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
  bool above = false, below = false; ///< the bounds themselves are left out
};
inline constexpr Bounds anything{}, positive{0, anything.most, true}, not_negative{0}, from_one{1},
    fraction{0, 1, true, true};

struct Key {
  const char *path; ///< of a scene: `rods[].material.young`; of an option: `-dt`
  KeyType type;
  const char *unit;
  const char *fallback; ///< as one would write it; `required`; or in brackets what happens without the key
  const char *meaning;
  Bounds bounds{};
  const char *choices = ""; ///< a|b|c
  const char *example = ""; ///< a value
  const char *group = "";   ///< of an option
  const char *more = "";    ///< what -help leaves out and pages have

  constexpr bool isOption() const { return path[0] == '-'; }
  constexpr bool isRequired() const { return std::string_view(fallback) == "required"; }
  /// Whether `fallback` is a value.
  constexpr bool hasFallback() const { return !isRequired() && fallback[0] != '('; }
  constexpr std::string_view name() const {
    const std::string_view whole = path, end = whole.substr(isOption() ? 1 : whole.rfind('.') + 1);
    return end;
  }
  /// Path of the map that holds it, empty at the top.
  constexpr std::string_view parent() const {
    const std::size_t dot = std::string_view(path).rfind('.');
    return isOption() || dot == std::string_view::npos ? std::string_view() : std::string_view(path).substr(0, dot);
  }
};

} // namespace tendril
