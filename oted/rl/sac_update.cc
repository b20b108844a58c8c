#include "oted/rl/sac_update.h"

#include <algorithm>

#include "oted/base/error.h"
#include "oted/nn/kernels.h"

namespace oted {

SacUpdate::SacUpdate(TanhGaussianPolicy actor, const std::vector<int>& critic_hidden, const SacUpdateOptions& options,
                     Rng& rng)
    : options_(options),
      actor_(std::move(actor)),
      temperature_(options.initial_alpha, options.target_entropy, static_cast<float>(options.learning_rate)) {
  const Adam::Options adam{.learning_rate = static_cast<float>(options.learning_rate)};
  for (int i = 0; i < 2; ++i) {
    critics_[i] = Mlp(actor_.obs_dim() + actor_.act_dim(), critic_hidden, 1);
    critics_[i].Initialize(rng);
    target_critics_[i] = critics_[i];
    critic_adam_[i] = Adam(critics_[i].n_parameters(), adam);
  }
  actor_adam_ = Adam(actor_.net().n_parameters(), adam);
  actor_gradient_.resize(actor_.net().n_parameters());
  critic_gradient_.resize(critics_[0].n_parameters());
}

ReplayLosses SacUpdate::Step(const TransitionBatch& batch) {
  const float alpha = temperature_.alpha();
  ForwardActor(batch);
  const double mean_log_prob = actions_.MeanLogProb(batch.size);
  const double alpha_loss = temperature_.Step(mean_log_prob);
  ReplayLosses losses = StepCritics(batch, alpha);
  losses.actor_loss = StepActor(batch, alpha) + alpha * mean_log_prob;
  losses.alpha = alpha;
  losses.alpha_loss = alpha_loss;
  return losses;
}

/// a ~ pi(.|s) and a' ~ pi(.|s') with their log probabilities, in one pass over [s; s'].
void SacUpdate::ForwardActor(const TransitionBatch& batch) {
  const int obs_dim = actor_.obs_dim(), n = batch.size;
  actor_out_ = actor_pass_.Forward(actor_.net(), batch.observations.data(), 2 * n);
  actions_.Forward(actor_out_, batch.noise.data(), 2 * n, actor_.act_dim());
  joint_pi_.resize(batch.joint.size());
  joint_next_.resize(batch.joint.size());
  actions_.Join(batch.observations.data(), obs_dim, 0, n, joint_pi_.data());
  actions_.Join(batch.observations.data() + static_cast<ptrdiff_t>(n) * obs_dim, obs_dim, n, n, joint_next_.data());
}

ReplayLosses SacUpdate::StepCritics(const TransitionBatch& batch, float alpha) {
  const size_t n = static_cast<size_t>(batch.size);
  target_.resize(n);
  dq_.resize(n);

  // y = r + discount (min_i Q'_i(s', a') - alpha log pi(a'|s'))
  for (int i = 0; i < 2; ++i) {
    const float* q = critic_pass_[0].Forward(target_critics_[i], joint_next_.data(), batch.size);
    for (size_t b = 0; b < n; ++b) target_[b] = i == 0 ? q[b] : std::min(target_[b], q[b]);
  }
  for (size_t b = 0; b < n; ++b) {
    target_[b] = batch.rewards[b] + batch.discounts[b] * (target_[b] - alpha * actions_.log_prob()[n + b]);
  }

  ReplayLosses losses;
  for (int i = 0; i < 2; ++i) {
    const float* q = critic_pass_[0].Forward(critics_[i], batch.joint.data(), batch.size);
    for (size_t b = 0; b < n; ++b) {
      const float error = q[b] - target_[b];
      losses.critic_loss += 0.5 * error * error / static_cast<double>(n);
      losses.mean_q += 0.5 * q[b] / static_cast<double>(n);
      dq_[b] = error / static_cast<float>(n);
    }
    critic_pass_[0].Backward(critics_[i], batch.joint.data(), dq_.data(), batch.size,
                             {.parameters = critic_gradient_.data()});
    // The targets follow at once: nothing below reads them in this step, and the critics are in the cache.
    critic_adam_[i].Step(critics_[i].parameters(), critic_gradient_, target_critics_[i].parameters(),
                         static_cast<float>(options_.tau));
  }
  return losses;
}

/// Returns mean -min_i Q_i(s, a), the critics' part of the actor's loss.
double SacUpdate::StepActor(const TransitionBatch& batch, float alpha) {
  const double loss = action_gradient_.Compute(critics_, critic_pass_, joint_pi_.data(), actor_.obs_dim(),
                                               actor_.act_dim(), batch.size);
  // The actor's activations at s are still those of ForwardActor: its parameters have not moved since.
  actor_dout_.resize(static_cast<size_t>(batch.size) * static_cast<size_t>(actor_.net().out()));
  actions_.Backward(actor_out_, batch.noise.data(), action_gradient_.dq_da(), alpha, batch.size, actor_dout_.data());
  actor_pass_.Backward(actor_.net(), batch.observations.data(), actor_dout_.data(), batch.size,
                       {.parameters = actor_gradient_.data()});
  actor_adam_.Step(actor_.net().parameters(), actor_gradient_);
  return loss;
}

LearnedState SacUpdate::State() {
  LearnedState state("sac/");
  state.Add("actor", actor_.net().parameters(), actor_adam_);
  state.Add("critic0", critics_[0].parameters(), critic_adam_[0]);
  state.Add("critic1", critics_[1].parameters(), critic_adam_[1]);
  temperature_.AddTo(state);
  state.Add("target0", target_critics_[0].parameters());
  state.Add("target1", target_critics_[1].parameters());
  return state;
}

}  // namespace oted
