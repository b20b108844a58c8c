// What the report shows of the logs: their replay in both simulators, and pictures.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/run/pipeline_testing.h"

namespace oted::pipeline_motion_test {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

json ReplayOf(const fs::path& out) { return ReadJson(out / "motion/replay.json"); }

TEST(PipelineReplayTest, TheRecordComparesTheLogsWithBothSimulatorsAtTheSameActions) {
  const TestFolder folder;
  RunConfig config = TinyConfig();
  config.report.replay_steps = 10;
  RunPipeline(config, folder.path(), &Pipeline::ReplayLogs);
  const json replay = ReplayOf(folder.path());
  EXPECT_EQ(replay["nominal"], json(std::vector<double>(config.parameters.size(), 1.0)));
  ASSERT_GT(replay["channels"].size(), 5u);
  double before = std::numeric_limits<double>::infinity();
  for (const json& channel : replay["channels"]) {
    ASSERT_EQ(channel["logged"].size(), 11u);
    EXPECT_EQ(channel["logged"][0], channel["nominal"][0]) << "a replay starts in the logged state";
    EXPECT_EQ(channel["logged"][0], channel["designed"][0]);
    // The data are float32 and were logged in the nominal simulator: replayed there, they come out again.
    const double end = channel["logged"][10].get<double>();
    EXPECT_NEAR(channel["nominal"][10].get<double>(), end, 1e-2 * (1 + std::abs(end))) << channel["name"];
    EXPECT_LE(channel["error_nominal"].get<double>(), before) << "the largest error first";
    before = channel["error_nominal"].get<double>();
  }
  EXPECT_LT(replay["error"]["nominal"]["median"][10].get<double>(),
            replay["error"]["designed"]["median"][10].get<double>());
  EXPECT_FALSE(fs::exists(folder.path() / "motion/motion.json")) << "no pictures were asked for";
}

TEST(PipelineReplayTest, PicturesAreDrawnWhereTheyCanBeAndOtherwiseANoteSaysWhy) {
  const TestFolder folder;
  RunConfig config = TinyConfig();
  config.report.replay_steps = 5;
  config.report.motion = Motion::kAuto;
  ::setenv("MUJOCO_GL", "off", 1);
  RunPipeline(config, folder.path(), &Pipeline::ReplayLogs);
  EXPECT_THAT(ReadJson(folder.path() / "motion/motion.json")["note"].get<std::string>(), HasSubstr("MUJOCO_GL=off"));
  const std::string replay = ReadFile(folder / "motion/replay.json");
  config.report.motion = Motion::kTrue;
  NullSink log;
  EXPECT_THAT(MessageOf<UsageError>([&] { Pipeline(config, folder.path(), {.log = &log}); }),
              testing::AllOf(HasSubstr("report.motion"), HasSubstr("MUJOCO_GL=off")));
  ::unsetenv("MUJOCO_GL");

  // The next call draws what the first could not; the curves do not depend on it.
  config.report.motion = Motion::kAuto;
  RunPipeline(config, folder.path(), &Pipeline::ReplayLogs);
  EXPECT_EQ(ReadFile(folder / "motion/replay.json"), replay);
  const json motion = ReadJson(folder.path() / "motion/motion.json");
  if (motion.contains("note")) GTEST_SKIP() << motion["note"];
  EXPECT_EQ(motion["n_frames"], 6);
  for (const char* name : {"logged", "nominal", "designed"}) {
    EXPECT_GT(fs::file_size(folder.path() / "motion" / (std::string(name) + ".webp")), 1000u);
  }
  config.report.motion = Motion::kFalse;
  RunPipeline(config, folder.path(), &Pipeline::ReplayLogs);
  EXPECT_FALSE(fs::exists(folder.path() / "motion/logged.webp"));
}

TEST(PipelineReplayTest, LogsThatAreTooShortGiveANoteAndNoError) {
  const TestFolder folder;
  RunConfig config = TinyConfig();
  config.report.replay_steps = 100000;
  RunPipeline(config, folder.path(), &Pipeline::ReplayLogs);
  EXPECT_THAT(ReplayOf(folder.path())["note"].get<std::string>(), HasSubstr("report.replay_steps"));
  // Another length is simply replayed anew.
  config.report.replay_steps = 5;
  RunPipeline(config, folder.path(), &Pipeline::ReplayLogs);
  EXPECT_TRUE(ReplayOf(folder.path()).contains("window"));
}

}  // namespace oted::pipeline_motion_test
