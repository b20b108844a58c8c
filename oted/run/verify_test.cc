#include "oted/run/verify.h"

#include <gtest/gtest.h>

#include <atomic>
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
    }
  });
  for (int i = 0; i < 300; ++i) {
    for (const VerifiedFile& file : VerifyRun(folder.path()).files) {
      if (file.path.filename() == "checkpoint.json") {
        EXPECT_NE(file.state, FileState::kDamaged) << file.note;
      }
    }
  }
  over = true;
  stage.join();
}

}  // namespace oted::verify_test
