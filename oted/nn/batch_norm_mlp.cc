#include "oted/nn/batch_norm_mlp.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/gemm.h"
#include "oted/nn/kernels.h"

namespace oted {

BatchNormMlp::BatchNormMlp(int in, const std::vector<int>& hidden, int out) : layers_(Mlp(in, hidden, out).layers()) {
  n_linear_ = layers_.back().bias + static_cast<size_t>(out);
  size_t offset = n_linear_;
  for (const Mlp::Layer& layer : layers_) {
    gamma_.push_back(offset);
    offset += 2 * static_cast<size_t>(layer.in);
  }
  parameters_.resize(offset);
  running_.resize(offset - n_linear_);
}

void BatchNormMlp::Initialize(Rng& rng) {
  std::vector<int> hidden;
  for (size_t l = 0; l + 1 < layers_.size(); ++l) hidden.push_back(layers_[l].out);
  Mlp linear(in(), hidden, out());
  linear.Initialize(rng);
  std::ranges::copy(linear.parameters(), parameters_.begin());
  for (size_t l = 0; l < layers_.size(); ++l) {
    const size_t n = static_cast<size_t>(layers_[l].in);
    std::fill_n(parameters_.data() + gamma(l), n, 1.0f);
    std::fill_n(parameters_.data() + beta(l), n, 0.0f);
    std::fill_n(running_.data() + running_mean(l), n, 0.0f);
    std::fill_n(running_.data() + running_variance(l), n, 1.0f);
  }
}

namespace {

/// weights and bias of one layer after y = scale x + offset on its input.
void Fold(const Mlp::Layer& layer, const float* parameters, const float* scale, const float* offset, float* folded) {
  const size_t out = static_cast<size_t>(layer.out);
  float* bias = folded + layer.bias;
  std::copy_n(parameters + layer.bias, out, bias);
  kernels::ScaleRows(parameters + layer.weight, scale, offset, folded + layer.weight, bias, layer.in, layer.out);
}

}  // namespace

void BatchNormMlp::FoldInto(Mlp& folded) const {
  OTED_CHECK(folded.n_parameters() == n_linear_);
  AlignedVector<float> scale, offset;
  for (size_t l = 0; l < layers_.size(); ++l) {
    const size_t n = static_cast<size_t>(layers_[l].in);
    const float *mean = running_.data() + running_mean(l), *variance = running_.data() + running_variance(l);
    const float *gamma = parameters_.data() + this->gamma(l), *beta = parameters_.data() + this->beta(l);
    scale.resize(n);
    offset.resize(n);
    for (size_t j = 0; j < n; ++j) {
      scale[j] = gamma[j] / std::sqrt(variance[j] + kEpsilon);
      offset[j] = beta[j] - scale[j] * mean[j];
    }
    Fold(layers_[l], parameters_.data(), scale.data(), offset.data(), folded.parameters().data());
  }
}

void BatchNormPass::Normalise(BatchNormMlp& net, size_t l, const float* h, int batch, float momentum,
                              bool renormalise) {
  const size_t n = static_cast<size_t>(net.layers()[l].in);
  Columns& c = columns_[l];
  for (AlignedVector<float>* values : {&c.mean, &c.variance, &c.factor, &c.shift, &c.scale, &c.offset}) {
    values->resize(n);
  }
  kernels::ColumnMoments(h, c.mean.data(), c.variance.data(), batch, static_cast<int>(n));
  float* running_mean = net.running().data() + net.running_mean(l);
  float* running_variance = net.running().data() + net.running_variance(l);
  const float *gamma = net.parameters().data() + net.gamma(l), *beta = net.parameters().data() + net.beta(l);
  for (size_t j = 0; j < n; ++j) {
    const float deviation = std::sqrt(c.variance[j] + BatchNormMlp::kEpsilon);
    c.factor[j] = 1;
    c.shift[j] = 0;
    if (renormalise) {
      const float inverse = 1 / std::sqrt(running_variance[j] + BatchNormMlp::kEpsilon);
      c.factor[j] = std::clamp(deviation * inverse, 1 / BatchNormMlp::kMaxFactor, BatchNormMlp::kMaxFactor);
      c.shift[j] =
          std::clamp((c.mean[j] - running_mean[j]) * inverse, -BatchNormMlp::kMaxShift, BatchNormMlp::kMaxShift);
    }
    c.scale[j] = gamma[j] * c.factor[j] / deviation;
    c.offset[j] = beta[j] + gamma[j] * c.shift[j] - c.scale[j] * c.mean[j];
    running_mean[j] += momentum * (c.mean[j] - running_mean[j]);
    running_variance[j] += momentum * (c.variance[j] - running_variance[j]);
  }
}

const float* BatchNormPass::Forward(BatchNormMlp& net, const float* x, int batch, float momentum, bool renormalise) {
  const kernels::FlushDenormals flush;
  const auto& layers = net.layers();
  columns_.resize(layers.size());
  activations_.resize(layers.size());
  folded_.resize(layers.back().bias + static_cast<size_t>(layers.back().out));
  fresh_ = true;
  for (size_t l = 0; l < layers.size(); ++l) {
    const Mlp::Layer& layer = layers[l];
    Normalise(net, l, x, batch, momentum, renormalise);
    Fold(layer, net.parameters().data(), columns_[l].scale.data(), columns_[l].offset.data(), folded_.data());
    AlignedVector<float>& y = activations_[l];
    y.resize(std::max(y.size(), static_cast<size_t>(batch) * static_cast<size_t>(layer.out)));
    const float *weight = folded_.data() + layer.weight, *bias = folded_.data() + layer.bias;
    const bool hidden = l + 1 < layers.size();
    if (layer.out == 1) {
      kernels::RowProducts(x, weight, *bias, y.data(), batch, layer.in);
    } else {
      Gemm(Op::kNone, Op::kNone, batch, layer.out, layer.in, x, layer.in, weight, layer.out, 0.0f, y.data(), layer.out,
           {.bias = bias, .rectify = hidden});
    }
    x = y.data();
  }
  return x;
}

void BatchNormPass::Backward(const BatchNormMlp& net, const float* x, const float* dy, int batch,
                             float* parameter_gradient) {
  const kernels::FlushDenormals flush;
  OTED_CHECK(fresh_);
  fresh_ = false;
  const auto& layers = net.layers();
  const float* parameters = net.parameters().data();
  kernels::SumColumns(dy, parameter_gradient + layers.back().bias, batch, layers.back().out);
  for (size_t l = layers.size(); l-- > 0;) {
    const Mlp::Layer& layer = layers[l];
    const Columns& c = columns_[l];
    const size_t in = static_cast<size_t>(layer.in), out = static_cast<size_t>(layer.out);
    // dy is the gradient at this layer's linear output, h the layer's input before it is normalised.
    float* h = l == 0 ? nullptr : activations_[l - 1].data();
    const float* input = l == 0 ? x : h;
    const float* bias_gradient = parameter_gradient + layer.bias;
    // First that of the folded weights: y = h (scale W) + (b + offset W).
    float* weight_gradient = parameter_gradient + layer.weight;
    if (layer.out == 1) {
      kernels::WeightedColumnSums(dy, input, weight_gradient, batch, layer.in);
    } else {
      Gemm(Op::kTranspose, Op::kNone, layer.in, layer.out, batch, input, layer.in, dy, layer.out, 0.0f, weight_gradient,
           layer.out);
    }
    slope_.resize(in);
    constant_.resize(in);
    for (size_t j = 0; j < in; ++j) {
      const float* w = parameters + layer.weight + j * out;
      float *dw = weight_gradient + j * out, d_scale = 0, d_offset = 0;
      kernels::UnfoldRow(w, bias_gradient, c.scale[j], c.offset[j], dw, &d_scale, &d_offset, layer.out);
      // scale = gamma factor / deviation, offset = beta + gamma shift - scale mean; factor and shift are constants.
      const float deviation = std::sqrt(c.variance[j] + BatchNormMlp::kEpsilon);
      const float per_gamma = c.factor[j] / deviation;
      parameter_gradient[net.gamma(l) + j] = d_scale * per_gamma + d_offset * (c.shift[j] - per_gamma * c.mean[j]);
      parameter_gradient[net.beta(l) + j] = d_offset;
      // mean = sum h / B, deviation^2 = sum (h - mean)^2 / B + epsilon: every row has a share in them.
      const float d_mean = -c.scale[j] * d_offset;
      const float d_deviation = -c.scale[j] / deviation * (d_scale - c.mean[j] * d_offset);
      slope_[j] = d_deviation / (static_cast<float>(batch) * deviation);
      constant_[j] = d_mean / static_cast<float>(batch) - slope_[j] * c.mean[j];
    }
    if (l == 0) return;
    const float* weight = folded_.data() + layer.weight;
    float* sums = parameter_gradient + layers[l - 1].bias;
    if (layer.out == 1) {
      kernels::NormalisedRowProductsGradient(dy, weight, slope_.data(), constant_.data(), h, sums, batch, layer.in);
    } else {
      dh_.resize(std::max(dh_.size(), static_cast<size_t>(batch) * in));
      Gemm(Op::kNone, Op::kTranspose, batch, layer.in, layer.out, dy, layer.out, weight, layer.out, 0.0f, dh_.data(),
           layer.in);
      kernels::NormalisedGradient(dh_.data(), slope_.data(), constant_.data(), h, sums, batch, layer.in);
    }
    dy = h;
  }
}

}  // namespace oted
