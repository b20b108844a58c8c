#include "oted/matching/grid_distribution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::grid_distribution_test {

ParameterSpace Space(double low = 0.0, double high = 0.6) {
  return ParameterSpace({{.name = "density", .field = "env/density", .low = low, .high = high}});
}

TEST(GridDistribution, ItsValuesAreTheMultiplesOfTheStepWithinTheBounds) {
  const GridDistribution q(Space(), 0.05);
  ASSERT_EQ(q.values(0).size(), 13u);
  for (size_t k = 0; k < 13; ++k) EXPECT_NEAR(q.values(0)[k], 0.05 * static_cast<double>(k), 1e-12);
  EXPECT_EQ(GridDistribution(Space(0.07, 0.24), 0.05).values(0).size(), 3u);
  EXPECT_NE(MessageOf<UsageError>([] { GridDistribution(Space(0.11, 0.14), 0.05); }).find("design.grid_step"),
            std::string::npos);
}

TEST(GridDistribution, StartsAtThePriorAndItsKlIsThatOfTheDefinition) {
  GridDistribution q(Space(), 0.3);  // 0, 0.3, 0.6
  EXPECT_NEAR(q.KlToPrior(), 0, 1e-12);
  q.SetProbabilities(0, {0.5, 0.25, 0.25});
  EXPECT_NEAR(q.KlToPrior(), 0.5 * std::log(1.5) + 0.5 * std::log(0.75), 1e-12);
}

TEST(GridDistribution, EvenDrawsComeAsOftenAsTheirProbabilitySays) {
  GridDistribution q(Space(), 0.3);
  q.SetProbabilities(0, {0.5, 0.3, 0.2});
  Rng rng(1);
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::vector<double> count(3, 0.0);
    for (const auto& draw : q.DrawEvenly(10, rng)) count[static_cast<size_t>(draw[0])] += 1;
    EXPECT_EQ(count, (std::vector<double>{5, 3, 2}));
  }
}

TEST(GridDistribution, FollowsRewardToItsBestValueAndTheStepIsTheNaturalGradient) {
  GridDistribution q(Space(), 0.05);
  Rng rng(2);
  for (int i = 0; i < 60; ++i) {
    const auto draws = q.DrawEvenly(32, rng);
    std::vector<double> rewards;
    for (const auto& draw : draws) rewards.push_back(-std::pow(q.ValuesAt(draw)[0] - 0.26, 2));
    const double mean = std::accumulate(rewards.begin(), rewards.end(), 0.0) / 32;
    for (double& reward : rewards) reward = 100 * (reward - mean);
    q.Ascend(draws, rewards, 0.0, 0.5);
  }
  EXPECT_NEAR(q.Mode()[0], 0.25, 1e-12);
  // One step from uniform: logits move by step times the mean advantage of each value's draws.
  GridDistribution one(Space(), 0.3);
  one.Ascend({{0}, {0}, {2}}, std::vector<double>{0.4, 0.2, -0.6}, 0.0, 0.5);
  const std::vector<double> raw = {std::exp(0.15), 1.0, std::exp(-0.3)};
  const double total = raw[0] + raw[1] + raw[2];
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(one.probabilities(0)[k], 0.98 * raw[k] / total + 0.02 / 3, 1e-12);
  }
}

TEST(GridDistribution, WithoutRewardItReturnsToThePrior) {
  GridDistribution q(Space(), 0.3);
  q.SetProbabilities(0, {0.9, 0.05, 0.05});
  for (int i = 0; i < 400; ++i) q.Ascend({{0}, {1}, {2}}, std::vector<double>{0, 0, 0}, 0.1, 0.5);
  for (const double p : q.probabilities(0)) EXPECT_NEAR(p, 1.0 / 3, 1e-3);
}

TEST(GridDistribution, ItsCumulativeSpreadsEachValueOverTheStepAroundIt) {
  GridDistribution q(Space(), 0.3);
  q.SetProbabilities(0, {0.5, 0.3, 0.2});
  EXPECT_NEAR(q.Cumulative(0, 0.15), 0.5, 1e-12);  // 0 covers [0, 0.15]: the bound cuts it
  EXPECT_NEAR(q.Cumulative(0, 0.3), 0.5 + 0.15, 1e-12);
  EXPECT_NEAR(q.Cumulative(0, 0.6), 1.0, 1e-12);
  EXPECT_NEAR(q.Mean()[0], 0.3 * 0.3 + 0.2 * 0.6, 1e-12);
}

}  // namespace oted::grid_distribution_test
