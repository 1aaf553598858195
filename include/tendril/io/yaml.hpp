#pragma once
/// \file yaml.hpp
/// Reading YAML with messages a user can act on: every error names file, line, what was found and what may stand there.

#include "tendril/io/keys.hpp"
#include "tendril/model/scene.hpp"

#include <set>
#include <yaml-cpp/yaml.h>

namespace tendril {

/// The documents of a YAML text. Refused are more than a few million values (those of aliases counted where they
/// stand), maps and lists in more than 32 others, and what no document can begin with, at which yaml-cpp would stay for
/// ever. \throws SceneError with the line
std::vector<YAML::Node> loadYaml(const std::string &text, const std::string &file);

/// One value of a YAML file.
class YamlValue {
public:
  YamlValue(const YAML::Node &node, std::string file, std::string name)
      : node_(node), file_(std::move(file)), name_(std::move(name)) {}

  /// File and line, or the option.
  std::string place() const;
  [[noreturn]] void fail(const std::string &message) const;
  const std::string &name() const { return name_; }
  const std::string &file() const { return file_; }
  const YAML::Node &node() const { return node_; }
  bool isMap() const { return node_.IsMap(); }
  bool isScalar() const { return node_.IsScalar(); }

  double number() const; ///< finite
  int integer() const;
  bool boolean() const;
  std::string text() const;
  Vec3 vector() const; ///< three finite numbers
  std::vector<double> numbers(std::size_t count) const;
  std::vector<YamlValue> items() const; ///< of a list

  // By a row of the table of keys: within its bounds, one of its choices.
  double number(const Key &key) const;
  int integer(const Key &key) const;
  std::string word(const Key &key) const;
  std::array<double, 2> pair(const Key &key) const; ///< one number is both

private:
  YAML::Node node_;
  std::string file_, name_;
};

/// A YAML map, read by the table of keys: types, bounds, choices and fallbacks are those of the table, and every
/// message names the line. A key given twice is an error, and so are keys that are not in the table or were never asked
/// for, found by finish().
class YamlMap {
public:
  /// The whole file.
  explicit YamlMap(const YamlValue &value);
  /// A block of the file, or one entry of a list of blocks.
  YamlMap(const YamlValue &value, KeyOf<KeyType::map, KeyType::list, KeyType::word_or_map> block);

  bool has(AnyKey key) { return has(*key); }
  YamlValue at(AnyKey key) { return at(*key); } ///< as it is written, or the fallback; without one the key is required
  double number(KeyOf<KeyType::number> key) { return at(*key).number(*key); }
  int integer(KeyOf<KeyType::integer> key) { return at(*key).integer(*key); }
  bool flag(KeyOf<KeyType::flag> key) { return at(*key).boolean(); }
  std::string word(KeyOf<KeyType::word, KeyType::word_or_map> key) { return at(*key).word(*key); }
  Vec3 vector(KeyOf<KeyType::vector> key) { return at(*key).vector(); }
  std::array<double, 2> pair(KeyOf<KeyType::pair> key) { return at(*key).pair(*key); }
  /// Call when all has been read.
  void finish() const;
  /// A key that is not in the table, before anything that is missing for it is told.
  void refuseUnknown() const;
  const YamlValue &value() const { return value_; }

  bool has(const Key &key);
  YamlValue at(const Key &key);

private:
  YamlValue value_;
  std::string path_; ///< of the keys in it
  std::set<std::string> asked_;

  void refuseRepeated() const;
  std::string named(const Key &key);
};

/// Why a number cannot be computed with, as "must be finite": squares and products of numbers have to stay numbers.
std::string unfitNumber(double value);
/// What is wrong with a number by the bounds of its key, or an empty string.
std::string outOfBounds(const Key &key, double value);

/// The choices of a key.
std::vector<std::string> choicesOf(const Key &key);

/// The candidate closest to a misspelt word, or an empty string when none is near.
std::string closest(const std::string &word, const std::vector<std::string> &candidates);

} // namespace tendril
