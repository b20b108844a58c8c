#pragma once
/// Penalties on a critic's slope, with their second derivatives by hand: that of Gulrajani et al. (2017), which keeps
/// it near 1, and that of Fisher-BRC (Kostrikov et al. 2021), which keeps it small. A rectifier has no second
/// derivative: what a penalty asks of the weights is one pass forward with tangents in the place of inputs.

#include <vector>

#include "oted/base/array2.h"
#include "oted/nn/mlp.h"

namespace oted {

/// A penalty of a network f with one output, and its gradient. Reuses its memory.
class GradientPenalty {
 public:
  /// P = mean_i (|d f(x_i) / d x_i| - 1)^2.
  /// @param x         (batch, in)
  /// @param weight    of P in what the gradient belongs to
  /// @param gradient  n_parameters: weight dP / d parameters is added; biases have none
  /// @return P
  double Add(const Mlp& mlp, const float* x, int batch, double weight, float* gradient);
  /// The same for P = mean_i |d f(x_i) / d x_i|^2, where the slope is that in some columns of x alone.
  double AddSquare(const Mlp& mlp, const float* x, int batch, InputColumns columns, double weight, float* gradient);

 private:
  /// Fills slope_ (batch, in) and what AddTangents needs.
  void ComputeSlope(const Mlp& mlp, const float* x, int batch);
  /// Adds to `gradient` what d P / d slope in tangents_[0] comes to.
  void AddTangents(const Mlp& mlp, int batch, float* gradient);

  std::vector<AlignedVector<float>> activations_;  // per hidden layer: (batch, out)
  std::vector<AlignedVector<float>> deltas_;       // per layer: df / d its linear output, (batch, out)
  std::vector<AlignedVector<float>> tangents_;     // per layer: its input's, (batch, in)
  AlignedVector<float> slope_, layer_gradient_;
};

}  // namespace oted
