#pragma once
/// Training one Soft Actor-Critic agent in simulators: the paper's agents. Knows nothing of the design: where an
/// episode's parameters come from is a callback.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/rl/replay_training.h"

namespace oted {

/// Defaults are what earns most in minutes of a processor's time (docs/speed.md), not Stable-Baselines3's: small
/// networks on normalised observations, many lanes, rewards of three steps, the best of three starts, averaged weights.
struct SacConfig : ReplayConfig {
  double tau = 0.005;

  SacConfig() {
    n_lanes = 16;
    batch_size = 64;
    hidden = {64, 64};
    learning_rate = 1e-3;
    multi_step = 3;
    average_over = 1'000;
    n_starts = 3;
    normalize_observations = true;
  }
  FieldList Fields();
};

/// Trains one agent by TrainByReplay; `hidden` is of actor and critics.
/// @throws as TrainByReplay
ReplayAgent TrainAgent(const AgentJob& job, const SacConfig& config);

}  // namespace oted
