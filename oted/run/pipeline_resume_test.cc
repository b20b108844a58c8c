// The same bytes after stops, again, with pieces missing and at any number of threads; other settings are refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/run/pipeline_testing.h"

namespace oted::pipeline_resume_test {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

TEST_F(PipelineTest, RunningAgainDoesNothing) {
  const fs::path copy = Copy();
  const Snapshot before = Look(copy);
  Watch watch;
  RunPipeline(TinyConfig(), copy, watch);
  EXPECT_TRUE(watch.worked.empty()) << "first of them: " << *watch.worked.begin();
  const Snapshot after = Look(copy);
  ASSERT_EQ(after.size(), before.size());
  for (const auto& [name, file] : before) {
    EXPECT_EQ(after.at(name).first, file.first) << name;
    // The record of what was asked is written anew each time.
    if (name != "run.toml" && name != "dataset.json") {
      EXPECT_EQ(after.at(name).second, file.second) << name;
    }
  }
}

TEST_F(PipelineTest, AMissingPieceIsMadeAgainAloneAndIsTheSame) {
  const fs::path copy = Copy();
  const auto before = Bytes(copy);
  fs::remove(copy / "design/default/2/q.json");
  Watch watch;
  RunPipeline(TinyConfig(), copy, watch);
  EXPECT_THAT(watch.worked, testing::ElementsAre("design/default/2"));
  EXPECT_EQ(Bytes(copy), before);
}

TEST_F(PipelineTest, GivesTheSameBytesAtAnyNumberOfThreads) {
  RunConfig config = TinyConfig();
  config.run.threads = 3;
  RunPipeline(config, Fresh("three"));
  auto one = Bytes(Whole()), three = Bytes(Fresh("three"));
  EXPECT_EQ(one.erase("run.toml") + three.erase("run.toml"), 2u) << "it holds the number of threads";
  ASSERT_EQ(one.size(), three.size());
  for (const auto& [name, bytes] : one) EXPECT_EQ(three.at(name), bytes) << name;
}

TEST_F(PipelineTest, OtherSettingsInTheSameDirectoryAreRefusedAndNothingIsTouched) {
  const fs::path copy = Copy();
  const Snapshot before = Look(copy);
  const auto refuse = [&](const std::string& assignment) {
    RunConfig config = TinyConfig();
    config.Set(assignment);
    EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, copy); }), HasSubstr("choose another --out"))
        << assignment;
    EXPECT_EQ(Look(copy), before) << assignment;
  };
  refuse("run.seed=2");
  refuse("clone.max_steps=61");
  refuse("design.adversarial.lambda=0.02");
  refuse("selection.judge_steps=21");
  refuse("sac.gamma=0.98");
  refuse("data.episodes=7");
  refuse("data.action_delay=1");
  refuse("agents.selection_episodes=3");
  refuse("agents.train_in=samples");
  refuse("agents.nominal_at=1.5,1.5");
  RunConfig config = TinyConfig();
  config.Set("sac.gamma=0.98");
  const std::string told = MessageOf<UsageError>([&] { RunPipeline(config, copy); });
  for (const char* stage : {"agents/1", "agents/2", "policy_selection.json"}) {
    EXPECT_THAT(told, HasSubstr((copy / stage).string())) << "one after another, each costs a call";
  }
  config = TinyConfig();
  config.parameters[0].high = 1.9;
  EXPECT_THROW(RunPipeline(config, copy), UsageError);
  config = TinyConfig();
  config.truth["gravity"] = 1.1;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, copy); }), HasSubstr("evaluation.json"));
  EXPECT_EQ(Look(copy), before);
  config = TinyConfig();
  config.baselines.run = {"dr"};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, copy); }), HasSubstr("evaluation.json"))
      << "its table is of other policies";
  EXPECT_EQ(Look(copy), before);
}

TEST_F(PipelineTest, AStoppedRunGoesOnAsIfItHadNot) {
  // Algorithm 1 keeps checkpoints; trajectory matching, which takes seconds, begins anew.
  RunConfig tiny = TinyConfig();
  tiny.design.method = DesignMethod::kTransitions;
  const fs::path out = Fresh("stopped"), undisturbed = Fresh("undisturbed");
  RunPipeline(tiny, undisturbed);
  for (const auto& [stage, at] : {std::pair{"design", 2}, std::pair{"train", 150}}) {
    Watch watch;
    watch.stop_stage = stage;
    watch.stop_at = at;
    EXPECT_THROW(RunPipeline(tiny, out, watch), Interrupted) << stage;
    EXPECT_FALSE(fs::exists(out / "evaluation.json"));
    RunConfig other = tiny;
    other.Set("design.adversarial.lambda=0.02");
    other.Set("sac.gamma=0.98");
    EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(other, out); }),
                HasSubstr("different from its run.toml: design.adversarial.lambda = 0.02 (was 0.01), sac.gamma = 0.98"))
        << "work of other settings would be gone on with: " << stage;
  }
  RunPipeline(tiny, out);
  const auto whole = Bytes(undisturbed), stopped = Bytes(out);
  ASSERT_EQ(stopped.size(), whole.size());
  for (const auto& [name, bytes] : whole) EXPECT_EQ(stopped.at(name), bytes) << name;
}

}  // namespace oted::pipeline_resume_test
