#pragma once
/// Fisher-BRC (Kostrikov, Tompson, Fergus and Nachum 2021): a behaviour policy by maximum likelihood, then actor and
/// critics whose value is an offset to its log density.

#include <memory>

#include "oted/data/npz.h"
#include "oted/nn/action_mixture.h"
#include "oted/nn/gradient_penalty.h"
#include "oted/nn/mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/action_gradient.h"
#include "oted/rl/learned_state.h"
#include "oted/rl/offline/offline_rows.h"
#include "oted/rl/squashed_actions.h"
#include "oted/rl/temperature.h"

namespace oted {

/// A network s -> mixtures of act_dim actions. @param hidden  its hidden layers
Mlp MixtureNet(int obs_dim, const std::vector<int>& hidden, int act_dim);

/// What one step of MixtureUpdate draws for each row: which component, and the normal within it.
struct MixtureNoise {
  std::vector<double> uniforms, normals;  ///< (B, act_dim) each
};
void DrawMixtureNoise(int batch, int act_dim, Rng& rng, MixtureNoise& noise);

struct MixtureLosses {
  double log_density = 0;  ///< mean log mu(a|s) of the logged actions
  double entropy = 0;      ///< mean -log mu(a~|s) of drawn ones
  double alpha = 0;
};

/// Phase 1:  minimise  -mean (log mu(a|s) + alpha H),  H = -log mu(a~|s) at one drawn a~,  and  alpha (H + act_dim)
/// over alpha. The draw moves with its component; the component's choice carries no gradient.
class MixtureUpdate {
 public:
  /// @param net  as MixtureNet makes it, initialised
  MixtureUpdate(Mlp net, double learning_rate);
  MixtureLosses Step(const OfflineBatch& batch, const MixtureNoise& noise);
  void set_learning_rate(double learning_rate);
  Mlp& net() { return net_; }
  double log_alpha() const { return temperature_.log_alpha(); }
  /// Parameters and moments, as "mixture/...".
  void AddTo(LearnedState& state);

 private:
  int act_dim_;
  Mlp net_;
  Adam adam_;
  Temperature temperature_;
  MlpPass pass_;
  AlignedVector<float> dout_, gradient_;
};

struct FisherBrcOptions {
  double learning_rate = 3e-4;  ///< of actor, critics and temperature
  double gamma = 0.99;
  double tau = 0.005;
  double gradient_penalty = 0.1;  ///< of the offsets' slope in the actions
  double reward_bonus = 5;        ///< added to every reward
};

struct FisherBrcLosses {
  double critic_loss = 0, actor_loss = 0, penalty = 0, alpha = 0, mean_q = 0;
};

/// Phase 2, with mu frozen:
///
///   Q_i(s, a) = O_i(s, a) + log mu(a|s)
///   target:   y = r + bonus + gamma (1 - terminated) min_i [O'_i(s', a') + log mu(a'|s')],  a' ~ pi(s')
///   critics:  minimise  sum_i mean (Q_i(s, a) - y)^2 + gradient_penalty sum_i mean |d O_i(s, a_pi) / d a_pi|^2
///   actor:    minimise  mean alpha log pi(a_pi|s) - min_i Q_i(s, a_pi)
///   alpha:    minimise  alpha mean (-log pi(a_pi|s) + act_dim)
///
/// One draw a_pi ~ pi(s) serves critics, actor and temperature. Gradients are written out by hand;
/// fisher_brc_update_torch_test holds them against libtorch's autograd.
class FisherBrcUpdate {
 public:
  /// @param mixture         the behaviour policy; its clone counts, later changes do not
  /// @param critic0, critic1  O_1, O_2: [s, a] -> 1, initialised
  FisherBrcUpdate(TanhGaussianPolicy actor, Mlp critic0, Mlp critic1, Mlp mixture, const FisherBrcOptions& options);

  FisherBrcLosses Step(const OfflineBatch& batch);

  const TanhGaussianPolicy& actor() const { return actor_; }
  Mlp& mixture() { return mixture_; }
  Mlp& critic(int i) { return critics_[i]; }
  Mlp& target_critic(int i) { return target_critics_[i]; }
  double log_alpha() const { return temperature_.log_alpha(); }
  /// Parameters and moments, as "actor/..." and so on; the mixture with them.
  void AddTo(LearnedState& state);

 private:
  void Act(const OfflineBatch& batch);
  void Target(const OfflineBatch& batch);
  FisherBrcLosses StepCritics(const OfflineBatch& batch);
  double StepActor(const OfflineBatch& batch);

  FisherBrcOptions options_;
  TanhGaussianPolicy actor_;
  Mlp critics_[2], target_critics_[2], mixture_;
  Temperature temperature_;
  Adam actor_adam_, critic_adam_[2];

  MlpPass actor_pass_, critic_pass_[2], mixture_pass_;
  const float *actor_out_ = nullptr, *mixture_out_ = nullptr;  // (2B, .), at s, then at s'
  SquashedActions actions_;
  ActionGradient action_gradient_;
  GradientPenalty penalty_;
  AlignedVector<float> joint_pi_, joint_next_, dq_, da_, dout_, actor_gradient_, critic_gradient_;
  std::vector<double> target_, log_mu_, log_mu_logged_, d_mu_;
};

}  // namespace oted
