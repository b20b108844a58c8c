#pragma once
/// The gradient penalty of Gulrajani et al. (2017), which keeps a critic's slope near 1, with its second derivatives by
/// hand. A rectifier has none: what the penalty asks of the weights is one pass forward with tangents in the place of
/// inputs.

#include <vector>

#include "oted/base/array2.h"
#include "oted/nn/mlp.h"

namespace oted {

/// P = mean_i (|d f(x_i) / d x_i| - 1)^2 of a network f with one output, and its gradient. Reuses its memory.
class GradientPenalty {
 public:
  /// @param x         (batch, in)
  /// @param weight    of P in what the gradient belongs to
  /// @param gradient  n_parameters: weight dP / d parameters is added; biases have none
  /// @return P
  double Add(const Mlp& mlp, const float* x, int batch, double weight, float* gradient);

 private:
  std::vector<AlignedVector<float>> activations_;  // per hidden layer: (batch, out)
  std::vector<AlignedVector<float>> deltas_;       // per layer: df / d its linear output, (batch, out)
  std::vector<AlignedVector<float>> tangents_;     // per layer: its input's, (batch, in)
  AlignedVector<float> slope_, layer_gradient_;
};

}  // namespace oted
