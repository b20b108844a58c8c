#include "oted/nn/mlp.h"

#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/gemm.h"
#include "oted/nn/kernels.h"

namespace oted {

Mlp::Mlp(int in, const std::vector<int>& hidden, int out) {
  std::vector<int> widths = hidden;
  widths.push_back(out);
  size_t offset = 0;
  for (const int width : widths) {
    OTED_CHECK(in > 0 && width > 0);
    const size_t weights = static_cast<size_t>(in) * static_cast<size_t>(width);
    layers_.push_back({in, width, offset, offset + weights});
    offset += weights + static_cast<size_t>(width);
    in = width;
  }
  parameters_.resize(offset);
}

void Mlp::Initialize(Rng& rng) {
  for (const Layer& layer : layers_) {
    const double bound = 1.0 / std::sqrt(static_cast<double>(layer.in));
    const size_t end = layer.bias + static_cast<size_t>(layer.out);
    for (size_t i = layer.weight; i < end; ++i) parameters_[i] = static_cast<float>(rng.Uniform(-bound, bound));
  }
}

std::vector<int> Mlp::hidden() const {
  std::vector<int> widths;
  for (size_t l = 0; l + 1 < layers_.size(); ++l) widths.push_back(layers_[l].out);
  return widths;
}

const float* MlpPass::Forward(const Mlp& mlp, const float* x, int batch) {
  const kernels::FlushDenormals flush;
  activations_.resize(mlp.layers().size());
  for (size_t l = 0; l < mlp.layers().size(); ++l) {
    const Mlp::Layer& layer = mlp.layers()[l];
    AlignedVector<float>& y = activations_[l];
    y.resize(std::max(y.size(), static_cast<size_t>(batch) * static_cast<size_t>(layer.out)));
    const float* parameters = mlp.parameters().data();
    Gemm(Op::kNone, Op::kNone, batch, layer.out, layer.in, x, layer.in, parameters + layer.weight, layer.out, 0.0f,
         y.data(), layer.out);
    if (l + 1 < mlp.layers().size()) {
      kernels::AddBiasRelu(y.data(), parameters + layer.bias, batch, layer.out);
    } else {
      kernels::AddBias(y.data(), parameters + layer.bias, batch, layer.out);
    }
    x = y.data();
  }
  return x;
}

void MlpPass::Backward(const Mlp& mlp, const float* x, const float* dy, int batch, float* parameter_gradient, float* dx,
                       InputColumns columns) {
  const kernels::FlushDenormals flush;
  const auto& layers = mlp.layers();
  const float* parameters = mlp.parameters().data();
  for (size_t l = layers.size(); l-- > 0;) {
    const Mlp::Layer& layer = layers[l];
    // dy is the gradient at this layer's linear output.
    if (parameter_gradient != nullptr) {
      const float* input = l == 0 ? x : activations_[l - 1].data();
      Gemm(Op::kTranspose, Op::kNone, layer.in, layer.out, batch, input, layer.in, dy, layer.out, 0.0f,
           parameter_gradient + layer.weight, layer.out);
      if (l + 1 == layers.size()) kernels::SumColumns(dy, parameter_gradient + layer.bias, batch, layer.out);
    }
    if (l == 0) {
      if (dx == nullptr) return;
      const int width = columns.end - columns.begin;
      Gemm(Op::kNone, Op::kTranspose, batch, width, layer.out, dy, layer.out,
           parameters + layer.weight + static_cast<size_t>(columns.begin) * static_cast<size_t>(layer.out), layer.out,
           0.0f, dx, width);
      return;
    }
    next_gradient_.resize(std::max(next_gradient_.size(), static_cast<size_t>(batch) * static_cast<size_t>(layer.in)));
    Gemm(Op::kNone, Op::kTranspose, batch, layer.in, layer.out, dy, layer.out, parameters + layer.weight, layer.out,
         0.0f, next_gradient_.data(), layer.in);
    const float* h = activations_[l - 1].data();
    if (parameter_gradient != nullptr) {
      kernels::MaskByReluSumColumns(next_gradient_.data(), h, parameter_gradient + layers[l - 1].bias, batch, layer.in);
    } else {
      kernels::MaskByRelu(next_gradient_.data(), h, batch, layer.in);
    }
    gradient_.swap(next_gradient_);
    dy = gradient_.data();
  }
}

void Adam::Step(std::span<float> parameters, std::span<const float> gradient) {
  const kernels::FlushDenormals flush;
  OTED_CHECK(parameters.size() == m_.size() && gradient.size() == m_.size());
  ++n_steps_;
  const double t = static_cast<double>(n_steps_);
  const double correction1 = 1.0 - std::pow(static_cast<double>(options_.beta1), t);
  const double correction2 = 1.0 - std::pow(static_cast<double>(options_.beta2), t);
  kernels::Adam(parameters.data(), gradient.data(), m_.data(), v_.data(), m_.size(),
                {.beta1 = options_.beta1,
                 .beta2 = options_.beta2,
                 .step_size = static_cast<float>(options_.learning_rate / correction1),
                 .inverse_sqrt_correction = static_cast<float>(1.0 / std::sqrt(correction2)),
                 .epsilon = options_.epsilon,
                 .weight_decay = options_.weight_decay});
}

}  // namespace oted
