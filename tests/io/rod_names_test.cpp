#include "tendril/io/rod_names.hpp"

#include <gtest/gtest.h>

namespace tendril::test {

TEST(RodNames, AreThoseOfRodsAndBlocksAndNumbers) {
  RodNames names;
  for (const char *name : {"hair.0#0", "hair.0#1", "hair.1#0", "rope", "a.b"}) names.add(name);
  using List = std::vector<int>;
  EXPECT_EQ(names.find("hair"), (List{0, 1, 2}));
  EXPECT_EQ(names.find("hair.0"), (List{0, 1}));
  EXPECT_EQ(names.find("hair.0#1"), (List{1}));
  EXPECT_EQ(names.find("rope"), (List{3}));
  EXPECT_EQ(names.find("4"), (List{4}));
  EXPECT_EQ(names.find("all"), (List{0, 1, 2, 3, 4}));
  for (const char *none : {"", "hai", "5", "04", "-1", "99999999999999999999", "hair.2", "#"})
    EXPECT_EQ(names.find(none), List{}) << none;
  EXPECT_TRUE(names.isTaken("hair"));
  EXPECT_FALSE(names.isTaken("4"));
}

} // namespace tendril::test
