#include "oted/studies/design_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::design_study_test {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

json Setting(const char* name, std::vector<std::vector<double>> modes, double deviation, double progress, double c,
             double common) {
  json seeds = json::array();
  for (const auto& mode : modes) seeds.push_back({{"mode", mode}});
  return {{"name", name},
          {"method", "paper"},
          {"design_deviation", deviation},
          {"learning_progress", progress},
          {"c", c},
          {"common", common},
          {"seeds", seeds}};
}

/// Three settings whose errors are 0.1, 0.2 and 0.6.
json Design() {
  return {{"dataset", {{"n_transitions", 100}}},
          {"verdict", "gap_closed"},
          {"parameters", {{{"name", "friction"}}, {{"name", "gain"}}}},
          {"settings",
           {Setting("near", {{1.1, 0.9}, {1.2, 1.0}}, 0.3, 0.1, 0.6, 0.5),
            Setting("middle", {{0.8, 0.8}}, 0.1, 0.2, 0.5, 0.6), Setting("far", {{1.6, 1.6}}, 0.2, 0.3, 0.4, 0.4)}}};
}

TEST(ScoreCell, ErrorsAreMeansOverParametersAndSeedsInMultiplesOfNominal) {
  const json record = ScoreCell({}, {"hopper", "medium", "all"}, Design());
  EXPECT_NEAR(record["settings"][0]["error"], 0.1, 1e-12);
  EXPECT_NEAR(record["settings"][1]["error"], 0.2, 1e-12);
  EXPECT_NEAR(record["worst_error"], 0.6, 1e-12);
  EXPECT_TRUE(record["counts"]);
}

TEST(ScoreCell, EachRankingPicksByItsOwnScoreAndPaysItsRegret) {
  const json picks = ScoreCell({}, {"hopper", "medium", "all"}, Design())["picks"];
  EXPECT_EQ(picks["c"]["setting"], "near");  // highest
  EXPECT_EQ(picks["c"]["regret"], 0);
  EXPECT_EQ(picks["design_deviation"]["setting"], "middle");  // lowest
  EXPECT_NEAR(picks["design_deviation"]["regret"], 0.1, 1e-12);
  EXPECT_EQ(picks["learning_progress"]["setting"], "far");
  EXPECT_NEAR(picks["learning_progress"]["regret"], 0.5, 1e-12);
  EXPECT_EQ(picks["common"]["setting"], "middle");
  EXPECT_NEAR(picks["random"]["regret"], 0.3 - 0.1, 1e-12);
}

TEST(ScoreCell, APoolWithoutABadSettingDoesNotCount) {
  json design = Design();
  design["settings"].erase(2);
  EXPECT_FALSE(ScoreCell({}, {"hopper", "medium", "all"}, design)["counts"]);
}

TEST(ScoreCell, ErrorsAreFromTheTargetWhereTheDemonstrationsWereMade) {
  DesignStudy study;
  study.target = {{"friction", 1.2}, {"gain", 0.9}, {"gravity", 1.0}};
  const json record = ScoreCell(study, {"hopper", "medium", "all"}, Design());
  EXPECT_NEAR(record["settings"][0]["error"], 0.05, 1e-12);  // 0.1 and 0 of one seed, 0 and 0.1 of the other
  EXPECT_NEAR(record["middle_error"], 0.15, 1e-12);          // 1.1 against 1.2 and 0.9
  EXPECT_THAT(Table2({record}), HasSubstr("| hopper-medium | 0.150 |"));
  EXPECT_NO_THROW(study.CheckIsOfThis({"hopper", "medium", "all"}, record));
  EXPECT_THAT(MessageOf<UsageError>([&] {
                DesignStudy().CheckIsOfThis({"hopper", "medium", "all"}, record);
              }),
              HasSubstr("take another --out"));
}

TEST(SetNamedValue, TakesKnownNamesAndNumbersAlone) {
  std::map<std::string, double> values = DesignStudy().target;
  SetNamedValue(values, "--target", "gain=1.3");
  EXPECT_EQ(values.at("gain"), 1.3);
  for (const char* wrong : {"gain", "gain=", "gain=x", "wind=1"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { SetNamedValue(values, "--target", wrong); }), HasSubstr("--target"));
  }
}

TEST(Table2, CountsZeroRegretAndShowsThePapersFigures) {
  const std::string table = Table2({ScoreCell({}, {"hopper", "medium", "all"}, Design())});
  EXPECT_THAT(table, HasSubstr("| hopper-medium | 0.100 | 0.100, 0.600 | 0.300 | 0.200 (0.000), regret 0.100 |"));
  EXPECT_THAT(table, HasSubstr("0.203 (0.025), 0.235 (0.034), 0.203 (0.025) |"));
  EXPECT_THAT(table, HasSubstr("of 1 pools"));
  EXPECT_THAT(table, HasSubstr("log ratios c(h) 1;"));
  EXPECT_THAT(table, HasSubstr("common judge 0."));
}

TEST(Table2, OneSeedHasNoSpreadAndNoDeviationToPickBy) {
  json design = Design();
  design["settings"] = {Setting("near", {{1.1, 0.9}}, 0, 0.1, 0.6, 0.5),
                        Setting("far", {{1.6, 1.6}}, 0, 0.3, 0.4, 0.4)};
  DesignStudy study;
  study.n_seeds = 1;
  const json record = ScoreCell(study, {"hopper", "medium", "all"}, design);
  EXPECT_FALSE(record["picks"].contains("design_deviation"));
  const std::string table = Table2({record});
  EXPECT_THAT(table, HasSubstr("| 0.350 | – | 0.600, regret 0.500 | 0.100 |"));
  EXPECT_THAT(table, Not(HasSubstr("design deviation 0")));
}

TEST(Figure2, ShowsEachParameterAloneAndJointly) {
  json alone = Design();
  alone["parameters"] = {{{"name", "gain"}}};
  alone["settings"] = {Setting("default", {{1.3}, {0.9}}, 0, 0, 0, 0)};
  const std::string table = Figure2(
      {ScoreCell({}, {"hopper", "expert", "gain"}, alone), ScoreCell({}, {"hopper", "expert", "all"}, Design())});
  EXPECT_THAT(
      table,
      HasSubstr("| hopper-expert |  | 0.200 (0.141) |  | 0.150 (0.071) | 0.050 (0.071) |  | 0.100, 0.100, 0.100 |"));
}

TEST(DesignStudy, Table2HasNineCellsAndEightSettingsFigure2ThirtySixAndOne) {
  const DesignStudy table2 = DesignStudy::Named("table2"), figure2 = DesignStudy::Named("figure2");
  EXPECT_EQ(table2.Cells().size(), 9u);
  EXPECT_EQ(figure2.Cells().size(), 36u);
  const RunConfig config = table2.ConfigOf(table2.Cells()[0]);
  EXPECT_EQ(config.settings.size(), 8u);
  std::set<std::string> distinct;
  for (auto [name, setting] : config.settings) distinct.insert(setting.ToJson().dump());
  EXPECT_EQ(distinct.size(), 8u) << "no two settings are the same";
  EXPECT_EQ(config.parameters.size(), 3u);
  EXPECT_EQ(figure2.ConfigOf(figure2.Cells()[0]).parameters.size(), 1u);
  EXPECT_NO_THROW(config.Check());
}

TEST(DesignStudy, UnknownNamesAreUsageErrorsThatNameTheKnown) {
  EXPECT_THAT(MessageOf<UsageError>([] { DesignStudy::Named("table9"); }), HasSubstr("table2|figure2"));
  DesignStudy study;
  study.tasks = {"hoper"};
  EXPECT_THAT(MessageOf<UsageError>([&] { study.Cells(); }), HasSubstr("hopper"));
}

}  // namespace oted::design_study_test
