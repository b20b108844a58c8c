#pragma once
/// libtorch as the reference of what is written by hand. Include from *_torch_test.cc files only.

#include <torch/optim/adam.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "oted/nn/autograd.h"

namespace oted {

/// All numbers of `tensors`, or of their gradients, one tensor after the other.
inline std::vector<double> Flattened(const std::vector<torch::Tensor>& tensors, bool gradients = false) {
  std::vector<double> flat;
  for (const torch::Tensor& tensor : tensors) {
    const torch::Tensor values = (gradients ? tensor.grad() : tensor.detach()).contiguous();
    flat.insert(flat.end(), values.data_ptr<double>(), values.data_ptr<double>() + values.numel());
  }
  return flat;
}

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
