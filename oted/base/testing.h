#pragma once
/// What tests of several folders need. Include from *_test.cc files only.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "oted/base/files.h"

namespace oted {

/// A folder of its own, removed with its content at the end.
class TestFolder {
 public:
  TestFolder() {
    static std::atomic<int> counter{0};
    path_ = std::filesystem::path(testing::TempDir()) / fmt::format("oted-{}-{}", ::getpid(), counter++);
    std::filesystem::create_directories(path_);
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  std::filesystem::path path() const { return path_; }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

/// Runs a script in the tests' Python environment with `folder` as its working directory; fails with what the script
/// printed when it does not exit with 0.
inline testing::AssertionResult RunPython(const std::string& script, const TestFolder& folder) {
  WriteFileAtomically(folder / "script.py", script);
  const std::string command =
      fmt::format("cd '{}' && '{}' script.py > output.txt 2>&1", folder.path().string(), OTED_TEST_PYTHON);
  if (std::system(command.c_str()) == 0) return testing::AssertionSuccess();
  return testing::AssertionFailure() << ReadFile(folder / "output.txt");
}

/// The message of the E that `call` throws; a test failure when it throws none or another.
template <class E, class Call>
std::string MessageOf(const Call& call) {
  try {
    call();
  } catch (const E& error) {
    const std::string message = error.what();
    EXPECT_EQ(message.find('\n'), std::string::npos) << "an error is one line: " << message;
    return message;
  }
  ADD_FAILURE() << "no error was thrown";
  return "";
}

}  // namespace oted
