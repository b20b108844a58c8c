#pragma once
/// What SAC and CrossQ on libtorch's autograd have in common. Includes torch's headers: for this folder and
/// *_torch_test.cc alone.

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "oted/nn/autograd.h"
#include "oted/rl/replay_buffer.h"
#include "oted/rl/replay_training.h"

namespace oted {

/// What a learner holds, by the names of LearnedState: flat tensors, and the optimisers' counters.
struct AutogradState {
  std::vector<std::pair<std::string, torch::Tensor>> values;
  std::vector<int64_t*> n_steps;

  void Add(const std::string& name, const torch::Tensor& flat) { values.emplace_back(name, flat); }
  /// NAME/parameters and the moments NAME/m and NAME/v.
  void Add(const std::string& name, AutogradAdam& adam) {
    Add(name + "/parameters", adam.on.flat);
    Add(name + "/m", adam.m);
    Add(name + "/v", adam.v);
    n_steps.push_back(&adam.n_steps);
  }
};

/// A TransitionBatch of B rows where the learner computes.
struct AutogradBatch {
  torch::Tensor s, s_next;          ///< (B, obs_dim)
  torch::Tensor joint;              ///< (B, obs_dim + act_dim)
  torch::Tensor noise, next_noise;  ///< (B, act_dim)
  torch::Tensor reward, discount;   ///< (B, 1)

  AutogradBatch(const TransitionBatch& batch, const torch::TensorOptions& options) {
    const int64_t n = batch.size;
    const auto columns = [n](const AlignedVector<float>& v, int64_t rows) {
      return static_cast<int64_t>(v.size()) / (rows * n);
    };
    const torch::Tensor both = ToTensor(batch.observations, 2 * n, columns(batch.observations, 2), options);
    const torch::Tensor both_noise = ToTensor(batch.noise, 2 * n, columns(batch.noise, 2), options);
    s = both.narrow(0, 0, n);
    s_next = both.narrow(0, n, n);
    noise = both_noise.narrow(0, 0, n);
    next_noise = both_noise.narrow(0, n, n);
    joint = ToTensor(batch.joint, n, columns(batch.joint, 1), options);
    reward = ToTensor(batch.rewards, n, 1, options);
    discount = ToTensor(batch.discounts, n, 1, options);
  }
};

/// The temperature: a leaf of one number.
struct AutogradTemperature : AutogradParameters {
  AutogradTemperature(double log_alpha, const torch::TensorOptions& options)
      : AutogradParameters(torch::full({1}, log_alpha, options)) {
    AddLeaf(0, 1, 1);
  }
  torch::Tensor alpha() const { return flat.exp(); }
  /// -log_alpha (mean log pi(a|s) + target_entropy)
  torch::Tensor Loss(const torch::Tensor& log_prob, double target_entropy) const {
    return -(parameters[0] * (log_prob.detach() + target_entropy)).mean();
  }
};

/// A reparameterised draw of a squashed diagonal Gaussian, and its log probability (B, 1).
/// @param out    (B, 2 act_dim): mean and log_std
/// @param noise  (B, act_dim) standard normals
inline std::pair<torch::Tensor, torch::Tensor> AutogradSquash(const torch::Tensor& out, const torch::Tensor& noise) {
  const int64_t act_dim = noise.size(1);
  const torch::Tensor mean = out.narrow(1, 0, act_dim), log_std = out.narrow(1, act_dim, act_dim).clamp(-20, 2);
  const torch::Tensor action = (mean + log_std.exp() * noise).tanh();
  const torch::Tensor gaussian = -0.5 * noise.pow(2) - log_std - 0.5 * std::log(2 * M_PI);
  return {action, (gaussian - (1 - action.pow(2) + 1e-6).log()).sum(1, true)};
}

/// The order of ReplayLosses, in one transfer.
inline ReplayLosses ToLosses(std::vector<torch::Tensor> figures) {
  for (torch::Tensor& figure : figures) figure = figure.detach().flatten();
  const torch::Tensor here = torch::cat(figures).to(torch::kCPU, torch::kFloat64);
  const double* value = here.data_ptr<double>();
  return {
      .critic_loss = value[0], .actor_loss = value[1], .alpha = value[2], .alpha_loss = value[3], .mean_q = value[4]};
}

}  // namespace oted
