#pragma once
/// Training one CrossQ agent in simulators (Bhatt, Palenicek et al. 2024).

#include <filesystem>
#include <string>
#include <vector>

#include "oted/rl/replay_training.h"

namespace oted {

/// Defaults are the paper's and its authors' program's except where noted. Sizes, lanes and the number of gradient
/// steps are what earns most in minutes of a processor's time (docs/speed.md).
struct CrossQConfig : ReplayConfig {
  std::vector<int> critic_hidden = {128, 128};  ///< the paper: 2048, 2048
  double beta1 = 0.5;
  int policy_delay = 3;
  double momentum = 0.01;
  int64_t renorm_warmup = 100'000;

  CrossQConfig() {
    n_lanes = 16;
    updates_per_step = 0.25;  // the paper: 1, of one lane
    batch_size = 128;         // the paper: 256
    hidden = {128, 128};      // the paper: 256, 256
    average_over = 1'000;
    n_starts = 3;
    learning_rate = 1e-3;
    learning_starts = 5'000;  // with 1,000 some agents learn to stand still at once, and stay (docs/deviations.md)
  }
  FieldList Fields();
};

/// Trains one agent by TrainByReplay; `hidden` is of the actor.
/// @throws as TrainByReplay
ReplayAgent TrainAgent(const AgentJob& job, const CrossQConfig& config);

}  // namespace oted
