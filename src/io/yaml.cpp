#include "tendril/io/yaml.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <sstream>
#include <yaml-cpp/eventhandler.h>

namespace tendril {
namespace {

/// Reads a text ahead of yaml-cpp's nodes and ends it by an exception where they would take too much, or never end.
class Guard : public YAML::EventHandler {
public:
  void OnDocumentStart(const YAML::Mark &mark) override {
    if (mark.pos <= end_) throw YAML::ParserException(mark, "what stands here belongs to nothing");
    end_ = mark.pos;
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark &mark, YAML::anchor_t anchor) override { value(mark, anchor); }
  void OnScalar(const YAML::Mark &mark, const std::string &, YAML::anchor_t anchor, const std::string &) override {
    value(mark, anchor);
  }
  void OnAlias(const YAML::Mark &mark, YAML::anchor_t anchor) override {
    for (const Block &block : open_)
      if (block.anchor == anchor) throw YAML::ParserException(mark, "an alias of what it stands in");
    count(mark, sizes_[anchor]);
  }
  void OnSequenceStart(const YAML::Mark &mark, const std::string &, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    begin(mark, anchor);
  }
  void OnSequenceEnd() override { end(); }
  void OnMapStart(const YAML::Mark &mark, const std::string &, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    begin(mark, anchor);
  }
  void OnMapEnd() override { end(); }

private:
  struct Block {
    YAML::anchor_t anchor;
    double before; ///< values
  };
  std::vector<Block> open_;
  std::map<YAML::anchor_t, double> sizes_; ///< values of what an anchor stands for
  double values_ = 0;
  int end_ = -1; ///< place of the last event

  void count(const YAML::Mark &mark, double values) {
    constexpr double most = 5e6;
    values_ += values;
    end_ = std::max(end_, mark.pos);
    if (values_ > most)
      throw YAML::ParserException(mark, "more than 5 million values; write points into a polyline file");
  }
  void value(const YAML::Mark &mark, YAML::anchor_t anchor) {
    count(mark, 1);
    if (anchor != YAML::NullAnchor) sizes_[anchor] = 1;
  }
  void begin(const YAML::Mark &mark, YAML::anchor_t anchor) {
    constexpr std::size_t deepest = 32;
    if (open_.size() == deepest) throw YAML::ParserException(mark, "more than 32 maps and lists in each other");
    open_.push_back({anchor, values_});
    count(mark, 1);
  }
  void end() {
    if (open_.back().anchor != YAML::NullAnchor) sizes_[open_.back().anchor] = values_ - open_.back().before;
    open_.pop_back();
  }
};

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

std::vector<YAML::Node> loadYaml(const std::string &text, const std::string &file) {
  try {
    std::istringstream in(text);
    YAML::Parser parser(in);
    Guard guard;
    while (parser.HandleNextDocument(guard)) {}
    return YAML::LoadAll(text);
  } catch (const YAML::Exception &e) {
    throw SceneError(file + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
}

std::string YamlValue::place() const {
  const bool has_line = file_.rfind("option ", 0) != 0 && node_.IsDefined() && node_.Mark().line >= 0;
  return has_line ? file_ + ":" + std::to_string(node_.Mark().line + 1) : file_;
}

void YamlValue::fail(const std::string &message) const { throw SceneError(place() + ": " + message); }

double YamlValue::number() const {
  double value;
  if (!node_.IsScalar() || !YAML::convert<double>::decode(node_, value))
    fail("'" + name_ + "' must be a number, found " + describe(node_));
  if (const std::string wrong = unfitNumber(value); !wrong.empty())
    fail("'" + name_ + "' " + wrong + ", found " + describe(node_));
  return value;
}

int YamlValue::integer() const {
  double number; // not as an int, which would take a leading 0 for a sign of octal numbers
  if (!node_.IsScalar() || !YAML::convert<double>::decode(node_, number) || number != std::floor(number))
    fail("'" + name_ + "' must be a whole number, found " + describe(node_));
  if (!(std::abs(number) <= std::numeric_limits<int>::max()))
    fail("'" + name_ + "' is too large, found " + describe(node_));
  return int(number);
}

double YamlValue::number(const Key &key) const {
  const double value = number();
  if (const std::string wrong = outOfBounds(key, value); !wrong.empty())
    fail("'" + name_ + "' " + wrong + ", found " + describe(node_));
  return value;
}

int YamlValue::integer(const Key &key) const {
  const int value = integer();
  constexpr int most = 10'000'000; // of anything that is counted
  if (const std::string wrong = outOfBounds(key, value); !wrong.empty())
    fail("'" + name_ + "' " + wrong + ", found " + describe(node_));
  if (value > most)
    fail("'" + name_ + "' is too large: at most " + std::to_string(most) + ", found " + describe(node_));
  return value;
}

std::array<double, 2> YamlValue::pair(const Key &key) const {
  if (isScalar()) {
    const double both = number(key);
    return {both, both};
  }
  const std::vector<double> list = numbers(2);
  for (const double value : list)
    if (const std::string wrong = outOfBounds(key, value); !wrong.empty())
      fail("'" + name_ + "' " + wrong + ", found " + std::to_string(value));
  return {list[0], list[1]};
}

std::string YamlValue::word(const Key &key) const {
  const std::string value = text();
  const std::vector<std::string> choices = choicesOf(key);
  if (std::find(choices.begin(), choices.end(), value) != choices.end()) return value;
  const std::string near = closest(value, choices);
  fail("'" + name_ + "' must be one of " + join(choices) + "; found '" + value + "'" +
       (near.empty() ? "" : "; did you mean '" + near + "'?"));
}

bool YamlValue::boolean() const {
  bool value;
  if (!node_.IsScalar() || !YAML::convert<bool>::decode(node_, value))
    fail("'" + name_ + "' must be true or false, found " + describe(node_));
  return value;
}

std::string YamlValue::text() const {
  if (!node_.IsScalar()) fail("'" + name_ + "' must be a word, found " + describe(node_));
  return node_.Scalar();
}

std::vector<double> YamlValue::numbers(std::size_t count) const {
  if (!node_.IsSequence() || node_.size() != count)
    fail("'" + name_ + "' must be a list of " + std::to_string(count) + " numbers, found " + describe(node_));
  std::vector<double> values;
  for (const YAML::Node &n : node_) values.push_back(YamlValue(n, file_, name_).number());
  return values;
}

Vec3 YamlValue::vector() const {
  const std::vector<double> v = numbers(3);
  return {v[0], v[1], v[2]};
}

std::vector<YamlValue> YamlValue::items() const {
  if (!node_.IsSequence()) fail("'" + name_ + "' must be a list, found " + describe(node_));
  std::vector<YamlValue> list;
  for (std::size_t i = 0; i < node_.size(); ++i)
    list.emplace_back(node_[i], file_, name_ + "[" + std::to_string(i) + "]");
  return list;
}

YamlMap::YamlMap(const YamlValue &value) : value_(value) { refuseRepeated(); }

YamlMap::YamlMap(const YamlValue &value, KeyOf<KeyType::map, KeyType::list, KeyType::word_or_map> block)
    : value_(value), path_(std::string(block->path) + (block->type == KeyType::list ? "[]" : "")) {
  refuseRepeated();
}

void YamlMap::refuseRepeated() const {
  if (!value_.isMap())
    value_.fail("'" + value_.name() + "' must be a map of keys and values, found " + describe(value_.node()));
  std::map<std::string, int> line;
  for (const auto &entry : value_.node()) {
    const YamlValue key(entry.first, value_.file(), value_.name());
    if (!key.isScalar()) key.fail("a key in '" + value_.name() + "' must be a word, found " + describe(entry.first));
    const auto [first, fresh] = line.emplace(key.text(), entry.first.Mark().line + 1);
    if (!fresh)
      key.fail("the key '" + key.text() + "' stands here a second time (first in line " +
               std::to_string(first->second) + "); keep one of the two");
  }
}

/// The name of a key, which has to be one of this block.
std::string YamlMap::named(const Key &key) {
  if (key.parent() != path_) throw std::logic_error("the key " + std::string(key.path) + " is not one of " + path_);
  return *asked_.emplace(key.name()).first;
}

bool YamlMap::has(const Key &key) { return value_.node()[named(key)].IsDefined(); }

YamlValue YamlMap::at(const Key &key) {
  const std::string name = named(key);
  if (has(key)) return {value_.node()[name], value_.file(), name};
  if (key.hasFallback()) return {YAML::Load(key.fallback), value_.file(), name};
  std::vector<std::string> others;
  for (const auto &entry : value_.node())
    if (!asked_.count(entry.first.Scalar())) others.push_back(entry.first.Scalar());
  const std::string near = closest(name, others);
  const std::string choices = join(choicesOf(key)),
                    what = key.type == KeyType::word_or_map ? "a map, or " + choices : choices;
  value_.fail("'" + value_.name() + "' needs the key '" + name + "'" + (what.empty() ? "" : " (" + what + ")") +
              (near.empty() ? "" : ", found '" + near + "'"));
}

void YamlMap::finish() const {
  refuseUnknown();
  for (const auto &entry : value_.node())
    if (const std::string name = entry.first.Scalar(); !asked_.count(name))
      YamlValue(entry.first, value_.file(), name)
          .fail("the key '" + name + "' has no meaning in this '" + value_.name() + "'; take it away");
}

void YamlMap::refuseUnknown() const {
  std::vector<std::string> allowed;
  for (const Key &key : keys)
    if (!key.isOption() && key.parent() == path_) allowed.emplace_back(key.name());
  for (const auto &entry : value_.node()) {
    const std::string name = entry.first.Scalar();
    if (std::find(allowed.begin(), allowed.end(), name) != allowed.end()) continue;
    const YamlValue key(entry.first, value_.file(), name);
    const std::string near = closest(name, allowed);
    key.fail("unknown key '" + name + "' in '" + value_.name() + "'" +
             (near.empty() ? "" : "; did you mean '" + near + "'?") + " Allowed: " + join(allowed));
  }
}

std::string unfitNumber(double value) {
  if (!std::isfinite(value)) return "must be finite";
  const double size = std::abs(value);
  return size == 0 || (size >= 1e-100 && size <= 1e100) ? "" : "must be 0 or of a size between 1e-100 and 1e100";
}

std::string outOfBounds(const Key &key, double value) {
  auto text = [](double bound) {
    std::ostringstream s;
    s << bound;
    return s.str();
  };
  const Bounds &b = key.bounds;
  const bool fits = (b.above ? value > b.least : value >= b.least) && (b.below ? value < b.most : value <= b.most);
  if (fits) return {};
  if (std::isfinite(b.least) && std::isfinite(b.most))
    return std::string("must lie in ") + (b.above ? "(" : "[") + text(b.least) + ", " + text(b.most) +
           (b.below ? ")" : "]");
  if (std::isfinite(b.most)) return (b.below ? "must be below " : "must be at most ") + text(b.most);
  if (b.least == 0) return b.above ? "must be greater than zero" : "must not be negative";
  return (b.above ? "must be greater than " : "must be at least ") + text(b.least);
}

std::vector<std::string> choicesOf(const Key &key) {
  std::vector<std::string> choices;
  std::istringstream in(key.choices);
  for (std::string word; std::getline(in, word, '|');) choices.push_back(word);
  return choices;
}

} // namespace tendril
