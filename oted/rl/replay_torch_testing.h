#pragma once
/// Comparing two learners step by step: batches, and losses. Include from *_torch_test.cc files only.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "oted/rl/replay_buffer.h"
#include "oted/rl/replay_training.h"

namespace oted {

/// 64 transitions, a fifth of them terminal. Columns of the observations differ in size, but no more than keeps actions
/// off their bounds, as does the small noise: there single precision knows log(1 - a^2 + 1e-6) to a few per cent only.
inline TransitionBatch RandomBatch(int obs_dim, int act_dim, Rng& rng) {
  constexpr int kBatch = 64;
  ReplayBuffer buffer(obs_dim, act_dim, kBatch);
  std::vector<double> s(static_cast<size_t>(obs_dim)), s_next(s), a(static_cast<size_t>(act_dim));
  for (int row = 0; row < kBatch; ++row) {
    for (size_t j = 0; j < s.size(); ++j) {
      const double size = 0.2 + 0.8 * static_cast<double>(j) / obs_dim;
      s[j] = size * rng.Normal() + 0.1;
      s_next[j] = size * rng.Normal() - 0.2;
    }
    for (double& v : a) v = rng.Uniform(-1, 1);
    buffer.Add(s, a, rng.Normal(), s_next, rng.Uniform() < 0.2 ? 0 : 0.99);
  }
  TransitionBatch batch;
  buffer.Sample(kBatch, rng, batch);
  for (float& v : batch.noise) v *= 0.3f;
  return batch;
}

/// @param tolerance  relative, and absolute below 1
inline void ExpectNear(const ReplayLosses& got, const ReplayLosses& want, int step, double tolerance = 2e-5) {
  const auto near = [&](double a, double b, const char* what) {
    EXPECT_NEAR(a, b, tolerance * (1 + std::abs(b))) << what << " at step " << step;
  };
  near(got.critic_loss, want.critic_loss, "critic loss");
  near(got.actor_loss, want.actor_loss, "actor loss");
  near(got.alpha, want.alpha, "alpha");
  near(got.alpha_loss, want.alpha_loss, "alpha loss");
  near(got.mean_q, want.mean_q, "mean Q");
}

}  // namespace oted
