/// The table of keys against what the program has.
#include "tendril/io/keys.hpp"

#include "tendril/dynamics/integrator.hpp"
#include "tendril/io/yaml.hpp"

#include <gtest/gtest.h>

#include <set>

namespace tendril::test {
namespace {

TEST(Keys, AreThereOnce) {
  std::set<std::string> paths;
  for (const Key &key : keys) EXPECT_TRUE(paths.insert(key.path).second) << key.path;
}

TEST(Keys, HaveTheirBlockAndFallbacksWithinTheirBounds) {
  for (const Key &key : keys) {
    std::string block(key.parent());
    if (block.ends_with("[]")) block.resize(block.size() - 2);
    if (!block.empty()) EXPECT_NE(findKey(block), nullptr) << key.path;
    if (key.type == KeyType::word && key.hasFallback()) {
      const std::vector<std::string> choices = choicesOf(key);
      EXPECT_NE(std::find(choices.begin(), choices.end(), key.fallback), choices.end()) << key.path;
    }
    if ((key.type == KeyType::number || key.type == KeyType::integer) && key.hasFallback())
      EXPECT_EQ(outOfBounds(key, std::stod(key.fallback)), "") << key.path;
    if ((key.type == KeyType::number || key.type == KeyType::integer) && *key.example)
      EXPECT_EQ(outOfBounds(key, std::stod(key.example)), "") << key.path;
  }
}

TEST(Keys, NameEveryIntegrator) {
  const std::vector<std::string> choices = choicesOf(*AnyKey("-integrator"));
  EXPECT_EQ(std::set<std::string>(choices.begin(), choices.end()), [] {
    const auto names = integratorNames();
    return std::set<std::string>(names.begin(), names.end());
  }());
}

} // namespace
} // namespace tendril::test
