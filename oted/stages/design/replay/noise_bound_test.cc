#include "oted/stages/design/replay/noise_bound.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/rng.h"

namespace oted::noise_bound_test {

/// Episodes of a slow sine, a ramp and readings at random, with noise on them.
Dataset Logs(int n_rows, double noise) {
  Dataset logs;
  Rng rng(1);
  for (int i = 0; i < n_rows; ++i) {
    logs.observations.AppendRow(std::vector<double>{std::sin(0.1 * i) + noise * rng.Normal(),
                                                    0.3 * i + noise * rng.Normal(), rng.Uniform(-1, 1)});
    logs.actions.AppendRow(std::vector<double>{0});
    logs.terminals.push_back(0);
    logs.timeouts.push_back(i == n_rows - 1);
  }
  logs.next_observations = logs.observations;
  return logs;
}

TEST(LargestNoise, IsSomewhatMoreThanTheNoiseOfSmoothReadings) {
  const Eigen::VectorXd largest = LargestNoise(Logs(4000, 0.02));
  for (const int c : {0, 1}) {
    EXPECT_GT(largest[c], 1.1 * 0.02);
    EXPECT_LT(largest[c], 1.45 * 0.02);
  }
  EXPECT_GT(largest[2], 1 / std::sqrt(3.0)) << "what has no course at all may be noise";
}

TEST(LargestNoise, ExactReadingsHaveNoneThatMatters) {
  const Eigen::VectorXd largest = LargestNoise(Logs(400, 0));
  EXPECT_LT(largest[0], 1e-6) << "a sine is a polynomial but for high orders";
  EXPECT_LT(largest[1], 1e-10);
}

TEST(LargestNoise, IsUnknownOfEpisodesOfFourReadings) { EXPECT_TRUE(std::isinf(LargestNoise(Logs(4, 0.02))[0])); }

}  // namespace oted::noise_bound_test
