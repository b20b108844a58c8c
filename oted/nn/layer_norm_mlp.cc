#include "oted/nn/layer_norm_mlp.h"

#include <algorithm>

#include "oted/base/error.h"
#include "oted/nn/gemm.h"
#include "oted/nn/kernels.h"

namespace oted {

LayerNormMlp::LayerNormMlp(int in, const std::vector<int>& hidden, int out) {
  const Mlp linear(in, hidden, out);
  layers_ = linear.layers();
  size_t offset = linear.n_parameters();
  for (const int width : hidden) {
    gamma_.push_back(offset);
    offset += 2 * static_cast<size_t>(width);
  }
  parameters_.resize(offset);
}

void LayerNormMlp::Initialize(Rng& rng) {
  Mlp linear(
      in(),
      [&] {
        std::vector<int> widths;
        for (size_t l = 0; l + 1 < layers_.size(); ++l) widths.push_back(layers_[l].out);
        return widths;
      }(),
      out());
  linear.Initialize(rng);
  std::ranges::copy(linear.parameters(), parameters_.begin());
  for (size_t l = 0; l < gamma_.size(); ++l) {
    const auto begin = parameters_.begin() + static_cast<ptrdiff_t>(gamma_[l]);
    std::fill_n(begin, layers_[l].out, 1.0f);
    std::fill_n(begin + layers_[l].out, layers_[l].out, 0.0f);
  }
}

const float* LayerNormPass::Forward(const LayerNormMlp& net, const float* x, int batch) {
  const kernels::FlushDenormals flush;
  const float* parameters = net.parameters().data();
  const auto& layers = net.layers();
  hidden_.resize(layers.size() - 1);
  fresh_ = true;
  for (size_t l = 0; l < hidden_.size(); ++l) {
    const Mlp::Layer& layer = layers[l];
    Hidden& hidden = hidden_[l];
    const size_t n = static_cast<size_t>(batch), area = n * static_cast<size_t>(layer.out);
    hidden.rectified.resize(area);
    hidden.normalised.resize(area);
    hidden.mean.resize(n);
    hidden.inverse.resize(n);
    Gemm(Op::kNone, Op::kNone, batch, layer.out, layer.in, x, layer.in, parameters + layer.weight, layer.out, 0.0f,
         hidden.rectified.data(), layer.out, {.bias = parameters + layer.bias, .rectify = true});
    kernels::NormaliseRows(hidden.rectified.data(),
                           {parameters + net.gamma(l), parameters + net.beta(l), LayerNormMlp::kEpsilon},
                           hidden.normalised.data(), hidden.mean.data(), hidden.inverse.data(), batch, layer.out);
    x = hidden.normalised.data();
  }
  const Mlp::Layer& last = layers.back();
  y_.resize(static_cast<size_t>(batch) * static_cast<size_t>(last.out));
  Gemm(Op::kNone, Op::kNone, batch, last.out, last.in, x, last.in, parameters + last.weight, last.out, 0.0f, y_.data(),
       last.out, {.bias = parameters + last.bias});
  return y_.data();
}

void LayerNormPass::Backward(const LayerNormMlp& net, const float* x, const float* dy, int batch,
                             const MlpGradients& out) {
  const kernels::FlushDenormals flush;
  OTED_CHECK(fresh_);
  fresh_ = false;
  const auto& layers = net.layers();
  const float* parameters = net.parameters().data();
  // What the fused kernel sums up in any case.
  unwanted_.resize(net.n_parameters());
  float* gradient = out.parameters != nullptr ? out.parameters : unwanted_.data();
  if (out.parameters != nullptr) kernels::SumColumns(dy, gradient + layers.back().bias, batch, layers.back().out);
  for (size_t l = layers.size(); l-- > 0;) {
    const Mlp::Layer& layer = layers[l];
    const float* weight = parameters + layer.weight;
    const float* input = l == 0 ? x : hidden_[l - 1].normalised.data();
    if (out.parameters != nullptr) {
      Gemm(Op::kTranspose, Op::kNone, layer.in, layer.out, batch, input, layer.in, dy, layer.out, 0.0f,
           gradient + layer.weight, layer.out);
    }
    if (l == 0) {
      if (out.x == nullptr) return;
      const int width = out.columns.end - out.columns.begin;
      Gemm(Op::kNone, Op::kTranspose, batch, width, layer.out, dy, layer.out,
           weight + static_cast<size_t>(out.columns.begin) * static_cast<size_t>(layer.out), layer.out, 0.0f, out.x,
           width);
      return;
    }
    // The gradient takes the place of the layer's input, which was read last above.
    Hidden& below = hidden_[l - 1];
    float* dh = below.normalised.data();
    Gemm(Op::kNone, Op::kTranspose, batch, layer.in, layer.out, dy, layer.out, weight, layer.out, 0.0f, dh, layer.in);
    kernels::NormalisedRowsGradient(
        dh, below.rectified.data(), parameters + net.gamma(l - 1), below.mean.data(), below.inverse.data(),
        {gradient + net.gamma(l - 1), gradient + net.beta(l - 1), gradient + layers[l - 1].bias}, batch, layer.in);
    dy = dh;
  }
}

}  // namespace oted
