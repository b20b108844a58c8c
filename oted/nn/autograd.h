#pragma once
/// The networks of oted/nn on libtorch's autograd, in any precision and on any device: what tests hold the hand-written
/// forms against (in double precision, so that the two differ by the latter's rounding alone), and what trains on a GPU
/// (oted/rl/autograd). Brings torch's headers with it: for those two alone.

// Not torch/torch.h: it takes half as long again to compile.
#include <torch/csrc/autograd/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <initializer_list>
#include <span>
#include <vector>

#include "oted/nn/batch_norm_mlp.h"
#include "oted/nn/layer_norm_mlp.h"
#include "oted/nn/mlp.h"

namespace oted {

/// A copy of `values` as a (rows, cols) tensor.
inline torch::Tensor ToTensor(std::span<const float> values, int64_t rows, int64_t cols,
                              const torch::TensorOptions& options = torch::kFloat64) {
  const torch::Tensor here = torch::from_blob(const_cast<float*>(values.data()), {rows, cols}, torch::kFloat32);
  return here.to(options, /*non_blocking=*/false, /*copy=*/true);
}

/// A vector of parameters, and leaf tensors that share its memory.
struct AutogradParameters {
  torch::Tensor flat;                     ///< (n), the order of the hand-written network's vector
  std::vector<torch::Tensor> parameters;  ///< leaves in that order, so that their gradients joined are flat's

  explicit AutogradParameters(const torch::Tensor& values) : flat(values.flatten()) {}
  /// The next leaf: `rows` x `cols` numbers from `offset` on.
  void AddLeaf(size_t offset, int64_t rows, int64_t cols) {
    const torch::Tensor part = flat.narrow(0, static_cast<int64_t>(offset), rows * cols).view({rows, cols});
    parameters.push_back(part.detach().requires_grad_());
  }
};

/// An Mlp: weight (in, out) and bias (1, out) of each layer in turn.
struct AutogradMlp : AutogradParameters {
  explicit AutogradMlp(const Mlp& mlp, const torch::TensorOptions& options = torch::kFloat64)
      : AutogradParameters(ToTensor(mlp.parameters(), 1, static_cast<int64_t>(mlp.n_parameters()), options)) {
    for (const Mlp::Layer& layer : mlp.layers()) {
      AddLeaf(layer.weight, layer.in, layer.out);
      AddLeaf(layer.bias, 1, layer.out);
    }
  }

  torch::Tensor Forward(torch::Tensor x) const {
    for (size_t i = 0; i < parameters.size(); i += 2) {
      x = torch::addmm(parameters[i + 1], x, parameters[i]);
      if (i + 2 < parameters.size()) x = torch::relu(x);
    }
    return x;
  }
};

/// A LayerNormMlp: weight and bias of each layer in turn, then gamma and beta of each hidden one.
struct AutogradLayerNormMlp : AutogradParameters {
  explicit AutogradLayerNormMlp(const LayerNormMlp& net, const torch::TensorOptions& options = torch::kFloat64)
      : AutogradParameters(ToTensor(net.parameters(), 1, static_cast<int64_t>(net.n_parameters()), options)),
        n_layers_(net.layers().size()) {
    for (const Mlp::Layer& layer : net.layers()) {
      AddLeaf(layer.weight, layer.in, layer.out);
      AddLeaf(layer.bias, 1, layer.out);
    }
    for (size_t l = 0; l + 1 < n_layers_; ++l) {
      AddLeaf(net.gamma(l), 1, net.layers()[l].out);
      AddLeaf(net.beta(l), 1, net.layers()[l].out);
    }
  }

  torch::Tensor Forward(torch::Tensor x) const {
    for (size_t l = 0; l < n_layers_; ++l) {
      x = torch::addmm(parameters[2 * l + 1], x, parameters[2 * l]);
      if (l + 1 == n_layers_) break;
      const torch::Tensor h = torch::relu(x), mean = h.mean(1, true), variance = (h - mean).pow(2).mean(1, true);
      x = (h - mean) / (variance + LayerNormMlp::kEpsilon).sqrt() * parameters[2 * (n_layers_ + l)] +
          parameters[2 * (n_layers_ + l) + 1];
    }
    return x;
  }

 private:
  size_t n_layers_;
};

/// A BatchNormMlp as sb3-contrib's CrossQ writes its networks: for each layer weight and bias, then for each layer
/// gamma and beta.
struct AutogradBatchNormMlp : AutogradParameters {
  torch::Tensor running;  ///< (2 x inputs of all layers): for each layer means, then variances

  explicit AutogradBatchNormMlp(const BatchNormMlp& net, const torch::TensorOptions& options = torch::kFloat64)
      : AutogradParameters(ToTensor(net.parameters(), 1, static_cast<int64_t>(net.n_parameters()), options)),
        running(ToTensor(net.running(), 1, static_cast<int64_t>(net.running().size()), options).flatten()) {
    for (const Mlp::Layer& layer : net.layers()) {
      AddLeaf(layer.weight, layer.in, layer.out);
      AddLeaf(layer.bias, 1, layer.out);
    }
    for (size_t l = 0; l < net.layers().size(); ++l) {
      const int64_t in = net.layers()[l].in;
      AddLeaf(net.gamma(l), 1, in);
      AddLeaf(net.beta(l), 1, in);
      means_.push_back(running.narrow(0, static_cast<int64_t>(net.running_mean(l)), in).view({1, in}));
      variances_.push_back(running.narrow(0, static_cast<int64_t>(net.running_variance(l)), in).view({1, in}));
    }
  }

  size_t n_layers() const { return means_.size(); }

  /// By the batch's statistics, moving the running ones.
  torch::Tensor Train(const torch::Tensor& x, double momentum, bool renormalise) {
    return Forward(x, [&](const torch::Tensor& h, size_t l) {
      const torch::Tensor mean = h.mean(0, true), variance = (h - mean).pow(2).mean(0, true);
      const torch::Tensor deviation = (variance + BatchNormMlp::kEpsilon).sqrt();
      torch::Tensor normalised = (h - mean) / deviation;
      if (renormalise) {
        const torch::Tensor scale = (variances_[l] + BatchNormMlp::kEpsilon).sqrt();
        const torch::Tensor r =
            (deviation.detach() / scale).clamp(1 / BatchNormMlp::kMaxFactor, BatchNormMlp::kMaxFactor);
        const torch::Tensor d =
            ((mean.detach() - means_[l]) / scale).clamp(-BatchNormMlp::kMaxShift, BatchNormMlp::kMaxShift);
        normalised = normalised * r + d;
      }
      means_[l].lerp_(mean.detach(), momentum);
      variances_[l].lerp_(variance.detach(), momentum);
      return normalised;
    });
  }

  /// By the running statistics.
  torch::Tensor Evaluate(const torch::Tensor& x) const {
    return Forward(x, [&](const torch::Tensor& h, size_t l) {
      return (h - means_[l]) / (variances_[l] + BatchNormMlp::kEpsilon).sqrt();
    });
  }

 private:
  template <class Normalise>
  torch::Tensor Forward(torch::Tensor x, const Normalise& normalise) const {
    for (size_t l = 0; l < n_layers(); ++l) {
      const torch::Tensor &gamma = parameters[2 * (n_layers() + l)], &beta = parameters[2 * (n_layers() + l) + 1];
      x = torch::addmm(parameters[2 * l + 1], normalise(x, l) * gamma + beta, parameters[2 * l]);
      if (l + 1 < n_layers()) x = torch::relu(x);
    }
    return x;
  }

  std::vector<torch::Tensor> means_, variances_;  // views of running
};

/// Adam (Kingma and Ba 2015) on a whole vector at once.
class AutogradAdam {
 public:
  AutogradParameters on;
  torch::Tensor m, v;  ///< moments, (n)
  int64_t n_steps = 0;

  AutogradAdam(const AutogradParameters& parameters, double learning_rate, double beta1)
      : on(parameters),
        m(torch::zeros_like(on.flat)),
        v(torch::zeros_like(on.flat)),
        learning_rate_(learning_rate),
        beta1_(beta1) {}

  void Step(const torch::Tensor& gradient) {
    constexpr double kBeta2 = 0.999, kEpsilon = 1e-8;
    const torch::NoGradGuard no_grad;
    const double steps = static_cast<double>(++n_steps);
    m.mul_(beta1_).add_(gradient, 1 - beta1_);
    v.mul_(kBeta2).addcmul_(gradient, gradient, 1 - kBeta2);
    const torch::Tensor scale = v.sqrt().div_(std::sqrt(1 - std::pow(kBeta2, steps))).add_(kEpsilon);
    on.flat.addcdiv_(m, scale, -learning_rate_ / (1 - std::pow(beta1_, steps)));
  }

 private:
  double learning_rate_, beta1_;
};

/// One step of each on the gradient of `loss`.
inline void Minimise(const torch::Tensor& loss, std::initializer_list<AutogradAdam*> optimisers) {
  std::vector<torch::Tensor> leaves;
  for (const AutogradAdam* adam : optimisers) {
    leaves.insert(leaves.end(), adam->on.parameters.begin(), adam->on.parameters.end());
  }
  std::vector<torch::Tensor> gradients = torch::autograd::grad({loss}, leaves);
  auto next = gradients.begin();
  for (AutogradAdam* adam : optimisers) {
    std::vector<torch::Tensor> parts;
    for (size_t i = 0; i < adam->on.parameters.size(); ++i) parts.push_back((next++)->flatten());
    adam->Step(torch::cat(parts));
  }
}

}  // namespace oted
