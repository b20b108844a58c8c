#pragma once
/// Training one CrossQ agent in simulators (Bhatt, Palenicek et al. 2024).

#include <filesystem>
#include <string>
#include <vector>

#include "oted/rl/replay_training.h"

namespace oted {

/// Defaults are the paper's and its authors' program's except where noted.
struct CrossQConfig : ReplayConfig {
  std::vector<int> critic_hidden = {256, 256};  ///< the paper: 2048, 2048
  double beta1 = 0.5;
  int policy_delay = 3;
  double momentum = 0.01;
  int64_t renorm_warmup = 100'000;

  CrossQConfig() {
    learning_rate = 1e-3;
    learning_starts = 5'000;  // with 1,000 some agents learn to stand still at once, and stay (docs/deviations.md)
  }
  FieldList Fields();
};

/// Trains one agent by TrainByReplay; `hidden` is of the actor.
/// @throws as TrainByReplay
ReplayAgent TrainAgent(const AgentJob& job, const CrossQConfig& config);

}  // namespace oted
