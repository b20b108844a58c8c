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

namespace {

/// Whether a layer is a row product, which no matrix product is fast at: one output, and rectified inputs.
bool IsRowProduct(const Mlp& mlp, size_t l) { return l > 0 && mlp.layers()[l].out == 1; }

}  // namespace

const float* MlpPass::Forward(const Mlp& mlp, const float* x, int batch) {
  const kernels::FlushDenormals flush;
  const float* parameters = mlp.parameters().data();
  activations_.resize(mlp.layers().size());
  fresh_ = true;
  for (size_t l = 0; l < mlp.layers().size(); ++l) {
    const Mlp::Layer& layer = mlp.layers()[l];
    AlignedVector<float>& y = activations_[l];
    y.resize(std::max(y.size(), static_cast<size_t>(batch) * static_cast<size_t>(layer.out)));
    const bool hidden = l + 1 < mlp.layers().size();
    if (!hidden && IsRowProduct(mlp, l)) {
      kernels::RowProducts(x, parameters + layer.weight, parameters[layer.bias], y.data(), batch, layer.in);
    } else {
      Gemm(Op::kNone, Op::kNone, batch, layer.out, layer.in, x, layer.in, parameters + layer.weight, layer.out, 0.0f,
           y.data(), layer.out, {.bias = parameters + layer.bias, .rectify = hidden});
    }
    x = y.data();
  }
  return x;
}

void MlpPass::Backward(const Mlp& mlp, const float* x, const float* dy, int batch, const MlpGradients& out) {
  Propagate(mlp, x, dy, batch, nullptr, out);
}

void MlpPass::BackwardRows(const Mlp& mlp, std::span<const int> rows, const float* dy, float* dx,
                           InputColumns columns) {
  Propagate(mlp, nullptr, dy, static_cast<int>(rows.size()), rows.data(), {.x = dx, .columns = columns});
}

void MlpPass::Propagate(const Mlp& mlp, const float* x, const float* dy, int batch, const int* rows,
                        const MlpGradients& out) {
  const auto& [parameter_gradient, dx, columns] = out;
  const kernels::FlushDenormals flush;
  OTED_CHECK(fresh_);
  fresh_ = false;
  const auto& layers = mlp.layers();
  const float* parameters = mlp.parameters().data();
  if (parameter_gradient != nullptr) {
    kernels::SumColumns(dy, parameter_gradient + layers.back().bias, batch, layers.back().out);
  }
  for (size_t l = layers.size(); l-- > 0;) {
    const Mlp::Layer& layer = layers[l];
    const float* weight = parameters + layer.weight;
    // dy is the gradient at this layer's linear output, h the layer's input.
    const float* h = l == 0 ? x : activations_[l - 1].data();
    float* weight_gradient = parameter_gradient != nullptr ? parameter_gradient + layer.weight : nullptr;
    const bool row_product = IsRowProduct(mlp, l);
    if (weight_gradient != nullptr && !row_product) {
      Gemm(Op::kTranspose, Op::kNone, layer.in, layer.out, batch, h, layer.in, dy, layer.out, 0.0f, weight_gradient,
           layer.out);
    }
    if (l == 0) {
      if (dx == nullptr) return;
      const int width = columns.end - columns.begin;
      Gemm(Op::kNone, Op::kTranspose, batch, width, layer.out, dy, layer.out,
           weight + static_cast<size_t>(columns.begin) * static_cast<size_t>(layer.out), layer.out, 0.0f, dx, width);
      return;
    }
    // The gradient takes the place of h: an element of h is last read where the gradient's is written, and with `rows`
    // ascending, a row moves up only.
    float* dh = activations_[l - 1].data();
    // At the linear output of the layer below, whose bias gradient is the sum over rows.
    float* bias_gradient = parameter_gradient != nullptr ? parameter_gradient + layers[l - 1].bias : nullptr;
    if (!row_product) {
      Gemm(Op::kNone, Op::kTranspose, batch, layer.in, layer.out, dy, layer.out, weight, layer.out, 0.0f, dh, layer.in,
           {.mask = h, .ld_mask = layer.in, .mask_rows = rows, .column_sums = bias_gradient});
    } else if (weight_gradient != nullptr) {
      kernels::RowProductsGradients(dy, weight, dh, weight_gradient, bias_gradient, batch, layer.in);
    } else {
      kernels::RowProductsInputGradient(dy, weight, dh, rows, batch, layer.in);
    }
    dy = dh;
  }
}

kernels::AdamArguments Adam::NextStep() {
  ++n_steps_;
  const double t = static_cast<double>(n_steps_);
  const double correction1 = 1.0 - std::pow(static_cast<double>(options_.beta1), t);
  const double correction2 = 1.0 - std::pow(static_cast<double>(options_.beta2), t);
  return {.beta1 = options_.beta1,
          .beta2 = options_.beta2,
          .step_size = static_cast<float>(options_.learning_rate / correction1),
          .inverse_sqrt_correction = static_cast<float>(1.0 / std::sqrt(correction2)),
          .epsilon = options_.epsilon,
          .weight_decay = options_.weight_decay};
}

void Adam::Step(std::span<float> parameters, std::span<const float> gradient) {
  const kernels::FlushDenormals flush;
  OTED_CHECK(parameters.size() == m_.size() && gradient.size() == m_.size());
  kernels::Adam(parameters.data(), gradient.data(), m_.data(), v_.data(), m_.size(), NextStep());
}

void Adam::Step(std::span<float> parameters, std::span<const float> gradient, std::span<float> target, float tau) {
  const kernels::FlushDenormals flush;
  OTED_CHECK(parameters.size() == m_.size() && gradient.size() == m_.size() && target.size() == m_.size());
  kernels::AdamPolyak(parameters.data(), gradient.data(), m_.data(), v_.data(), target.data(), tau, m_.size(),
                      NextStep());
}

}  // namespace oted
