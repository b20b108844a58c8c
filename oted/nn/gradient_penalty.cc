#include "oted/nn/gradient_penalty.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/gemm.h"
#include "oted/nn/kernels.h"

namespace oted {
namespace {

constexpr float kSmallestSlope = 1e-12f;  // below it, it has no direction

size_t Area(int rows, int cols) { return static_cast<size_t>(rows) * static_cast<size_t>(cols); }

}  // namespace

void GradientPenalty::ComputeSlope(const Mlp& mlp, const float* x, int batch) {
  const auto& layers = mlp.layers();
  OTED_CHECK(mlp.out() == 1 && batch > 0);
  const float* parameters = mlp.parameters().data();
  const size_t n = layers.size();
  activations_.resize(n);
  deltas_.resize(n);
  tangents_.resize(n);

  const float* h = x;
  for (size_t l = 0; l + 1 < n; ++l) {
    const Mlp::Layer& layer = layers[l];
    activations_[l].resize(Area(batch, layer.out));
    Gemm(Op::kNone, Op::kNone, batch, layer.out, layer.in, h, layer.in, parameters + layer.weight, layer.out, 0.0f,
         activations_[l].data(), layer.out, {.bias = parameters + layer.bias, .rectify = true});
    h = activations_[l].data();
  }

  // d f / d x, through the rectifiers that are open.
  deltas_[n - 1].assign(static_cast<size_t>(batch), 1.0f);
  for (size_t l = n - 1; l > 0; --l) {
    const Mlp::Layer& layer = layers[l];
    deltas_[l - 1].resize(Area(batch, layer.in));
    Gemm(Op::kNone, Op::kTranspose, batch, layer.in, layer.out, deltas_[l].data(), layer.out, parameters + layer.weight,
         layer.out, 0.0f, deltas_[l - 1].data(), layer.in, {.mask = activations_[l - 1].data(), .ld_mask = layer.in});
  }
  const int in = mlp.in();
  slope_.resize(Area(batch, in));
  Gemm(Op::kNone, Op::kTranspose, batch, in, layers[0].out, deltas_[0].data(), layers[0].out,
       parameters + layers[0].weight, layers[0].out, 0.0f, slope_.data(), in);
  tangents_[0].resize(slope_.size());
}

double GradientPenalty::Add(const Mlp& mlp, const float* x, int batch, double weight, float* gradient) {
  const kernels::FlushDenormals flush;
  ComputeSlope(mlp, x, batch);
  const int in = mlp.in();
  double penalty = 0;
  for (int i = 0; i < batch; ++i) {
    const float* row = slope_.data() + Area(i, in);
    float square = 0;
    for (int j = 0; j < in; ++j) square += row[j] * row[j];
    const float norm = std::sqrt(square);
    penalty += (norm - 1.0) * (norm - 1.0) / batch;
    const float factor = static_cast<float>(2.0 * weight / batch) * (norm - 1.0f) / std::max(norm, kSmallestSlope);
    for (int j = 0; j < in; ++j) tangents_[0][Area(i, in) + static_cast<size_t>(j)] = factor * row[j];
  }

  AddTangents(mlp, batch, gradient);
  return penalty;
}

double GradientPenalty::AddSquare(const Mlp& mlp, const float* x, int batch, InputColumns columns, double weight,
                                  float* gradient) {
  const kernels::FlushDenormals flush;
  ComputeSlope(mlp, x, batch);
  const int in = mlp.in();
  const float factor = static_cast<float>(2.0 * weight / batch);
  double penalty = 0;
  std::ranges::fill(tangents_[0], 0.0f);
  for (int i = 0; i < batch; ++i) {
    for (int j = columns.begin; j < columns.end; ++j) {
      const size_t at = Area(i, in) + static_cast<size_t>(j);
      penalty += static_cast<double>(slope_[at]) * slope_[at] / batch;
      tangents_[0][at] = factor * slope_[at];
    }
  }
  AddTangents(mlp, batch, gradient);
  return penalty;
}

void GradientPenalty::AddTangents(const Mlp& mlp, int batch, float* gradient) {
  const auto& layers = mlp.layers();
  const float* parameters = mlp.parameters().data();
  const size_t n = layers.size();
  // slope = delta_0 W_0^T and so on, linear in every W_l: its derivative joins what came down to the layer with what
  // came up.
  for (size_t l = 0; l < n; ++l) {
    const Mlp::Layer& layer = layers[l];
    layer_gradient_.resize(Area(layer.in, layer.out));
    Gemm(Op::kTranspose, Op::kNone, layer.in, layer.out, batch, tangents_[l].data(), layer.in, deltas_[l].data(),
         layer.out, 0.0f, layer_gradient_.data(), layer.out);
    float* of_layer = gradient + layer.weight;
    for (size_t k = 0; k < Area(layer.in, layer.out); ++k) of_layer[k] += layer_gradient_[k];
    if (l + 1 == n) break;
    tangents_[l + 1].resize(Area(batch, layer.out));
    Gemm(Op::kNone, Op::kNone, batch, layer.out, layer.in, tangents_[l].data(), layer.in, parameters + layer.weight,
         layer.out, 0.0f, tangents_[l + 1].data(), layer.out, {.mask = activations_[l].data(), .ld_mask = layer.out});
  }
}

}  // namespace oted
