// Where agents train: the designed simulators, and the baselines' own.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/run/pipeline_testing.h"

namespace oted::pipeline_baselines_test {

using nlohmann::json;
namespace fs = std::filesystem;

/// The tiny study with one agent, all of the baselines beside it.
RunConfig WithBaselines() {
  RunConfig config = TinyConfig();
  config.agents.n_agents = 1;
  config.baselines.run = {"dr", "is", "bc_dr", "f_brc", "mbop", "td3_bc", "rebrac"};
  config.baselines.is.episodes = 1;
  return config;
}

/// One whole run of that study.
const fs::path& WholeWithBaselines() {
  static const TestFolder folder;
  static const bool done = (RunPipeline(WithBaselines(), folder.path() / "run"), true);
  static const fs::path path = folder.path() / "run";
  EXPECT_TRUE(done);
  return path;
}

TEST_F(PipelineTest, BaselinesAreTrainedAndEvaluatedAndTouchNothingElse) {
  const fs::path& out = WholeWithBaselines();
  const auto plain = Bytes(Whole()), with = Bytes(out);
  for (const char* file : {"design.json", "clone/policy.npz", "agents/1/policy.npz", "nominal/1/policy.npz"}) {
    EXPECT_EQ(with.at(file), plain.at(file)) << file;
  }
  for (const std::string name : {"dr", "is"}) {
    const std::string folder = "baselines/" + name + "/1/";
    EXPECT_TRUE(with.contains(folder + "policy.onnx")) << name;
    EXPECT_NE(with.at(folder + "policy.npz"), with.at("nominal/1/policy.npz")) << name;
    EXPECT_EQ(ReadJson(out / folder / "agent.json").at("baseline"), name);
  }
  EXPECT_TRUE(with.contains("baselines/bc_dr/policy.onnx"));
  for (const std::string name : {"f_brc", "mbop", "td3_bc", "rebrac"}) {
    const std::string folder = "baselines/" + name + "/";
    EXPECT_TRUE(with.contains(folder + "policy.npz")) << name;
    EXPECT_EQ(with.contains(folder + "policy.onnx"), name != "mbop") << "a planner has no ONNX form";
    EXPECT_FALSE(with.contains(folder + "checkpoint.npz")) << name;
    const json record = ReadJson(out / folder / "offline.json");
    EXPECT_EQ(record.at("baseline"), name);
    EXPECT_GT(record.at("n_transitions").get<int>(), 8);
  }
  const json interval = ReadJson(out / "baselines/is/1/agent.json").at("episodes");
  EXPECT_LE(interval.at("interval/low/friction").get<double>(), 1.0) << "it began at the nominal value";
  EXPECT_GE(interval.at("interval/high/friction").get<double>(), 1.0);
  std::vector<std::string> names;
  const json evaluation = ReadJson(out / "evaluation.json");
  for (const json& policy : evaluation.at("policies")) names.push_back(policy.at("name"));
  EXPECT_THAT(names, testing::ElementsAre("random", "clone", "f_brc", "mbop", "td3_bc", "rebrac", "bc_dr", "sac_dr",
                                          "sac_is", "sac_nominal", "oted_sac"));
}

TEST_F(PipelineTest, AgentsTrainInModesSamplesOrTheBestSimulator) {
  const auto policy_of = [&](const std::string& train_in, int n_seeds) {
    RunConfig config = TinyConfig();
    config.truth.clear();
    config.agents.n_agents = 1;
    config.Set("agents.train_in=" + train_in);
    config.selection.n_seeds = n_seeds;
    const fs::path out = CopyWithoutAgents(train_in + std::to_string(n_seeds));
    if (n_seeds != 2) fs::remove(out / "design.json");
    RunPipeline(config, out, &Pipeline::TrainAgents);
    const json record = ReadJson(out / "agents/1/agent.json");
    EXPECT_EQ(record.value("train_in", "modes"), train_in);
    return ReadFile(out / "agents/1/policy.npz");
  };
  const std::string modes = ReadFile(Whole() / "agents/1/policy.npz");
  EXPECT_NE(policy_of("samples", 2), modes);
  EXPECT_NE(policy_of("best", 2), modes);
  EXPECT_EQ(policy_of("best", 1), policy_of("modes", 1)) << "with one seed there is one simulator";
}

TEST_F(PipelineTest, BaselinesHaveTheSameBytesAtAnyNumberOfThreadsAndAfterStops) {
  const fs::path stopped = CopyWithoutAgents("stopped");
  RunConfig config = WithBaselines();
  config.run.threads = 3;
  for (const int64_t at : {0, 100, 150}) {
    Watch watch;
    watch.stop_stage = "train";
    watch.stop_at = at;
    EXPECT_THROW(RunPipeline(config, stopped, watch), Interrupted) << at;
  }
  RunPipeline(config, stopped);
  auto whole = Bytes(WholeWithBaselines()), other = Bytes(stopped);
  EXPECT_EQ(whole.erase("run.toml") + other.erase("run.toml"), 2u) << "it holds the number of threads";
  ASSERT_EQ(whole.size(), other.size());
  for (const auto& [name, bytes] : whole) EXPECT_EQ(other.at(name), bytes) << name;
}

}  // namespace oted::pipeline_baselines_test
