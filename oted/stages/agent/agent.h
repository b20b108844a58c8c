#pragma once
/// Stage 4 (paper, Algorithm 2): train an agent in the mixture of designed simulators.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/rl/ppo.h"
#include "oted/rl/sac.h"

namespace oted {

/// Trains one agent, by SAC where actions are continuous and by PPO where they are discrete; at each episode's start
/// i ~ U[1, n] and the simulator is set to the mode z_i of q(.|h_i). With a single z the simulator is a fixed one.
/// @param modes  (n, parameters), at least one
SacResult TrainAgent(const SimulatorFactory& factory, const std::vector<std::vector<double>>& modes,
                     const SacConfig& config, RngKey key, const std::filesystem::path& folder,
                     const std::string& run_name, const RunContext& context);
PpoResult TrainAgent(const SimulatorFactory& factory, const std::vector<std::vector<double>>& modes,
                     const PpoConfig& config, RngKey key, const std::filesystem::path& folder,
                     const std::string& run_name, const RunContext& context);

}  // namespace oted
