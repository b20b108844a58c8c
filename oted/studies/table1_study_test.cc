#include "oted/studies/table1_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/studies/design_study.h"
#include "oted/studies/study_file.h"
#include "oted/studies/table1_text.h"

namespace oted::table1_study_test {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

/// One task, two datasets, all parameters; agents of a few steps, clones of a few updates.
Table1Study Tiny(std::vector<std::string> methods) {
  Table1Study study;
  study.tasks = {"hopper"};
  study.datasets = {"medium", "expert"};
  study.parameters = {"all"};
  study.methods = std::move(methods);
  study.steps = 200;
  study.data_folder = OTED_TEST_SOURCE_DIR "/examples/data";
  study.assignments = {"sac.learning_starts=100", "sac.batch_size=16",       "sac.hidden=8",
                       "sac.eval_interval=100",   "sac.eval_episodes=1",     "sac.n_lanes=4",
                       "clone.hidden=8",          "clone.max_steps=40",      "agents.target_episodes=3",
                       "data.episodes=1",         "f_brc.behavior_steps=20", "f_brc.n_steps=40",
                       "f_brc.hidden=8",          "f_brc.behavior_hidden=8", "td3_bc.n_steps=40",
                       "td3_bc.hidden=8",         "rebrac.n_steps=40",       "rebrac.hidden=8",
                       "rebrac.batch_size=32",    "mbop.n_steps=40",         "mbop.hidden=8",
                       "mbop.batch_size=32",      "mbop.trajectories=10",    "mbop.horizon=3"};
  return study;
}

std::vector<std::string> Names(const Table1Study& study) {
  std::vector<std::string> names;
  for (const Table1Cell& cell : study.Cells()) names.push_back(cell.Name());
  return names;
}

std::vector<json> RunStudy(const Table1Study& study, const std::filesystem::path& out, int n_threads = 1) {
  NullSink log;
  return RunTable1(study, out, "a command", {}, {&log, nullptr, n_threads});
}

/// Asks for a stop once an agent has trained for a hundred steps.
class StopsHalfway : public NullSink {
 public:
  void Progress(std::string_view, std::string_view, int64_t done, int64_t, std::string_view) override {
    if (done == 100) stop = true;
  }
  std::atomic<bool> stop{false};
};

/// A record but for what depends on the clock.
json Timeless(json record) {
  for (json& seed : record["seeds"]) seed.erase("seconds");
  return record;
}

TEST(Table1Study, AgentsThatSeeNoLogsServeAllDatasetsAndACloneServesAllParameters) {
  Table1Study study = Tiny({"bc", "dr", "oted"});
  study.parameters = {"gain", "all"};
  EXPECT_THAT(Names(study),
              testing::UnorderedElementsAre("hopper-medium-bc", "hopper-expert-bc", "hopper-gain-dr", "hopper-all-dr",
                                            "hopper-medium-gain-oted", "hopper-medium-all-oted",
                                            "hopper-expert-gain-oted", "hopper-expert-all-oted"));
}

TEST(Table1Study, BcDrBringsWhatItCollectsWith) {
  Table1Study study = Tiny({"bc_dr"});
  study.datasets = {"medium"};
  EXPECT_THAT(Names(study), ElementsAre("hopper-all-dr", "hopper-medium-all-bc_dr"));
  study.assignments.push_back("baselines.bc_dr_collector=clone");
  EXPECT_THAT(Names(study), ElementsAre("hopper-medium-bc", "hopper-medium-all-bc_dr"));
}

TEST(Table1Study, TheWholePaperHas36CellsOfOtedAndNineOfWhatLearnsFromLogsAlone) {
  int oted = 0, bc = 0, dr = 0, mbop = 0;
  for (const Table1Cell& cell : Table1Study().Cells()) {
    mbop += cell.method == Table1Method::kMbop;
    oted += cell.method == Table1Method::kOted;
    bc += cell.method == Table1Method::kBc;
    dr += cell.method == Table1Method::kDr;
  }
  EXPECT_EQ(oted, 36);
  EXPECT_EQ(bc, 9);
  EXPECT_EQ(mbop, 9) << "it, too, learns from the logs alone";
  EXPECT_EQ(dr, 12) << "three tasks, four parameter settings";
}

TEST(Table1Study, TheTargetIsNominalAndTheGuessIsNot) {
  const Table1Study study = Tiny({"nominal"});
  const RunConfig config = study.ConfigOf(study.Cells()[0], 7);
  EXPECT_EQ(config.run.seed, 7);
  EXPECT_EQ(config.algorithms.sac.n_steps, 200);
  EXPECT_THAT(config.TruthVector(), ElementsAre(1, 1, 1));
  EXPECT_THAT(config.agents.nominal_at, ElementsAre(1.67, 0.77, 0.83));
  Table1Study other = study;
  SetNamedValue(other.guess, "--guess", "gain=0.5");
  EXPECT_THAT(other.ConfigOf(other.Cells()[0], 7).agents.nominal_at, ElementsAre(1.67, 0.5, 0.83));
}

TEST(Table1Study, ResultsDoNotDependOnThreadsNorOnBeingMadeInOneGo) {
  const TestFolder whole, parts;
  const Table1Study study = [] {
    Table1Study s = Tiny({"bc", "f_brc", "mbop", "td3_bc", "rebrac", "dr", "is", "bc_dr", "nominal"});
    s.datasets = {"medium"};
    s.n_seeds = 2;
    return s;
  }();
  const std::vector<json> expected = RunStudy(study, whole / "study");
  ASSERT_EQ(expected.size(), study.Cells().size());
  Table1Study first = study;
  first.n_seeds = 1;
  first.methods = {"dr", "is"};
  StopsHalfway log;
  EXPECT_THROW(RunTable1(first, parts / "study", "a command", {}, {&log, &log.stop, 1}), Interrupted);
  EXPECT_TRUE(std::filesystem::exists(parts.path() / "study/runs/hopper-all-dr/1/agents/1/checkpoint.npz"));
  RunStudy(first, parts / "study", 3);
  const std::vector<json> records = RunStudy(study, parts / "study", 3);
  for (size_t i = 0; i < records.size(); ++i) {
    EXPECT_EQ(Timeless(records[i]), Timeless(expected[i]));
    EXPECT_EQ(StudyFile(parts / "study").Find(study.Cells()[i].Name()), records[i]);
    ASSERT_EQ(records[i]["seeds"].size(), 2u);
    EXPECT_EQ(records[i]["seeds"][1]["seed"], 2);
    EXPECT_NE(records[i]["seeds"][0]["mean_return"], records[i]["seeds"][1]["mean_return"]);
  }
  // What is complete is not run again: the time of the first run stands.
  EXPECT_EQ(RunStudy(study, parts / "study"), records);
}

TEST(Table1Study, OfSeveralAgentsTheOneCountsThatDidBestWhereItTrained) {
  const TestFolder folder;
  Table1Study study = Tiny({"dr"});
  study.assignments.push_back("agents.n_agents=3");
  const json seed = RunStudy(study, folder / "study", 2)[0].at("seeds").at(0);
  const std::filesystem::path run = folder.path() / "study/runs/hopper-all-dr/1";
  double best = -INFINITY;
  std::string its_policy;
  for (const char* j : {"1", "2", "3"}) {
    const double own = ReadJson(run / "agents" / j / "agent.json").at("eval_return");
    if (own > best) its_policy = ReadFile(run / "agents" / j / "policy.npz");
    best = std::max(best, own);
  }
  EXPECT_EQ(seed.at("eval_return"), best);
  EXPECT_EQ(ReadFile(run / "policy.npz"), its_policy);
}

TEST(Table1Study, SeedsOfOtherSettingsAreRefused) {
  const TestFolder folder;
  Table1Study study = Tiny({"bc"});
  RunStudy(study, folder / "study");
  study.assignments.push_back("clone.max_steps=50");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunStudy(study, folder / "study"); }), HasSubstr("assignments"));
}

TEST(Table1Study, AGuessOutsideTheRangeAndMissingDataAreToldBeforeAnythingRuns) {
  const TestFolder folder;
  Table1Study study = Tiny({"nominal", "bc"});
  SetNamedValue(study.guess, "--guess", "gravity=3");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunStudy(study, folder / "study"); }), HasSubstr("gravity"));
  study = Tiny({"dr", "bc"});
  study.data_folder = folder.path().string();
  EXPECT_THAT(MessageOf<DataError>([&] { RunStudy(study, folder / "study"); }), HasSubstr("hopper-medium.hdf5"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

json Record(const char* task, json dataset, json parameters, const char* method, std::vector<double> scores) {
  json seeds = json::array();
  for (const double score : scores) seeds.push_back({{"score", score}});
  return {{"task", task},     {"dataset", dataset}, {"parameters", parameters},
          {"method", method}, {"steps", 200},       {"seeds", seeds}};
}

TEST(Table1Text, HasMeanAndSpreadBesideThePapersFigures) {
  Table1Study study = Tiny({});
  study.parameters = {"gain", "all"};
  const std::string text =
      Table1(study, {Record("hopper", "medium", nullptr, "bc", {10}), Record("hopper", nullptr, "all", "dr", {20, 22}),
                     Record("hopper", "expert", "gain", "oted", {50.04})});
  EXPECT_THAT(text, HasSubstr("| dataset | parameters | BC | paper | DR | paper | OTED | paper |\n"));
  EXPECT_THAT(text, HasSubstr("| hopper-medium | gain | 10.0 | 29.0 |  | 73.9 |  | 94.2 (8.6) |\n"));
  EXPECT_THAT(text, HasSubstr("| hopper-medium | all | 10.0 | 29.0 | 21.0 (1.4; 2) | 73.9 |  | 109.8 (2.6) |\n"));
  EXPECT_THAT(text, HasSubstr("| hopper-expert | gain |  | 109.0 |  | 73.9 | 50.0 | 100.4 (5.0) |\n"));
  EXPECT_THAT(text, HasSubstr("| hopper-expert | all |  | 109.0 | 21.0 (1.4; 2) | 73.9 |  | 45.2 (4.9) |\n"));
  EXPECT_THAT(text, Not(HasSubstr("D4RL's whole")));
}

TEST(Table1Text, PublishedFiguresOfOfflineLearnersSayWhatTheyWereMeasuredOn) {
  Table1Study study = Tiny({});
  json mbop = Record("hopper", "medium", nullptr, "mbop", {10}),
       rebrac = Record("hopper", "expert", nullptr, "rebrac", {30});
  mbop["seeds"][0]["n_transitions"] = 1403;
  rebrac["seeds"][0]["n_transitions"] = 5000;
  const std::string text = Table1(study, {mbop, rebrac});
  EXPECT_THAT(text, HasSubstr("| dataset | parameters | MBOP | paper | ReBRAC | CORL |\n"));
  EXPECT_THAT(text, HasSubstr("| hopper-medium | all | 10.0 | 48.8 |  | 102.3 (0.2) |\n"));
  EXPECT_THAT(text, HasSubstr("| hopper-expert | all |  | - | 30.0 | - |\n"));
  EXPECT_THAT(text, HasSubstr("D4RL's whole v0 datasets"));
  EXPECT_THAT(text, HasSubstr("Ours learn from 1403 to 5000 transitions: not comparable."));
}

}  // namespace oted::table1_study_test
