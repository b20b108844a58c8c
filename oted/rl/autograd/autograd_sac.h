#pragma once
/// SacUpdate's step as Stable-Baselines3 writes it, on autograd. Includes torch's headers: for this folder and
/// *_torch_test.cc alone.

#include "oted/rl/autograd/learner.h"
#include "oted/rl/sac_update.h"

namespace oted {

class AutogradSac {
 public:
  /// Starts with `start`'s networks and temperature, and fresh optimisers.
  AutogradSac(SacUpdate& start, const SacUpdateOptions& options, const torch::TensorOptions& where)
      : options_(options),
        where_(where),
        actor(start.actor().net(), where),
        critics{AutogradMlp(start.critic(0), where), AutogradMlp(start.critic(1), where)},
        targets{AutogradMlp(start.target_critic(0), where), AutogradMlp(start.target_critic(1), where)},
        temperature(start.log_alpha(), where),
        actor_adam_(actor, options.learning_rate, 0.9),
        critic_adam_{{critics[0], options.learning_rate, 0.9}, {critics[1], options.learning_rate, 0.9}},
        alpha_adam_(temperature, options.learning_rate, 0.9) {}

  ReplayLosses Step(const TransitionBatch& transitions);

  AutogradState State() {
    AutogradState state;
    state.Add("sac/actor", actor_adam_);
    state.Add("sac/critic0", critic_adam_[0]);
    state.Add("sac/critic1", critic_adam_[1]);
    state.Add("sac/alpha", alpha_adam_);
    state.Add("sac/target0", targets[0].flat);
    state.Add("sac/target1", targets[1].flat);
    return state;
  }

 private:
  SacUpdateOptions options_;
  torch::TensorOptions where_;

 public:
  AutogradMlp actor, critics[2], targets[2];
  AutogradTemperature temperature;

 private:
  AutogradAdam actor_adam_, critic_adam_[2], alpha_adam_;
};

}  // namespace oted
