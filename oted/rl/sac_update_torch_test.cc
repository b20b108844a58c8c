#include <gtest/gtest.h>

#include "oted/rl/replay_torch_testing.h"
#include "oted/rl/sac_update.h"

namespace oted {
namespace {

constexpr int kBatch = 64;

Normalizer Identity(int dim) {
  return {std::vector<double>(static_cast<size_t>(dim), 0.0), std::vector<double>(static_cast<size_t>(dim), 1.0)};
}

/// SAC as Stable-Baselines3 writes it, on autograd and in double precision. Same start as `update`.
class TorchSac {
 public:
  TorchSac(SacUpdate& update, const SacUpdateOptions& options)
      : options_(options),
        actor(update.actor().net()),
        critics{TorchMlp(update.critic(0)), TorchMlp(update.critic(1))},
        targets{TorchMlp(update.target_critic(0)), TorchMlp(update.target_critic(1))},
        log_alpha(torch::full({1}, update.log_alpha(), torch::kFloat64).requires_grad_()),
        act_dim_(update.actor().act_dim()),
        actor_adam_(actor.parameters, torch::optim::AdamOptions(options.learning_rate)),
        critic_adam_(Joined(), torch::optim::AdamOptions(options.learning_rate)),
        alpha_adam_({log_alpha}, torch::optim::AdamOptions(options.learning_rate)) {}

  ReplayLosses Step(const TransitionBatch& batch) {
    const int64_t n = batch.size, obs_dim = actor.parameters[0].size(0);
    const torch::Tensor both = ToTensor(batch.observations, 2 * n, obs_dim),
                        noise = ToTensor(batch.noise, 2 * n, act_dim_);
    const torch::Tensor s = both.slice(0, 0, n), s_next = both.slice(0, n, 2 * n);
    const torch::Tensor joint = ToTensor(batch.joint, n, obs_dim + act_dim_);
    const torch::Tensor reward = ToTensor(batch.rewards, n, 1), terminated = ToTensor(batch.terminated, n, 1);

    const auto [action, log_prob] = Act(s, noise.slice(0, 0, n));
    const torch::Tensor alpha = log_alpha.detach().exp();
    const torch::Tensor alpha_loss = -(log_alpha * (log_prob + options_.target_entropy).detach()).mean();
    Minimise(alpha_adam_, alpha_loss);

    torch::Tensor y;
    {
      const torch::NoGradGuard no_grad;
      const auto [next_action, next_log_prob] = Act(s_next, noise.slice(0, n, 2 * n));
      const torch::Tensor next = torch::cat({s_next, next_action}, 1);
      const torch::Tensor q =
          torch::minimum(targets[0].Forward(next), targets[1].Forward(next)) - alpha * next_log_prob;
      y = reward + (1 - terminated) * options_.gamma * q;
    }
    const torch::Tensor q0 = critics[0].Forward(joint), q1 = critics[1].Forward(joint);
    const torch::Tensor critic_loss = 0.5 * (torch::mse_loss(q0, y) + torch::mse_loss(q1, y));
    Minimise(critic_adam_, critic_loss);

    const torch::Tensor on_policy = torch::cat({s, action}, 1);
    const torch::Tensor q_pi = torch::minimum(critics[0].Forward(on_policy), critics[1].Forward(on_policy));
    const torch::Tensor actor_loss = (alpha * log_prob - q_pi).mean();
    Minimise(actor_adam_, actor_loss);

    const torch::NoGradGuard no_grad;
    for (size_t i = 0; i < 2; ++i) {
      for (size_t k = 0; k < targets[i].parameters.size(); ++k) {
        targets[i].parameters[k].mul_(1 - options_.tau).add_(critics[i].parameters[k], options_.tau);
      }
    }
    ReplayLosses losses;
    losses.critic_loss = critic_loss.item<double>();
    losses.actor_loss = actor_loss.item<double>();
    losses.alpha = alpha.item<double>();
    losses.alpha_loss = alpha_loss.item<double>();
    losses.mean_q = (0.5 * (q0 + q1)).mean().item<double>();
    return losses;
  }

 private:
  SacUpdateOptions options_;

 public:
  TorchMlp actor;
  std::array<TorchMlp, 2> critics, targets;
  torch::Tensor log_alpha;

 private:
  std::vector<torch::Tensor> Joined() const {
    std::vector<torch::Tensor> all = critics[0].parameters;
    all.insert(all.end(), critics[1].parameters.begin(), critics[1].parameters.end());
    return all;
  }

  std::pair<torch::Tensor, torch::Tensor> Act(const torch::Tensor& s, const torch::Tensor& noise) const {
    return TorchSquash(actor.Forward(s), noise);
  }

  int64_t act_dim_;
  torch::optim::Adam actor_adam_, critic_adam_, alpha_adam_;
};

SacUpdate MakeUpdate(int obs_dim, int act_dim, const std::vector<int>& hidden, const SacUpdateOptions& options) {
  const std::vector<double> low(static_cast<size_t>(act_dim), -1.0), high(static_cast<size_t>(act_dim), 1.0);
  TanhGaussianPolicy actor(Identity(obs_dim), hidden, low, high);
  Rng rng(11);
  actor.net().Initialize(rng);
  return SacUpdate(std::move(actor), hidden, options, rng);
}

TransitionBatch RandomBatch(int obs_dim, int act_dim, Rng& rng) {
  ReplayBuffer buffer(obs_dim, act_dim, kBatch);
  std::vector<double> s(static_cast<size_t>(obs_dim)), s_next(s), a(static_cast<size_t>(act_dim));
  for (int row = 0; row < kBatch; ++row) {
    for (double& v : s) v = rng.Normal();
    for (double& v : s_next) v = rng.Normal();
    for (double& v : a) v = rng.Uniform(-1, 1);
    buffer.Add(s, a, rng.Normal(), s_next, rng.Uniform() < 0.2);
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
  TorchSac reference(update, options);
  Rng rng(12);
  for (int step = 0; step < 60; ++step) {
    const TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    ExpectNear(update.Step(batch), reference.Step(batch), step);
  }
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), reference.actor.Flat()), kTolerance);
  for (int i = 0; i < 2; ++i) {
    const size_t k = static_cast<size_t>(i);
    EXPECT_LT(MaxDifference(update.critic(i).parameters(), reference.critics[k].Flat()), kTolerance) << i;
    EXPECT_LT(MaxDifference(update.target_critic(i).parameters(), reference.targets[k].Flat()), kTolerance) << i;
  }
  EXPECT_NEAR(update.log_alpha(), reference.log_alpha.item<double>(), kTolerance);
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
  TorchSac reference(update, options);
  for (int step = 0; step < 10; ++step) {
    TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    // Small noise: at |a| = 1 single precision knows log(1 - a^2 + 1e-6) to a few per cent only.
    for (float& v : batch.noise) v *= 0.1f;
    ExpectNear(update.Step(batch), reference.Step(batch), step);
  }
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), reference.actor.Flat()), kTolerance);
  EXPECT_EQ(update.actor().net().parameters()[bias + 2], 4.0f);
  EXPECT_EQ(update.actor().net().parameters()[bias + 3], -30.0f);
}

TEST(SacUpdate, TerminatedRowsDoNotBootstrapAndTruncatedRowsDo) {
  const int obs_dim = 3, act_dim = 1;
  SacUpdateOptions options;
  options.target_entropy = -act_dim;
  Rng rng(14);
  TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
  const auto critic_loss = [&](float terminated, float target_bias) {
    batch.terminated.assign(kBatch, terminated);
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
    const float* q = pass.Forward(fresh.critic(i), batch.joint.data(), kBatch);
    for (size_t b = 0; b < kBatch; ++b) regression += 0.5 * std::pow(q[b] - batch.rewards[b], 2) / kBatch;
  }
  EXPECT_NEAR(critic_loss(1, 0), regression, 1e-5);
  EXPECT_EQ(critic_loss(1, 0), critic_loss(1, 100));
  // A time limit is no end: the next state's value, raised by 100, is in the target with weight gamma.
  EXPECT_GT(critic_loss(0, 100), 0.5 * 2 * 0.9 * std::pow(options.gamma * 100, 2));
}

TEST(SacUpdate, ARestoredUpdateGoesOnWithTheSameNumbers) {
  const int obs_dim = 3, act_dim = 2;
  SacUpdateOptions options;
  options.target_entropy = -act_dim;
  Rng rng(15);
  SacUpdate update = MakeUpdate(obs_dim, act_dim, {16}, options);
  for (int step = 0; step < 5; ++step) update.Step(RandomBatch(obs_dim, act_dim, rng));
  NpzArrays arrays;
  update.Save(arrays);
  SacUpdate restored = MakeUpdate(obs_dim, act_dim, {16}, options);
  restored.Restore(ParseNpz(NpzBytes(arrays), "memory"));
  for (int step = 0; step < 5; ++step) {
    const TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    const ReplayLosses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.critic_loss, b.critic_loss);
    EXPECT_EQ(a.actor_loss, b.actor_loss);
    EXPECT_EQ(a.alpha, b.alpha);
  }
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
  EXPECT_EQ(update.target_critic(1).parameters(), restored.target_critic(1).parameters());
}

}  // namespace
}  // namespace oted
