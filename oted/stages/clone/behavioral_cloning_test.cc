#include "oted/stages/clone/behavioral_cloning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/stages/clone/clone.h"

namespace oted::behavioral_cloning_test {

SimulatorSpec Spec() {
  SimulatorSpec spec;
  spec.task = "Toy";
  spec.observation_shape = {3};
  spec.act_dim = 2;
  spec.action_low = {-1, -2};
  spec.action_high = {1, 4};
  return spec;
}

double TrueMean(std::span<const double> s, int j) { return j == 0 ? 0.3 + 0.5 * s[0] - 0.2 * s[1] : -0.1 + 0.4 * s[2]; }
constexpr double kTrueStd[] = {0.2, 0.5};

/// `n` transitions of a linear-tanh-Gaussian policy at normal states.
Dataset MakeDataset(int n, uint64_t seed) {
  const SimulatorSpec spec = Spec();
  Dataset dataset;
  Rng rng(seed);
  for (int i = 0; i < n; ++i) {
    const std::vector<double> s = {rng.Normal(), rng.Normal(), rng.Normal()};
    std::vector<double> a(2);
    for (int j = 0; j < 2; ++j) {
      const size_t k = static_cast<size_t>(j);
      const double u = TrueMean(s, j) + kTrueStd[j] * rng.Normal();
      a[k] = 0.5 * (spec.action_low[k] + spec.action_high[k]) +
             0.5 * (spec.action_high[k] - spec.action_low[k]) * std::tanh(u);
    }
    dataset.observations.AppendRow(s);
    dataset.actions.AppendRow(a);
    dataset.next_observations.AppendRow(s);
  }
  dataset.terminals.assign(static_cast<size_t>(n), 0);
  dataset.timeouts.assign(static_cast<size_t>(n), 0);
  return dataset;
}

CloneConfig SmallConfig() {
  CloneConfig config;
  config.hidden = {32};
  config.max_steps = 1500;
  return config;
}

/// Keeps the curves.
class Recorder : public NullSink {
 public:
  void Scalar(std::string_view, std::string_view key, int64_t step, double value) override {
    curves[std::string(key)][step] = value;
  }
  std::map<std::string, std::map<int64_t, double>> curves;
};

CloneResult Clone(const Dataset& dataset, const CloneConfig& config, LogSink* log = nullptr) {
  NullSink nothing;
  return CloneBehavior({dataset, Spec(), config, RngKey(4), "clone", {log != nullptr ? log : &nothing, nullptr, 1}});
}

const TanhGaussianPolicy& PolicyOf(const CloneResult& clone) {
  return dynamic_cast<const TanhGaussianPolicy&>(*clone.policy);
}

/// Mean and std of u at a state, (2 act_dim), as the policy's network gives them.
std::vector<double> HeadAt(const TanhGaussianPolicy& policy, std::span<const double> s) {
  std::vector<float> x(3);
  policy.NormalizeObservations(s, x);
  MlpPass pass;
  const float* out = pass.Forward(policy.net(), x.data(), 1);
  return {out[0], out[1], std::exp(out[2]), std::exp(out[3])};
}

TEST(CloneBehavior, RecoversTheMeanAndSpreadOfAKnownPolicy) {
  const CloneResult clone = Clone(MakeDataset(6000, 1), SmallConfig());
  Rng rng(9);
  double mean_error[2] = {0, 0}, std_error[2] = {0, 0};
  constexpr int kProbes = 300;
  for (int i = 0; i < kProbes; ++i) {
    const std::vector<double> s = {rng.Normal(), rng.Normal(), rng.Normal()};
    const std::vector<double> head = HeadAt(PolicyOf(clone), s);
    for (int j = 0; j < 2; ++j) {
      const size_t k = static_cast<size_t>(j);
      mean_error[j] += std::abs(head[k] - TrueMean(s, j)) / kProbes;
      std_error[j] += std::abs(head[k + 2] - kTrueStd[j]) / kProbes;
    }
  }
  // A fifth of the policy's own spread.
  for (int j = 0; j < 2; ++j) {
    EXPECT_LT(mean_error[j], 0.2 * kTrueStd[j]) << j;
    EXPECT_LT(std_error[j], 0.2 * kTrueStd[j]) << j;
  }
  // The loss is the entropy of u where the clone is right.
  double entropy = 0;
  for (const double std : kTrueStd) entropy += std::log(std) + 0.5 * std::log(2 * M_PI * std::exp(1.0));
  EXPECT_NEAR(clone.held_out_loss, entropy, 0.1);
}

TEST(CloneBehavior, KeepsThePolicyOfTheBestHeldOutCheck) {
  CloneConfig config = SmallConfig();
  config.hidden = {64, 64};
  config.learning_rate = 3e-3;
  config.check_interval = 20;
  config.patience = 8;
  config.weight_decay = 0;
  Recorder log;
  // 300 transitions: over-fitting sets in at once.
  const Dataset dataset = MakeDataset(300, 2);
  const CloneResult clone = Clone(dataset, config, &log);
  const auto& curve = log.curves["clone/held_out_loss"];
  ASSERT_FALSE(curve.empty());
  double lowest = INFINITY;
  for (const auto& [step, loss] : curve) lowest = std::min(lowest, loss);
  EXPECT_EQ(clone.held_out_loss, lowest);
  EXPECT_EQ(curve.at(clone.n_steps), lowest);
  EXPECT_EQ(curve.rbegin()->first, clone.n_steps + 8 * 20) << "the search ends `patience` checks after the best one";
  EXPECT_LT(clone.n_steps, 1000);
  // The kept policy is the one of that step: a run that ends there gives the same bytes.
  config.max_steps = clone.n_steps;
  EXPECT_EQ(PolicyOf(Clone(dataset, config)).net().parameters(), PolicyOf(clone).net().parameters());
}

TEST(CloneBehavior, ASingleBlockOfTransitionsIsEnough) {
  CloneConfig config = SmallConfig();
  config.max_steps = 50;
  for (const int n : {2, 25, 26}) {
    const CloneResult clone = Clone(MakeDataset(n, 3), config);
    EXPECT_TRUE(std::isfinite(clone.held_out_loss)) << n;
  }
}

TEST(CloneBehavior, ActionsAtTheBoundsGiveFiniteLosses) {
  Dataset dataset = MakeDataset(200, 4);
  for (int i = 0; i < 100; ++i) dataset.actions(i, 0) = i % 2 == 0 ? 1 : -1;
  CloneConfig config = SmallConfig();
  config.max_steps = 200;
  const CloneResult clone = Clone(dataset, config);
  EXPECT_TRUE(std::isfinite(clone.held_out_loss));
  for (const float p : PolicyOf(clone).net().parameters()) ASSERT_TRUE(std::isfinite(p));
}

TEST(CloneBehavior, ANetworkThatDivergesIsADataErrorWithItsRemedy) {
  CloneConfig config = SmallConfig();
  config.learning_rate = 1e30;
  EXPECT_THAT(MessageOf<DataError>([&] { Clone(MakeDataset(200, 4), config); }),
              testing::HasSubstr("lower clone.learning_rate (1e+30)"));
}

TEST(CloneBehavior, WrongDimensionsAreADataError) {
  SimulatorSpec spec = Spec();
  spec.observation_shape = {4};
  NullSink log;
  const Dataset dataset = MakeDataset(50, 5);
  MessageOf<DataError>([&] { CloneBehavior({dataset, spec, {}, RngKey(1), "clone", {&log, nullptr, 1}}); });
  spec = Spec();
  spec.act_dim = 3;
  spec.action_low = {-1, -1, -1};
  spec.action_high = {1, 1, 1};
  MessageOf<DataError>([&] { CloneBehavior({dataset, spec, {}, RngKey(1), "clone", {&log, nullptr, 1}}); });
}

TEST(CloneBehavior, AStopIsAnInterruption) {
  const std::atomic<bool> stop = true;
  NullSink log;
  EXPECT_THROW(CloneBehavior({MakeDataset(100, 6), Spec(), SmallConfig(), RngKey(1), "clone", {&log, &stop, 1}}),
               Interrupted);
}

/// Images of 3x3 cells, kind 0 or 1, and a direction; the action is 1 with probability 0.9 where the middle cell is 1,
/// otherwise the direction's.
Dataset GridLogs(int n) {
  Rng rng(11);
  Dataset dataset;
  for (int i = 0; i < n; ++i) {
    std::vector<double> s;
    for (int j = 0; j < 9; ++j) s.push_back(static_cast<double>(rng.Below(2)));
    s.push_back(static_cast<double>(rng.Below(3)));
    const bool obeys = rng.Uniform() < 0.9;
    dataset.observations.AppendRow(s);
    dataset.next_observations.AppendRow(s);
    dataset.actions.AppendRow(std::vector<double>{s[4] == 1 && obeys ? 1 : s[9]});
    dataset.terminals.push_back(0);
    dataset.timeouts.push_back(i % 50 == 49);
  }
  return dataset;
}

SimulatorSpec GridSpec() {
  SimulatorSpec spec;
  spec.task = "Cells";
  spec.observation_shape = {10};
  spec.image_shape = {3, 3, 1};
  spec.observation_levels = {2, 2, 2, 2, 2, 2, 2, 2, 2, 3};
  spec.act_dim = 1;
  spec.n_discrete_actions = 3;
  return spec;
}

TEST(CloneBehavior, OfImagesAndDiscreteActionsRecoversTheProbabilities) {
  CloneConfig config = SmallConfig();
  config.filters = {8};
  config.hidden = {16};
  config.max_steps = 1500;
  NullSink log;
  const CloneResult clone = CloneBehavior({GridLogs(3000), GridSpec(), config, RngKey(1), "clone", {&log, nullptr, 1}});
  // 0.5 x H(direction known) + 0.5 x entropy of 0.9 and 0.1, less where direction 1 makes both the same: a third.
  const double floor = 0.5 * (2.0 / 3) * (-0.9 * std::log(0.9) - 0.1 * std::log(0.1));
  EXPECT_LT(clone.held_out_loss, floor + 0.05);
  EXPECT_GT(clone.held_out_loss, floor - 0.05);
  const auto actor = clone.policy->MakeActor(ActionNoise::kSampled);
  std::vector<double> s = {0, 1, 0, 1, 1, 1, 0, 0, 1, 2};
  Rng rng(2);
  int ones = 0;
  for (int i = 0; i < 2000; ++i) {
    double action = -1;
    actor->Act(s, 1, rng, {&action, 1});
    ones += action == 1;
  }
  EXPECT_NEAR(ones / 2000.0, 0.9, 0.05);
  double likely = -1;
  clone.policy->MakeActor(ActionNoise::kMean)->Act(s, 1, rng, {&likely, 1});
  EXPECT_EQ(likely, 1);
}

TEST(CloneBehavior, AnActionThatIsNoIndexIsADataError) {
  Dataset dataset = GridLogs(100);
  dataset.actions(7, 0) = 3;
  NullSink log;
  CloneConfig config = SmallConfig();
  config.filters = {8};
  const std::string message = MessageOf<DataError>([&] {
    CloneBehavior({dataset, GridSpec(), config, RngKey(1), "clone", {&log, nullptr, 1}});
  });
  EXPECT_NE(message.find("[7]"), std::string::npos) << message;
}

TEST(CloneBehavior, SameSeedSameBytesAndAnotherSeedOthers) {
  CloneConfig config = SmallConfig();
  config.max_steps = 100;
  NullSink log;
  const Dataset dataset = MakeDataset(500, 7);
  const auto bytes = [&](uint64_t seed, int n_threads) {
    const CloneResult clone =
        CloneBehavior({dataset, Spec(), config, RngKey(seed), "clone", {&log, nullptr, n_threads}});
    return PolicyOf(clone).net().parameters();
  };
  EXPECT_EQ(bytes(1, 1), bytes(1, 2));
  EXPECT_NE(bytes(1, 1), bytes(2, 1));
}

}  // namespace oted::behavioral_cloning_test
