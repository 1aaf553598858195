#include "tendril/io/yaml.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <sstream>

namespace tendril {
namespace {

std::string describe(const YAML::Node &node) {
  if (node.IsNull()) return "nothing";
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  return "'" + node.Scalar().substr(0, 60) + "'";
}

std::string join(const std::vector<std::string> &words) {
  std::string s;
  for (const std::string &w : words) s += (s.empty() ? "" : ", ") + w;
  return s;
}

std::size_t editDistance(const std::string &a, const std::string &b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
      diagonal = above;
    }
  }
  return row.back();
}

} // namespace

std::string closest(const std::string &word, const std::vector<std::string> &candidates) {
  std::string best;
  std::size_t least = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string &c : candidates)
    if (const std::size_t d = editDistance(word, c); d < least) {
      least = d;
      best = c;
    }
  return best;
}

void YamlValue::fail(const std::string &message) const {
  std::ostringstream s;
  s << file_;
  if (file_.rfind("option ", 0) != 0 && node_.IsDefined() && node_.Mark().line >= 0) s << ":" << node_.Mark().line + 1;
  throw SceneError(s.str() + ": " + message);
}

double YamlValue::number() const {
  double value;
  if (!node_.IsScalar() || !YAML::convert<double>::decode(node_, value)) fail("'" + name_ + "' must be a number, found " + describe(node_));
  if (!std::isfinite(value)) fail("'" + name_ + "' must be finite, found " + describe(node_));
  return value;
}

double YamlValue::positive() const {
  const double value = number();
  if (value <= 0) fail("'" + name_ + "' must be greater than zero, found " + describe(node_));
  return value;
}

double YamlValue::notNegative() const {
  const double value = number();
  if (value < 0) fail("'" + name_ + "' must not be negative, found " + describe(node_));
  return value;
}

int YamlValue::integer(int least, int most) const {
  int value;
  if (!node_.IsScalar() || !YAML::convert<int>::decode(node_, value)) fail("'" + name_ + "' must be a whole number, found " + describe(node_));
  if (value < least || value > most)
    fail("'" + name_ + "' must be at least " + std::to_string(least) + " and at most " + std::to_string(most) + ", found " + describe(node_));
  return value;
}

bool YamlValue::boolean() const {
  bool value;
  if (!node_.IsScalar() || !YAML::convert<bool>::decode(node_, value)) fail("'" + name_ + "' must be true or false, found " + describe(node_));
  return value;
}

std::string YamlValue::text() const {
  if (!node_.IsScalar()) fail("'" + name_ + "' must be a word, found " + describe(node_));
  return node_.Scalar();
}

std::vector<double> YamlValue::numbers(std::size_t count) const {
  if (!node_.IsSequence() || node_.size() != count) fail("'" + name_ + "' must be a list of " + std::to_string(count) + " numbers, found " + describe(node_));
  std::vector<double> values;
  for (const YAML::Node &n : node_) values.push_back(YamlValue(n, file_, name_).number());
  return values;
}

Vec3 YamlValue::vector() const {
  const std::vector<double> v = numbers(3);
  return {v[0], v[1], v[2]};
}

std::string YamlValue::oneOf(const std::vector<std::string> &choices) const {
  const std::string value = text();
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) fail("'" + name_ + "' must be one of " + join(choices) + "; found '" + value + "'");
  return value;
}

std::vector<YamlValue> YamlValue::items() const {
  if (!node_.IsSequence()) fail("'" + name_ + "' must be a list, found " + describe(node_));
  std::vector<YamlValue> list;
  for (std::size_t i = 0; i < node_.size(); ++i) list.emplace_back(node_[i], file_, name_ + "[" + std::to_string(i) + "]");
  return list;
}

YamlMap::YamlMap(const YamlValue &value) : value_(value) {
  if (!value.isMap()) value.fail("'" + value.name() + "' must be a map of keys and values, found " + describe(value.node()));
  std::map<std::string, int> line;
  for (const auto &entry : value.node()) {
    const YamlValue key(entry.first, value.file(), value.name());
    if (!key.isScalar()) key.fail("a key in '" + value.name() + "' must be a word, found " + describe(entry.first));
    const auto [first, fresh] = line.emplace(key.text(), entry.first.Mark().line + 1);
    if (!fresh) key.fail("the key '" + key.text() + "' stands here a second time (first in line " + std::to_string(first->second) + "); keep one of the two");
  }
}

bool YamlMap::has(const std::string &key) {
  known_.insert(key);
  return value_.node()[key].IsDefined();
}

YamlValue YamlMap::at(const std::string &key) {
  if (!has(key)) {
    std::vector<std::string> others;
    for (const auto &entry : value_.node())
      if (!known_.count(entry.first.Scalar())) others.push_back(entry.first.Scalar());
    const std::string near = closest(key, others);
    value_.fail("'" + value_.name() + "' needs the key '" + key + "'" + (near.empty() ? "" : ", found '" + near + "'"));
  }
  return {value_.node()[key], value_.file(), key};
}

void YamlMap::finish() const {
  for (const auto &entry : value_.node()) {
    const std::string key = entry.first.Scalar();
    if (known_.count(key)) continue;
    const std::vector<std::string> allowed(known_.begin(), known_.end());
    const std::string near = closest(key, allowed);
    YamlValue(entry.first, value_.file(), key)
        .fail("unknown key '" + key + "' in '" + value_.name() + "'" + (near.empty() ? "" : "; did you mean '" + near + "'?") + " Allowed: " + join(allowed));
  }
}

} // namespace tendril
