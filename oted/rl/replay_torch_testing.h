#pragma once
/// What SAC and CrossQ on autograd have in common. Include from *_torch_test.cc files only.

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "oted/nn/torch_testing.h"
#include "oted/rl/replay_training.h"

namespace oted {

/// A reparameterised draw and its log probability: a squashed diagonal Gaussian.
/// @param out    (n, 2 act_dim): mean and log_std
/// @param noise  (n, act_dim) standard normals
inline std::pair<torch::Tensor, torch::Tensor> TorchSquash(const torch::Tensor& out, const torch::Tensor& noise) {
  const int64_t act_dim = noise.size(1);
  const torch::Tensor mean = out.slice(1, 0, act_dim);
  const torch::Tensor log_std = out.slice(1, act_dim, 2 * act_dim).clamp(-20, 2);
  const torch::Tensor u = mean + log_std.exp() * noise, action = u.tanh();
  const torch::Tensor gaussian = -0.5 * ((u - mean) / log_std.exp()).pow(2) - log_std - 0.5 * std::log(2 * M_PI);
  return {action, (gaussian - (1 - action.pow(2) + 1e-6).log()).sum(1, true)};
}

inline void Minimise(torch::optim::Adam& adam, const torch::Tensor& loss) {
  adam.zero_grad();
  loss.backward();
  adam.step();
}

inline void ExpectNear(const ReplayLosses& got, const ReplayLosses& want, int step) {
  const auto near = [&](double a, double b, const char* what) {
    EXPECT_NEAR(a, b, 2e-5 * (1 + std::abs(b))) << what << " at step " << step;
  };
  near(got.critic_loss, want.critic_loss, "critic loss");
  near(got.actor_loss, want.actor_loss, "actor loss");
  near(got.alpha, want.alpha, "alpha");
  near(got.alpha_loss, want.alpha_loss, "alpha loss");
  near(got.mean_q, want.mean_q, "mean Q");
}

}  // namespace oted
