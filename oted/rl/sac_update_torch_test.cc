#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"
#include "oted/rl/autograd/autograd_sac.h"
#include "oted/rl/replay_torch_testing.h"
#include "oted/rl/sac_update.h"

namespace oted::sac_update_torch_test {

Normalizer Identity(int dim) {
  return {std::vector<double>(static_cast<size_t>(dim), 0.0), std::vector<double>(static_cast<size_t>(dim), 1.0)};
}

SacUpdate MakeUpdate(int obs_dim, int act_dim, const std::vector<int>& hidden, const SacUpdateOptions& options) {
  const std::vector<double> low(static_cast<size_t>(act_dim), -1.0), high(static_cast<size_t>(act_dim), 1.0);
  TanhGaussianPolicy actor(Identity(obs_dim), hidden, low, high);
  Rng rng(11);
  actor.net().Initialize(rng);
  return SacUpdate(std::move(actor), hidden, options, rng);
}

/// Observations and noise at their full size, where RandomBatch's are small.
TransitionBatch NormalBatch(int obs_dim, int act_dim, Rng& rng) {
  constexpr int kBatch = 64;
  ReplayBuffer buffer(obs_dim, act_dim, kBatch);
  std::vector<double> s(static_cast<size_t>(obs_dim)), s_next(s), a(static_cast<size_t>(act_dim));
  for (int row = 0; row < kBatch; ++row) {
    for (double& v : s) v = rng.Normal();
    for (double& v : s_next) v = rng.Normal();
    for (double& v : a) v = rng.Uniform(-1, 1);
    buffer.Add(s, a, rng.Normal(), s_next, rng.Uniform() < 0.2 ? 0 : 0.99);
  }
  TransitionBatch batch;
  buffer.Sample(kBatch, rng, batch);
  return batch;
}

// Adam divides a gradient by its own size: where the terms of a gradient cancel to their rounding error (1e-7 of them),
// the step's error is that fraction of the learning rate, 3e-4, and over 60 steps it adds up to some 1e-6.
constexpr double kTolerance = 1e-5;

void CompareOverSteps(int obs_dim, int act_dim) {
  torch::set_num_threads(1);
  SacUpdateOptions options;
  options.target_entropy = -act_dim;
  options.tau = 0.02;  // so that 60 steps move the targets well beyond the tolerance
  SacUpdate update = MakeUpdate(obs_dim, act_dim, {128, 128}, options);
  const auto actor_start = update.actor().net().parameters();
  const auto target_start = update.target_critic(0).parameters();
  AutogradSac reference(update, options, torch::kFloat64);
  Rng rng(12);
  for (int step = 0; step < 60; ++step) {
    const TransitionBatch batch = NormalBatch(obs_dim, act_dim, rng);
    ExpectNear(update.Step(batch), reference.Step(batch), step);
  }
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), Flattened(reference.actor.parameters)), kTolerance);
  for (int i = 0; i < 2; ++i) {
    const size_t k = static_cast<size_t>(i);
    EXPECT_LT(MaxDifference(update.critic(i).parameters(), Flattened(reference.critics[k].parameters)), kTolerance)
        << i;
    EXPECT_LT(MaxDifference(update.target_critic(i).parameters(), Flattened(reference.targets[k].parameters)),
              kTolerance)
        << i;
  }
  EXPECT_NEAR(update.log_alpha(), reference.temperature.flat.item<double>(), kTolerance);
  // What is compared has moved by far more than the tolerance.
  EXPECT_GT(MaxDifference(update.actor().net().parameters(), actor_start), 100 * kTolerance);
  EXPECT_GT(MaxDifference(update.target_critic(0).parameters(), target_start), 100 * kTolerance);
  EXPECT_GT(std::abs(update.log_alpha()), 100 * kTolerance);
}

TEST(SacUpdateAgainstAutograd, StaysEqualOverSixtyStepsAtHalfCheetahsSize) { CompareOverSteps(17, 6); }
TEST(SacUpdateAgainstAutograd, StaysEqualOverSixtyStepsAtHoppersSize) { CompareOverSteps(11, 3); }

TEST(SacUpdateAgainstAutograd, ClampedStandardDeviationsPassNoGradient) {
  const int obs_dim = 4, act_dim = 2;
  SacUpdateOptions options;
  options.target_entropy = -act_dim;
  TanhGaussianPolicy actor(Identity(obs_dim), {16}, {-1, -1}, {1, 1});
  Rng rng(13);
  actor.net().Initialize(rng);
  // One action dimension beyond each bound of the log standard deviation.
  const size_t bias = actor.net().layers().back().bias;
  actor.net().parameters()[bias + 2] = 4.0f;
  actor.net().parameters()[bias + 3] = -30.0f;
  SacUpdate update(actor, {16}, options, rng);
  AutogradSac reference(update, options, torch::kFloat64);
  for (int step = 0; step < 10; ++step) {
    TransitionBatch batch = NormalBatch(obs_dim, act_dim, rng);
    // Small noise: at |a| = 1 single precision knows log(1 - a^2 + 1e-6) to a few per cent only.
    for (float& v : batch.noise) v *= 0.1f;
    ExpectNear(update.Step(batch), reference.Step(batch), step);
  }
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), Flattened(reference.actor.parameters)), kTolerance);
  EXPECT_EQ(update.actor().net().parameters()[bias + 2], 4.0f);
  EXPECT_EQ(update.actor().net().parameters()[bias + 3], -30.0f);
}

TEST(SacUpdate, TerminatedRowsDoNotBootstrapAndTruncatedRowsDo) {
  const int obs_dim = 3, act_dim = 1;
  SacUpdateOptions options;
  options.target_entropy = -act_dim;
  Rng rng(14);
  TransitionBatch batch = NormalBatch(obs_dim, act_dim, rng);
  const auto critic_loss = [&](float discount, float target_bias) {
    batch.discounts.assign(batch.discounts.size(), discount);
    SacUpdate update = MakeUpdate(obs_dim, act_dim, {8}, options);
    for (int i = 0; i < 2; ++i) {
      Mlp& target = update.target_critic(i);
      target.parameters()[target.layers().back().bias] += target_bias;
    }
    return update.Step(batch).critic_loss;
  };
  // With no value beyond, the loss is that of a regression on the rewards.
  SacUpdate fresh = MakeUpdate(obs_dim, act_dim, {8}, options);
  double regression = 0;
  for (int i = 0; i < 2; ++i) {
    MlpPass pass;
    const float* q = pass.Forward(fresh.critic(i), batch.joint.data(), batch.size);
    for (size_t b = 0; b < batch.rewards.size(); ++b) {
      regression += 0.5 * std::pow(q[b] - batch.rewards[b], 2) / batch.size;
    }
  }
  EXPECT_NEAR(critic_loss(0, 0), regression, 1e-5);
  EXPECT_EQ(critic_loss(0, 0), critic_loss(0, 100));
  // A time limit is no end: the next state's value, raised by 100, is in the target with its discount.
  EXPECT_GT(critic_loss(0.99f, 100), 0.5 * 2 * 0.9 * std::pow(0.99 * 100, 2));
}

TEST(SacUpdate, ARestoredUpdateGoesOnWithTheSameNumbers) {
  const int obs_dim = 3, act_dim = 2;
  SacUpdateOptions options;
  options.target_entropy = -act_dim;
  Rng rng(15);
  SacUpdate update = MakeUpdate(obs_dim, act_dim, {16}, options);
  for (int step = 0; step < 5; ++step) update.Step(NormalBatch(obs_dim, act_dim, rng));
  NpzArrays arrays;
  update.Save(arrays);
  SacUpdate restored = MakeUpdate(obs_dim, act_dim, {16}, options);
  restored.Restore(ParseNpz(NpzBytes(arrays), "memory"));
  for (int step = 0; step < 5; ++step) {
    const TransitionBatch batch = NormalBatch(obs_dim, act_dim, rng);
    const ReplayLosses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.critic_loss, b.critic_loss);
    EXPECT_EQ(a.actor_loss, b.actor_loss);
    EXPECT_EQ(a.alpha, b.alpha);
  }
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
  EXPECT_EQ(update.target_critic(1).parameters(), restored.target_critic(1).parameters());
}

}  // namespace oted::sac_update_torch_test
