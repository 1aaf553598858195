#pragma once
/// \file exact_sum.hpp
/// Sums that do not depend on the order of what is added.

#include <cstdint>
#include <vector>

namespace tendril {

/// The exact sum of doubles, rounded once: a number of fixed point that is as long as the range of a double (a long
/// accumulator, Kulisch and Miranker 1986). Whatever is added in whatever order, on however many ranks, comes to the
/// same bits. One number alone is just kept. At most 2^30 are added.
class ExactSum {
public:
  void add(double x);
  /// Rounded to the nearest double; of numbers that are not finite, their sum.
  double value() const;
  /// The accumulator as whole numbers, `words` of them: those of two sums added one by one are those of their sum.
  static constexpr int words = 71;
  std::int64_t *data() {
    spread();
    return words_.data();
  }

private:
  double first_ = 0;
  bool any_ = false;
  std::vector<std::int64_t> words_; ///< empty as long as one number is all
  void spread();
  void accumulate(double x);
};

} // namespace tendril
