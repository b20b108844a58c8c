#pragma once
/// Reparameterised draws of a tanh-Gaussian policy on a batch, and the way back (Haarnoja et al. 2018, Appendix C).

#include "oted/base/array2.h"

namespace oted {

/// a = tanh(mean + std noise) and log pi(a|s), for rows of a policy network's output [mean | log_std].
/// Order and the constant 1e-6 in log(1 - a^2 + 1e-6) are Stable-Baselines3's.
class SquashedActions {
 public:
  /// @param out    (rows, 2 act_dim)
  /// @param noise  (rows, act_dim) standard normals
  void Forward(const float* out, const float* noise, int rows, int act_dim);

  /// (rows, act_dim) in [-1, 1], and (rows); valid until the next Forward.
  const float* actions() const { return actions_.data(); }
  const float* log_prob() const { return log_prob_.data(); }
  /// Mean of log pi over the leading `rows` rows.
  double MeanLogProb(int rows) const;

  /// [s, a] of rows [begin, begin + rows) of the last Forward.
  /// @param observations  (rows, obs_dim)
  /// @param joint         (rows, obs_dim + act_dim), overwritten
  void Join(const float* observations, int obs_dim, int begin, int rows, float* joint) const;

  /// d / d out of  dq_da . a + mean alpha log pi  on the leading `rows` rows of the last Forward.
  /// @param out, noise  those of Forward
  /// @param dq_da       (rows, act_dim) gradient of the rest of the loss with respect to a
  /// @param dout        (rows, 2 act_dim), overwritten
  void Backward(const float* out, const float* noise, const float* dq_da, float alpha, int rows, float* dout) const;

 private:
  size_t width_ = 0;
  AlignedVector<float> actions_, log_std_, std_, log_slope_, log_prob_;
};

}  // namespace oted
