#include "oted/rl/autograd/autograd_sac.h"

namespace oted {

ReplayLosses AutogradSac::Step(const TransitionBatch& transitions) {
  const AutogradBatch batch(transitions, where_);
  const auto [action, log_prob] = AutogradSquash(actor.Forward(batch.s), batch.noise);
  const torch::Tensor alpha = temperature.alpha();
  const torch::Tensor alpha_loss = temperature.Loss(log_prob, options_.target_entropy);
  Minimise(alpha_loss, {&alpha_adam_});

  torch::Tensor y;
  {
    const torch::NoGradGuard no_grad;
    const auto [next_action, next_log_prob] = AutogradSquash(actor.Forward(batch.s_next), batch.next_noise);
    const torch::Tensor next = torch::cat({batch.s_next, next_action}, 1);
    const torch::Tensor q = torch::minimum(targets[0].Forward(next), targets[1].Forward(next)) - alpha * next_log_prob;
    y = batch.reward + batch.discount * q;
  }
  const torch::Tensor q0 = critics[0].Forward(batch.joint), q1 = critics[1].Forward(batch.joint);
  const torch::Tensor critic_loss = 0.5 * (torch::mse_loss(q0, y) + torch::mse_loss(q1, y));
  Minimise(critic_loss, {&critic_adam_[0], &critic_adam_[1]});

  const torch::Tensor on_policy = torch::cat({batch.s, action}, 1);
  const torch::Tensor q_pi = torch::minimum(critics[0].Forward(on_policy), critics[1].Forward(on_policy));
  const torch::Tensor actor_loss = (alpha * log_prob - q_pi).mean();
  Minimise(actor_loss, {&actor_adam_});

  for (int i = 0; i < 2; ++i) targets[i].flat.lerp_(critics[i].flat, options_.tau);
  return ToLosses({critic_loss, actor_loss, alpha, alpha_loss, (0.5 * (q0 + q1)).mean()});
}

}  // namespace oted
