#pragma once
/// Perceptrons with layer normalisation after every rectifier (Ba, Kiros and Hinton 2016), as the critics of ReBRAC
/// are, forward and backward by hand.

#include <vector>

#include "oted/nn/mlp.h"

namespace oted {

/// x (in) -> [linear, rectifier, normalise] per hidden layer -> linear (out).
class LayerNormMlp {
 public:
  static constexpr float kEpsilon = 1e-6f;  ///< added to variances

  LayerNormMlp() = default;
  LayerNormMlp(int in, const std::vector<int>& hidden, int out);
  /// Linear layers as Mlp::Initialize; normalisations begin with scale 1 and shift 0.
  void Initialize(Rng& rng);

  int in() const { return layers_.front().in; }
  int out() const { return layers_.back().out; }
  /// Offsets into the leading part of parameters(), as Mlp's.
  const std::vector<Mlp::Layer>& layers() const { return layers_; }
  /// The linear layers as in Mlp, then for each hidden layer the scales gamma and the shifts beta of its output.
  AlignedVector<float>& parameters() { return parameters_; }
  const AlignedVector<float>& parameters() const { return parameters_; }
  size_t n_parameters() const { return parameters_.size(); }
  /// Offset of hidden layer l's gamma in parameters(); beta follows.
  size_t gamma(size_t l) const { return gamma_[l]; }
  size_t beta(size_t l) const { return gamma_[l] + static_cast<size_t>(layers_[l].out); }

 private:
  std::vector<Mlp::Layer> layers_;
  std::vector<size_t> gamma_;
  AlignedVector<float> parameters_;
};

/// The activations of one network on one batch, kept from Forward for one Backward.
class LayerNormPass {
 public:
  /// @param x (batch, in). @return (batch, out), owned by this object and valid until its next Forward.
  const float* Forward(const LayerNormMlp& net, const float* x, int batch);
  /// Back-propagates dy = d loss / d output of the last Forward. Once per Forward.
  /// @param x   the input of that Forward
  /// @param dy  (batch, out)
  void Backward(const LayerNormMlp& net, const float* x, const float* dy, int batch, const MlpGradients& out);

 private:
  struct Hidden {
    AlignedVector<float> rectified, normalised;  // (batch, out)
    AlignedVector<float> mean, inverse;          // (batch): of the rectified row
  };
  std::vector<Hidden> hidden_;
  AlignedVector<float> y_, unwanted_;
  bool fresh_ = false;
};

}  // namespace oted
