#pragma once
/// \file digest.hpp
/// A checksum of 64 bits.

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>

namespace tendril {

/// Every step is a one-to-one map of the sum, so that no single change of what is added leaves it as it was (after
/// FNV-1a by words).
class Digest {
public:
  void add(const void *data, std::size_t bytes) {
    const char *p = static_cast<const char *>(data);
    for (std::size_t i = 0; i < bytes; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, p + i, std::min<std::size_t>(8, bytes - i));
      sum_ = (sum_ ^ word) * 0x100000001b3U;
      sum_ ^= sum_ >> 32;
    }
  }
  void add(const std::string &text) {
    const std::uint64_t size = text.size();
    add(&size, sizeof size);
    add(text.data(), text.size());
  }
  std::string hex() const {
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(sum_));
    return text;
  }

private:
  std::uint64_t sum_ = 0xcbf29ce484222325U;
};

} // namespace tendril
