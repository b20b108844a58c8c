#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"
#include "oted/rl/offline/fisher_brc_update.h"
#include "oted/rl/offline/offline_torch_testing.h"

namespace oted::fisher_brc_update_torch_test {

constexpr int kObs = 11, kAct = 3, kK = kMixtureComponents;
constexpr double kHalfLogTwoPi = 0.91893853320467274;

/// A network's outputs as (B, act_dim, components) each.
struct Mixtures {
  torch::Tensor logits, means, stds;
  explicit Mixtures(const torch::Tensor& out) {
    const auto part = [&](int k) { return out.slice(1, k * kAct * kK, (k + 1) * kAct * kK).reshape({-1, kAct, kK}); };
    logits = part(0);
    means = part(1);
    stds = part(2).clamp(-20, 2).exp();
  }
  /// log mu(tanh u|s), (B, 1)
  torch::Tensor LogDensityAt(const torch::Tensor& u) const {
    const torch::Tensor z = (u.unsqueeze(2) - means) / stds;
    const torch::Tensor terms = logits.log_softmax(2) - 0.5 * z.pow(2) - stds.log() - kHalfLogTwoPi;
    return (terms.logsumexp(2) - (1 - u.tanh().pow(2)).log()).sum(1, true);
  }
  torch::Tensor LogDensity(const torch::Tensor& actions) const {
    return LogDensityAt(actions.clamp(-1 + kMixtureMargin, 1 - kMixtureMargin).atanh());
  }
};

TEST(MixtureUpdateAgainstAutograd, StaysEqualOverFortySteps) {
  torch::set_num_threads(1);
  Rng rng(2);
  Mlp net = MixtureNet(kObs, {64, 64}, kAct);
  net.Initialize(rng);
  for (int j = 0; j < kAct * kK; ++j) {  // components apart
    net.parameters()[net.layers().back().bias + static_cast<size_t>(kAct * kK + j)] =
        0.4f * static_cast<float>(j % kK - 2);
  }
  const auto start = net.parameters();
  MixtureUpdate update(net, 1e-3);
  AutogradMlp reference(net);
  AutogradParameters log_alpha(torch::zeros({1}, torch::kFloat64));
  log_alpha.AddLeaf(0, 1, 1);
  AutogradAdam adam(reference, 1e-3, 0.9), alpha_adam(log_alpha, 1e-3, 0.9);
  for (int step = 0; step < 40; ++step) {
    const OfflineBatch batch = RandomOfflineBatch(kObs, kAct, rng);
    MixtureNoise noise;
    DrawMixtureNoise(batch.size, kAct, rng, noise);
    const BatchTensors b(batch, kObs, kAct);
    const Mixtures mu(reference.Forward(b.states));
    const torch::Tensor cumulative = mu.logits.softmax(2).cumsum(2).detach();
    const torch::Tensor uniforms = torch::tensor(noise.uniforms, torch::kFloat64).reshape({-1, kAct, 1});
    const torch::Tensor normals = torch::tensor(noise.normals, torch::kFloat64).reshape({-1, kAct});
    const torch::Tensor picked = (uniforms >= cumulative).sum(2, true).clamp_max(kK - 1);
    const torch::Tensor u = mu.means.gather(2, picked).squeeze(2) + mu.stds.gather(2, picked).squeeze(2) * normals;
    const torch::Tensor alpha = log_alpha.parameters[0].exp();
    const torch::Tensor log_density = mu.LogDensity(b.actions).mean(), entropy = -mu.LogDensityAt(u).mean();
    const MixtureLosses got = update.Step(batch, noise);
    EXPECT_NEAR(got.log_density, log_density.item<double>(), 1e-5 * (1 + std::abs(log_density.item<double>()))) << step;
    EXPECT_NEAR(got.entropy, entropy.item<double>(), 1e-5 * (1 + std::abs(entropy.item<double>()))) << step;
    EXPECT_NEAR(got.alpha, alpha.item<double>(), 1e-5) << step;
    Minimise(-(log_density + alpha.detach().squeeze() * entropy), {&adam});
    Minimise((alpha * (entropy.detach() + kAct)).sum(), {&alpha_adam});
  }
  EXPECT_LT(MaxDifference(update.net().parameters(), Flattened(reference.parameters)), 2e-5);
  EXPECT_NEAR(update.log_alpha(), log_alpha.flat.item<double>(), 1e-5);
  EXPECT_GT(MaxDifference(update.net().parameters(), start), 1e-2);
  EXPECT_GT(std::abs(update.log_alpha()), 1e-2);
}

/// Phase 2 as its paper writes it, on autograd and in double precision.
class TorchFisherBrc {
 public:
  TorchFisherBrc(FisherBrcUpdate& update, const FisherBrcOptions& options)
      : actor(update.actor().net()),
        mixture(update.mixture()),
        offsets{AutogradMlp(update.critic(0)), AutogradMlp(update.critic(1))},
        targets{AutogradMlp(update.target_critic(0)), AutogradMlp(update.target_critic(1))},
        log_alpha(torch::zeros({1}, torch::kFloat64)),
        options_(options),
        actor_adam_(actor, options.learning_rate, 0.9),
        adams_{AutogradAdam(offsets[0], options.learning_rate, 0.9),
               AutogradAdam(offsets[1], options.learning_rate, 0.9)},
        alpha_adam_(WithLeaf(log_alpha), options.learning_rate, 0.9) {}

  FisherBrcLosses Step(const OfflineBatch& batch) {
    const BatchTensors b(batch, kObs, kAct);
    const Mixtures mu(mixture.Forward(b.states).detach()), mu_next(mixture.Forward(b.next).detach());
    const auto [action, log_pi] = Act(b.states, b.noise);
    torch::Tensor y;
    {
      const torch::NoGradGuard no_grad;
      const torch::Tensor next = Act(b.next, b.next_noise).first;
      const torch::Tensor joint = torch::cat({b.next, next}, 1);
      const torch::Tensor smaller = torch::minimum(targets[0].Forward(joint), targets[1].Forward(joint));
      y = b.rewards + options_.reward_bonus +
          options_.gamma * (1 - b.terminated) * (smaller + mu_next.LogDensity(next));
    }
    FisherBrcLosses losses;
    const torch::Tensor of_logged = mu.LogDensity(b.actions);
    torch::Tensor critic_loss = torch::zeros({}, torch::kFloat64), penalty = critic_loss.clone();
    const torch::Tensor at = action.detach().clone().requires_grad_();
    for (const AutogradMlp& offset : offsets) {
      const torch::Tensor q = offset.Forward(b.joint) + of_logged;
      losses.mean_q += 0.5 * q.mean().item<double>();
      critic_loss = critic_loss + (q - y).pow(2).mean();
      const torch::Tensor value = offset.Forward(torch::cat({b.states, at}, 1)).sum();
      penalty = penalty + torch::autograd::grad({value}, {at}, {}, true, true)[0].pow(2).sum(1).mean();
    }
    losses.critic_loss = critic_loss.item<double>();
    losses.penalty = penalty.item<double>();
    // Plus zero: the last bias has no part in the penalty.
    Minimise(critic_loss + options_.gradient_penalty * penalty, {&adams_[0], &adams_[1]});
    {
      const torch::NoGradGuard no_grad;
      for (size_t i = 0; i < 2; ++i) targets[i].flat.lerp_(offsets[i].flat, options_.tau);
    }
    const torch::Tensor joint = torch::cat({b.states, action}, 1);
    const torch::Tensor alpha = log_alpha.parameters[0].exp();
    const torch::Tensor value =
        torch::minimum(offsets[0].Forward(joint), offsets[1].Forward(joint)) + mu.LogDensity(action);
    const torch::Tensor actor_loss = (alpha.detach() * log_pi - value).mean();
    losses.actor_loss = actor_loss.item<double>();
    losses.alpha = alpha.item<double>();
    const torch::Tensor alpha_loss = (alpha * (-log_pi.detach().mean() + kAct)).sum();
    Minimise(actor_loss, {&actor_adam_});
    Minimise(alpha_loss, {&alpha_adam_});
    return losses;
  }

  AutogradMlp actor, mixture;
  std::array<AutogradMlp, 2> offsets, targets;
  AutogradParameters log_alpha;

 private:
  static AutogradParameters& WithLeaf(AutogradParameters& parameters) {
    parameters.AddLeaf(0, 1, 1);
    return parameters;
  }
  std::pair<torch::Tensor, torch::Tensor> Act(const torch::Tensor& states, const torch::Tensor& noise) const {
    const torch::Tensor out = actor.Forward(states);
    const torch::Tensor log_std = out.slice(1, kAct, 2 * kAct).clamp(-20, 2);
    const torch::Tensor action = (out.slice(1, 0, kAct) + log_std.exp() * noise).tanh();
    const torch::Tensor log_pi =
        (-0.5 * noise.pow(2) - log_std - kHalfLogTwoPi - (1 - action.pow(2) + 1e-6).log()).sum(1, true);
    return {action, log_pi};
  }

  FisherBrcOptions options_;
  AutogradAdam actor_adam_;
  std::array<AutogradAdam, 2> adams_;
  AutogradAdam alpha_adam_;
};

FisherBrcUpdate MakeUpdate(Rng& rng, const FisherBrcOptions& options) {
  TanhGaussianPolicy actor = PlainActor(kObs, kAct, {64, 64, 64}, rng);
  Mlp mixture = MixtureNet(kObs, {32, 32}, kAct), offsets[2];
  mixture.Initialize(rng);
  for (Mlp& offset : offsets) {
    offset = Mlp(kObs + kAct, {64, 64, 64}, 1);
    offset.Initialize(rng);
  }
  return FisherBrcUpdate(actor, offsets[0], offsets[1], mixture, options);
}

/// Small noise: at |a| = 1 single precision knows log(1 - a^2) to a few per cent only.
OfflineBatch MildBatch(Rng& rng) {
  OfflineBatch batch = RandomOfflineBatch(kObs, kAct, rng);
  for (float& v : batch.noise) v *= 0.3f;
  return batch;
}

TEST(FisherBrcUpdateAgainstAutograd, StaysEqualOverFortySteps) {
  torch::set_num_threads(1);
  const FisherBrcOptions options{.tau = 0.05, .gradient_penalty = 0.5};
  Rng rng(3);
  FisherBrcUpdate update = MakeUpdate(rng, options);
  const auto actor_start = update.actor().net().parameters();
  const auto target_start = update.target_critic(0).parameters();
  TorchFisherBrc reference(update, options);
  for (int step = 0; step < 40; ++step) {
    const OfflineBatch batch = MildBatch(rng);
    const FisherBrcLosses got = update.Step(batch), want = reference.Step(batch);
    const auto near = [&](double a, double b, const char* what) {
      EXPECT_NEAR(a, b, 1e-5 * (1 + std::abs(b))) << what << " at step " << step;
    };
    near(got.critic_loss, want.critic_loss, "critic loss");
    near(got.penalty, want.penalty, "penalty");
    near(got.actor_loss, want.actor_loss, "actor loss");
    near(got.alpha, want.alpha, "alpha");
    near(got.mean_q, want.mean_q, "mean Q");
  }
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), Flattened(reference.actor.parameters)), 1e-5);
  for (int i = 0; i < 2; ++i) {
    const auto k = static_cast<size_t>(i);
    EXPECT_LT(MaxDifference(update.critic(i).parameters(), Flattened(reference.offsets[k].parameters)), 1e-5);
    EXPECT_LT(MaxDifference(update.target_critic(i).parameters(), Flattened(reference.targets[k].parameters)), 1e-5);
  }
  EXPECT_NEAR(update.log_alpha(), reference.log_alpha.flat.item<double>(), 1e-5);
  EXPECT_GT(MaxDifference(update.actor().net().parameters(), actor_start), 1e-3);
  EXPECT_GT(MaxDifference(update.target_critic(0).parameters(), target_start), 1e-3);
}

TEST(FisherBrcUpdate, ARestoredUpdateGoesOnWithTheSameNumbers) {
  Rng rng(4), one(5), other(6);
  FisherBrcUpdate update = MakeUpdate(one, {}), restored = MakeUpdate(other, {});
  for (int step = 0; step < 3; ++step) update.Step(MildBatch(rng));
  NpzArrays arrays;
  const auto state_of = [](FisherBrcUpdate& of) {
    LearnedState state("f_brc/");
    of.AddTo(state);
    return state;
  };
  state_of(update).Save(arrays);
  state_of(restored).Restore(ParseNpz(NpzBytes(arrays), "memory"));
  for (int step = 0; step < 3; ++step) {
    const OfflineBatch batch = MildBatch(rng);
    const FisherBrcLosses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.critic_loss, b.critic_loss);
    EXPECT_EQ(a.actor_loss, b.actor_loss);
  }
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
}

}  // namespace oted::fisher_brc_update_torch_test
