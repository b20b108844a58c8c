#pragma once
/// The temperature alpha of Soft Actor-Critic: what a nat of entropy is worth in reward.

#include <cmath>

#include "oted/base/array2.h"
#include "oted/nn/mlp.h"
#include "oted/rl/learned_state.h"

namespace oted {

/// Steps of Adam on log alpha that minimise  -log_alpha (mean log pi(a|s) + target_entropy)  (Haarnoja et al. 2018,
/// "Soft actor-critic algorithms and applications", Sec. 5, in the form of Stable-Baselines3).
class Temperature {
 public:
  /// @param target_entropy  of the squashed action [nats]; usually -act_dim
  Temperature(double initial_alpha, double target_entropy, float learning_rate)
      : target_entropy_(target_entropy), adam_(1, {.learning_rate = learning_rate}) {
    log_alpha_[0] = static_cast<float>(std::log(initial_alpha));
  }

  float alpha() const { return std::exp(log_alpha_[0]); }
  double log_alpha() const { return log_alpha_[0]; }

  /// One step. Returns the loss before it.
  double Step(double mean_log_prob) {
    const double loss = -log_alpha_[0] * (mean_log_prob + target_entropy_);
    const float gradient = static_cast<float>(-(mean_log_prob + target_entropy_));
    adam_.Step({log_alpha_.data(), 1}, {&gradient, 1});
    return loss;
  }

  void AddTo(LearnedState& state) { state.Add("alpha", log_alpha_, adam_); }

 private:
  double target_entropy_;
  AlignedVector<float> log_alpha_ = AlignedVector<float>(1);
  Adam adam_;
};

}  // namespace oted
