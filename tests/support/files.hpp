#pragma once
/// Files for the tests of readers.
#include "tendril/model/scene.hpp"

#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <unistd.h>

namespace tendril::test {

/// A folder that goes away with its object.
class Folder {
public:
  Folder() : path_(std::filesystem::temp_directory_path() / ("tendril_test_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(path_);
  }
  Folder(const Folder &) = delete;
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string path(const std::string &name) const { return (path_ / name).string(); }
  /// Writes a file and returns its path.
  std::string write(const std::string &name, const std::string &text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

private:
  std::filesystem::path path_;
};

/// Message of the SceneError that `action` throws; the test fails when it throws none.
template <class Action> std::string messageOf(Action action) {
  try {
    action();
  } catch (const SceneError &e) {
    return e.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

/// `text` contains `part`.
inline testing::AssertionResult says(const std::string &text, const std::string &part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not say '" << part << "'";
}

} // namespace tendril::test
