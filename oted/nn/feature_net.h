#pragma once
/// A network on raw rows, chosen by what they are: a perceptron on numbers, convolutions on an image with what joins
/// it.

#include <string>
#include <variant>
#include <vector>

#include "oted/nn/conv.h"
#include "oted/nn/encoder.h"
#include "oted/nn/mlp.h"

namespace oted {

/// How large a network is, whatever it looks at.
struct NetSize {
  std::vector<int> hidden;   ///< widths of the linear layers
  std::vector<int> filters;  ///< of each 3x3 convolution; unused without an image
  bool mean_pool = false;    ///< the mean over all places of an image follows its convolutions
};

class FeatureNet {
 public:
  FeatureNet() = default;
  /// The encoder is fitted on `rows`. Quantities are cut to +-`bound` spreads where it is positive.
  FeatureNet(const Array2<double>& rows, const InputShape& shape, const NetSize& size, int out, float bound = 0);
  FeatureNet(Encoder encoder, const NetSize& size, int out, float bound = 0);
  void Initialize(Rng& rng);

  const Encoder& encoder() const { return encoder_; }
  float bound() const { return bound_; }
  int in() const { return encoder_.in(); }
  int out() const;
  /// Of the flat vector, in its order: the convolutions' (ConvNet), then the linear ones.
  const std::vector<Mlp::Layer>& layers() const;
  AlignedVector<float>& parameters();
  const AlignedVector<float>& parameters() const;
  size_t n_parameters() const { return parameters().size(); }
  NetSize size() const;
  /// Arrays PREFIX/parameters, hidden, filters, mean_pool, out, bound where there is one, and the encoder's,
  /// PREFIX/input/...
  void Save(const std::string& prefix, NpzArrays& arrays) const;
  /// Sizes are checked before anything of that size is made. @throws DataError naming `where`
  static FeatureNet FromArrays(const std::string& prefix, const NpzArrays& arrays, const std::string& where);
  /// Replaces the encoder by one of the same dimensions. @throws DataError for another
  void RestoreEncoder(Encoder encoder, const std::string& where);

 private:
  friend class FeaturePass;
  Encoder encoder_;
  float bound_ = 0;
  std::variant<Mlp, ConvNet> net_;
};

/// The activations of one network on one batch, kept from Forward for Backward.
class FeaturePass {
 public:
  /// Rows [first, first + n) of the next batch. Reserve makes room for the batch before.
  void Reserve(const FeatureNet& net, int n);
  void Encode(const FeatureNet& net, const Array2<double>& rows, int first);
  void Encode(const FeatureNet& net, std::span<const double> row, int at);
  /// @return (n, out) of the batch, valid until the next Forward
  const float* Forward(const FeatureNet& net);
  /// @param dy (n, out). @param gradient n_parameters, overwritten
  void Backward(const FeatureNet& net, const float* dy, float* gradient);

 private:
  int n_ = 0;
  AlignedVector<float> images_, extra_;
  MlpPass mlp_;
  ConvPass conv_;
};

}  // namespace oted
