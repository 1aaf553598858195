/// What may go to a terminal.
#include "tendril/io/text.hpp"

#include <gtest/gtest.h>

namespace tendril::test {
namespace {

TEST(Text, PrintableShowsControlCharactersAndBytesThatAreNoUtf8) {
  EXPECT_EQ(printable("r\u00f6d \u6746 \U0001F9F5\n\ttab"), "r\u00f6d \u6746 \U0001F9F5\n\ttab");
  EXPECT_EQ(printable(std::string("a\0b\x1b[2J\x7f\r", 9)), "a\\x00b\\x1B[2J\\x7F\\x0D");
  EXPECT_EQ(printable("\xE4 \xC3"), "\\xE4 \\xC3"); // Latin-1; the first half of a character
  EXPECT_EQ(printable("\xC2\x9B"), "\\xC2\\x9B");   // a control character of two bytes
  EXPECT_EQ(printable("a\u202Eb\u2066 \u2020"),
            "a\\xE2\\x80\\xAEb\\xE2\\x81\\xA6 \u2020"); // what turns the order of characters
  EXPECT_EQ(printable("\xC0\xAF\xED\xA0\x80"),
            "\\xC0\\xAF\\xED\\xA0\\x80"); // longer than need be; half of a pair of UTF-16
}

} // namespace
} // namespace tendril::test
