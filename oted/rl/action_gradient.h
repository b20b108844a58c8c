#pragma once
/// The critics' part of an actor's loss, mean -min_i Q_i(s, a), and its gradient with respect to the actions.

#include <vector>

#include "oted/nn/mlp.h"

namespace oted {

/// Reuses its memory from call to call.
class ActionGradient {
 public:
  /// @param critics  two, of the same shape
  /// @param passes   two; their activations are lost
  /// @param joint    (batch, obs_dim + act_dim): [s, a]
  /// @return mean -min_i Q_i(s, a)
  double Compute(const Mlp* critics, MlpPass* passes, const float* joint, int obs_dim, int act_dim, int batch);

  /// (batch, act_dim) of the last Compute.
  const float* dq_da() const { return dq_da_.data(); }

 private:
  std::vector<int> smaller_[2];  // rows of the batch whose smaller critic it is
  AlignedVector<float> dq_, dq_da_, dq_da_rows_;
};

}  // namespace oted
