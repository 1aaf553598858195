#include "tendril/geometry/exact_sum.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <limits>

namespace tendril {
namespace {

/// Digits of 32 bits in words of 64, the first of 2^-1074; two more for carries. Behind them counts of infinities, of
/// negative ones, and of what is not a number.
constexpr int digits = 68, plus_infinity = digits, minus_infinity = digits + 1, undefined = digits + 2, lowest = -1074;
constexpr std::int64_t mask = 0xffffffff;

} // namespace

void ExactSum::add(double x) {
  if (any_ || !words_.empty()) {
    spread();
    accumulate(x);
  } else
    first_ = x;
  any_ = true;
}

void ExactSum::spread() {
  if (!words_.empty()) return;
  words_.assign(words, 0);
  if (any_) accumulate(first_);
}

void ExactSum::accumulate(double x) {
  if (!std::isfinite(x)) {
    ++words_[std::isnan(x) ? undefined : x > 0 ? plus_infinity : minus_infinity];
    return;
  }
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const int exponent = int(bits >> 52 & 0x7ff);
  const std::uint64_t fraction = bits & ((std::uint64_t(1) << 52) - 1),
                      mantissa = exponent > 0 ? fraction | std::uint64_t(1) << 52 : fraction;
  const int place = exponent > 0 ? exponent - 1 : 0; // of the last bit, from `lowest`
  const unsigned __int128 shifted = (unsigned __int128)mantissa << (place % 32);
  const std::int64_t sign = x < 0 ? -1 : 1;
  for (int k = 0; k < 3; ++k) words_[place / 32 + k] += sign * std::int64_t(std::uint64_t(shifted >> 32 * k) & mask);
}

double ExactSum::value() const {
  if (words_.empty()) return first_;
  if (words_[undefined] > 0 || (words_[plus_infinity] > 0 && words_[minus_infinity] > 0))
    return std::numeric_limits<double>::quiet_NaN();
  if (words_[plus_infinity] > 0) return std::numeric_limits<double>::infinity();
  if (words_[minus_infinity] > 0) return -std::numeric_limits<double>::infinity();
  std::array<std::int64_t, digits> d;
  auto carry = [&](std::int64_t sign) { // the sign of what is above all digits
    std::int64_t over = 0;
    for (int k = 0; k < digits; ++k) {
      over += sign * words_[k];
      d[k] = over & mask;
      over >>= 32;
    }
    return over;
  };
  const double sign = carry(1) < 0 ? -1 : 1;
  if (sign < 0) carry(-1);
  int top = digits - 1;
  while (top > 0 && d[top] == 0) --top;
  // More than 64 bits, the last of which tells whether there are any below: so rounding to nearest is right.
  unsigned __int128 leading = 0;
  for (int k = top; k > top - 3; --k) leading = leading << 32 | (k >= 0 ? (unsigned __int128)d[k] : 0);
  for (int k = top - 3; k >= 0; --k)
    if (d[k] != 0) leading |= 1;
  return sign * std::ldexp(double(leading), lowest + 32 * (top - 2));
}

} // namespace tendril
