#include <gtest/gtest.h>

#include <array>

#include "oted/nn/batch_norm_torch_testing.h"
#include "oted/rl/crossq_update.h"
#include "oted/rl/replay_torch_testing.h"

namespace oted {
namespace {

constexpr int kBatch = 64;

TanhGaussianPolicy MakePolicy(int obs_dim, int act_dim, const std::vector<int>& hidden) {
  const std::vector<double> low(static_cast<size_t>(act_dim), -1.0), high(static_cast<size_t>(act_dim), 1.0);
  return TanhGaussianPolicy(
      {std::vector<double>(static_cast<size_t>(obs_dim), 0.0), std::vector<double>(static_cast<size_t>(obs_dim), 1.0)},
      hidden, low, high);
}

CrossQUpdate MakeUpdate(int obs_dim, int act_dim, const std::vector<int>& hidden, const CrossQUpdateOptions& options) {
  Rng rng(11);
  return CrossQUpdate(MakePolicy(obs_dim, act_dim, hidden), hidden, options, rng);
}

/// Observations whose columns differ in size, but no more than keeps actions off their bounds: there single precision
/// knows log(1 - a^2 + 1e-6) to a few per cent only.
TransitionBatch RandomBatch(int obs_dim, int act_dim, Rng& rng) {
  ReplayBuffer buffer(obs_dim, act_dim, kBatch);
  std::vector<double> s(static_cast<size_t>(obs_dim)), s_next(s), a(static_cast<size_t>(act_dim));
  for (int row = 0; row < kBatch; ++row) {
    for (size_t j = 0; j < s.size(); ++j) {
      const double size = 0.2 + 0.8 * static_cast<double>(j) / obs_dim;
      s[j] = size * rng.Normal() + 0.1;
      s_next[j] = size * rng.Normal() - 0.2;
    }
    for (double& v : a) v = rng.Uniform(-1, 1);
    buffer.Add(s, a, rng.Normal(), s_next, rng.Uniform() < 0.2);
  }
  TransitionBatch batch;
  buffer.Sample(kBatch, rng, batch);
  for (float& v : batch.noise) v *= 0.3f;
  return batch;
}

/// CrossQ as sb3-contrib writes it, on autograd and in double precision. Same start as `update`.
class TorchCrossQ {
 public:
  TorchCrossQ(CrossQUpdate& update, const CrossQUpdateOptions& options)
      : options_(options),
        actor(update.actor_net()),
        critics{TorchBatchNormMlp(update.critic(0)), TorchBatchNormMlp(update.critic(1))},
        log_alpha(torch::full({1}, update.log_alpha(), torch::kFloat64).requires_grad_()),
        act_dim_(update.actor().act_dim()),
        actor_adam_(actor.parameters, Options(options, options.beta1)),
        critic_adam_(Joined(), Options(options, options.beta1)),
        alpha_adam_({log_alpha}, Options(options, 0.9)) {}

  ReplayLosses Step(const TransitionBatch& batch) {
    const int64_t n = batch.size, obs_dim = actor.parameters[0].size(0);
    const torch::Tensor both = ToTensor(batch.observations, 2 * n, obs_dim),
                        noise = ToTensor(batch.noise, 2 * n, act_dim_);
    const torch::Tensor s = both.slice(0, 0, n), s_next = both.slice(0, n, 2 * n);
    const torch::Tensor reward = ToTensor(batch.rewards, n, 1), terminated = ToTensor(batch.terminated, n, 1);
    const torch::Tensor alpha = log_alpha.detach().exp();
    const bool renormalise = n_updates_ > options_.renorm_warmup;

    const auto [next_action, next_log_prob] = TorchSquash(actor.Evaluate(s_next).detach(), noise.slice(0, n, 2 * n));
    const torch::Tensor joint = ToTensor(batch.joint, n, obs_dim + act_dim_);
    const torch::Tensor all = torch::cat({joint, torch::cat({s_next, next_action}, 1)}, 0);
    std::array<torch::Tensor, 2> q, q_next;
    for (size_t i = 0; i < 2; ++i) {
      const torch::Tensor values = critics[i].Train(all, options_.momentum, renormalise);
      q[i] = values.slice(0, 0, n);
      q_next[i] = values.slice(0, n, 2 * n).detach();
    }
    const torch::Tensor y =
        reward + (1 - terminated) * options_.gamma * (torch::minimum(q_next[0], q_next[1]) - alpha * next_log_prob);
    const torch::Tensor critic_loss = 0.5 * (torch::mse_loss(q[0], y) + torch::mse_loss(q[1], y));
    Minimise(critic_adam_, critic_loss);
    losses_.critic_loss = critic_loss.item<double>();
    losses_.mean_q = (0.5 * (q[0] + q[1])).mean().item<double>();

    if (++n_updates_ % options_.policy_delay != 0) return losses_;
    const auto [action, log_prob] =
        TorchSquash(actor.Train(s, options_.momentum, n_updates_ > options_.renorm_warmup), noise.slice(0, 0, n));
    const torch::Tensor alpha_loss = -(log_alpha * (log_prob + options_.target_entropy).detach()).mean();
    Minimise(alpha_adam_, alpha_loss);
    const torch::Tensor on_policy = torch::cat({s, action}, 1);
    const torch::Tensor q_pi = torch::minimum(critics[0].Evaluate(on_policy), critics[1].Evaluate(on_policy));
    const torch::Tensor actor_loss = (alpha * log_prob - q_pi).mean();
    Minimise(actor_adam_, actor_loss);
    losses_.actor_loss = actor_loss.item<double>();
    losses_.alpha = alpha.item<double>();
    losses_.alpha_loss = alpha_loss.item<double>();
    return losses_;
  }

 private:
  CrossQUpdateOptions options_;

 public:
  TorchBatchNormMlp actor;
  std::array<TorchBatchNormMlp, 2> critics;
  torch::Tensor log_alpha;

 private:
  static torch::optim::AdamOptions Options(const CrossQUpdateOptions& options, double beta1) {
    return torch::optim::AdamOptions(options.learning_rate).betas({beta1, 0.999});
  }

  std::vector<torch::Tensor> Joined() const {
    std::vector<torch::Tensor> all = critics[0].parameters;
    all.insert(all.end(), critics[1].parameters.begin(), critics[1].parameters.end());
    return all;
  }

  int64_t act_dim_, n_updates_ = 0;
  ReplayLosses losses_;
  torch::optim::Adam actor_adam_, critic_adam_, alpha_adam_;
};

// Adam divides a gradient by its own size, so where a gradient's terms cancel to their rounding error a step is that
// error's sign. With batch normalisation this is so at once for the bias of a layer whose outputs are normalised after
// the rectifier of dead units, and elsewhere over many steps.
constexpr double kTolerance = 3e-5;

void CompareOverSteps(int obs_dim, int act_dim, int64_t renorm_warmup) {
  torch::set_num_threads(1);
  CrossQUpdateOptions options;
  options.learning_rate = 3e-4;
  options.target_entropy = -act_dim;
  options.momentum = 0.05;
  options.renorm_warmup = renorm_warmup;
  CrossQUpdate update = MakeUpdate(obs_dim, act_dim, {128, 128}, options);
  const auto actor_start = update.actor_net().parameters();
  const auto running_start = update.critic(0).running();
  TorchCrossQ reference(update, options);
  Rng rng(12);
  for (int step = 0; step < 60; ++step) {
    const TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    ExpectNear(update.Step(batch), reference.Step(batch), step);
  }
  EXPECT_LT(MaxDifference(update.actor_net().parameters(), reference.actor.Flat()), kTolerance);
  EXPECT_LT(MaxDifference(update.actor_net().running(), reference.actor.FlatRunning()), kTolerance);
  for (int i = 0; i < 2; ++i) {
    const size_t k = static_cast<size_t>(i);
    EXPECT_LT(MaxDifference(update.critic(i).parameters(), reference.critics[k].Flat()), kTolerance) << i;
    EXPECT_LT(MaxDifference(update.critic(i).running(), reference.critics[k].FlatRunning()), 10 * kTolerance) << i;
  }
  EXPECT_NEAR(update.log_alpha(), reference.log_alpha.item<double>(), kTolerance);
  // What is compared has moved by far more than the tolerance.
  EXPECT_GT(MaxDifference(update.actor_net().parameters(), actor_start), 100 * kTolerance);
  EXPECT_GT(MaxDifference(update.critic(0).running(), running_start), 100 * kTolerance);
  EXPECT_GT(std::abs(update.log_alpha()), 100 * kTolerance);
}

TEST(CrossQUpdateAgainstAutograd, StaysEqualOverSixtyStepsByTheBatchsStatistics) { CompareOverSteps(17, 6, 100); }
TEST(CrossQUpdateAgainstAutograd, StaysEqualOverSixtyStepsWhereRenormalisationBegins) { CompareOverSteps(11, 3, 20); }

TEST(CrossQUpdate, TheActorMovesInEveryThirdStepAlone) {
  CrossQUpdateOptions options;
  options.target_entropy = -2;
  CrossQUpdate update = MakeUpdate(3, 2, {16}, options);
  Rng rng(15);
  for (int step = 1; step <= 9; ++step) {
    const auto before = update.actor().net().parameters();
    const double log_alpha = update.log_alpha();
    update.Step(RandomBatch(3, 2, rng));
    EXPECT_EQ(update.actor().net().parameters() != before, step % 3 == 0) << step;
    EXPECT_EQ(update.log_alpha() != log_alpha, step % 3 == 0) << step;
  }
}

TEST(CrossQUpdate, ARestoredUpdateGoesOnWithTheSameNumbers) {
  const int obs_dim = 3, act_dim = 2;
  CrossQUpdateOptions options;
  options.target_entropy = -act_dim;
  Rng rng(15);
  CrossQUpdate update = MakeUpdate(obs_dim, act_dim, {16}, options);
  for (int step = 0; step < 5; ++step) update.Step(RandomBatch(obs_dim, act_dim, rng));
  NpzArrays arrays;
  update.Save(arrays);
  CrossQUpdate restored = MakeUpdate(obs_dim, act_dim, {16}, options);
  restored.Restore(ParseNpz(NpzBytes(arrays), "memory"));
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
  for (int step = 0; step < 7; ++step) {
    const TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    const ReplayLosses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.critic_loss, b.critic_loss);
    if (step > 0) {  // before, the loss is of a step that the restored one has not seen
      EXPECT_EQ(a.actor_loss, b.actor_loss);
    }
  }
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
  EXPECT_EQ(update.critic(1).parameters(), restored.critic(1).parameters());
  EXPECT_EQ(update.critic(1).running(), restored.critic(1).running());
}

}  // namespace
}  // namespace oted
