#include "oted/rl/offline/td3_update.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "oted/nn/kernels_math.h"

namespace oted {
namespace {

/// tanh of the leading half of each row of a policy network's output.
void MeanActions(const float* out, int rows, size_t act_dim, AlignedVector<float>& actions) {
  actions.resize(static_cast<size_t>(rows) * act_dim);
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    std::copy_n(out + 2 * b * act_dim, act_dim, actions.data() + b * act_dim);
  }
  kernels::Tanh(actions.data(), actions.data(), actions.size());
}

void JoinRows(const float* observations, size_t obs_dim, const AlignedVector<float>& actions, size_t act_dim,
              AlignedVector<float>& joint) {
  const size_t rows = actions.size() / act_dim;
  joint.resize(rows * (obs_dim + act_dim));
  float* to = joint.data();
  for (size_t b = 0; b < rows; ++b) {
    to = std::copy_n(observations + b * obs_dim, obs_dim, to);
    to = std::copy_n(actions.data() + b * act_dim, act_dim, to);
  }
}

}  // namespace

void MakeDeterministic(TanhGaussianPolicy& policy) {
  const Mlp::Layer& last = policy.net().layers().back();
  const int act_dim = policy.act_dim();
  float* parameters = policy.net().parameters().data();
  for (int i = 0; i < last.in; ++i) std::fill_n(parameters + last.weight + i * last.out + act_dim, act_dim, 0.0f);
  std::fill_n(parameters + last.bias + act_dim, act_dim, kLogStdMin);
}

template <class Net, class Pass>
Td3Update<Net, Pass>::Td3Update(TanhGaussianPolicy actor, Net critic0, Net critic1, const Td3Options& options)
    : options_(options), actor_(std::move(actor)), critics_{std::move(critic0), std::move(critic1)} {
  MakeDeterministic(actor_);
  target_actor_ = actor_.net();
  const Adam::Options adam{.learning_rate = static_cast<float>(options.learning_rate)};
  actor_adam_ = Adam(actor_.net().n_parameters(), adam);
  for (int i = 0; i < 2; ++i) {
    target_critics_[i] = critics_[i];
    critic_adam_[i] = Adam(critics_[i].n_parameters(), adam);
  }
  actor_gradient_.resize(actor_.net().n_parameters());
  critic_gradient_.resize(critics_[0].n_parameters());
}

template <class Net, class Pass>
Td3Losses Td3Update<Net, Pass>::Step(const OfflineBatch& batch) {
  Target(batch);
  Td3Losses losses = StepCritics(batch);
  since_actor_[0] += 1;
  if (static_cast<int>(since_actor_[0]) >= options_.policy_delay) {
    since_actor_ = {0, static_cast<float>(StepActor(batch))};
    const auto follow = [&](AlignedVector<float>& target, const AlignedVector<float>& parameters) {
      const float tau = static_cast<float>(options_.tau);
      for (size_t k = 0; k < target.size(); ++k) target[k] += tau * (parameters[k] - target[k]);
    };
    follow(target_actor_.parameters(), actor_.net().parameters());
    for (int i = 0; i < 2; ++i) follow(target_critics_[i].parameters(), critics_[i].parameters());
  }
  losses.actor_loss = since_actor_[1];
  return losses;
}

/// Fills target_ with y.
template <class Net, class Pass>
void Td3Update<Net, Pass>::Target(const OfflineBatch& batch) {
  const size_t n = static_cast<size_t>(batch.size), obs_dim = static_cast<size_t>(actor_.obs_dim()),
               act_dim = static_cast<size_t>(actor_.act_dim());
  const float* next = batch.observations.data() + n * obs_dim;
  MeanActions(actor_pass_.Forward(target_actor_, next, batch.size), batch.size, act_dim, actions_);
  const float* noise = batch.noise.data() + n * act_dim;
  const float scale = static_cast<float>(options_.noise), clip = static_cast<float>(options_.noise_clip);
  for (size_t i = 0; i < actions_.size(); ++i) {
    actions_[i] = std::clamp(actions_[i] + std::clamp(scale * noise[i], -clip, clip), -1.0f, 1.0f);
  }
  JoinRows(next, obs_dim, actions_, act_dim, joint_);
  target_.resize(n);
  for (int i = 0; i < 2; ++i) {
    const float* q = critic_pass_[0].Forward(target_critics_[i], joint_.data(), batch.size);
    for (size_t b = 0; b < n; ++b) target_[b] = i == 0 ? q[b] : std::min(target_[b], q[b]);
  }
  const float gamma = static_cast<float>(options_.gamma), penalty = static_cast<float>(options_.critic_penalty);
  for (size_t b = 0; b < n; ++b) {
    float square = 0;
    for (size_t j = b * act_dim; j < (b + 1) * act_dim; ++j) {
      square += (actions_[j] - batch.next_actions[j]) * (actions_[j] - batch.next_actions[j]);
    }
    target_[b] = batch.rewards[b] + gamma * (1.0f - batch.terminated[b]) * (target_[b] - penalty * square);
  }
}

template <class Net, class Pass>
Td3Losses Td3Update<Net, Pass>::StepCritics(const OfflineBatch& batch) {
  const size_t n = static_cast<size_t>(batch.size);
  dq_.resize(n);
  Td3Losses losses;
  for (int i = 0; i < 2; ++i) {
    const float* q = critic_pass_[0].Forward(critics_[i], batch.joint.data(), batch.size);
    for (size_t b = 0; b < n; ++b) {
      const float error = q[b] - target_[b];
      losses.critic_loss += static_cast<double>(error) * error / static_cast<double>(n);
      losses.mean_q += 0.5 * q[b] / static_cast<double>(n);
      dq_[b] = 2.0f * error / static_cast<float>(n);
    }
    critic_pass_[0].Backward(critics_[i], batch.joint.data(), dq_.data(), batch.size,
                             {.parameters = critic_gradient_.data()});
    critic_adam_[i].Step(critics_[i].parameters(), critic_gradient_);
  }
  return losses;
}

/// Fills da_ with d mean Q / d a. @return value_weight / mean |Q|
template <class Net, class Pass>
double Td3Update<Net, Pass>::ValueGradient(const OfflineBatch& batch, double& mean_q) {
  const size_t n = static_cast<size_t>(batch.size);
  const int obs_dim = actor_.obs_dim(), n_critics = options_.smaller_critic ? 2 : 1;
  const float* q[2] = {nullptr, nullptr};
  for (int i = 0; i < n_critics; ++i) q[i] = critic_pass_[i].Forward(critics_[i], joint_.data(), batch.size);
  std::vector<uint8_t> second(n);
  double size = 0;
  mean_q = 0;
  for (size_t b = 0; b < n; ++b) {
    second[b] = n_critics == 2 && q[1][b] < q[0][b];
    const double value = q[second[b]][b];
    mean_q += value / static_cast<double>(n);
    size += std::abs(value) / static_cast<double>(n);
  }
  da_.assign(n * static_cast<size_t>(actor_.act_dim()), 0.0f);
  part_.resize(da_.size());
  for (int i = 0; i < n_critics; ++i) {
    for (size_t b = 0; b < n; ++b) dq_[b] = second[b] == i ? 1.0f / static_cast<float>(n) : 0.0f;
    critic_pass_[i].Backward(critics_[i], joint_.data(), dq_.data(), batch.size,
                             {.x = part_.data(), .columns = {obs_dim, obs_dim + actor_.act_dim()}});
    for (size_t k = 0; k < da_.size(); ++k) da_[k] += part_[k];
  }
  return options_.value_weight / std::max(size, 1e-12);
}

template <class Net, class Pass>
double Td3Update<Net, Pass>::StepActor(const OfflineBatch& batch) {
  const size_t n = static_cast<size_t>(batch.size), obs_dim = static_cast<size_t>(actor_.obs_dim()),
               act_dim = static_cast<size_t>(actor_.act_dim());
  MeanActions(actor_pass_.Forward(actor_.net(), batch.observations.data(), batch.size), batch.size, act_dim, actions_);
  JoinRows(batch.observations.data(), obs_dim, actions_, act_dim, joint_);
  double mean_q = 0;
  const double lambda = ValueGradient(batch, mean_q);
  double loss = -lambda * mean_q;
  dout_.assign(2 * n * act_dim, 0.0f);
  const float of_logs = static_cast<float>(2 * options_.actor_penalty / static_cast<double>(n));
  for (size_t b = 0; b < n; ++b) {
    const float* logged = batch.joint.data() + b * (obs_dim + act_dim) + obs_dim;
    for (size_t j = 0; j < act_dim; ++j) {
      const size_t at = b * act_dim + j;
      const float action = actions_[at], away = action - logged[j];
      loss += options_.actor_penalty * away * away / static_cast<double>(n);
      dout_[2 * b * act_dim + j] = (of_logs * away - static_cast<float>(lambda) * da_[at]) * (1.0f - action * action);
    }
  }
  actor_pass_.Backward(actor_.net(), batch.observations.data(), dout_.data(), batch.size,
                       {.parameters = actor_gradient_.data()});
  actor_adam_.Step(actor_.net().parameters(), actor_gradient_);
  return loss;
}

template <class Net, class Pass>
LearnedState Td3Update<Net, Pass>::State() {
  LearnedState state("td3/");
  state.Add("actor", actor_.net().parameters(), actor_adam_);
  state.Add("critic0", critics_[0].parameters(), critic_adam_[0]);
  state.Add("critic1", critics_[1].parameters(), critic_adam_[1]);
  state.Add("target_actor", target_actor_.parameters());
  state.Add("target0", target_critics_[0].parameters());
  state.Add("target1", target_critics_[1].parameters());
  state.Add("since_actor", since_actor_);
  return state;
}

template <class Net, class Pass>
void Td3Update<Net, Pass>::Save(NpzArrays& arrays) {
  State().Save(arrays);
}

template <class Net, class Pass>
void Td3Update<Net, Pass>::Restore(const NpzArrays& arrays) {
  State().Restore(arrays);
}

template class Td3Update<Mlp, MlpPass>;
template class Td3Update<LayerNormMlp, LayerNormPass>;

}  // namespace oted
