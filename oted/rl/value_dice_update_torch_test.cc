#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"
#include "oted/rl/value_dice_update.h"

// After the headers of ours: it brings logging macros of its own.
#include <torch/csrc/autograd/autograd.h>

namespace oted::value_dice_update_torch_test {

constexpr int kBatch = 48;

TanhGaussianPolicy MakeActor(int obs_dim, int act_dim, const std::vector<int>& hidden) {
  const auto width = static_cast<size_t>(obs_dim), n = static_cast<size_t>(act_dim);
  TanhGaussianPolicy actor({std::vector<double>(width, 0.0), std::vector<double>(width, 1.0)}, hidden,
                           std::vector<double>(n, -1.0), std::vector<double>(n, 1.0));
  Rng rng(11);
  actor.net().Initialize(rng);
  return actor;
}

ValueDiceBatch RandomBatch(int obs_dim, int act_dim, bool has_replay, Rng& rng) {
  ValueDiceBatch batch;
  batch.size = kBatch;
  batch.has_replay = has_replay;
  const size_t n_replay = has_replay ? kBatch : 0;
  batch.observations.resize((2 * kBatch + n_replay) * static_cast<size_t>(obs_dim));
  batch.joint.resize((kBatch + n_replay) * static_cast<size_t>(obs_dim + act_dim));
  batch.noise.resize((2 * kBatch + n_replay) * static_cast<size_t>(act_dim));
  batch.mix.resize(kBatch);
  for (AlignedVector<float>* values : {&batch.observations, &batch.joint, &batch.noise}) {
    rng.FillNormal({values->data(), values->size()});
  }
  for (float& v : batch.mix) v = static_cast<float>(rng.Uniform());
  return batch;
}

/// ValueDICE as its paper writes it, on autograd and in double precision.
class TorchValueDice {
 public:
  TorchValueDice(const ValueDiceUpdate& update, const ValueDiceOptions& options)
      : actor(update.actor().net()),
        critic(update.critic()),
        options_(options),
        act_dim_(update.actor().act_dim()),
        actor_adam_(actor.parameters, torch::optim::AdamOptions(options.actor_learning_rate)),
        critic_adam_(critic.parameters, torch::optim::AdamOptions(options.critic_learning_rate)) {}

  ValueDiceLosses Step(const ValueDiceBatch& batch) {
    const int64_t n = batch.size, obs_dim = actor.parameters[0].size(0), parts = batch.has_replay ? 3 : 2;
    const torch::Tensor observations = ToTensor(batch.observations, parts * n, obs_dim);
    const torch::Tensor noise = ToTensor(batch.noise, parts * n, act_dim_);
    const torch::Tensor joint = ToTensor(batch.joint, (parts - 1) * n, obs_dim + act_dim_);
    const torch::Tensor out = actor.Forward(observations);
    const torch::Tensor log_std = out.slice(1, act_dim_, 2 * act_dim_).clamp(-5, 2);
    const torch::Tensor action = (out.slice(1, 0, act_dim_) + log_std.exp() * noise).tanh();
    const torch::Tensor drawn = torch::cat({observations, action}, 1);

    const torch::Tensor nu = critic.Forward(joint), nu_drawn = critic.Forward(drawn);
    const double gamma = options_.gamma, alpha = batch.has_replay ? options_.replay_share : 0;
    const torch::Tensor x = nu - gamma * nu_drawn.slice(0, n, parts * n);
    torch::Tensor weight = torch::full({n, 1}, (1 - alpha) / static_cast<double>(n), torch::kFloat64);
    torch::Tensor linear = (1 - alpha) * (1 - gamma) * nu_drawn.slice(0, 0, n).mean();
    if (batch.has_replay) {
      weight = torch::cat({weight, torch::full({n, 1}, alpha / static_cast<double>(n), torch::kFloat64)}, 0);
      linear = linear + alpha * x.slice(0, n, 2 * n).mean();
    }
    const torch::Tensor objective = (weight * x.exp()).sum().log() - linear;

    const torch::Tensor mix = ToTensor(batch.mix, n, 1);
    const torch::Tensor first = batch.has_replay ? joint.slice(0, n, 2 * n) : drawn.slice(0, 0, n);
    const torch::Tensor even = 1 - torch::arange(n, torch::kFloat64).remainder(2).reshape({n, 1});
    const torch::Tensor other = even * first + (1 - even) * drawn.slice(0, n, 2 * n);
    const torch::Tensor between = (mix * joint.slice(0, 0, n) + (1 - mix) * other).detach().requires_grad_();
    const torch::Tensor slope = torch::autograd::grad({critic.Forward(between).sum()}, {between}, {}, true, true)[0];
    const torch::Tensor penalty = (slope.norm(2, 1) - 1).pow(2).mean();

    torch::Tensor orthogonality = torch::zeros({}, torch::kFloat64);
    for (size_t l = 0; l < actor.parameters.size(); l += 2) {
      const torch::Tensor gram = actor.parameters[l].t().matmul(actor.parameters[l]);
      orthogonality = orthogonality + (gram - gram.diagonal().diag()).pow(2).sum();
    }
    const auto critic_gradients = torch::autograd::grad({objective + options_.gradient_penalty * penalty},
                                                        critic.parameters, {}, true, false, true);
    const auto actor_gradients =
        torch::autograd::grad({-objective + options_.orthogonal * orthogonality}, actor.parameters, {}, true);
    Move(critic_adam_, critic.parameters, critic_gradients);
    Move(actor_adam_, actor.parameters, actor_gradients);
    return {objective.item<double>(), penalty.item<double>(), orthogonality.item<double>()};
  }

  AutogradMlp actor, critic;

 private:
  static void Move(torch::optim::Adam& adam, std::vector<torch::Tensor>& parameters,
                   const std::vector<torch::Tensor>& gradients) {
    for (size_t i = 0; i < parameters.size(); ++i) {
      parameters[i].mutable_grad() = gradients[i].defined() ? gradients[i] : torch::zeros_like(parameters[i]);
    }
    adam.step();
  }

  ValueDiceOptions options_;
  int64_t act_dim_;
  torch::optim::Adam actor_adam_, critic_adam_;
};

void CompareOverSteps(int obs_dim, int act_dim, bool has_replay) {
  torch::set_num_threads(1);
  ValueDiceOptions options;
  options.actor_learning_rate = 1e-3;  // so that forty steps show
  options.orthogonal = 0.01;
  options.replay_share = has_replay ? 0.3 : 0;
  Rng rng(12);
  ValueDiceUpdate update(MakeActor(obs_dim, act_dim, {64, 64}), {128, 128}, options, rng);
  const auto actor_start = update.actor().net().parameters();
  const auto critic_start = update.critic().parameters();
  TorchValueDice reference(update, options);
  for (int step = 0; step < 40; ++step) {
    const ValueDiceBatch batch = RandomBatch(obs_dim, act_dim, has_replay, rng);
    const ValueDiceLosses got = update.Step(batch), want = reference.Step(batch);
    EXPECT_NEAR(got.objective, want.objective, 2e-5 * (1 + std::abs(want.objective))) << step;
    EXPECT_NEAR(got.penalty, want.penalty, 2e-5 * (1 + want.penalty)) << step;
    EXPECT_NEAR(got.orthogonality, want.orthogonality, 2e-5 * (1 + want.orthogonality)) << step;
  }
  // Adam's step is the learning rate whatever the gradient's size, so that rounding counts for most where a gradient
  // is nearly zero: a hundredth of what was moved.
  EXPECT_LT(MaxDifference(update.actor().net().parameters(), Flattened(reference.actor.parameters)), 1e-4);
  // J does not depend on a constant in nu, whose derivative is rounding alone: the last bias stays.
  AlignedVector<float> critic = update.critic().parameters();
  std::vector<double> expected = Flattened(reference.critic.parameters);
  EXPECT_EQ(critic.back(), critic_start.back());
  critic.pop_back();
  expected.pop_back();
  EXPECT_LT(MaxDifference(critic, expected), 1e-4);
  EXPECT_GT(MaxDifference(update.actor().net().parameters(), actor_start), 1e-2);
  EXPECT_GT(MaxDifference(update.critic().parameters(), critic_start), 1e-2);
}

TEST(ValueDiceUpdateAgainstAutograd, StaysEqualOverFortySteps) { CompareOverSteps(17, 6, false); }
TEST(ValueDiceUpdateAgainstAutograd, StaysEqualWithAReplay) { CompareOverSteps(11, 3, true); }

}  // namespace oted::value_dice_update_torch_test
