#pragma once
/// One gradient step of Proximal Policy Optimisation (Schulman et al. 2017) for discrete actions.

#include <span>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/npz.h"
#include "oted/nn/categorical_policy.h"
#include "oted/rl/learned_state.h"

namespace oted {

struct PpoUpdateOptions {
  double learning_rate = 3e-4;
  double clip_range = 0.2;     ///< of the probability ratio, around 1
  double ent_coef = 0.0;       ///< weight of the entropy bonus
  double vf_coef = 0.5;        ///< weight of the value loss
  double max_grad_norm = 0.5;  ///< the gradient of all parameters is shortened to it
};

/// Samples of one gradient step.
struct PpoBatch {
  Array2<double> observations;    ///< (B, obs_dim), raw
  std::vector<int> actions;       ///< (B)
  std::vector<float> log_probs;   ///< (B), of the actions when they were taken
  std::vector<float> advantages;  ///< (B), as they enter the loss
  std::vector<float> returns;     ///< (B), the values' targets
  int size() const { return static_cast<int>(actions.size()); }
};

/// Means over the batch, as Stable-Baselines3 logs them.
struct PpoLosses {
  double policy_loss = 0, value_loss = 0, entropy = 0;
  double approx_kl = 0;      ///< mean of (r - 1) - log r
  double clip_fraction = 0;  ///< share of samples whose ratio lies beyond the clip range
  double gradient_norm = 0;  ///< before it is shortened
};

/// What a learner of PPO holds and does.
///
///   minimise  -mean min(r A, clip(r, 1 - c, 1 + c) A) + vf_coef mean (V - R)^2 - ent_coef mean H,
///   r = pi(a|s) / pi_old(a|s),  by Adam with epsilon 1e-5, the gradient's norm shortened.
///
/// Policy and value are two networks of the same form. Losses and constants are Stable-Baselines3's. Gradients are
/// written out by hand; ppo_update_torch_test holds them against libtorch's autograd.
class PpoUpdate {
 public:
  /// Weights as PyTorch draws them, the policy's head a hundredth of that: nearly uniform actions at the start.
  PpoUpdate(const Encoder& encoder, const NetSize& size, int n_actions, const PpoUpdateOptions& options, Rng& rng);

  /// @param observations (n, obs_dim), raw. @param logits (n, n_actions). @param values (n)
  void Evaluate(std::span<const double> observations, int n, std::span<float> logits, std::span<float> values);
  void EvaluateValues(std::span<const double> observations, int n, std::span<float> values);
  PpoLosses Step(const PpoBatch& batch);

  const CategoricalPolicy& policy() const { return policy_; }
  FeatureNet& actor() { return policy_.net(); }
  FeatureNet& critic() { return critic_; }

  PpoUpdate(const PpoUpdate&) = delete;
  PpoUpdate& operator=(const PpoUpdate&) = delete;

  /// Networks and optimiser moments under names that start with "ppo/".
  void Save(NpzArrays& arrays) { State().Save(arrays); }
  /// @throws DataError naming the array that is missing or of another size; the caller names the file.
  void Restore(const NpzArrays& arrays) { State().Restore(arrays); }

 private:
  /// A network with what its gradient step needs.
  struct Part {
    FeatureNet* net;
    Adam adam;
    FeaturePass pass;
    const float* out = nullptr;  // of the last Forward
    AlignedVector<float> dout;   // the loss's gradient there
    AlignedVector<float> gradient;
  };
  LearnedState State();
  Part MakePart(FeatureNet& net) const;
  void Forward(Part& part, std::span<const double> observations, int n);

  PpoUpdateOptions options_;
  CategoricalPolicy policy_;
  FeatureNet critic_;
  Part actor_part_, critic_part_;
};

}  // namespace oted
