#include "oted/rl/policy_evaluation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/testing.h"

namespace oted::policy_evaluation_test {

const BatchPolicy kPush = [](std::span<const double>, int, std::span<double> actions) {
  std::fill(actions.begin(), actions.end(), 1.0);
};

TEST(EvaluateBatchPolicy, FiguresAreThoseOfTheClosedForm) {
  const RngKey key(4);
  const PolicyEvaluation result =
      EvaluateBatchPolicy(PointMassFactory({.max_episode_steps = 7}), kPush, {0.5, 1, 0}, 9, 2, key);
  double sum = 0, squares = 0, low = INFINITY, high = -INFINITY;
  for (uint64_t k = 0; k < 9; ++k) {
    Rng rng = key.Index(k).MakeRng();
    const double x0 = rng.Uniform(-1, 1);
    double expected = 0;
    for (int t = 1; t <= 7; ++t) expected -= std::pow(x0 + 0.05 * t, 2);
    EXPECT_NEAR(result.episodes[k].episode_return, expected, 1e-12);
    sum += expected;
    squares += expected * expected;
    low = std::min(low, expected);
    high = std::max(high, expected);
  }
  EXPECT_NEAR(result.mean_return, sum / 9, 1e-12);
  EXPECT_NEAR(result.std_return, std::sqrt((squares - sum * sum / 9) / 8), 1e-9);
  EXPECT_NEAR(result.min_return, low, 1e-12);
  EXPECT_NEAR(result.max_return, high, 1e-12);
  EXPECT_DOUBLE_EQ(result.mean_length, 7);
  EXPECT_EQ(result.n_truncated, 9);
}

TEST(EvaluateBatchPolicy, CountsTheWaysInWhichEpisodesEnd) {
  const PolicyEvaluation fallen =
      EvaluateBatchPolicy(PointMassFactory({.terminate_beyond = 1.5}), kPush, {1, 1, 0}, 12, 1, RngKey(4));
  EXPECT_GT(fallen.n_terminated, 0);
  EXPECT_EQ(fallen.n_terminated + fallen.n_truncated, 12);
  const PolicyEvaluation broken =
      EvaluateBatchPolicy(PointMassFactory({.diverge_beyond = 1.5}), kPush, {1, 1, 0}, 12, 1, RngKey(4));
  EXPECT_EQ(broken.n_diverged, fallen.n_terminated);
  EXPECT_EQ(broken.n_truncated, fallen.n_truncated);
  double lowest = 0;
  for (const EpisodeResult& episode : broken.episodes) lowest = std::min(lowest, episode.episode_return);
  EXPECT_EQ(broken.min_return, lowest);
}

TEST(RunPolicy, RunsEpisodeKInTheKthParametersAndRepeatsThem) {
  TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  policy.net().parameters()[4] = 0.5f;  // mean action tanh(0.5), whatever the state
  const RngKey key(6);
  const std::vector<std::vector<double>> z = {{1, 1, 0}, {0.5, 1, 0}};
  double expected = 0;
  for (uint64_t k = 0; k < 5; ++k) {
    Rng rng = key.Index(k).MakeRng();
    const double x0 = rng.Uniform(-1, 1), step = 0.1 * std::tanh(0.5) * z[k % 2][0];
    for (int t = 1; t <= 20; ++t) expected -= std::pow(x0 + step * t, 2) / 5;
  }
  EXPECT_NEAR(MeanReturn(RunPolicy(PointMassFactory(), policy, {.z = z, .n_episodes = 5, .key = key})), expected, 1e-5);
}

}  // namespace oted::policy_evaluation_test
