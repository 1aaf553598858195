#pragma once
/// \file numbers_by_rod.hpp
/// What lists of a scene have of each rod.

#include <span>
#include <vector>

namespace tendril {

/// Numbers of what a list has of each rod, rising.
class NumbersByRod {
public:
  NumbersByRod() = default;
  template <class Items> NumbersByRod(const Items &items, std::size_t rods) {
    if (items.empty()) return;
    begin_.assign(rods + 1, 0);
    for (const auto &item : items) ++begin_[item.rod + 1];
    for (std::size_t r = 0; r < rods; ++r) begin_[r + 1] += begin_[r];
    numbers_.resize(items.size());
    std::vector<int> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t k = 0; k < items.size(); ++k) numbers_[next[items[k].rod]++] = int(k);
  }
  std::span<const int> of(int rod) const {
    if (numbers_.empty()) return {};
    return std::span(numbers_).subspan(begin_[rod], begin_[rod + 1] - begin_[rod]);
  }

private:
  std::vector<int> begin_, numbers_;
};

} // namespace tendril
