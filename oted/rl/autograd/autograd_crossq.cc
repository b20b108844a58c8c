#include "oted/rl/autograd/autograd_crossq.h"

namespace oted {

ReplayLosses AutogradCrossQ::Step(const TransitionBatch& transitions) {
  const AutogradBatch batch(transitions, where_);
  const int64_t n = transitions.size;
  const torch::Tensor alpha = temperature.alpha();
  const auto renormalises = [&] { return critic_adam_[0].n_steps > options_.renorm_warmup; };

  const auto [next_action, next_log_prob] = AutogradSquash(actor.Evaluate(batch.s_next).detach(), batch.next_noise);
  const torch::Tensor both = torch::cat({batch.joint, torch::cat({batch.s_next, next_action}, 1)}, 0);
  torch::Tensor q[2], q_next[2];
  for (int i = 0; i < 2; ++i) {
    const torch::Tensor values = critics[i].Train(both, options_.momentum, renormalises());
    q[i] = values.narrow(0, 0, n);
    q_next[i] = values.narrow(0, n, n).detach();
  }
  const torch::Tensor value = torch::minimum(q_next[0], q_next[1]) - alpha * next_log_prob;
  const torch::Tensor y = batch.reward + batch.discount * value;
  const torch::Tensor critic_loss = 0.5 * (torch::mse_loss(q[0], y) + torch::mse_loss(q[1], y));
  Minimise(critic_loss, {&critic_adam_[0], &critic_adam_[1]});

  if (critic_adam_[0].n_steps % options_.policy_delay == 0) {
    const auto [action, log_prob] =
        AutogradSquash(actor.Train(batch.s, options_.momentum, renormalises()), batch.noise);
    const torch::Tensor alpha_loss = temperature.Loss(log_prob, options_.target_entropy);
    Minimise(alpha_loss, {&alpha_adam_});
    const torch::Tensor on_policy = torch::cat({batch.s, action}, 1);
    const torch::Tensor q_pi = torch::minimum(critics[0].Evaluate(on_policy), critics[1].Evaluate(on_policy));
    const torch::Tensor actor_loss = (alpha * log_prob - q_pi).mean();
    Minimise(actor_loss, {&actor_adam_});
    of_last_actor_step_ = {actor_loss.detach(), alpha, alpha_loss.detach()};
  }
  const auto& [actor_loss, last_alpha, alpha_loss] = of_last_actor_step_;
  return ToLosses({critic_loss, actor_loss, last_alpha, alpha_loss, (0.5 * (q[0] + q[1])).mean()});
}

}  // namespace oted
