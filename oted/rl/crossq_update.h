#pragma once
/// One gradient step of CrossQ (Bhatt, Palenicek et al. 2024, "Batch normalization in deep reinforcement learning for
/// greater sample efficiency and simplicity"): Soft Actor-Critic with batch-normalised networks and no target networks.

#include <vector>

#include "oted/data/npz.h"
#include "oted/nn/batch_norm_mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/action_gradient.h"
#include "oted/rl/learned_state.h"
#include "oted/rl/replay_training.h"
#include "oted/rl/squashed_actions.h"
#include "oted/rl/temperature.h"

namespace oted {

/// Defaults are the paper's, as in sb3-contrib and sbx.
struct CrossQUpdateOptions {
  double learning_rate = 1e-3;  ///< of actor, critics and temperature
  double beta1 = 0.5;           ///< Adam's, of actor and critics
  double target_entropy = 0;    ///< of the squashed action; usually -act_dim
  double initial_alpha = 1.0;
  int policy_delay = 3;             ///< updates of the critics for one of actor and temperature
  double momentum = 0.01;           ///< of the running statistics
  int64_t renorm_warmup = 100'000;  ///< updates by the batch's statistics alone before renormalisation begins
};

/// What a learner of CrossQ holds and does.
///
///   critics: [Q_i(s, a); Q_i(s', a')] in one pass, so that one normalisation serves both
///            y = r + discount (min_i Q_i(s', a') - alpha log pi(a'|s')), a constant
///            minimise  1/2 sum_i mean (Q_i(s, a) - y)^2
///   in every policy_delay-th step, with the critics as they are then and their running statistics
///   alpha:   minimise  -log_alpha (log pi(a|s) + target_entropy)
///   actor:   minimise  mean alpha log pi(a|s) - min_i Q_i(s, a)
///
/// a' comes from the actor with its running statistics, a from the batch's. Gradients are written out by hand;
/// crossq_update_torch_test holds them against libtorch's autograd.
class CrossQUpdate : public ReplayUpdate {
 public:
  /// @param actor  the shape, the observations' normaliser and the actions' scale; its weights are drawn here
  CrossQUpdate(const TanhGaussianPolicy& actor, const std::vector<int>& critic_hidden,
               const CrossQUpdateOptions& options, Rng& rng);

  /// The losses of actor and temperature are those of their last step.
  ReplayLosses Step(const TransitionBatch& batch) override;

  /// The actor with its running statistics folded into its weights.
  const TanhGaussianPolicy& actor() const override { return actor_; }
  BatchNormMlp& actor_net() { return actor_net_; }
  /// To be called after a change of actor_net().
  void FoldActor() { actor_net_.FoldInto(actor_.net()); }
  BatchNormMlp& critic(int i) { return critics_[i]; }
  double log_alpha() const { return temperature_.log_alpha(); }

  /// Parameters, running statistics and optimiser moments under names that start with "crossq/".
  void Save(NpzArrays& arrays) override { State().Save(arrays); }
  void Restore(const NpzArrays& arrays) override;
  LearnedState State();

 private:
  void StepCritics(const TransitionBatch& batch, float alpha);
  void StepActor(const TransitionBatch& batch, float alpha);
  /// Number of critic updates made, counted by their optimiser.
  int64_t n_updates() { return critic_adam_[0].n_steps(); }
  bool Renormalises() { return n_updates() > options_.renorm_warmup; }

  CrossQUpdateOptions options_;
  TanhGaussianPolicy actor_;
  BatchNormMlp actor_net_, critics_[2];
  Mlp folded_critics_[2];
  Temperature temperature_;
  Adam actor_adam_, critic_adam_[2];
  ReplayLosses losses_;

  MlpPass next_pass_, folded_pass_[2];
  BatchNormPass actor_pass_, critic_pass_[2];
  SquashedActions next_actions_, actions_;  // at s', at s
  ActionGradient action_gradient_;
  AlignedVector<float> both_, joint_pi_;  // [s, a; s', a'~pi] (2B, obs_dim + act_dim); [s, a~pi] (B, ...)
  AlignedVector<float> target_, dq_, actor_dout_;
  AlignedVector<float> actor_gradient_, critic_gradient_;
};

}  // namespace oted
