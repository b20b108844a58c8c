#include "oted/matching/judge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::judge_test {

JudgeScore Gap(const std::vector<double>& truth, const PointMassOptions& options = {}) {
  const Dataset logs = PointMassLogs(truth, 40, options);
  const PointMassFactory factory(options);
  return JudgeReplays(factory, SplitForJudge(logs), {factory.parameters().Nominal()}, 1000, 200, RngKey(1));
}

TEST(AreaUnderCurve, IsTheShareOfPairsInOrder) {
  EXPECT_EQ(AreaUnderCurve({3, 4}, {1, 2}), 1);
  EXPECT_EQ(AreaUnderCurve({1, 2}, {3, 4}), 0);
  EXPECT_EQ(AreaUnderCurve({1, 3}, {2, 2, 4}), 2.0 / 6);
  EXPECT_EQ(AreaUnderCurve({1, 1}, {1}), 0.5);
}

TEST(JudgeReplays, SeesNothingInDataOfTheNominalSimulator) {
  const JudgeScore score = Gap({1, 1, 0.5});
  EXPECT_NEAR(score.auc, 0.5, 0.01);
  EXPECT_NEAR(score.accuracy, 0.5, 0.02);
  EXPECT_NEAR(score.common, std::numbers::ln2, 0.005);
  EXPECT_GE(score.n_data, 2000);
  EXPECT_EQ(score.n_data, score.n_simulated);
}

TEST(JudgeReplays, AskedOfRowsThatAreEqualButForRoundingWouldSeeNothing) {
  Array2<double> logged[2], simulated[2];
  Rng rng(1);
  for (int h = 0; h < 2; ++h) {
    for (int i = 0; i < 1000; ++i) {
      const double value = rng.Normal();
      logged[h].AppendRow(std::vector{value, value * value});
      simulated[h].AppendRow(std::vector{value + 1e-4, value * value});
    }
  }
  const JudgeScore score = JudgeSamples(logged, simulated, 200, RngKey(1));
  EXPECT_NEAR(score.common, std::numbers::ln2, 1e-3);
  EXPECT_NEAR(score.auc, 0.5, 1e-3);
}

TEST(JudgeReplays, SeesNothingWhereHalfOfTheStatesCannotBeSet) {
  PointMassOptions clipped;
  clipped.velocity_clip = 0.5;
  EXPECT_NEAR(Gap({1, 1, 0.5}, clipped).auc, 0.5, 0.01);
}

TEST(JudgeReplays, TellsAFarTargetNearlyAlways) {
  const JudgeScore score = Gap({2, 0.2, 0.5});
  EXPECT_GT(score.auc, 0.9);
  EXPECT_GT(score.accuracy, 0.8);
  EXPECT_LT(score.common, 0.45);
}

TEST(JudgeReplays, IsAnErrorWhereNoStateCanBeSet) {
  PointMassOptions clipped;
  clipped.velocity_clip = 0;
  EXPECT_NE(MessageOf<DataError>([&] { Gap({1, 1, 0.5}, clipped); }).find("can be set"), std::string::npos);
}

TEST(JudgeSimulator, RanksTheTruthAboveTheNominal) {
  const std::vector<double> truth = {1.6, 0.5, 0.5};
  const Dataset logs = PointMassLogs(truth, 30);
  const PointMassFactory factory;
  const JudgeHalves halves = SplitForJudge(logs);
  const EvidenceConfig evidence = CommonEvidence(factory.spec(), 200);
  const auto judge = [&](const std::vector<double>& z) {
    return JudgeSimulator(factory, {halves, nullptr, evidence, 200}, {z, z}, RngKey(2));
  };
  const JudgeScore at_truth = judge(truth), at_nominal = judge(factory.parameters().Nominal());
  EXPECT_GT(at_truth.common, at_nominal.common + 0.1);
  EXPECT_LT(at_truth.auc, at_nominal.auc - 0.1);
}

TEST(SplitForJudge, HalvesHoldEveryTransitionOnceAndNoEpisodeTwice) {
  const Dataset logs = PointMassLogs({1, 1, 0.5}, 7);
  const JudgeHalves halves = SplitForJudge(logs);
  EXPECT_EQ(halves.part[0].size() + halves.part[1].size(), logs.size());
  EXPECT_EQ(halves.part[0].Episodes().size() + halves.part[1].Episodes().size(), 7u);
  EXPECT_LE(std::abs(halves.part[0].size() - halves.part[1].size()), 20);  // an episode
}

}  // namespace oted::judge_test
