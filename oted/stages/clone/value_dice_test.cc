#include "oted/stages/clone/value_dice.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/testing.h"

namespace oted::value_dice_test {

constexpr double kGainX = -1.2, kGainV = -0.3, kStd = 0.25;

/// u ~ N(-1.2 x - 0.3 v, 0.25^2), a = tanh(u), in the point mass.
Dataset Demonstrations(int n_episodes, uint64_t seed) {
  PointMassOptions options;
  options.max_episode_steps = 60;
  PointMass simulator(options, n_episodes, 1);
  Rng rng(seed);
  const auto act = [&](std::span<const double> s, int n, std::span<double> actions) {
    for (size_t i = 0; i < static_cast<size_t>(n); ++i) {
      actions[i] = std::tanh(kGainX * s[2 * i] + kGainV * s[2 * i + 1] + kStd * rng.Normal());
    }
  };
  EpisodeRecorder recorder(n_episodes);
  const std::vector<double> z = {1.0, 0.6, 0.5};
  RunEpisodes(simulator, std::vector(static_cast<size_t>(n_episodes), z), act, RngKey(seed), recorder.Observer());
  return recorder.Logs();
}

CloneConfig SmallConfig() {
  CloneConfig config;
  config.method = CloneMethod::kValueDice;
  config.hidden = {};
  config.max_steps = 100;
  config.valuedice_start = ValueDiceStart::kRandomWeights;
  config.valuedice_updates = 6'000;
  config.valuedice_batch = 128;
  config.valuedice_hidden = {32, 32};
  config.valuedice_actor_rate = 1e-3;  // the paper's wants a million updates from random weights
  config.valuedice_discount = 0.9;
  config.valuedice_penalty = 1;  // log ratios of such a narrow policy are steep
  return config;
}

CloneResult Clone(const Dataset& dataset, const CloneConfig& config, uint64_t seed = 3, int n_threads = 1) {
  NullSink log;
  return CloneBehavior({dataset, PointMass::MakeSpec({}), config, RngKey(seed), "clone", {&log, nullptr, n_threads}});
}

const TanhGaussianPolicy& PolicyOf(const CloneResult& clone) {
  return dynamic_cast<const TanhGaussianPolicy&>(*clone.policy);
}

TEST(CloneByValueDice, RecoversALinearGaussianExpertFromFiveDemonstrations) {
  const Dataset logs = Demonstrations(5, 1);
  ASSERT_EQ(logs.size(), 300);
  const CloneResult clone = Clone(logs, SmallConfig());
  EXPECT_EQ(clone.method, CloneMethod::kValueDice);
  // The mean action where the expert goes, and the spread, beside a policy of random weights.
  CloneConfig untrained = SmallConfig();
  untrained.valuedice_updates = 1;
  const Dataset elsewhere = Demonstrations(20, 2);
  const auto measure = [&](const CloneResult& of) {
    const TanhGaussianPolicy& policy = PolicyOf(of);
    MlpPass pass;
    double mean = 0, spread = 0;
    for (int i = 0; i < elsewhere.size(); ++i) {
      std::vector<float> x(2);
      policy.NormalizeObservations(elsewhere.observations.row(i), x);
      const float* out = pass.Forward(policy.net(), x.data(), 1);
      const double wanted = kGainX * elsewhere.observations(i, 0) + kGainV * elsewhere.observations(i, 1);
      mean += std::abs(out[0] - wanted) / elsewhere.size();
      spread += std::exp(out[1]) / elsewhere.size();
    }
    return std::pair(mean, spread);
  };
  EXPECT_LT(measure(clone).first, 0.1);
  EXPECT_NEAR(measure(clone).second, kStd, 0.07);
  EXPECT_GT(measure(Clone(logs, untrained)).first, 0.3);
}

TEST(CloneByValueDice, FromTheBehaviouralCloneItsFirstPolicyIsThatClone) {
  const Dataset logs = Demonstrations(5, 1);
  CloneConfig config = SmallConfig();
  config.valuedice_start = ValueDiceStart::kBehavioralClone;
  config.valuedice_updates = 1;
  config.valuedice_actor_rate = 1e-12;
  CloneConfig behavioural = config;
  behavioural.method = CloneMethod::kBehavioralCloning;
  const CloneResult bc = Clone(logs, behavioural), valuedice = Clone(logs, config);
  EXPECT_EQ(PolicyOf(bc).net().parameters(), PolicyOf(valuedice).net().parameters());
  EXPECT_NEAR(bc.held_out_loss, valuedice.held_out_loss, 1e-9) << "the same rows are held out";
  EXPECT_EQ(valuedice.n_steps, bc.n_steps + 1);
}

TEST(CloneByValueDice, SameSeedSameBytesAtAnyNumberOfThreadsAndAfterAStop) {
  const Dataset logs = Demonstrations(3, 4);
  CloneConfig config = SmallConfig();
  config.valuedice_updates = 60;
  const auto bytes = [&](uint64_t seed, int n_threads) {
    return PolicyOf(Clone(logs, config, seed, n_threads)).net().parameters();
  };
  const auto first = bytes(1, 1);
  EXPECT_EQ(first, bytes(1, 2));
  EXPECT_NE(first, bytes(2, 1));
  const std::atomic<bool> stop = true;
  NullSink log;
  config.check_interval = 10;
  EXPECT_THROW(CloneBehavior({logs, PointMass::MakeSpec({}), config, RngKey(1), "clone", {&log, &stop, 1}}),
               Interrupted);
  EXPECT_EQ(first, bytes(1, 1));
}

TEST(CloneByValueDice, OfDiscreteActionsIsAUsageErrorAndAutoIsBehaviouralCloning) {
  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.n_discrete_actions = 3;
  CloneConfig config;
  config.method = CloneMethod::kValueDice;
  const std::string message = MessageOf<UsageError>([&] { config.MethodFor(spec); });
  EXPECT_NE(message.find("discrete"), std::string::npos) << message;
  config.method = CloneMethod::kAuto;
  EXPECT_EQ(config.MethodFor(spec), CloneMethod::kBehavioralCloning);
  EXPECT_EQ(config.MethodFor(PointMass::MakeSpec({})), CloneMethod::kAuto);
}

}  // namespace oted::value_dice_test
