#pragma once
/// A BatchNormMlp on autograd, as sb3-contrib's CrossQ writes its networks. Include from *_torch_test.cc files only.

#include <vector>

#include "oted/nn/batch_norm_mlp.h"
#include "oted/nn/torch_testing.h"

namespace oted {

/// Starts with the network's parameters and running statistics, in double precision.
struct TorchBatchNormMlp {
  /// For each layer weight, bias; then for each layer gamma, beta: the order of the flat vector.
  std::vector<torch::Tensor> parameters;
  std::vector<torch::Tensor> running;  // for each layer mean, variance

  explicit TorchBatchNormMlp(const BatchNormMlp& net) {
    const float *p = net.parameters().data(), *r = net.running().data();
    for (const Mlp::Layer& layer : net.layers()) {
      const size_t in = static_cast<size_t>(layer.in), out = static_cast<size_t>(layer.out);
      parameters.push_back(ToTensor({p + layer.weight, in * out}, layer.in, layer.out).requires_grad_());
      parameters.push_back(ToTensor({p + layer.bias, out}, 1, layer.out).requires_grad_());
    }
    for (size_t l = 0; l < net.layers().size(); ++l) {
      const size_t in = static_cast<size_t>(net.layers()[l].in);
      parameters.push_back(ToTensor({p + net.gamma(l), in}, 1, net.layers()[l].in).requires_grad_());
      parameters.push_back(ToTensor({p + net.beta(l), in}, 1, net.layers()[l].in).requires_grad_());
      running.push_back(ToTensor({r + net.running_mean(l), in}, 1, net.layers()[l].in));
      running.push_back(ToTensor({r + net.running_variance(l), in}, 1, net.layers()[l].in));
    }
  }

  size_t n_layers() const { return running.size() / 2; }

  /// By the batch's statistics, moving the running ones.
  torch::Tensor Train(torch::Tensor x, double momentum, bool renormalise) {
    return Forward(x, [&](torch::Tensor h, size_t l) {
      const torch::Tensor mean = h.mean(0, true), variance = (h - mean).pow(2).mean(0, true);
      const torch::Tensor deviation = (variance + BatchNormMlp::kEpsilon).sqrt();
      torch::Tensor normalised = (h - mean) / deviation;
      if (renormalise) {
        const torch::Tensor scale = (running[2 * l + 1] + BatchNormMlp::kEpsilon).sqrt();
        const torch::Tensor r = (deviation.detach() / scale).clamp(1.0 / 3.0, 3.0);
        const torch::Tensor d = ((mean.detach() - running[2 * l]) / scale).clamp(-5.0, 5.0);
        normalised = normalised * r + d;
      }
      running[2 * l] = running[2 * l] + momentum * (mean.detach() - running[2 * l]);
      running[2 * l + 1] = running[2 * l + 1] + momentum * (variance.detach() - running[2 * l + 1]);
      return normalised;
    });
  }

  /// By the running statistics.
  torch::Tensor Evaluate(torch::Tensor x) const {
    return Forward(x, [&](torch::Tensor h, size_t l) {
      return (h - running[2 * l]) / (running[2 * l + 1] + BatchNormMlp::kEpsilon).sqrt();
    });
  }

  std::vector<double> Flat(bool gradients = false) const { return Flattened(parameters, gradients); }
  std::vector<double> FlatRunning() const { return Flattened(running); }

 private:
  template <class Normalise>
  torch::Tensor Forward(torch::Tensor x, const Normalise& normalise) const {
    for (size_t l = 0; l < n_layers(); ++l) {
      const torch::Tensor &gamma = parameters[2 * (n_layers() + l)], &beta = parameters[2 * (n_layers() + l) + 1];
      x = (normalise(x, l) * gamma + beta).matmul(parameters[2 * l]) + parameters[2 * l + 1];
      if (l + 1 < n_layers()) x = torch::relu(x);
    }
    return x;
  }
};

}  // namespace oted
