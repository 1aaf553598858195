#include "tendril/io/output_folder.hpp"

#include "tendril/model/scene.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fcntl.h>
#include <filesystem>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tendril {
namespace {

namespace fs = std::filesystem;
constexpr const char *results[] = {"checkpoint.h5",   "trajectory.h5", "trajectory.xdmf",
                                   "diagnostics.csv", "log.txt",       "options.yaml"};

/// Checkpoints go first: of a folder cleared by half none is left.
std::vector<std::string> removeResults(const std::string &folder) {
  std::vector<std::string> removed;
  for (const std::string name : results)
    for (const char *end : {"", ".part"}) {
      std::error_code error;
      if (fs::remove(folder + "/" + name + end, error)) removed.push_back(name + end);
      if (error)
        throw SceneError("option -output_dir: '" + folder + "/" + name + end +
                         "' of an earlier run cannot be removed; choose another folder");
    }
  return removed;
}

/// Whether the file behind a descriptor is still that at the path.
bool isAt(int file, const std::string &path) {
  struct stat here, there;
  return fstat(file, &here) == 0 && stat(path.c_str(), &there) == 0 && here.st_ino == there.st_ino &&
         here.st_dev == there.st_dev;
}

} // namespace

OutputFolder::OutputFolder(const std::string &path) : path_(path) {
  std::error_code error;
  made_ = fs::create_directories(path, error);
  while (!error) {
    lock_ = open(lockPath().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (lock_ < 0) break;
    const bool held =
        flock(lock_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK; // file systems without locks hold nothing
    if (held) {
      char owner[32] = "";
      const ssize_t n = pread(lock_, owner, sizeof owner - 1, 0);
      close(lock_);
      throw SceneError("option -output_dir: another run" +
                       (n > 0 ? " (process " + std::string(owner, std::size_t(n)) + ")" : std::string()) +
                       " is writing to '" + path + "'; choose another folder");
    }
    if (isAt(lock_, lockPath())) break;
    close(lock_); // the run before has just ended and taken it away
    lock_ = -1;
  }
  const std::string owner = std::to_string(getpid());
  if (lock_ < 0 || ftruncate(lock_, 0) != 0)
    throw SceneError("option -output_dir: '" + path + "' cannot be written; choose another folder");
  (void)!pwrite(lock_, owner.data(), owner.size(), 0); // on a full disk without a number
}

OutputFolder::~OutputFolder() {
  std::error_code error;
  fs::remove(lockPath(), error);
  close(lock_);
  if (made_) fs::remove(path_, error);
}

/// Numbers of the parts, rising.
std::vector<int> OutputFolder::parts() const {
  std::vector<int> numbers;
  std::error_code error;
  for (const fs::directory_entry &entry : fs::directory_iterator(path_, error)) {
    const std::string name = entry.path().filename().string();
    int number = 0;
    if (name.rfind("part_", 0) != 0) continue;
    const auto [end, bad] = std::from_chars(name.data() + 5, name.data() + name.size(), number);
    if (bad == std::errc() && end == name.data() + name.size() && number > 0) numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

std::vector<std::string> OutputFolder::checkpoints() const {
  std::vector<std::string> found;
  auto look = [&](const std::string &folder) {
    if (fs::exists(folder + "/checkpoint.h5")) found.push_back(folder + "/checkpoint.h5");
  };
  look(path_);
  const std::vector<int> numbers = parts();
  for (auto n = numbers.rbegin(); n != numbers.rend(); ++n) look(path_ + "/part_" + std::to_string(*n));
  return found;
}

bool OutputFolder::replaces(const std::string &file) const {
  std::error_code error;
  auto isHere = [&](const std::string &folder) {
    return std::any_of(std::begin(results), std::end(results),
                       [&](const char *name) { return fs::equivalent(file, folder + "/" + name, error); });
  };
  if (isHere(path_)) return true;
  const std::vector<int> numbers = parts();
  return std::any_of(numbers.begin(), numbers.end(),
                     [&](int n) { return isHere(path_ + "/part_" + std::to_string(n)); });
}

std::vector<std::string> OutputFolder::clear() const {
  std::vector<std::string> removed = removeResults(path_);
  for (const int n : parts()) {
    const std::string name = "part_" + std::to_string(n);
    if (!removeResults(path_ + "/" + name).empty()) removed.push_back(name);
    std::error_code error;
    fs::remove(path_ + "/" + name, error);
  }
  return removed;
}

std::string OutputFolder::setAside(const std::string &checkpoint) const {
  if (fs::path(checkpoint).parent_path() != fs::path(path_)) {
    removeResults(path_);
    return checkpoint;
  }
  const std::vector<int> numbers = parts();
  const std::string part = path_ + "/part_" + std::to_string(numbers.empty() ? 1 : numbers.back() + 1);
  std::error_code error;
  fs::create_directories(part, error);
  for (auto name = std::rbegin(results); !error && name != std::rend(results);
       ++name) // the checkpoint last: until then it is found here
    if (const std::string from = path_ + "/" + *name; fs::exists(from)) fs::rename(from, part + "/" + *name, error);
  if (error) throw SceneError("option -output_dir: the results of the run before cannot be moved to '" + part + "'");
  return part + "/checkpoint.h5";
}

void OutputFolder::refuseToReplace(const std::vector<std::string> &inputs) const {
  for (const std::string &input : inputs)
    if (replaces(input))
      throw SceneError("option -output_dir: results would replace '" + input +
                       "', which this run reads; choose another folder, or another name for that file");
}

} // namespace tendril
