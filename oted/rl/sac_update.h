#pragma once
/// One gradient step of Soft Actor-Critic (Haarnoja et al. 2019) with twin critics and automatic temperature.

#include <memory>
#include <vector>

#include "oted/data/npz.h"
#include "oted/nn/mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/action_gradient.h"
#include "oted/rl/learned_state.h"
#include "oted/rl/replay_training.h"
#include "oted/rl/squashed_actions.h"
#include "oted/rl/temperature.h"

namespace oted {

struct SacUpdateOptions {
  double learning_rate = 3e-4;  ///< of actor, critics and temperature
  double tau = 0.005;           ///< Polyak step of the target critics
  double target_entropy = 0;    ///< of the squashed action; usually -act_dim
  double initial_alpha = 1.0;   ///< temperature at the start
};

/// What a learner of SAC holds and does; the networks are on flat parameters.
///
///   alpha:   minimise  -log_alpha (log pi(a|s) + target_entropy)
///   critics: y = r + discount (min_i Q'_i(s', a') - alpha log pi(a'|s'))
///            minimise  1/2 sum_i mean (Q_i(s, a) - y)^2
///   actor:   minimise  mean alpha log pi(a|s) - min_i Q_i(s, a)
///   targets: Q'_i += tau (Q_i - Q'_i)
///
/// Order, losses and the constant 1e-6 in log(1 - a^2 + 1e-6) are Stable-Baselines3's. Gradients are written out by
/// hand; sac_update_test holds them against libtorch's autograd.
class SacUpdate : public ReplayUpdate {
 public:
  /// @param actor initialised; its normaliser is applied by the caller before observations enter a batch.
  SacUpdate(TanhGaussianPolicy actor, const std::vector<int>& critic_hidden, const SacUpdateOptions& options, Rng& rng);

  ReplayLosses Step(const TransitionBatch& batch) override;

  const TanhGaussianPolicy& actor() const override { return actor_; }
  Mlp& actor_net() { return actor_.net(); }
  Mlp& critic(int i) { return critics_[i]; }
  Mlp& target_critic(int i) { return target_critics_[i]; }
  double log_alpha() const { return temperature_.log_alpha(); }

  /// Parameters and optimiser moments under names that start with "sac/".
  void Save(NpzArrays& arrays) override { State().Save(arrays); }
  void Restore(const NpzArrays& arrays) override { State().Restore(arrays); }
  LearnedState State();

 private:
  void ForwardActor(const TransitionBatch& batch);
  ReplayLosses StepCritics(const TransitionBatch& batch, float alpha);
  double StepActor(const TransitionBatch& batch, float alpha);

  SacUpdateOptions options_;
  TanhGaussianPolicy actor_;
  Mlp critics_[2], target_critics_[2];
  Temperature temperature_;
  Adam actor_adam_, critic_adam_[2];

  MlpPass actor_pass_, critic_pass_[2];            // few, so that they stay in the cache
  const float* actor_out_ = nullptr;               // (2B, 2 act_dim), owned by actor_pass_
  SquashedActions actions_;                        // at s, then at s'
  ActionGradient action_gradient_;                 // of the smaller critic, at s
  AlignedVector<float> joint_pi_, joint_next_;     // (B, obs_dim + act_dim): [s, a~pi], [s', a'~pi]
  AlignedVector<float> target_, dq_, actor_dout_;  // gradients at the networks' outputs
  AlignedVector<float> actor_gradient_, critic_gradient_;
};

}  // namespace oted
