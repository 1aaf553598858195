/// What a user sees of a run. Here the output is no terminal.
#include "support/files.hpp"
#include "support/rods.hpp"

#include "tendril/io/progress.hpp"
#include "tendril/solver/activity.hpp"

#include <filesystem>

namespace tendril::test {
namespace {

std::string textOf(const std::string &path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

Diagnostics rowAt(double time) {
  Diagnostics row;
  row.time = time;
  row.dt = 0.5;
  return row;
}

TEST(Progress, TellsLoadFactorsInStatics) {
  const std::string path = (std::filesystem::temp_directory_path() / "tendril_progress_log.txt").string();
  for (const auto &[settings, words] : {std::pair{statics(), "load factor 0.5 of 1  increment 0.5  its"},
                                        std::pair{dynamics(0.5, 2), "time 0.5 of 2  dt 0.5  its"}}) {
    testing::internal::CaptureStdout();
    { Progress(settings, path).step(rowAt(0.5)); }
    const std::string out = testing::internal::GetCapturedStdout();
    EXPECT_EQ(out.rfind(words, 0), 0u) << out;
    EXPECT_EQ(textOf(path), out);
  }
  LoopSettings along = statics();
  along.continuation = Continuation::arclength;
  testing::internal::CaptureStdout();
  { Progress(along, path).step(rowAt(0.5)); }
  EXPECT_EQ(testing::internal::GetCapturedStdout().rfind("load factor 0.5 of 1  length 0.5  its", 0), 0u);
  std::filesystem::remove(path);
}

TEST(Progress, TellsWhatTakesLongAndFailures) {
  const std::string path = (std::filesystem::temp_directory_path() / "tendril_progress_log.txt").string();
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  {
    Progress progress(statics(), path);
    const Doing here([](std::ostream &out) { out << "rod 'a\x1b'"; });
    watch().beat(); // nothing has taken long
    watch().wait = 0;
    watch().beat();
    watch().wait = Watch().wait;
    progress.fail("step 1");
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "tendril: step 1\n");
  const std::string out = testing::internal::GetCapturedStdout();
  EXPECT_EQ(out.rfind("working for 0 s: rod 'a", 0), 0u) << out;
  EXPECT_EQ(std::count(out.begin(), out.end(), '\n'), 1);
  EXPECT_EQ(out.find('\x1b'), std::string::npos);
  EXPECT_EQ(textOf(path), out + "failed: step 1\n");
  EXPECT_FALSE(watch().tell); // nobody listens any more
  std::filesystem::remove(path);
}

} // namespace
} // namespace tendril::test
