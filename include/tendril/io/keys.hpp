#pragma once
/// \file keys.hpp
/// The table of all keys of a scene and all options of the program. Readers take types, bounds, choices and fallbacks
/// from it, and what is not in it cannot be read: a path that is missing, or of another type, does not compile. -help,
/// -schema and -keys print it; scripts/docs makes pages of it.

#include "tendril/io/body_keys.hpp"
#include "tendril/io/option_keys.hpp"
#include "tendril/io/scene_keys.hpp"
#include "tendril/io/tendon_keys.hpp"

#include <array>
#include <string>

namespace tendril {

/// Keys of scenes, then options.
inline constexpr auto keys = [] {
  std::array<Key, std::size(scene_keys) + std::size(body_keys) + std::size(tendon_keys) + std::size(option_keys)> all{};
  std::size_t row = 0;
  for (const Key &key : scene_keys) all[row++] = key;
  for (const Key &key : body_keys) all[row++] = key;
  for (const Key &key : tendon_keys) all[row++] = key;
  for (const Key &key : option_keys) all[row++] = key;
  return all;
}();

/// Row of a key in the table, or the number of its rows.
constexpr std::size_t rowOf(std::string_view path) {
  std::size_t row = 0;
  while (row < std::size(keys) && keys[row].path != path) ++row;
  return row;
}

constexpr const Key *findKey(std::string_view path) {
  const std::size_t row = rowOf(path);
  return row < std::size(keys) ? &keys[row] : nullptr;
}

/// A key of the table that one reads as one of some types.
template <KeyType... types> class KeyOf {
public:
  consteval KeyOf(const char *path) : row_(rowOf(path)) {
    if (row_ == std::size(keys)) throw "this key is not in the table of keys.hpp";
    if (sizeof...(types) > 0 && !((keys[row_].type == types) || ...))
      throw "this key has another type in the table of keys.hpp";
  }
  const Key &operator*() const { return keys[row_]; }
  const Key *operator->() const { return &keys[row_]; }

private:
  std::size_t row_;
};
using AnyKey = KeyOf<>;

/// What -help prints: the options in groups.
std::string helpText();
/// The table as JSON, for scripts/docs.
std::string keysAsJson();
/// The scene language as a JSON Schema, draft 7.
std::string schemaAsJson();

} // namespace tendril
