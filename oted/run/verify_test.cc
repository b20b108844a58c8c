#include "oted/run/verify.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "oted/base/files.h"
#include "oted/base/testing.h"

namespace oted::verify_test {

TEST(VerifyRun, ACheckpointThatIsRemovedMeanwhileIsNoDamage) {
  const TestFolder folder;
  WriteFileAtomically(folder / "design.json", "{}");
  std::filesystem::create_directory(folder / "clone");
  std::atomic<bool> over = false;
  std::thread stage([&] {
    while (!over) {
      WriteJson(folder / "clone/checkpoint.json", {{"fingerprint", "aa"}});
      RemoveFile(folder / "clone/checkpoint.json");
      std::filesystem::create_directories(folder / "clone/starts/1");
      std::filesystem::remove_all(folder / "clone/starts");
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  for (int i = 0; i < 300; ++i) {
    for (const VerifiedFile& file : VerifyRun(folder.path()).files) {
      if (file.path != "design.json") {
        EXPECT_NE(file.state, FileState::kDamaged) << file.path << ": " << file.note;
      }
    }
  }
  over = true;
  stage.join();
}

}  // namespace oted::verify_test
