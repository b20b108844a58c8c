#pragma once
/// One gradient step of offline TD3 with a penalty on leaving the logs: TD3+BC (Fujimoto and Gu 2021) and ReBRAC
/// (Tarasov et al. 2023), which differ in their critics and constants.

#include "oted/data/npz.h"
#include "oted/nn/layer_norm_mlp.h"
#include "oted/nn/mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/learned_state.h"
#include "oted/rl/offline/offline_rows.h"

namespace oted {

struct Td3Options {
  double learning_rate = 3e-4;  ///< Adam's, of actor and critics
  double gamma = 0.99;
  double tau = 0.005;           ///< Polyak step of all targets
  double noise = 0.2;           ///< deviation of the target action's noise, of actions in [-1, 1] ...
  double noise_clip = 0.5;      ///< ... and its largest size
  int policy_delay = 2;         ///< steps of the critics for each of the actor and of the targets
  double value_weight = 2.5;    ///< of Q in the actor's loss, in units of mean |Q|
  double actor_penalty = 1;     ///< of |pi(s) - a|^2, summed over the dimensions, in the actor's loss
  double critic_penalty = 0;    ///< of |a' - logged a'|^2 in the critics' target
  bool smaller_critic = false;  ///< the actor climbs min_i Q_i; otherwise Q_1
};

struct Td3Losses {
  double critic_loss = 0, actor_loss = 0, mean_q = 0;  ///< actor_loss is that of the actor's last step
};

/// A policy whose mean action is tanh of the network's leading outputs and whose deviation is the smallest that there
/// is: deterministic, in the file format of all others.
/// @param policy  initialised; its last layer's outputs for log standard deviations are overwritten
void MakeDeterministic(TanhGaussianPolicy& policy);

/// What a learner holds and does.
///
///   target:  a' = clip(pi'(s') + clip(noise)),  y = r + gamma (1 - terminated) (min_i Q'_i(s', a')
///                                                                            - critic_penalty |a' - logged a'|^2)
///   critics: minimise  sum_i mean (Q_i(s, a) - y)^2
///   actor:   minimise  mean actor_penalty |pi(s) - a|^2 - lambda Q(s, pi(s)),  lambda = value_weight / mean |Q|
///   targets: towards actor and critics, by tau, after each step of the actor
///
/// Gradients are written out by hand; td3_update_torch_test holds them against libtorch's autograd.
/// @tparam Net, Pass  Mlp and MlpPass, or LayerNormMlp and LayerNormPass: of the critics
template <class Net, class Pass>
class Td3Update {
 public:
  /// @param actor, critics  initialised; the targets begin equal. The actor's normaliser is applied by the caller
  ///                        before observations enter a batch.
  Td3Update(TanhGaussianPolicy actor, Net critic0, Net critic1, const Td3Options& options);

  Td3Losses Step(const OfflineBatch& batch);

  TanhGaussianPolicy& actor() { return actor_; }
  const TanhGaussianPolicy& actor() const { return actor_; }
  Mlp& target_actor() { return target_actor_; }
  Net& critic(int i) { return critics_[i]; }
  Net& target_critic(int i) { return target_critics_[i]; }

  /// Parameters and optimiser moments under names that start with "td3/".
  void Save(NpzArrays& arrays);
  void Restore(const NpzArrays& arrays);

 private:
  LearnedState State();
  void Target(const OfflineBatch& batch);
  Td3Losses StepCritics(const OfflineBatch& batch);
  double StepActor(const OfflineBatch& batch);
  double ValueGradient(const OfflineBatch& batch, double& mean_q);

  Td3Options options_;
  TanhGaussianPolicy actor_;
  Mlp target_actor_;
  Net critics_[2], target_critics_[2];
  Adam actor_adam_, critic_adam_[2];
  // Critics' steps since the actor's last one, and the loss at that: part of a checkpoint.
  AlignedVector<float> since_actor_ = AlignedVector<float>(2);

  MlpPass actor_pass_;
  Pass critic_pass_[2];
  AlignedVector<float> joint_, actions_, target_, dq_, da_, part_, dout_;
  AlignedVector<float> actor_gradient_, critic_gradient_;
};

extern template class Td3Update<Mlp, MlpPass>;
extern template class Td3Update<LayerNormMlp, LayerNormPass>;

}  // namespace oted
