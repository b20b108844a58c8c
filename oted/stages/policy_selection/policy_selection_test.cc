#include "oted/stages/policy_selection/policy_selection.h"

#include <gtest/gtest.h>

#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/sim/testing.h"

namespace oted::policy_selection_test {

/// The mean action tanh(-stiffness x): 0 does nothing, more drives the mass to zero.
TanhGaussianPolicy Spring(float stiffness) {
  TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  std::fill(policy.net().parameters().begin(), policy.net().parameters().end(), 0.0f);
  policy.net().parameters()[0] = -stiffness;
  return policy;
}

const std::vector<std::vector<double>> kModes = {{0.5, 1, 0}, {1.0, 1, 0}, {2.0, 0.5, 1}};

PolicySelectionResult SelectIn(const SimulatorFactory& factory, const std::vector<TanhGaussianPolicy>& agents,
                               const std::vector<std::vector<double>>& modes, int n_episodes, int n_threads = 1) {
  NullSink log;
  std::vector<const Policy*> policies;
  for (const TanhGaussianPolicy& agent : agents) policies.push_back(&agent);
  return SelectPolicy(
      {factory, policies, modes, n_episodes, ActionNoise::kMean, RngKey(9), {.log = &log, .n_threads = n_threads}});
}

PolicySelectionResult Select(const std::vector<TanhGaussianPolicy>& agents, int n_threads = 1) {
  return SelectIn(PointMassFactory(), agents, kModes, 6, n_threads);
}

TEST(SelectPolicy, PicksTheBetterOfTwoWhereverItStands) {
  EXPECT_EQ(Select({Spring(0), Spring(3)}).selected, 1);
  EXPECT_EQ(Select({Spring(3), Spring(0)}).selected, 0);
  EXPECT_EQ(Select({Spring(-3), Spring(3), Spring(0)}).selected, 1);
}

TEST(SelectPolicy, ReturnsOneNumberPerAgentAndSimulatorAndTheirMeans) {
  const auto result = Select({Spring(0), Spring(3)});
  ASSERT_EQ(result.returns.size(), 2u);
  ASSERT_EQ(result.mean_return.size(), 2u);
  for (size_t j = 0; j < 2; ++j) {
    ASSERT_EQ(result.returns[j].size(), kModes.size());
    EXPECT_DOUBLE_EQ(result.mean_return[j], (result.returns[j][0] + result.returns[j][1] + result.returns[j][2]) / 3);
  }
  // Who does nothing stays where it starts, whatever the parameters: equal returns show equal start states.
  EXPECT_EQ(result.returns[0][0], result.returns[0][1]);
  EXPECT_EQ(result.returns[0][0], result.returns[0][2]);
  EXPECT_LT(result.returns[0][0], 0);
  EXPECT_NE(result.returns[1][0], result.returns[1][1]) << "who acts meets different gains";
}

TEST(SelectPolicy, EqualAgentsGetEqualReturnsAndTheFirstIsTaken) {
  const auto result = Select({Spring(1), Spring(1)});
  EXPECT_EQ(result.returns[0], result.returns[1]);
  EXPECT_EQ(result.selected, 0);
}

TEST(SelectPolicy, WhoBreaksThePhysicsDoesNotWinByAnEarlyEnd) {
  // Rewards are negative: pushing the mass past the edge ends the episode at a return near zero.
  const PointMassFactory factory({.diverge_beyond = 1.05, .max_episode_steps = 60});
  const std::vector<TanhGaussianPolicy> agents = {Spring(-9), Spring(0)};
  const std::vector<std::vector<double>> modes = {{2.0, 0.2, 0}};
  const auto result = SelectIn(factory, agents, modes, 6);
  ASSERT_EQ(result.n_diverged, (std::vector<int>{6, 0}));
  EXPECT_GT(MeanReturn(RunPolicy(factory, agents[0], {.z = modes, .n_episodes = 6, .key = RngKey(9)})),
            result.mean_return[1])
      << "the case tests nothing when the early end is no advantage";
  EXPECT_EQ(result.selected, 1);
  EXPECT_LE(result.mean_return[0], result.mean_return[1]);
}

TEST(SelectPolicy, AmongEqualMeansTheOneWithFewerDivergedEpisodesIsTaken) {
  // With one episode each the failure counts as the other's return.
  const PointMassFactory factory({.diverge_beyond = 1.05, .max_episode_steps = 60});
  const auto result = SelectIn(factory, {Spring(-9), Spring(0)}, {{2.0, 0.2, 0}}, 1);
  ASSERT_EQ(result.n_diverged, (std::vector<int>{1, 0}));
  EXPECT_EQ(result.mean_return[0], result.mean_return[1]);
  EXPECT_EQ(result.selected, 1);
}

TEST(SelectPolicy, DoesNotDependOnThreads) {
  const std::vector<TanhGaussianPolicy> agents = {Spring(0), Spring(1), Spring(3)};
  EXPECT_EQ(Select(agents, 1).returns, Select(agents, 3).returns);
}

}  // namespace oted::policy_selection_test
