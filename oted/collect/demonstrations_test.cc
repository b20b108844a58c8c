#include "oted/collect/demonstrations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/sim/testing.h"

namespace oted::demonstrations_test {

using testing::HasSubstr;

/// Pushes with u ~ N(mean, 0.3^2), wherever the mass is.
TanhGaussianPolicy Pushing(float mean) {
  TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  policy.net().parameters()[4] = mean;
  policy.net().parameters()[5] = std::log(0.3f);
  return policy;
}

Dataset Collect(const PointMassOptions& options, const std::vector<double>& z, int n_episodes, int n_threads = 1) {
  return CollectDemonstrations(PointMassFactory(options), z, Pushing(0.5f), n_episodes, RngKey(1), n_threads);
}

TEST(CollectDemonstrations, EpisodesTerminalsAndTimeoutsAreTheTasks) {
  const std::vector<double> z = {1.5, 1, 0};
  const Dataset dataset = Collect({.terminate_beyond = 1.3, .max_episode_steps = 15}, z, 12);
  dataset.Check();
  const auto episodes = dataset.Episodes();
  ASSERT_EQ(episodes.size(), 12u);
  int n_terminated = 0;
  for (const Episode& episode : episodes) {
    n_terminated += episode.terminated;
    EXPECT_EQ(dataset.observations(episode.begin, 1), 0) << "an episode starts at rest";
    for (int i = episode.begin; i < episode.end; ++i) {
      const double x = dataset.next_observations(i, 0);
      EXPECT_EQ(dataset.terminals[static_cast<size_t>(i)], std::abs(x) > 1.3);
      EXPECT_EQ(dataset.timeouts[static_cast<size_t>(i)], std::abs(x) <= 1.3 && i - episode.begin == 14);
      // Logged as float32: half a unit in the last place of numbers below 2 is 6e-8, and x^2 may carry it three times.
      EXPECT_NEAR(x, dataset.observations(i, 0) + 0.15 * dataset.actions(i, 0), 2e-7);
      EXPECT_NEAR(dataset.rewards[static_cast<size_t>(i)], -x * x, 4e-7);
      EXPECT_EQ(x, static_cast<double>(static_cast<float>(x)));
      if (i + 1 < episode.end) {
        EXPECT_EQ(dataset.observations(i + 1, 0), x);
      }
    }
  }
  EXPECT_GT(n_terminated, 0);
  EXPECT_LT(n_terminated, 12);
}

TEST(CollectDemonstrations, ActionsAreSampledFromThePolicy) {
  const Dataset dataset = Collect({}, {1, 1, 0}, 200);
  double mean = 0, squares = 0;
  const double n = dataset.size();
  for (int i = 0; i < dataset.size(); ++i) {
    const double u = std::atanh(dataset.actions(i, 0));
    mean += u / n;
    squares += u * u / n;
  }
  EXPECT_NEAR(mean, 0.5, 5 * 0.3 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares - mean * mean), 0.3, 5 * 0.3 / std::sqrt(2 * n));
}

TEST(CollectDemonstrations, NothingInTheDatasetTellsTheTruthThatHadNoEffect) {
  // `idle` is a parameter like any other, but it moves nothing: datasets that differ would carry it.
  const TestFolder folder;
  WriteDataset(Collect({}, {1.2, 1, 0.1}, 5), folder / "a.npz");
  WriteDataset(Collect({}, {1.2, 1, 0.9}, 5), folder / "b.npz");
  EXPECT_EQ(ReadFile(folder / "a.npz"), ReadFile(folder / "b.npz"));
  WriteDataset(Collect({}, {1.3, 1, 0.1}, 5), folder / "c.npz");
  EXPECT_NE(ReadFile(folder / "a.npz"), ReadFile(folder / "c.npz"));
}

TEST(CollectDemonstrations, TheSameAtAnyThreadCount) {
  const Dataset one = Collect({}, {1, 1, 0}, 5, 1), two = Collect({}, {1, 1, 0}, 5, 2);
  EXPECT_EQ(one.observations, two.observations);
  EXPECT_EQ(one.actions, two.actions);
}

TEST(CollectDemonstrations, ADivergingTargetIsADataError) {
  MessageOf<DataError>([] { Collect({.diverge_beyond = 0.9}, {2, 1, 0}, 20); });
}

SacConfig SmallSac(int64_t n_steps, int64_t eval_interval, std::vector<int> hidden) {
  SacConfig config;
  config.n_steps = n_steps;
  config.learning_starts = 100;
  config.eval_interval = eval_interval;
  config.batch_size = 32;
  config.hidden = std::move(hidden);
  return config;
}

TEST(TrainBehaviorPolicies, ExpertIsTheBestAndMediumNearestAThirdOnTheWayUp) {
  const TestFolder folder;
  SacConfig config = SmallSac(2000, 200, {16, 16});
  config.learning_rate = 1e-3;
  NullSink log;
  const PointMassFactory factory;
  const BehaviorPolicies policies = TrainBehaviorPolicies(
      {factory, "point mass", factory.parameters().Nominal(), config, 3}, folder.path(), {&log, nullptr, 1});

  const nlohmann::json record = ReadJson(folder / "training.json");
  const auto steps = record["learning_curve"]["step"].get<std::vector<int64_t>>();
  const auto returns = record["learning_curve"]["mean_return"].get<std::vector<double>>();
  ASSERT_EQ(steps.size(), 10u);
  const std::vector<double> nominal = factory.parameters().Nominal();
  const auto judge = [&](int64_t step) {
    const TanhGaussianPolicy snapshot =
        TanhGaussianPolicy::Load(folder.path() / "snapshots" / (std::to_string(step) + ".npz"));
    return MeanReturn(
        RunPolicy(factory, snapshot,
                  {.z = {nominal}, .n_episodes = 20, .key = RngKey(3).Stage("behavior policies").Stage("judge")}));
  };
  std::vector<double> sorted = returns;
  std::ranges::sort(sorted, std::greater<>());
  double best = -INFINITY;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (returns[i] >= sorted[4]) best = std::max(best, judge(steps[i]));
  }
  EXPECT_EQ(policies.expert_return, best) << "of the five that were evaluated best";
  EXPECT_EQ(judge(policies.expert_step), best);
  // Every snapshot on the way up, judged by hand on the same 20 episodes.
  const double third = policies.random_return + (policies.expert_return - policies.random_return) / 3;
  double nearest = INFINITY;
  int64_t nearest_step = 0;
  for (const int64_t step : steps) {
    if (step > policies.expert_step) break;
    const double mean_return = judge(step);
    const double distance = std::abs(mean_return - third);
    if (distance < nearest) nearest_step = step;
    nearest = std::min(nearest, distance);
  }
  EXPECT_EQ(policies.medium_step, nearest_step);
  EXPECT_EQ(std::abs(policies.medium_return - third), nearest);
  EXPECT_LE(policies.medium_step, policies.expert_step);
  EXPECT_GT(policies.expert_return, policies.random_return);
  EXPECT_EQ(record["expert"]["mean_return"], policies.expert_return);

  const TanhGaussianPolicy loaded = TanhGaussianPolicy::Load(folder / "expert.npz");
  EXPECT_EQ(loaded.net().parameters(), policies.expert.net().parameters());
  EXPECT_EQ(TanhGaussianPolicy::Load(folder / "medium.npz").net().parameters(), policies.medium.net().parameters());
}

TEST(TrainBehaviorPolicies, OnlyMoreStepsOfTheSameTrainingFollowInItsFolder) {
  const TestFolder folder;
  const SacConfig config = SmallSac(300, 100, {8});
  NullSink log;
  const PointMassFactory factory;
  std::vector<double> z = factory.parameters().Nominal();
  nlohmann::json task = {{"reward", "x"}};
  const auto train = [&](const SacConfig& changed, uint64_t seed) {
    return TrainBehaviorPolicies({factory, task, z, changed, seed}, folder.path(), {&log, nullptr, 1});
  };
  const auto message = [&](const SacConfig& changed, uint64_t seed) {
    return MessageOf<UsageError>([&] { train(changed, seed); });
  };
  train(config, 3);
  SacConfig other = config;
  other.gamma = 0.5;
  EXPECT_THAT(message(other, 3), HasSubstr("sac.gamma 0.99, not 0.5; only more"));
  EXPECT_THAT(message(config, 4), HasSubstr("seed 3, not 4"));
  other = config;
  other.n_steps = 200;
  EXPECT_THAT(message(other, 3), HasSubstr("sac.n_steps 300, not 200"));
  z[0] = 1.1;
  EXPECT_THAT(message(config, 3), HasSubstr("parameters.env/gain 1.0, not 1.1"));
  z[0] = 1;
  task["reward"] = "-x";
  EXPECT_THAT(message(config, 3), HasSubstr("task.reward \"x\", not \"-x\""));
  task["reward"] = "x";
  // Beyond start_steps it would have begun several times.
  other.n_steps = other.start_steps + 100;
  EXPECT_THAT(message(other, 3), HasSubstr("sac.n_steps 300, not"));
  other.n_steps = 400;
  EXPECT_EQ(train(other, 3).expert_step % 100, 0);
  EXPECT_EQ(ReadJson(folder / "training.json")["learning_curve"]["step"].size(), 4u);
  for (const char* damaged : {"[]", "3", "{}", "{\"sac\":{\"n_steps\":1}}", "{\"sac\":3}"}) {
    WriteFileAtomically(folder.path() / "behavior.json", damaged);
    EXPECT_THROW(train(other, 3), Error) << damaged;
  }
  RemoveFile(folder.path() / "behavior.json");
  EXPECT_THAT(message(other, 3), HasSubstr("no behavior.json that says of what"));
}

}  // namespace oted::demonstrations_test
