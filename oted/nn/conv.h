#pragma once
/// Small convolutional networks on one flat parameter vector, forward and backward by hand: 3x3 convolutions as matrix
/// products over patches, then a multi-layer perceptron. Tests hold them against libtorch's autograd.

#include <span>
#include <vector>

#include "oted/nn/mlp.h"

namespace oted {

/// What a network is made of. Images are (height, width, channels), row-major.
struct ConvShape {
  int height = 7, width = 7, channels = 3;
  std::vector<int> filters;  ///< of each 3x3 convolution: stride 1, no padding, rectifier; each takes 2 off both sides
  bool mean_pool = false;    ///< the mean over all places follows the convolutions; otherwise all places are kept
  int n_extra = 0;           ///< numbers that join the image's features: a direction, an action
  std::vector<int> hidden;   ///< widths of the perceptron's hidden layers
  int out = 1;
};

/// image -> [3x3 convolution, rectifier]* -> flatten or mean -> (features, extra) -> [linear, rectifier]* -> linear.
class ConvNet {
 public:
  ConvNet() = default;
  /// @throws UsageError when the convolutions leave nothing of the image.
  explicit ConvNet(const ConvShape& shape);
  /// Uniform in +-1/sqrt(fan_in) for weights and biases: PyTorch's default.
  void Initialize(Rng& rng);

  const ConvShape& shape() const { return shape_; }
  int image_size() const { return shape_.height * shape_.width * shape_.channels; }
  int n_convolutions() const { return static_cast<int>(shape_.filters.size()); }
  /// Height and width of the image that goes into convolution l, or comes out of the last one.
  int height(int l) const { return shape_.height - 2 * l; }
  int width(int l) const { return shape_.width - 2 * l; }
  int channels(int l) const { return l == 0 ? shape_.channels : shape_.filters[static_cast<size_t>(l) - 1]; }
  /// Features of the image that go into the perceptron.
  int n_features() const;

  /// The convolutions, then the linear layers. A convolution's weight is (9 channels, filters), rows in the order of
  /// the patch: its rows, its columns, the channels.
  const std::vector<Mlp::Layer>& layers() const { return layers_; }
  AlignedVector<float>& parameters() { return parameters_; }
  const AlignedVector<float>& parameters() const { return parameters_; }
  size_t n_parameters() const { return parameters_.size(); }

 private:
  ConvShape shape_;
  std::vector<Mlp::Layer> layers_;
  AlignedVector<float> parameters_;
};

/// The activations of one network on one batch, kept from Forward for Backward. Reuses its memory from call to call.
class ConvPass {
 public:
  /// @param images (batch, height, width, channels). @param extra (batch, n_extra), null when n_extra is 0.
  /// @return (batch, out), owned by this object and valid until its next Forward.
  const float* Forward(const ConvNet& net, const float* images, const float* extra, int batch);

  /// Back-propagates dy = d loss / d output (batch, out) of the last Forward, which had the same batch.
  /// @param parameter_gradient n_parameters, overwritten
  void Backward(const ConvNet& net, const float* dy, int batch, float* parameter_gradient);

 private:
  std::vector<AlignedVector<float>> inputs_;   // per layer: patches, or what goes into the linear layer
  std::vector<AlignedVector<float>> outputs_;  // per layer, after its rectifier
  AlignedVector<float> gradient_, input_gradient_;
};

}  // namespace oted
