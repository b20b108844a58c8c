#pragma once
/// Comparing two learners step by step. Include from *_torch_test.cc files only.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/rl/replay_training.h"

namespace oted {

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
