#include "oted/rl/ppo.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/rl/testing.h"
#include "oted/sim/testing.h"

namespace oted::ppo_test {

PpoConfig SmallConfig() {
  PpoConfig config;
  config.n_steps = 512;
  config.n_lanes = 4;
  config.rollout_steps = 32;
  config.n_epochs = 3;
  config.batch_size = 32;
  config.hidden = {16};
  config.filters = {4};
  config.eval_interval = 256;
  config.eval_episodes = 4;
  return config;
}

struct Training {
  const std::filesystem::path folder;
  CorridorOptions options = {};
  PpoConfig config = SmallConfig();
  EpisodeParameters parameters = [](Rng&) { return std::vector<double>{0.0}; };
  EvaluationObserver observer = {};
  const std::atomic<bool>* stop = nullptr;
  int n_threads = 1;
  uint64_t seed = 5;

  PpoResult operator()() const {
    NullSink log;
    DrawnEpisodes source(parameters);
    return TrainAgent({.factory = CorridorFactory(options),
                       .source = source,
                       .eval_parameters = {{0.0}},
                       .key = RngKey(seed),
                       .folder = folder,
                       .run_name = "agent",
                       .context = {&log, stop, n_threads},
                       .observer = observer},
                      config);
  }
};

std::string Bytes(const PpoResult& result) {
  const auto& p = result.policy.net().parameters();
  return std::string(reinterpret_cast<const char*>(p.data()), p.size() * sizeof(float));
}

class TrainPpoOn : public testing::TestWithParam<bool> {};

TEST_P(TrainPpoOn, FindsTheShortestWayToEitherEnd) {
  const TestFolder folder;
  Training run{folder.path(), {.as_image = GetParam()}};
  run.config.n_steps = 6144;
  run.config.learning_rate = 3e-3;
  run.config.gamma = 0.9;  // without it there is no hurry
  const PpoResult result = run();
  const auto episodes =
      RunPolicy(CorridorFactory(run.options), result.policy, {.z = {{0.0}}, .n_episodes = 40, .key = RngKey(77)});
  for (const EpisodeResult& episode : episodes) {
    EXPECT_EQ(episode.end, LaneStatus::kTerminated);
    EXPECT_EQ(episode.n_steps, 2) << "from the middle";
    EXPECT_EQ(episode.episode_return, 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Observations, TrainPpoOn, testing::Bool(),
                         [](const auto& param) { return param.param ? "Images" : "Vectors"; });

TEST(TrainPpo, NetworksThatDivergeAreAnErrorThatNamesTheirLearningRate) {
  const TestFolder folder;
  Training run{folder.path()};
  run.config.learning_rate = 1e30;
  EXPECT_THAT(MessageOf<DataError>([&] { run(); }), testing::HasSubstr("lower ppo.learning_rate (it is 1e+30)"));
}

TEST(TrainPpo, AStoppedRunThatGoesOnGivesTheBytesOfAnUninterruptedOne) {
  const TestFolder whole, parts;
  const EpisodeParameters draw = [](Rng& rng) { return std::vector<double>{rng.Uniform() < 0.5 ? 0.0 : 0.4}; };
  Training uninterrupted{whole.path()};
  uninterrupted.config.n_steps = 700;
  uninterrupted.config.keep = KeptPolicy::kLast;
  uninterrupted.parameters = draw;
  const PpoResult expected = uninterrupted();

  std::atomic<bool> stop = false;
  int segments = 0;
  Training parted{parts.path(), {}, uninterrupted.config, draw};
  parted.stop = &stop;
  parted.observer = [&](int64_t, const Policy&, double) {
    ++segments;
    stop = true;
  };
  EXPECT_THROW(parted(), Interrupted);
  EXPECT_EQ(segments, 1);
  stop = false;
  EXPECT_THROW(parted(), Interrupted);
  EXPECT_EQ(segments, 2);
  parted.stop = nullptr;
  const PpoResult resumed = parted();
  EXPECT_EQ(Bytes(resumed), Bytes(expected));
  EXPECT_EQ(resumed.eval_steps, (std::vector<int64_t>{256, 512, 768})) << "whole rollouts of 128 steps";
  EXPECT_EQ(resumed.eval_returns, expected.eval_returns);
  // Complete: nothing is trained again.
  EXPECT_EQ(Bytes(parted()), Bytes(expected));
  EXPECT_EQ(segments, 3);
}

TEST(TrainPpo, TheBestEvaluatedPolicyIsKept) {
  // With restless learning almost any seed has a best policy that is not its last.
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const TestFolder folder;
    Training run{folder.path()};
    run.seed = seed;
    run.config.n_steps = 1280;
    run.config.learning_rate = 0.1;
    std::vector<std::string> seen;
    run.observer = [&](int64_t, const Policy& policy, double) {
      PpoResult copy;
      copy.policy = dynamic_cast<const CategoricalPolicy&>(policy);
      seen.push_back(Bytes(copy));
    };
    const PpoResult result = run();
    const auto best = std::max_element(result.eval_returns.begin(), result.eval_returns.end());
    EXPECT_EQ(result.eval_return, *best);
    EXPECT_EQ(Bytes(result), seen[static_cast<size_t>(best - result.eval_returns.begin())]);
    if (best + 1 != result.eval_returns.end()) return;
  }
  FAIL() << "no seed had its best policy before its last";
}

TEST(TrainPpo, SameSeedSameBytesAtOneAndTwoThreadsAndAnotherSeedOthers) {
  const TestFolder one, two, other;
  Training run_one{one.path()}, run_two{two.path()}, run_other{other.path()};
  run_two.n_threads = 2;
  run_other.seed = 6;
  EXPECT_EQ(Bytes(run_one()), Bytes(run_two()));
  EXPECT_NE(Bytes(run_one()), Bytes(run_other()));
}

/// The value of the first state as the critic in the checkpoint has it.
double ValueOfStart(const std::filesystem::path& folder, const PpoConfig& config) {
  const NpzArrays arrays = ReadNpz(folder / "checkpoint.npz");
  const auto& parameters = std::get<std::vector<float>>(arrays.at("ppo/critic/parameters").values);
  // With one state alone the whole network is a constant: weights meet zeros, since the observation never varies.
  Mlp net(2, config.hidden, 1);
  EXPECT_EQ(net.n_parameters(), parameters.size());
  std::copy(parameters.begin(), parameters.end(), net.parameters().begin());
  const std::vector<float> x = {0, 0};
  MlpPass pass;
  return static_cast<double>(*pass.Forward(net, x.data(), 1));
}

/// One cell, one reward per step, for ever but for the clock.
class Treadmill : public Corridor {
 public:
  Treadmill(const CorridorOptions& options, int n_lanes) : Corridor(options, n_lanes) {}
  std::span<const double> observation(int) const override { return kNothing; }

 private:
  static constexpr std::array<double, 2> kNothing = {1, 1};
};
class TreadmillFactory : public CorridorFactory {
 public:
  explicit TreadmillFactory(const CorridorOptions& options) : CorridorFactory(options), options_(options) {}
  std::unique_ptr<Simulator> Make(int n_lanes, int) const override {
    return std::make_unique<Treadmill>(options_, n_lanes);
  }

 private:
  CorridorOptions options_;
};

TEST(TrainPpo, TimeLimitsAreBootstrappedThrough) {
  // Reward 1 in every step: V = 1 / (1 - gamma) = 5 if the clock is no end. Were it one, episodes of two steps would
  // have a mean value of 1.4 over their states.
  const TestFolder folder;
  PpoConfig config = SmallConfig();
  config.n_steps = 12'800;
  config.eval_interval = 12'800;
  config.gamma = 0.8;
  config.n_epochs = 10;
  config.learning_rate = 1e-2;
  config.max_grad_norm = 10;
  NullSink log;
  DrawnEpisodes source([](Rng&) { return std::vector<double>{0.0}; });
  TrainAgent({.factory = TreadmillFactory({.max_episode_steps = 2, .endless_reward = true}),
              .source = source,
              .eval_parameters = {{0.0}},
              .key = RngKey(1),
              .folder = folder.path(),
              .run_name = "agent",
              .context = {&log, nullptr, 1}},
             config);
  EXPECT_NEAR(ValueOfStart(folder.path(), config), 5, 0.1);
}

TEST(TrainPpo, DivergedStepsLeaveNoTrace) {
  const TestFolder folder;
  Training run{folder.path(), {.diverge_share = 0.1}};
  const PpoResult result = run();
  for (const float p : result.policy.net().parameters()) ASSERT_TRUE(std::isfinite(p));
  const NpzArrays arrays = ReadNpz(folder / "checkpoint.npz");
  for (const float p : std::get<std::vector<float>>(arrays.at("ppo/critic/parameters").values)) {
    ASSERT_TRUE(std::isfinite(p));
  }
}

TEST(TrainPpo, EachEpisodeRunsWithParametersDrawnAnew) {
  const TestFolder folder;
  Training run{folder.path(), {.max_episode_steps = 4}};
  int n_drawn = 0;
  run.parameters = [&](Rng&) {
    ++n_drawn;
    return std::vector<double>{0.9};
  };
  run();
  EXPECT_GT(n_drawn, 512 / 4) << "an episode has four steps at most";
}

TEST(TrainPpo, ContinuousActionsAreRefused) {
  const TestFolder folder;
  NullSink log;
  DrawnEpisodes source([](Rng&) { return std::vector<double>{1, 1, 0}; });
  EXPECT_NE(MessageOf<UsageError>([&] {
              TrainAgent({.factory = PointMassFactory(),
                          .source = source,
                          .eval_parameters = {{1, 1, 0}},
                          .key = RngKey(1),
                          .folder = folder.path(),
                          .run_name = "agent",
                          .context = {&log, nullptr, 1}},
                         SmallConfig());
            }).find("continuous"),
            std::string::npos);
}

TEST(TrainPpo, ADamagedCheckpointIsADataError) {
  const TestFolder folder;
  Training run{folder.path()};
  run();
  const NpzArrays arrays = ReadNpz(folder / "checkpoint.npz");
  ASSERT_GT(arrays.size(), 8u);
  for (const auto& [name, array] : arrays) {
    SCOPED_TRACE(name);
    for (const bool erase : {true, false}) {
      NpzArrays changed = arrays;
      if (erase) changed.erase(name);
      if (!erase) changed[name] = NpyArray(std::vector<uint8_t>{7, 7, 7});
      WriteNpz(changed, folder / "checkpoint.npz");
      MessageOf<DataError>([&] { run(); });
    }
  }
}

}  // namespace oted::ppo_test
