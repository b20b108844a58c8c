#include "oted/report/gather.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/report/sample_run.h"

namespace oted::gather_test {

using nlohmann::json;
using testing::HasSubstr;

TEST(GatherReportTest, HoldsWhatTheFilesHold) {
  TestFolder folder;
  const SampleRun run(folder.path());
  run.WriteAll();
  const json report = GatherReport(folder.path());
  EXPECT_EQ(report["schema"], "oted.report/1");
  EXPECT_EQ(report["title"], "Hopper-v5");
  EXPECT_EQ(report["design"], ReadJson(folder / "design.json"));
  EXPECT_EQ(report["dataset"], ReadJson(folder / "dataset.json"));
  EXPECT_EQ(report["policy_selection"], ReadJson(folder / "policy_selection.json"));
  EXPECT_EQ(report["policies"], ReadJson(folder / "evaluation.json")["policies"]);
  EXPECT_EQ(report["clone"]["result"], ReadJson(folder / "clone/clone.json"));
  EXPECT_EQ(report["warnings"], ReadJson(folder / "design.json")["warnings"]);
  EXPECT_EQ(report["run"]["config"], ReadFile(folder / "run.toml"));
  EXPECT_EQ(report["run"]["versions"], ReadJson(folder / "versions.json"));
  EXPECT_EQ(report["shown_setting"], "paper");
  ASSERT_EQ(report["design_seeds"].size(), 3u);
  ASSERT_EQ(report["agents"].size(), 3u);
  EXPECT_EQ(report["nominal"][1]["result"]["eval_return"], 1020.0);
  const Curve curve = ReadCurves(folder / "design/paper/2/curves.csv").At("design/mode/gain");
  const json& points = report["design_seeds"][1]["curves"]["design/mode/gain"];
  ASSERT_EQ(points.size(), curve.size());
  for (size_t i = 0; i < curve.size(); ++i) EXPECT_EQ(points[i], (json{curve[i].first, curve[i].second}));
}

TEST(GatherReportTest, AgentsOfBaselinesCarryTheirBaselinesName) {
  TestFolder folder;
  const SampleRun run(folder.path());
  run.WriteAll();
  EXPECT_FALSE(GatherReport(folder.path()).contains("baselines"));
  for (const char* name : {"dr", "is"}) {
    std::filesystem::create_directories(std::filesystem::path(folder / "baselines") / name);
    std::filesystem::copy(folder / "nominal/2", std::filesystem::path(folder / "baselines") / name / "2",
                          std::filesystem::copy_options::recursive);
  }
  WriteFileAtomically(folder / "baselines/bc_dr/clone.json", R"({"schema": "oted.clone/1"})");
  const json report = GatherReport(folder.path());
  ASSERT_EQ(report["baselines"].size(), 2u) << "BC+DR is no agent";
  EXPECT_EQ(report["baselines"][0]["baseline"], "dr");
  EXPECT_EQ(report["baselines"][1]["baseline"], "is");
  EXPECT_EQ(report["baselines"][1]["result"], report["nominal"][1]["result"]);
}

TEST(GatherReportTest, EveryParameterMeetsItsTruthByName) {
  TestFolder folder;
  SampleRun run(folder.path());
  run.WriteDesign();
  run.names = {"gravity", "friction", "unrelated"};  // the evaluation's order is another one
  run.truth = {1.2, 0.6, 9};
  run.found = {1.21, 0.67, 9};
  run.WriteEvaluation();
  const json parameters = GatherReport(folder.path())["parameters"];
  ASSERT_EQ(parameters.size(), 3u);
  EXPECT_EQ(parameters[0]["name"], "friction");
  EXPECT_EQ(parameters[0]["truth"], 0.6);
  EXPECT_NEAR(parameters[0]["absolute_error"].get<double>(), 0.07, 1e-12);
  EXPECT_EQ(parameters[0]["seed_modes"], (json{0.67, 0.62, 0.71}));
  EXPECT_FALSE(parameters[1].contains("truth"));
  EXPECT_EQ(parameters[2]["truth"], 1.2);
}

TEST(GatherReportTest, LongCurvesAreThinnedAndKeepTheirLastPoint) {
  TestFolder folder;
  WriteFileAtomically(folder / "agents/1/agent.json", R"({"schema": "oted.agent/1"})");
  std::string rows = "step,key,value\n";
  for (int step = 0; step < 2501; ++step) rows += fmt::format("{},eval/mean_reward,{}\n", step, 2 * step);
  WriteFileAtomically(folder / "agents/1/curves.csv", rows + "1,train/ent_coef,nan\n");
  const json report = GatherReport(folder.path());
  const json& curves = report["agents"][0]["curves"];
  const json& points = curves["eval/mean_reward"];
  EXPECT_LE(points.size(), 1000u);
  EXPECT_GE(points.size(), 500u);
  EXPECT_EQ(points.back(), (json{2500, 5000.0}));
  for (const json& point : points) EXPECT_EQ(point[1].get<double>(), 2 * point[0].get<double>());
  EXPECT_TRUE(curves["train/ent_coef"][0][1].is_null()) << "JSON has no NaN";
}

TEST(GatherReportTest, NumberedFoldersStandInNumericalOrder) {
  TestFolder folder;
  for (const char* name : {"10", "9", "1"}) {
    WriteFileAtomically(folder.path() / "agents" / name / "agent.json", R"({"schema": "oted.agent/1"})");
  }
  std::vector<std::string> names;
  const json report = GatherReport(folder.path());
  for (const json& agent : report["agents"]) names.push_back(agent["name"]);
  EXPECT_THAT(names, testing::ElementsAre("1", "9", "10"));
}

TEST(GatherReportTest, OnlyTheSelectedSettingsSeedsAreShown) {
  TestFolder folder;
  const SampleRun run(folder.path());
  run.WriteDesignSeeds();
  run.WriteDesign();
  CurvesWriter(folder / "design/another/1/curves.csv").Append(0, "design/reward", 1);
  const json report = GatherReport(folder.path());
  EXPECT_EQ(report["shown_setting"], "paper");
  EXPECT_EQ(report["design_seeds"].size(), 3u);
}

TEST(GatherReportTest, AFolderWithoutResultsIsAnErrorWithTheRemedy) {
  TestFolder folder;
  EXPECT_THAT(MessageOf<UsageError>([&] { GatherReport(folder.path()); }), HasSubstr("--out"));
  WriteFileAtomically(folder / "run.toml", SealedText("[run]\n", ""));
  EXPECT_THAT(MessageOf<UsageError>([&] { GatherReport(folder.path()); }), HasSubstr("no results"));
  EXPECT_THAT(MessageOf<UsageError>([&] { GatherReport(folder.path() / "missing"); }), HasSubstr("missing"));
}

TEST(GatherReportTest, AForeignOrDamagedFileIsNamed) {
  TestFolder folder;
  WriteFileAtomically(folder / "design.json", R"({"schema": "oted.design/9"})");
  EXPECT_THAT(MessageOf<DataError>([&] { GatherReport(folder.path()); }),
              testing::AllOf(HasSubstr("design.json"), HasSubstr("oted.design/9"), HasSubstr("'oted.design/1'")));
  WriteFileAtomically(folder / "design.json", R"([1, 2])");
  EXPECT_THAT(MessageOf<DataError>([&] { GatherReport(folder.path()); }), HasSubstr("design.json"));
  WriteFileAtomically(folder / "design.json", R"({"schema": "oted.design/1", "parameters": [)");
  EXPECT_THAT(MessageOf<DataError>([&] { GatherReport(folder.path()); }), HasSubstr("design.json"));
  WriteFileAtomically(folder / "design.json", R"({"schema": "oted.design/1", "parameters": [7]})");
  EXPECT_THAT(MessageOf<DataError>([&] { GatherReport(folder.path()); }), HasSubstr("layout"));
}

}  // namespace oted::gather_test
