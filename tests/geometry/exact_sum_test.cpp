#include "tendril/geometry/exact_sum.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace tendril {
namespace {

double sumOf(const std::vector<double> &values) {
  ExactSum sum;
  for (const double v : values) sum.add(v);
  return sum.value();
}

TEST(ExactSum, OneNumberIsKept) {
  for (const double x : {0.0, -0.0, 1.5, -3e-310, 1e308, 5e-324}) EXPECT_EQ(sumOf({x}), x);
  EXPECT_EQ(ExactSum().value(), 0);
}

TEST(ExactSum, LosesNothingAndRoundsOnce) {
  EXPECT_EQ(sumOf({1e300, 1, -1e300}), 1);
  EXPECT_EQ(sumOf({1, 1e-300, -1}), 1e-300);
  EXPECT_EQ(sumOf({0.1, 0.2, 0.3, -0.6}), 0.1 + 0.2 + 0.3 - 0.6 > 0 ? 2.7755575615628914e-17 : 0); // of the doubles
  // Halfway between two doubles to the even one; a little beyond, up.
  const double ulp = std::numeric_limits<double>::epsilon();
  EXPECT_EQ(sumOf({1, ulp / 2, 0}), 1);
  EXPECT_EQ(sumOf({1, ulp / 2, 1e-200}), 1 + ulp);
  EXPECT_EQ(sumOf({-1, -ulp / 2, -1e-200}), -1 - ulp);
  EXPECT_EQ(sumOf({1e308, 1e308, -1e308}), 1e308); // beyond the range on the way
  EXPECT_EQ(sumOf({3e-320, -5e-320, 4e-320}), 2e-320);
  EXPECT_EQ(sumOf({1e-5, -1e-5, 0}), 0);
}

TEST(ExactSum, WhatIsNotFiniteStays) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(sumOf({1, inf}), inf);
  EXPECT_EQ(sumOf({1, -inf, 3}), -inf);
  EXPECT_TRUE(std::isnan(sumOf({inf, -inf})));
  EXPECT_TRUE(std::isnan(sumOf({1, std::nan(""), 2})));
}

/// Against long double, which has 11 bits more: the sum of 10 000 numbers of one size is good to 2^-50 of it there.
TEST(ExactSum, DoesNotDependOnOrderOrParts) {
  std::mt19937 rng(7);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (int k = 0; k < 10000; ++k) values.push_back(normal(rng) * std::pow(10.0, k % 7));
  const double sum = sumOf(values);
  long double near = 0;
  for (const double v : values) near += v;
  EXPECT_NEAR(sum, double(near), 1e-12 * std::abs(sum) + 1e-6);
  for (int shuffle = 0; shuffle < 3; ++shuffle) {
    std::shuffle(values.begin(), values.end(), rng);
    EXPECT_EQ(sumOf(values), sum);
    ExactSum parts[3];
    for (std::size_t k = 0; k < values.size(); ++k) parts[k * k % 3].add(values[k]);
    for (int p = 1; p < 3; ++p)
      for (int k = 0; k < ExactSum::words; ++k) parts[0].data()[k] += parts[p].data()[k];
    EXPECT_EQ(parts[0].value(), sum);
  }
}

} // namespace
} // namespace tendril
