#include "oted/rl/gae.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace oted::gae_test {

struct Estimate {
  std::vector<float> advantages, returns;
};

Estimate Estimated(const std::vector<float>& rewards, const std::vector<float>& values,
                   const std::vector<StepEnd>& ends, const std::vector<float>& last_values, double gamma,
                   double lambda) {
  Estimate out{std::vector<float>(rewards.size()), std::vector<float>(rewards.size())};
  GeneralizedAdvantages({rewards, values, ends, last_values}, gamma, lambda, {out.advantages, out.returns});
  return out;
}

const std::vector<StepEnd> kRunning(3, StepEnd::kNone);

TEST(GeneralizedAdvantages, AgreesWithTheSumWorkedOutByHand) {
  // gamma = 1/2, lambda = 1/2. deltas: 1 + 2/2 - 4 = -2,  2 + 6/2 - 2 = 3,  3 + 8/2 - 6 = 1;
  // A2 = 1,  A1 = 3 + 1/4,  A0 = -2 + (3 + 1/4) / 4.
  const Estimate got = Estimated({1, 2, 3}, {4, 2, 6}, kRunning, {8}, 0.5, 0.5);
  EXPECT_FLOAT_EQ(got.advantages[2], 1);
  EXPECT_FLOAT_EQ(got.advantages[1], 3.25f);
  EXPECT_FLOAT_EQ(got.advantages[0], -1.1875f);
  EXPECT_FLOAT_EQ(got.returns[0], 2.8125f);
}

TEST(GeneralizedAdvantages, WithLambdaOneReturnsAreDiscountedSumsAndWithZeroOneStepTargets) {
  const std::vector<float> rewards = {1, -2, 0.5}, values = {3, 1, 2};
  const double gamma = 0.9;
  const Estimate whole = Estimated(rewards, values, kRunning, {7}, gamma, 1),
                 one = Estimated(rewards, values, kRunning, {7}, gamma, 0);
  EXPECT_NEAR(whole.returns[0], 1 - 2 * gamma + 0.5 * gamma * gamma + 7 * std::pow(gamma, 3), 1e-6);
  EXPECT_NEAR(one.returns[0], 1 + gamma * 1, 1e-6);
  EXPECT_NEAR(one.returns[2], 0.5 + gamma * 7, 1e-6);
}

TEST(GeneralizedAdvantages, TheTrueValuesOfAChainLeaveNoAdvantage) {
  // Reward 1 per step for ever: V = 1 / (1 - gamma).
  const std::vector<float> values(3, 10);
  for (const float a : Estimated({1, 1, 1}, values, kRunning, {10}, 0.9, 0.95).advantages) EXPECT_NEAR(a, 0, 1e-6);
}

TEST(GeneralizedAdvantages, NothingOfTheNextEpisodeReachesTheOneBeforeIt) {
  std::vector<StepEnd> ends = kRunning;
  ends[1] = StepEnd::kEpisode;
  const Estimate one = Estimated({1, 2, 3}, {4, 2, 6}, ends, {8}, 0.5, 0.5);
  EXPECT_FLOAT_EQ(one.advantages[1], 0) << "2 - 2";
  EXPECT_FLOAT_EQ(one.advantages[0], -2);
  const Estimate other = Estimated({1, 2, -50}, {4, 2, 99}, ends, {-70}, 0.5, 0.5);
  EXPECT_EQ(other.advantages[0], one.advantages[0]);
  EXPECT_EQ(other.advantages[1], one.advantages[1]);
}

TEST(GeneralizedAdvantages, ADroppedStepIsBootstrappedThroughAndItsNumbersAreNotRead) {
  std::vector<StepEnd> ends = kRunning;
  ends[1] = StepEnd::kDropped;
  const Estimate got = Estimated({1, NAN, 3}, {4, 2, 6}, ends, {8}, 0.5, 0.5);
  EXPECT_FLOAT_EQ(got.advantages[2], 1);
  EXPECT_EQ(got.advantages[1], 0);
  EXPECT_FLOAT_EQ(got.advantages[0], 1 + 0.5f * 2 - 4) << "the value of the state in which the dropped step began";
}

TEST(GeneralizedAdvantages, LanesDoNotSeeEachOther) {
  const Estimate one = Estimated({1, 2, 3}, {4, 2, 6}, kRunning, {8}, 0.5, 0.5);
  const Estimate two =
      Estimated({1, 9, 2, -9, 3, 9}, {4, 1, 2, 0, 6, 5}, std::vector<StepEnd>(6, StepEnd::kNone), {8, 3}, 0.5, 0.5);
  for (size_t t = 0; t < 3; ++t) EXPECT_EQ(two.advantages[2 * t], one.advantages[t]);
}

}  // namespace oted::gae_test
