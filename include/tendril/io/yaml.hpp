#pragma once
/// \file yaml.hpp
/// Reading YAML with messages a user can act on: every error names file, line, what was found and what may stand there.

#include "tendril/model/scene.hpp"

#include <set>
#include <yaml-cpp/yaml.h>

namespace tendril {

/// One value of a YAML file.
class YamlValue {
public:
  YamlValue(const YAML::Node &node, std::string file, std::string name) : node_(node), file_(std::move(file)), name_(std::move(name)) {}

  [[noreturn]] void fail(const std::string &message) const;
  const std::string &name() const { return name_; }
  const std::string &file() const { return file_; }
  const YAML::Node &node() const { return node_; }
  bool isMap() const { return node_.IsMap(); }
  bool isScalar() const { return node_.IsScalar(); }

  double number() const;      ///< finite
  double positive() const;    ///< finite, > 0
  double notNegative() const; ///< finite, >= 0
  int integer(int least, int most = 10'000'000) const;
  bool boolean() const;
  std::string text() const;
  Vec3 vector() const; ///< three finite numbers
  std::vector<double> numbers(std::size_t count) const;
  std::string oneOf(const std::vector<std::string> &choices) const;
  std::vector<YamlValue> items() const; ///< of a list

private:
  YAML::Node node_;
  std::string file_, name_;
};

/// A YAML map. A key given twice is an error, and so are keys that were never asked for, found by finish().
class YamlMap {
public:
  explicit YamlMap(const YamlValue &value);
  bool has(const std::string &key);
  YamlValue at(const std::string &key); ///< required
  /// Allowed keys beyond those asked for are none: call when all has been read.
  void finish() const;
  const YamlValue &value() const { return value_; }

  double number(const std::string &key, double fallback) { return has(key) ? at(key).number() : fallback; }
  Vec3 vector(const std::string &key, const Vec3 &fallback) { return has(key) ? at(key).vector() : fallback; }

private:
  YamlValue value_;
  std::set<std::string> known_;
};

/// The candidate closest to a misspelt word, or an empty string when none is near.
std::string closest(const std::string &word, const std::vector<std::string> &candidates);

} // namespace tendril
