#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"
#include "oted/rl/offline/offline_torch_testing.h"
#include "oted/rl/offline/td3_update.h"

namespace oted::td3_update_torch_test {

/// TD3+BC and ReBRAC as their papers write them, on autograd and in double precision.
template <class Net, class Pass, class AutogradNet>
class TorchTd3 {
 public:
  TorchTd3(Td3Update<Net, Pass>& update, const Td3Options& options)
      : actor(update.actor().net()),
        target_actor(update.target_actor()),
        critics{AutogradNet(update.critic(0)), AutogradNet(update.critic(1))},
        targets{AutogradNet(update.target_critic(0)), AutogradNet(update.target_critic(1))},
        options_(options),
        act_dim_(update.actor().act_dim()),
        actor_adam_(actor, options.learning_rate, 0.9),
        critic_adams_{AutogradAdam(critics[0], options.learning_rate, 0.9),
                      AutogradAdam(critics[1], options.learning_rate, 0.9)} {}

  Td3Losses Step(const OfflineBatch& batch) {
    const BatchTensors b(batch, actor.parameters[0].size(0), act_dim_);
    torch::Tensor y;
    {
      const torch::NoGradGuard no_grad;
      const torch::Tensor noise = (options_.noise * b.next_noise).clamp(-options_.noise_clip, options_.noise_clip);
      const torch::Tensor next = (Mean(target_actor, b.next) + noise).clamp(-1, 1);
      const torch::Tensor joint = torch::cat({b.next, next}, 1);
      const torch::Tensor smaller = torch::minimum(targets[0].Forward(joint), targets[1].Forward(joint));
      const torch::Tensor away = (next - b.next_actions).pow(2).sum(1, true);
      y = b.rewards + options_.gamma * (1 - b.terminated) * (smaller - options_.critic_penalty * away);
    }
    Td3Losses losses;
    const torch::Tensor q0 = critics[0].Forward(b.joint), q1 = critics[1].Forward(b.joint);
    const torch::Tensor critic_loss = (q0 - y).pow(2).mean() + (q1 - y).pow(2).mean();
    losses.critic_loss = critic_loss.item<double>();
    losses.mean_q = 0.5 * (q0.mean() + q1.mean()).item<double>();
    Minimise(critic_loss, {&critic_adams_[0], &critic_adams_[1]});
    if (++n_steps_ % options_.policy_delay == 0) {
      const torch::Tensor action = Mean(actor, b.states);
      const torch::Tensor joint = torch::cat({b.states, action}, 1);
      torch::Tensor q = critics[0].Forward(joint);
      if (options_.smaller_critic) q = torch::minimum(q, critics[1].Forward(joint));
      const torch::Tensor lambda = (options_.value_weight / q.abs().mean()).detach();
      const torch::Tensor away = (action - b.actions).pow(2).sum(1, true);
      const torch::Tensor loss = (options_.actor_penalty * away - lambda * q).mean();
      actor_loss_ = loss.item<double>();
      Minimise(loss, {&actor_adam_});
      const torch::NoGradGuard no_grad;
      target_actor.flat.lerp_(actor.flat, options_.tau);
      for (size_t i = 0; i < 2; ++i) targets[i].flat.lerp_(critics[i].flat, options_.tau);
    }
    losses.actor_loss = actor_loss_;
    return losses;
  }

  AutogradMlp actor, target_actor;
  std::array<AutogradNet, 2> critics, targets;

 private:
  torch::Tensor Mean(const AutogradMlp& net, const torch::Tensor& states) const {
    return net.Forward(states).slice(1, 0, act_dim_).tanh();
  }

  Td3Options options_;
  int64_t act_dim_;
  AutogradAdam actor_adam_;
  std::array<AutogradAdam, 2> critic_adams_;
  int n_steps_ = 0;
  double actor_loss_ = 0;
};

template <class Net, class Pass, class AutogradNet>
void CompareOverSteps(const Td3Options& options, const std::vector<int>& hidden) {
  torch::set_num_threads(1);
  constexpr int kObs = 11, kAct = 3;
  Rng rng(5);
  TanhGaussianPolicy actor = PlainActor(kObs, kAct, {64, 64}, rng);
  Net critics[2];
  for (Net& critic : critics) {
    critic = Net(kObs + kAct, hidden, 1);
    critic.Initialize(rng);
  }
  Td3Update<Net, Pass> update(actor, critics[0], critics[1], options);
  const auto actor_start = update.actor().net().parameters();
  const auto target_start = update.target_critic(0).parameters();
  TorchTd3<Net, Pass, AutogradNet> reference(update, options);
  for (int step = 0; step < 40; ++step) {
    const OfflineBatch batch = RandomOfflineBatch(kObs, kAct, rng);
    const Td3Losses got = update.Step(batch), want = reference.Step(batch);
    EXPECT_NEAR(got.critic_loss, want.critic_loss, 1e-5 * (1 + want.critic_loss)) << step;
    EXPECT_NEAR(got.actor_loss, want.actor_loss, 1e-5 * (1 + std::abs(want.actor_loss))) << step;
    EXPECT_NEAR(got.mean_q, want.mean_q, 1e-5 * (1 + std::abs(want.mean_q))) << step;
  }
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), Flattened(reference.actor.parameters)), 1e-5);
  EXPECT_LT(MaxDifference(update.target_actor().parameters(), Flattened(reference.target_actor.parameters)), 1e-5);
  for (int i = 0; i < 2; ++i) {
    const auto k = static_cast<size_t>(i);
    EXPECT_LT(MaxDifference(update.critic(i).parameters(), Flattened(reference.critics[k].parameters)), 1e-5);
    EXPECT_LT(MaxDifference(update.target_critic(i).parameters(), Flattened(reference.targets[k].parameters)), 1e-5);
  }
  // What is compared has moved by far more.
  EXPECT_GT(MaxDifference(update.actor().net().parameters(), actor_start), 1e-3);
  EXPECT_GT(MaxDifference(update.target_critic(0).parameters(), target_start), 1e-3);
}

TEST(Td3UpdateAgainstAutograd, TD3BCStaysEqualOverFortySteps) {
  CompareOverSteps<Mlp, MlpPass, AutogradMlp>({.tau = 0.05, .actor_penalty = 1.0 / 3}, {128, 128});
}

TEST(Td3UpdateAgainstAutograd, RebracStaysEqualOverFortySteps) {
  CompareOverSteps<LayerNormMlp, LayerNormPass, AutogradLayerNormMlp>(
      {.tau = 0.05, .value_weight = 1, .actor_penalty = 0.1, .critic_penalty = 0.5, .smaller_critic = true},
      {64, 64, 64});
}

TEST(Td3Update, ARestoredUpdateGoesOnWithTheSameNumbers) {
  Rng rng(6);
  const auto make = [] {
    Rng fixed(7);
    TanhGaussianPolicy actor = PlainActor(4, 2, {16}, fixed);
    Mlp critic(6, {16}, 1);
    critic.Initialize(fixed);
    return Td3Update<Mlp, MlpPass>(actor, critic, critic, {.policy_delay = 3});
  };
  auto update = make(), restored = make();
  for (int step = 0; step < 4; ++step) update.Step(RandomOfflineBatch(4, 2, rng));
  NpzArrays arrays;
  update.Save(arrays);
  restored.Restore(ParseNpz(NpzBytes(arrays), "memory"));
  for (int step = 0; step < 4; ++step) {
    const OfflineBatch batch = RandomOfflineBatch(4, 2, rng);
    const Td3Losses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.critic_loss, b.critic_loss);
    EXPECT_EQ(a.actor_loss, b.actor_loss);
  }
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
}

}  // namespace oted::td3_update_torch_test
