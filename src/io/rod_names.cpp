#include "tendril/io/rod_names.hpp"

#include <algorithm>
#include <numeric>

namespace tendril {

void RodNames::add(const std::string &name) {
  rods_[name].push_back(count_);
  for (std::size_t k = 0; k < name.size(); ++k)
    if (name[k] == '.' || name[k] == '#') rods_[name.substr(0, k)].push_back(count_);
  ++count_;
}

std::vector<int> RodNames::find(const std::string &word) const {
  if (word == "all") {
    std::vector<int> all(count_);
    std::iota(all.begin(), all.end(), 0);
    return all;
  }
  if (const auto named = rods_.find(word); named != rods_.end()) return named->second;
  const bool number = !word.empty() && word.size() < 10 && word.find_first_not_of("0123456789") == std::string::npos &&
                      (word == "0" || word[0] != '0');
  if (number && std::stoi(word) < count_) return {std::stoi(word)};
  return {};
}

} // namespace tendril
