#pragma once
/// CrossQUpdate's step as sb3-contrib writes it, on autograd. Includes torch's headers: for this folder and
/// *_torch_test.cc alone.

#include <array>

#include "oted/rl/autograd/learner.h"
#include "oted/rl/crossq_update.h"

namespace oted {

class AutogradCrossQ {
 public:
  /// Starts with `start`'s networks, running statistics and temperature, and fresh optimisers.
  AutogradCrossQ(CrossQUpdate& start, const CrossQUpdateOptions& options, const torch::TensorOptions& where)
      : options_(options),
        where_(where),
        actor(start.actor_net(), where),
        critics{AutogradBatchNormMlp(start.critic(0), where), AutogradBatchNormMlp(start.critic(1), where)},
        temperature(start.log_alpha(), where),
        actor_adam_(actor, options.learning_rate, options.beta1),
        critic_adam_{{critics[0], options.learning_rate, options.beta1},
                     {critics[1], options.learning_rate, options.beta1}},
        alpha_adam_(temperature, options.learning_rate, 0.9) {
    of_last_actor_step_.fill(torch::zeros({1}, where));
  }

  /// The losses of actor and temperature are those of their last step.
  ReplayLosses Step(const TransitionBatch& transitions);

  AutogradState State() {
    AutogradState state;
    state.Add("crossq/actor", actor_adam_);
    state.Add("crossq/actor/running", actor.running);
    state.Add("crossq/critic0", critic_adam_[0]);
    state.Add("crossq/critic0/running", critics[0].running);
    state.Add("crossq/critic1", critic_adam_[1]);
    state.Add("crossq/critic1/running", critics[1].running);
    state.Add("crossq/alpha", alpha_adam_);
    return state;
  }

 private:
  CrossQUpdateOptions options_;
  torch::TensorOptions where_;

 public:
  AutogradBatchNormMlp actor, critics[2];
  AutogradTemperature temperature;

 private:
  AutogradAdam actor_adam_, critic_adam_[2], alpha_adam_;
  std::array<torch::Tensor, 3> of_last_actor_step_;  // its loss, alpha, alpha's loss
};

}  // namespace oted
