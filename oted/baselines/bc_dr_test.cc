#include "oted/baselines/bc_dr.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/batch_policy.h"
#include "oted/sim/testing.h"

namespace oted::bc_dr_test {

constexpr double kSlope = -0.8, kLogStd = -1.5;

/// u ~ N(-0.8 x, 0.22^2), a = tanh(u).
TanhGaussianPolicy KnownPolicy() {
  TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  auto& p = policy.net().parameters();
  std::fill(p.begin(), p.end(), 0.0f);
  p[policy.net().layers()[0].weight] = kSlope;  // of x in the mean; (in, out) row-major
  p[policy.net().layers()[0].bias + 1] = kLogStd;
  return policy;
}

/// What that policy does at x from 0.5 to 1 alone.
Dataset LogsOfOneSide() {
  Dataset logs;
  Rng rng(3);
  for (int i = 0; i < 1500; ++i) {
    const std::vector<double> s = {rng.Uniform(0.5, 1), 0};
    logs.observations.AppendRow(s);
    logs.next_observations.AppendRow(s);
    logs.actions.AppendRow(std::vector<double>{std::tanh(kSlope * s[0] + std::exp(kLogStd) * rng.Normal())});
    logs.terminals.push_back(0);
    logs.timeouts.push_back(i % 20 == 19);
    logs.rewards.push_back(1);
  }
  return logs;
}

CloneConfig Small() {
  CloneConfig config;
  config.hidden = {32};
  config.max_steps = 2000;
  return config;
}

double MeanActionAt(const Policy& policy, double x) {
  const std::vector<double> s = {x, 0};
  std::vector<double> a(1);
  MeanActionPolicy(policy)(s, 1, a);
  return a[0];
}

TEST(BcDr, RecoversAKnownPolicyAlsoWhereOnlyTheSimulatedDataShowIt) {
  const PointMassFactory factory;
  const TanhGaussianPolicy known = KnownPolicy();
  NullSink log;
  const RunContext context{&log, nullptr, 1};
  const Dataset logs = LogsOfOneSide();
  const CloneResult both =
      CloneWithSimulated({logs, factory.spec(), Small(), RngKey(4), "bc_dr", context}, factory, known, 2.0);
  const CloneResult alone = CloneBehavior({logs, factory.spec(), Small(), RngKey(4), "clone", context});
  double worst = 0, worst_alone = 0;
  for (const double x : {-0.8, -0.5, -0.2, 0.2, 0.5, 0.8}) {
    const double truth = std::tanh(kSlope * x);
    worst = std::max(worst, std::abs(MeanActionAt(*both.policy, x) - truth));
    worst_alone = std::max(worst_alone, std::abs(MeanActionAt(*alone.policy, x) - truth));
  }
  EXPECT_LT(worst, 0.08);
  EXPECT_GT(worst_alone, 0.16) << "the logs alone say nothing of the other side";
}

TEST(BcDr, CollectsTheTransitionsOfWholeEpisodesInSimulatorsOverTheRange) {
  const PointMassFactory factory({.max_episode_steps = 7});
  const TanhGaussianPolicy known = KnownPolicy();
  const Dataset logs = CollectUnderRandomization(factory, known, 500, RngKey(2), 1);
  ASSERT_EQ(logs.size(), 500);
  const std::vector<Episode> episodes = logs.Episodes();
  ASSERT_EQ(episodes.size(), 72u);  // 500 / 7 = 71.4
  // v' = (1 - damping) v + gain a with v = 0 at first: an episode's first step shows its gain.
  double sum = 0, sum_of_squares = 0;
  for (const Episode& episode : episodes) {
    const double gain = logs.next_observations(episode.begin, 1) / logs.actions(episode.begin, 0);
    EXPECT_GE(gain, 0.2 - 1e-9);
    EXPECT_LE(gain, 2.0 + 1e-9);
    sum += gain;
    sum_of_squares += gain * gain;
  }
  const double n = static_cast<double>(episodes.size()), mean = sum / n;
  EXPECT_NEAR(mean, 1.1, 5 * 1.8 / std::sqrt(12 * n));
  EXPECT_NEAR(sum_of_squares / n - mean * mean, 1.8 * 1.8 / 12, 0.15);
  EXPECT_EQ(CollectUnderRandomization(factory, known, 500, RngKey(2), 3).actions, logs.actions) << "threads";
}

TEST(BcDr, ASimulatorThatOnlyDivergesIsADataError) {
  const PointMassFactory factory({.diverge_beyond = -1});
  const TanhGaussianPolicy known = KnownPolicy();
  EXPECT_THROW(CollectUnderRandomization(factory, known, 10, RngKey(2), 1), DataError);
}

}  // namespace oted::bc_dr_test
