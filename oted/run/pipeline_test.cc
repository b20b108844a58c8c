#include "oted/run/pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/dataset_files.h"
#include "oted/nn/onnx_policy.h"
#include "oted/rl/batch_policy.h"
#include "oted/run/pipeline_testing.h"

namespace oted::pipeline_test {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

TEST_F(PipelineTest, LeavesTheDocumentedFilesAndNoOthers) {
  std::set<std::string> names;
  for (const auto& [name, bytes] : Bytes(Whole())) names.insert(name);
  std::set<std::string> wanted = {"run.toml",          "dataset.json", "clone/policy.npz",      "clone/clone.json",
                                  "policy.onnx",       "design.json",  "policy_selection.json", "evaluation.json",
                                  "motion/replay.json"};
  const auto is_prediction = [](const std::string& name) { return name.ends_with("/prediction.json"); };
  EXPECT_EQ(std::erase_if(names, is_prediction), 1u) << "the best seed's";
  for (const char* k : {"1", "2"}) {
    wanted.insert(std::string("design/default/") + k + "/q.json");
    for (const char* folder : {"agents/", "nominal/"}) {
      wanted.insert(std::string(folder) + k + "/policy.npz");
      wanted.insert(std::string(folder) + k + "/agent.json");
      wanted.insert(std::string(folder) + k + "/policy.onnx");
    }
  }
  EXPECT_EQ(names, wanted);
}

TEST_F(PipelineTest, ItsResultsHaveTheDocumentedFields) {
  const json design = ReadJson(Whole() / "design.json");
  EXPECT_EQ(design.at("schema"), "oted.design/1");
  ASSERT_EQ(design.at("parameters").size(), 2u);
  EXPECT_EQ(design["parameters"][0].at("name"), "gravity") << "in the order of the configuration";
  EXPECT_EQ(design["parameters"][1].at("name"), "friction");
  for (const char* key : {"field", "unit", "nominal", "mode", "std", "interval90", "verdict"}) {
    EXPECT_TRUE(design["parameters"][0].contains(key)) << key;
  }
  EXPECT_EQ(design.at("selected"), "default");
  ASSERT_EQ(design.at("mixture").size(), 2u);
  for (const char* key : {"correlation", "score", "verdict", "dataset", "model", "versions", "settings", "log2"}) {
    EXPECT_TRUE(design.contains(key)) << key;
  }
  const json evaluation = ReadJson(Whole() / "evaluation.json");
  std::vector<std::string> policies;
  for (const json& policy : evaluation.at("policies")) policies.push_back(policy.at("name"));
  EXPECT_THAT(policies, testing::ElementsAre("random", "clone", "sac_nominal", "oted_sac"));
  EXPECT_EQ(evaluation["parameters"][1].at("truth"), 0.6);
  const json selection = ReadJson(Whole() / "policy_selection.json");
  EXPECT_EQ(selection.at("simulators").size(), 2u);
  ASSERT_EQ(selection.at("agents").size(), 2u);
  EXPECT_EQ(selection["agents"][0].at("returns").size(), 2u);
  const json dataset = ReadJson(Whole() / "dataset.json");
  EXPECT_EQ(dataset.at("n_episodes"), 8);
  EXPECT_EQ(dataset.at("sha256"), Sha256OfFile(Demos()));
  const RunConfig resolved = RunConfig::FromTomlFile((Whole() / "run.toml").string());
  EXPECT_EQ(resolved.ToJson(), TinyConfig().ToJson()) << "method = auto stays: design.json says what it became";
  EXPECT_EQ(design.at("method_choices").at(0).at("method"), "trajectories");
}

TEST_F(PipelineTest, TheTruthChangesNothingThatTheDesignWrites) {
  RunConfig other = TinyConfig(), without = TinyConfig();
  other.truth = {{"gravity", 0.3}, {"friction", 1.9}};
  without.truth.clear();
  RunPipeline(other, Fresh("other"), &Pipeline::SelectPolicy);
  RunPipeline(without, Fresh("without"), &Pipeline::SelectPolicy);
  const auto whole = Bytes(Whole());
  for (const char* name : {"other", "without"}) {
    const auto bytes = Bytes(Fresh(name));
    for (const auto& [file, content] : bytes) {
      if (file == "run.toml") continue;
      EXPECT_EQ(whole.at(file), content) << name << ": " << file;
    }
    for (const char* file :
         {"design.json", "design/default/1/q.json", "design/default/2/q.json", "agents/1/policy.npz"}) {
      EXPECT_TRUE(bytes.contains(file)) << file;
    }
  }
}

TEST_F(PipelineTest, EveryAgentLeavesAnOnnxFileThatActsAsItDoesAndTheSelectedOneLiesOnTop) {
  const fs::path out = Fresh("onnx");
  fs::copy(Whole(), out, fs::copy_options::recursive);
  const std::string selected = std::to_string(ReadJson(out / "policy_selection.json").at("selected").get<int>());
  EXPECT_EQ(ReadFile(out / "policy.onnx"), ReadFile(out / "agents" / selected / "policy.onnx"));
  const auto before = Bytes(out);
  for (const char* folder : {"agents/1", "agents/2", "nominal/1", "nominal/2"}) {
    const TanhGaussianPolicy policy = TanhGaussianPolicy::Load(out / folder / "policy.npz");
    const OnnxPolicy onnx = OnnxPolicy::Load(out / folder / "policy.onnx");
    EXPECT_EQ(onnx.metadata().at("task"), "Hopper-v5");
    EXPECT_EQ(onnx.metadata().at("action_names"), R"(["thigh_joint","leg_joint","foot_joint"])");
    EXPECT_EQ(onnx.metadata().at("control_period_s"), "0.008");
    EXPECT_THAT(onnx.metadata().at("observation_names"), HasSubstr("rootz_pos"));
    EXPECT_THAT(onnx.metadata().at("source"), HasSubstr(folder));
    std::vector<double> observations(3 * 11), actions(3 * 3);
    Rng rng(1);
    for (double& v : observations) v = rng.Normal();
    MeanActionPolicy(policy)(observations, 3, actions);
    const OnnxValue read = onnx.Evaluate(observations, 3);
    for (size_t i = 0; i < actions.size(); ++i) EXPECT_NEAR(read.data[i], actions[i], 1e-5);
    fs::remove(out / folder / "policy.onnx");
  }
  fs::remove(out / "policy.onnx");
  // An agent that is made again does not keep what lies there under its export's name.
  fs::remove(out / "agents/1/agent.json");
  WriteFileAtomically(out / "agents/1/policy.onnx", "another's");
  // As after a run of an earlier version: only the missing files are made again, byte for byte.
  RunPipeline(TinyConfig(), out);
  EXPECT_EQ(Bytes(out), before);
}

TEST_F(PipelineTest, ACsvWithTheTasksNamesInAnotherOrderIsTheSameData) {
  const auto factory = MakeSimulatorFactory(TaskConfig::FromArgument("Hopper-v5"), {});
  const Dataset demos = ReadDataset(Demos());
  Dataset named = demos;
  named.observation_names = factory->spec().observation_names;
  std::reverse(named.observation_names.begin(), named.observation_names.end());
  for (Array2<double>* m : {&named.observations, &named.next_observations}) {
    for (int i = 0; i < m->rows(); ++i) std::reverse(m->row(i).begin(), m->row(i).end());
  }
  named.period_s = factory->spec().control_period_s;
  const TestFolder folder;
  WriteDataset(named, folder / "demos.csv.gz");
  const Dataset read = ReadDataset(folder / "demos.csv.gz", DataOptionsFor(DataConfig{}, factory->spec()));
  EXPECT_EQ(read.observations, demos.observations);
  EXPECT_EQ(read.next_observations, demos.next_observations);
  EXPECT_EQ(read.actions, demos.actions);
  EXPECT_EQ(read.terminals, demos.terminals);
  EXPECT_THAT(read.remarks, testing::ElementsAre(HasSubstr("put into the task's order")));
}

TEST_F(PipelineTest, AWrongRequestIsRefusedBeforeAnythingIsWritten) {
  const auto refuse = [&](const RunConfig& config, const std::string& what) {
    try {
      RunPipeline(config, Fresh("none"));
      ADD_FAILURE() << "not refused: " << what;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(what));
    }
    EXPECT_FALSE(fs::exists(Fresh("none"))) << what;
  };
  RunConfig config = TinyConfig();
  config.truth["gravity"] = 2.5;
  refuse(config, "'gravity'");
  config = TinyConfig();
  config.data.episodes = "9";
  refuse(config, "holds 8");
  config = TinyConfig();
  config.task.name = "Walker2d-v5";
  refuse(config, "'Walker2d-v5'");
  config = TinyConfig();
  config.parameters[1].field = "geom/*/frction[0]";
  refuse(config, "frction");
  config = TinyConfig();
  config.agents.algorithm = AgentAlgorithm::kPpo;
  refuse(config, "continuous actions");
}

TEST_F(PipelineTest, AParameterWithoutEffectIsAWarningAndUnderStrictAnError) {
  RunConfig config = TinyConfig();
  // Friction is the larger of the two geoms': the foot's is 2, so the floor's below that does nothing.
  config.parameters[1] = ParseParameterSpec("floor=geom/floor/friction[0]:0.2:1.0");
  config.truth.clear();
  config.run.strict = true;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPipeline(config, Fresh("strict")); }), HasSubstr("'floor'"));
  EXPECT_FALSE(fs::exists(Fresh("strict")));
  config.run.strict = false;
  Watch watch;
  RunPipeline(config, Fresh("warned"), watch, &Pipeline::SelectSimulator);
  ASSERT_EQ(watch.warnings.size(), 1u) << "told once";
  EXPECT_THAT(watch.warnings[0], HasSubstr("'floor'"));
  const json design = ReadJson(Fresh("warned") / "design.json");
  EXPECT_EQ(design["parameters"][1].at("verdict"), "not_identified");
  EXPECT_EQ(design.at("warnings").size(), 1u);
}

}  // namespace oted::pipeline_test
