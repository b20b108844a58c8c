#include "oted/data/sensor_noise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::sensor_noise_test {

constexpr int kRows = 3000, kEpisodeRows = 100;

/// Observations (i, -i) going on within episodes of a hundred rows, with states and rewards.
Dataset Ramp() {
  Dataset logs;
  logs.observations = logs.next_observations = logs.qpos = logs.qvel = Array2<double>(kRows, 2);
  logs.actions = Array2<double>(kRows, 1);
  for (int i = 0; i < kRows; ++i) {
    logs.observations(i, 0) = i;
    logs.observations(i, 1) = -i;
    logs.next_observations(i, 0) = i + 1;
    logs.next_observations(i, 1) = -i - 1;
    logs.actions(i, 0) = 0.5 * i;
    logs.rewards.push_back(i);
    logs.terminals.push_back(0);
    logs.timeouts.push_back(i % kEpisodeRows == kEpisodeRows - 1);
  }
  return logs;
}

TEST(WithSensorNoise, EveryObservationGetsIndependentNoiseOfTheGivenDeviation) {
  const Dataset clean = Ramp(), noisy = WithSensorNoise(clean, 0.2, RngKey(1));
  double square[2] = {0, 0}, product = 0, successive = 0;
  for (int i = 0; i < kRows; ++i) {
    const double a = noisy.next_observations(i, 0) - clean.next_observations(i, 0);
    const double b = noisy.next_observations(i, 1) - clean.next_observations(i, 1);
    square[0] += a * a / kRows;
    square[1] += b * b / kRows;
    product += a * b / kRows;
    successive += a * (noisy.observations(i, 0) - clean.observations(i, 0)) / kRows;
  }
  // Five standard errors: of a variance sqrt(2 / n) of it, of a product 1 / sqrt(n).
  for (const double s : square) EXPECT_NEAR(s / 0.04, 1, 5 * std::sqrt(2.0 / kRows));
  EXPECT_NEAR(product / 0.04, 0, 5 / std::sqrt(kRows));
  EXPECT_NEAR(successive / 0.04, 0, 5 / std::sqrt(kRows));
}

TEST(WithSensorNoise, SuccessorAndNextObservationAreOneReadingWithinAnEpisode) {
  const Dataset noisy = WithSensorNoise(Ramp(), 0.2, RngKey(1));
  for (int i = 0; i + 1 < kRows; ++i) {
    for (int j = 0; j < 2; ++j) {
      if (i % kEpisodeRows == kEpisodeRows - 1) {
        EXPECT_NE(noisy.next_observations(i, j), noisy.observations(i + 1, j)) << "across the seam";
      } else {
        ASSERT_EQ(noisy.next_observations(i, j), noisy.observations(i + 1, j));
      }
    }
  }
}

TEST(WithSensorNoise, LeavesOutFullStatesAndKeepsTheRest) {
  const Dataset clean = Ramp(), noisy = WithSensorNoise(clean, 0.2, RngKey(1));
  EXPECT_FALSE(noisy.has_states());
  EXPECT_TRUE(noisy.qvel.empty());
  EXPECT_EQ(noisy.actions.values().size(), clean.actions.values().size());
  EXPECT_EQ(noisy.actions(17, 0), clean.actions(17, 0));
  EXPECT_EQ(noisy.rewards, clean.rewards);
  EXPECT_EQ(noisy.timeouts, clean.timeouts);
  EXPECT_EQ(noisy.terminals, clean.terminals);
}

TEST(WithSensorNoise, IsNamedByItsKey) {
  const Dataset one = WithSensorNoise(Ramp(), 0.2, RngKey(1)), again = WithSensorNoise(Ramp(), 0.2, RngKey(1)),
                other = WithSensorNoise(Ramp(), 0.2, RngKey(2));
  EXPECT_EQ(one.observations(5, 0), again.observations(5, 0));
  EXPECT_NE(one.observations(5, 0), other.observations(5, 0));
}

TEST(WithSensorNoise, RefusesWhatIsNoDeviation) {
  for (const double std : {0.0, -1.0, std::nan("")}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { WithSensorNoise(Ramp(), std, RngKey(1)); }),
                testing::HasSubstr("positive"));
  }
}

}  // namespace oted::sensor_noise_test
