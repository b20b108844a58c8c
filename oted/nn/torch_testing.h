#pragma once
/// libtorch as the reference of what is written by hand. Include from *_torch_test.cc files only.

// Not torch/torch.h: it takes half as long again to compile.
#include <torch/optim/adam.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "oted/nn/mlp.h"

namespace oted {

/// A copy of `values` as a (rows, cols) tensor of doubles.
inline torch::Tensor ToTensor(std::span<const float> values, int64_t rows, int64_t cols) {
  const std::vector<double> copy(values.begin(), values.end());
  return torch::tensor(copy, torch::kFloat64).reshape({rows, cols});
}

/// All numbers of `tensors`, or of their gradients, one tensor after the other.
inline std::vector<double> Flattened(const std::vector<torch::Tensor>& tensors, bool gradients = false) {
  std::vector<double> flat;
  for (const torch::Tensor& tensor : tensors) {
    const torch::Tensor values = (gradients ? tensor.grad() : tensor.detach()).contiguous();
    flat.insert(flat.end(), values.data_ptr<double>(), values.data_ptr<double>() + values.numel());
  }
  return flat;
}

/// An Mlp's numbers as leaf tensors in double precision: weight and bias of each layer in turn, the order of its flat
/// vector, so that one reference differs from the hand-written form by the latter's rounding alone.
struct TorchMlp {
  std::vector<torch::Tensor> parameters;

  explicit TorchMlp(const Mlp& mlp) {
    const float* p = mlp.parameters().data();
    for (const Mlp::Layer& layer : mlp.layers()) {
      const size_t in = static_cast<size_t>(layer.in), out = static_cast<size_t>(layer.out);
      parameters.push_back(ToTensor({p + layer.weight, in * out}, layer.in, layer.out).requires_grad_());
      parameters.push_back(ToTensor({p + layer.bias, out}, 1, layer.out).requires_grad_());
    }
  }

  torch::Tensor Forward(torch::Tensor x) const {
    for (size_t i = 0; i < parameters.size(); i += 2) {
      x = x.matmul(parameters[i]) + parameters[i + 1];
      if (i + 2 < parameters.size()) x = torch::relu(x);
    }
    return x;
  }

  /// All parameters, or all their gradients, in the order of the flat vector.
  std::vector<double> Flat(bool gradients = false) const { return Flattened(parameters, gradients); }
};

/// Normal numbers, the same for the same seed.
inline AlignedVector<float> Normals(size_t n, uint64_t seed, float mean = 0, float deviation = 1) {
  AlignedVector<float> values(n);
  Rng(seed).FillNormal({values.data(), values.size()});
  for (float& v : values) v = mean + deviation * v;
  return values;
}

/// The largest |v|.
inline double Largest(const std::vector<double>& values) {
  double largest = 0;
  for (const double v : values) largest = std::max(largest, std::abs(v));
  return largest;
}

/// The largest |a_i - b_i|.
template <class A, class B>
double MaxDifference(const A& a, const B& b) {
  double largest = a.size() == b.size() ? 0 : INFINITY;
  for (size_t i = 0; i < a.size() && i < b.size(); ++i) {
    const double difference = std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    if (!(difference <= largest)) largest = difference;  // also keeps a NaN
  }
  return largest;
}

}  // namespace oted
