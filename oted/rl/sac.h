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
ReplayAgent TrainSac(const SimulatorFactory& factory, EpisodeSource& source,
                     const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                     const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                     const EvaluationObserver& observer = {});
ReplayAgent TrainSac(const SimulatorFactory& factory, const EpisodeParameters& episode_parameters,
                     const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                     const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                     const EvaluationObserver& observer = {});

}  // namespace oted
