#pragma once
/// Training one Soft Actor-Critic agent in simulators: the paper's agents. Knows nothing of the design: where an
/// episode's parameters come from is a callback.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/rl/replay_training.h"

namespace oted {

struct SacConfig : ReplayConfig {
  double tau = 0.005;

  FieldList Fields(const std::string& section = "sac");
};

/// Trains one agent by TrainByReplay; `hidden` is of actor and critics.
/// @throws as TrainByReplay
ReplayAgent TrainAgent(const AgentJob& job, const SacConfig& config);

}  // namespace oted
