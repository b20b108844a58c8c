#include "oted/studies/density_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"

namespace oted::density_study_test {

using nlohmann::json;
using testing::HasSubstr;

json Seed(int seed, double mode, double yardstick, double yardstick_grid, std::vector<double> modes = {}) {
  return {{"seed", seed},
          {"mode", mode},
          {"std", 0.01},
          {"interval90", {mode - 0.02, mode + 0.02}},
          {"yardstick", yardstick},
          {"yardstick_grid", yardstick_grid},
          {"obstacles_seen", 10},
          {"cells_seen", 40},
          {"cpu_s", 12.0},
          {"modes", modes}};
}

json Record(std::vector<json> seeds, double target = 0.26) {
  return {{"schema", "oted.density_cell/1"},
          {"demonstrations", 5},
          {"target", target},
          {"designer", "gaussian"},
          {"realised", 0.25},
          {"discriminator_steps", 30},
          {"seeds", seeds}};
}

TEST(DensityErrors, AreRootMeanSquaresBesideTheYardsticksOnTheSameSeeds) {
  const DensityErrors errors = ErrorsOf(Record({Seed(1, 0.29, 0.30, 0.30), Seed(2, 0.22, 0.26, 0.25)}));
  EXPECT_EQ(errors.n_seeds, 2);
  EXPECT_NEAR(errors.rms, std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 2), 1e-12);
  EXPECT_NEAR(errors.bias, -0.005, 1e-12);
  EXPECT_NEAR(errors.yardstick_rms, 0.04 / std::sqrt(2), 1e-12);
  EXPECT_NEAR(errors.ratio, 1.25, 1e-12);  // 0.05 / 0.04
  EXPECT_EQ(errors.covered, 0);            // the test's intervals are as narrow as 0.02
  EXPECT_EQ(errors.within, 0);
  EXPECT_EQ(errors.yardstick_within, 0.5);
}

TEST(DensityErrors, NearestGridValueOf026Is025) {
  const DensityErrors errors = ErrorsOf(Record({Seed(1, 0.274, 0.26, 0.25), Seed(2, 0.276, 0.26, 0.30)}));
  EXPECT_EQ(errors.nearest, 0.5);
  EXPECT_EQ(errors.covered, 1);
  EXPECT_EQ(errors.yardstick_nearest, 0.5);
}

TEST(DensityErrors, TheRatiosIntervalIsAPointWhenAllSeedsAgree) {
  const DensityErrors errors = ErrorsOf(Record({Seed(1, 0.28, 0.27, 0.25), Seed(2, 0.24, 0.25, 0.25)}));
  EXPECT_NEAR(errors.ratio, 2, 1e-9);
  EXPECT_NEAR(errors.ratio_low, 2, 1e-9);
  EXPECT_NEAR(errors.ratio_high, 2, 1e-9);
}

TEST(ErrorCurves, MedianAndQuartilesOverSeedsByDiscriminatorStep) {
  const json curves = ErrorCurves(
      Record({Seed(1, 0, 0, 0, {0.36, 0.26}), Seed(2, 0, 0, 0, {0.46, 0.28}), Seed(3, 0, 0, 0, {0.16, 0.25})}));
  EXPECT_EQ(curves["steps"], json({30, 60}));
  EXPECT_NEAR(curves["median"][0], 0.10, 1e-12);
  EXPECT_NEAR(curves["high"][0], 0.15, 1e-12);  // between 0.10 and 0.20
  EXPECT_NEAR(curves["median"][1], 0.01, 1e-12);
  EXPECT_NEAR(curves["low"][1], 0.005, 1e-12);
}

TEST(Figure3, HasALineForEachRecordAndAPanelForEachDesigner) {
  const std::vector<json> records = {Record({Seed(1, 0.28, 0.27, 0.25, {0.28})}),
                                     Record({Seed(1, 0.11, 0.09, 0.10, {0.11})}, 0.10)};
  EXPECT_THAT(Figure3(records),
              HasSubstr("| 5 | gaussian | 0.26 | 0.250 | 1 | 0.0200 | +0.0200 | 0.0100 | 2.00 (2.00"));
  const json page = Figure3Page(records);
  ASSERT_EQ(page["panels"].size(), 1);
  EXPECT_EQ(page["panels"][0]["lines"].size(), 2);
  EXPECT_EQ(page["panels"][0]["lines"][1]["name"], "density 0.10");
  EXPECT_NEAR(page["panels"][0]["lines"][1]["level"], 0.01, 1e-12);
  EXPECT_EQ(page["rows"][0].size(), page["columns"].size());
}

TEST(DensityStudy, RefusesATargetThatIsNotSearchedAndAnUnknownDesigner) {
  DensityStudy study;
  study.targets = {0.7};
  EXPECT_THAT(MessageOf<UsageError>([&] { study.Cells(); }), HasSubstr("0.7"));
  study.targets = {0.1};
  study.designers = {"gausian"};
  EXPECT_THAT(MessageOf<UsageError>([&] { study.Cells(); }), HasSubstr("'gaussian'"));
}

TEST(DensityStudy, SeedsThatAreThereAreNotRunAgainAndOthersSettingsAreRefused) {
  const TestFolder folder;
  DensityStudy study;
  study.n_seeds = 2;
  // As small as a design can be: what is under test is the bookkeeping.
  study.assignments = {"clone.max_steps=1",           "design.images.n_iterations=2", "design.images.n_sims=4",
                       "design.adversarial.n_sims=4", "design.adversarial.n_steps=8", "design.discriminator.steps=1"};
  NullSink log;
  const RunContext one{&log, nullptr, 1}, two{&log, nullptr, 2};
  const DensityCell cell{2, 0.2, "gaussian"};
  const json alone = RunDensityCell(study, cell, folder / "a", "words", one);
  EXPECT_EQ(alone["seeds"].size(), 2);
  ASSERT_EQ(alone["seeds"][0]["modes"].size(), 3);  // two iterations, and the end
  EXPECT_NEAR(alone["seeds"][0]["modes"][2].get<double>(), alone["seeds"][0]["mode"].get<double>(), 1e-4);

  study.n_seeds = 3;
  const json more = RunDensityCell(study, cell, folder / "a", "words", two);
  ASSERT_EQ(more["seeds"].size(), 3);
  EXPECT_EQ(more["seeds"][0], alone["seeds"][0]);
  EXPECT_EQ(more["seeds"][1], alone["seeds"][1]);
  // The same from nothing on two threads: seeds do not depend on each other or on the threads.
  const json fresh = RunDensityCell(study, cell, folder / "b", "words", two);
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(fresh["seeds"][i]["mode"], more["seeds"][i]["mode"]);

  study.assignments.push_back("design.adversarial.lambda=0.1");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunDensityCell(study, cell, folder / "a", "words", one); }),
              HasSubstr("take another --out"));
}

}  // namespace oted::density_study_test
