#include "oted/rl/crossq_update.h"

#include <algorithm>

namespace oted {

CrossQUpdate::CrossQUpdate(const TanhGaussianPolicy& actor, const std::vector<int>& critic_hidden,
                           const CrossQUpdateOptions& options, Rng& rng)
    : options_(options),
      actor_(actor),
      actor_net_(actor.obs_dim(), actor.net().hidden(), 2 * actor.act_dim()),
      temperature_(options.initial_alpha, options.target_entropy, static_cast<float>(options.learning_rate)) {
  const Adam::Options adam{.learning_rate = static_cast<float>(options.learning_rate),
                           .beta1 = static_cast<float>(options.beta1)};
  actor_net_.Initialize(rng);
  FoldActor();
  actor_adam_ = Adam(actor_net_.n_parameters(), adam);
  for (int i = 0; i < 2; ++i) {
    critics_[i] = BatchNormMlp(actor_.obs_dim() + actor_.act_dim(), critic_hidden, 1);
    critics_[i].Initialize(rng);
    critic_adam_[i] = Adam(critics_[i].n_parameters(), adam);
    folded_critics_[i] = Mlp(critics_[i].in(), critic_hidden, 1);
  }
  actor_gradient_.resize(actor_net_.n_parameters());
  critic_gradient_.resize(critics_[0].n_parameters());
}

ReplayLosses CrossQUpdate::Step(const TransitionBatch& batch) {
  const float alpha = temperature_.alpha();
  StepCritics(batch, alpha);
  if (n_updates() % options_.policy_delay == 0) StepActor(batch, alpha);
  return losses_;
}

void CrossQUpdate::StepCritics(const TransitionBatch& batch, float alpha) {
  const int obs_dim = actor_.obs_dim(), act_dim = actor_.act_dim();
  const size_t n = static_cast<size_t>(batch.size);
  const float* next_observations = batch.observations.data() + n * static_cast<size_t>(obs_dim);
  const float* next_noise = batch.noise.data() + n * static_cast<size_t>(act_dim);
  const float* out = next_pass_.Forward(actor_.net(), next_observations, batch.size);
  next_actions_.Forward(out, next_noise, batch.size, act_dim);
  both_.resize(2 * batch.joint.size());
  std::ranges::copy(batch.joint, both_.begin());
  next_actions_.Join(next_observations, obs_dim, 0, batch.size, both_.data() + batch.joint.size());

  const float* q[2];
  const bool renormalise = Renormalises();
  for (int i = 0; i < 2; ++i) {
    q[i] = critic_pass_[i].Forward(critics_[i], both_.data(), 2 * batch.size, static_cast<float>(options_.momentum),
                                   renormalise);
  }
  // y = r + discount (min_i Q_i(s', a') - alpha log pi(a'|s'))
  target_.resize(n);
  for (size_t b = 0; b < n; ++b) {
    const float value = std::min(q[0][n + b], q[1][n + b]) - alpha * next_actions_.log_prob()[b];
    target_[b] = batch.rewards[b] + batch.discounts[b] * value;
  }
  losses_.critic_loss = losses_.mean_q = 0;
  dq_.assign(2 * n, 0.0f);  // the rows of s' matter through the statistics alone
  for (int i = 0; i < 2; ++i) {
    for (size_t b = 0; b < n; ++b) {
      const float error = q[i][b] - target_[b];
      losses_.critic_loss += 0.5 * error * error / static_cast<double>(n);
      losses_.mean_q += 0.5 * q[i][b] / static_cast<double>(n);
      dq_[b] = error / static_cast<float>(n);
    }
    critic_pass_[i].Backward(critics_[i], both_.data(), dq_.data(), 2 * batch.size, critic_gradient_.data());
    critic_adam_[i].Step(critics_[i].parameters(), critic_gradient_);
  }
}

void CrossQUpdate::StepActor(const TransitionBatch& batch, float alpha) {
  const int obs_dim = actor_.obs_dim(), act_dim = actor_.act_dim();
  const float* out = actor_pass_.Forward(actor_net_, batch.observations.data(), batch.size,
                                         static_cast<float>(options_.momentum), Renormalises());
  actions_.Forward(out, batch.noise.data(), batch.size, act_dim);
  const double mean_log_prob = actions_.MeanLogProb(batch.size);
  losses_.alpha = alpha;
  losses_.alpha_loss = temperature_.Step(mean_log_prob);

  joint_pi_.resize(batch.joint.size());
  actions_.Join(batch.observations.data(), obs_dim, 0, batch.size, joint_pi_.data());
  for (int i = 0; i < 2; ++i) critics_[i].FoldInto(folded_critics_[i]);
  losses_.actor_loss = alpha * mean_log_prob + action_gradient_.Compute(folded_critics_, folded_pass_, joint_pi_.data(),
                                                                        obs_dim, act_dim, batch.size);
  actor_dout_.resize(static_cast<size_t>(batch.size) * static_cast<size_t>(2 * act_dim));
  actions_.Backward(out, batch.noise.data(), action_gradient_.dq_da(), alpha, batch.size, actor_dout_.data());
  actor_pass_.Backward(actor_net_, batch.observations.data(), actor_dout_.data(), batch.size, actor_gradient_.data());
  actor_adam_.Step(actor_net_.parameters(), actor_gradient_);
  FoldActor();
}

LearnedState CrossQUpdate::State() {
  LearnedState state("crossq/");
  state.Add("actor", actor_net_.parameters(), actor_adam_);
  state.Add("actor/running", actor_net_.running());
  state.Add("critic0", critics_[0].parameters(), critic_adam_[0]);
  state.Add("critic0/running", critics_[0].running());
  state.Add("critic1", critics_[1].parameters(), critic_adam_[1]);
  state.Add("critic1/running", critics_[1].running());
  temperature_.AddTo(state);
  return state;
}

void CrossQUpdate::Restore(const NpzArrays& arrays) {
  State().Restore(arrays);
  FoldActor();
}

}  // namespace oted
