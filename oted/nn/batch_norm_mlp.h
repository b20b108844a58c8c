#pragma once
/// Perceptrons with batch normalisation before every linear layer (Ioffe and Szegedy 2015; renormalisation: Ioffe
/// 2017), as CrossQ's networks are (Bhatt et al. 2024), forward and backward by hand.
///
/// A normalisation is an affine map of each column, y = s x + t, so it is folded into the weights of the layer that
/// follows: what is left of it on a batch are the columns' means and variances, and on the way back one fused pass.
/// With the running statistics the whole network is a plain Mlp.

#include <span>
#include <vector>

#include "oted/nn/mlp.h"

namespace oted {

/// x (in) -> [normalise, linear, rectifier] per hidden layer -> normalise, linear (out).
class BatchNormMlp {
 public:
  static constexpr float kEpsilon = 1e-3f;  ///< added to variances
  /// Bounds of the renormalisation's factor and shift.
  static constexpr float kMaxFactor = 3.0f, kMaxShift = 5.0f;

  BatchNormMlp() = default;
  BatchNormMlp(int in, const std::vector<int>& hidden, int out);
  /// Linear layers as Mlp::Initialize; normalisations begin as the identity of what they have normalised.
  void Initialize(Rng& rng);

  int in() const { return layers_.front().in; }
  int out() const { return layers_.back().out; }
  /// Offsets into the leading part of parameters(), as Mlp's.
  const std::vector<Mlp::Layer>& layers() const { return layers_; }
  /// The linear layers as in Mlp, then for each layer the scales gamma (in) and the shifts beta (in) of its input.
  AlignedVector<float>& parameters() { return parameters_; }
  const AlignedVector<float>& parameters() const { return parameters_; }
  size_t n_parameters() const { return parameters_.size(); }
  /// Offset of layer l's gamma in parameters(); beta follows.
  size_t gamma(size_t l) const { return gamma_[l]; }
  size_t beta(size_t l) const { return gamma_[l] + static_cast<size_t>(layers_[l].in); }

  /// For each layer the running means (in), then the running variances (in) of its input.
  AlignedVector<float>& running() { return running_; }
  const AlignedVector<float>& running() const { return running_; }
  size_t running_mean(size_t l) const { return gamma_[l] - n_linear_; }
  size_t running_variance(size_t l) const { return running_mean(l) + static_cast<size_t>(layers_[l].in); }

  /// The same function as a plain network, with the running statistics.
  /// @param folded  of the same shape
  void FoldInto(Mlp& folded) const;

 private:
  std::vector<Mlp::Layer> layers_;
  std::vector<size_t> gamma_;
  size_t n_linear_ = 0;  // parameters of the linear layers
  AlignedVector<float> parameters_, running_;
};

/// The activations and statistics of one network on one batch, kept from Forward for one Backward.
class BatchNormPass {
 public:
  /// Normalises by the batch's own statistics, and moves the running ones towards them.
  /// @param x            (batch, in)
  /// @param momentum     of the running statistics: running += momentum (batch's - running)
  /// @param renormalise  on the scale of the running statistics, the gradient being that of the batch's (Ioffe 2017)
  /// @return (batch, out), owned by this object and valid until its next Forward
  const float* Forward(BatchNormMlp& net, const float* x, int batch, float momentum, bool renormalise);

  /// Back-propagates dy = d loss / d output of the last Forward, through the statistics as well. Once per Forward.
  /// @param x                   the input of that Forward
  /// @param dy                  (batch, out)
  /// @param parameter_gradient  n_parameters, overwritten
  void Backward(const BatchNormMlp& net, const float* x, const float* dy, int batch, float* parameter_gradient);

 private:
  /// Of one layer's input, per column: statistics, renormalisation, and the affine map that is folded.
  struct Columns {
    AlignedVector<float> mean, variance, factor, shift, scale, offset;
  };
  void Normalise(BatchNormMlp& net, size_t l, const float* h, int batch, float momentum, bool renormalise);

  std::vector<Columns> columns_;                   // per layer
  std::vector<AlignedVector<float>> activations_;  // per layer: (batch, out)
  AlignedVector<float> folded_;                    // the linear layers, folded, as Mlp's parameters
  AlignedVector<float> dh_, slope_, constant_;
  bool fresh_ = false;
};

}  // namespace oted
