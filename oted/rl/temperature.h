#pragma once
/// The temperature alpha of Soft Actor-Critic: what a nat of entropy is worth in reward.

#include <cmath>

#include "oted/base/array2.h"
#include "oted/nn/mlp.h"
#include "oted/rl/learned_state.h"

namespace oted {

/// What a temperature's loss multiplies -(mean log pi(a|s) + target_entropy) by: log alpha (Stable-Baselines3), or
/// alpha (Haarnoja et al. 2018, "Soft actor-critic algorithms and applications", Sec. 5).
enum class TemperatureLoss { kLogAlpha, kAlpha };

/// Steps of Adam on log alpha that minimise that loss.
class Temperature {
 public:
  /// @param target_entropy  of the squashed action [nats]; usually -act_dim
  Temperature(double initial_alpha, double target_entropy, float learning_rate,
              TemperatureLoss loss = TemperatureLoss::kLogAlpha)
      : target_entropy_(target_entropy), loss_(loss), adam_(1, {.learning_rate = learning_rate}) {
    log_alpha_[0] = static_cast<float>(std::log(initial_alpha));
  }

  float alpha() const { return std::exp(log_alpha_[0]); }
  double log_alpha() const { return log_alpha_[0]; }

  /// One step. Returns the loss before it.
  double Step(double mean_log_prob) {
    const double excess = -(mean_log_prob + target_entropy_), of_alpha = std::exp(log_alpha_[0]);
    const bool is_log = loss_ == TemperatureLoss::kLogAlpha;
    const float gradient = static_cast<float>(is_log ? excess : of_alpha * excess);
    const double loss = (is_log ? log_alpha_[0] : of_alpha) * excess;
    adam_.Step({log_alpha_.data(), 1}, {&gradient, 1});
    return loss;
  }
  void set_learning_rate(float learning_rate) { adam_.set_learning_rate(learning_rate); }

  void AddTo(LearnedState& state) { state.Add("alpha", log_alpha_, adam_); }

 private:
  double target_entropy_;
  TemperatureLoss loss_;
  AlignedVector<float> log_alpha_ = AlignedVector<float>(1);
  Adam adam_;
};

}  // namespace oted
