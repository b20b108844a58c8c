#pragma once
/// Stage 4 (paper, Algorithm 2): train an agent in the designed simulators.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/matching/designer.h"
#include "oted/rl/crossq.h"
#include "oted/rl/ppo.h"
#include "oted/rl/sac.h"

namespace oted {

/// Algorithm 2, line 1: at each episode's start i ~ U[1, n], and the simulator is set to the mode z_i of q(.|h_i). With
/// a single z the simulator is a fixed one.
/// @param modes  (n, parameters), at least one
EpisodeParameters DrawModes(std::vector<std::vector<double>> modes);

/// Sec. 4, step 3: z is drawn anew from q at each episode's start, here from the mixture of the n seeds' q(.|h_i).
/// @param q  at least one
EpisodeParameters DrawSamples(std::vector<Designer> q);

/// Trains one agent, by SAC or CrossQ where actions are continuous and by PPO where they are discrete. Lines 2 and 3 of
/// Algorithm 2, run and update, are the algorithm's own loop.
/// @param where  its episodes
/// @param evaluate_in  (n, parameters): the simulators in which its checkpoints are compared
ReplayAgent TrainAgent(const SimulatorFactory& factory, EpisodeSource& where,
                       const std::vector<std::vector<double>>& evaluate_in, const SacConfig& config, RngKey key,
                       const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                       const EvaluationObserver& observer = {});
ReplayAgent TrainAgent(const SimulatorFactory& factory, EpisodeSource& where,
                       const std::vector<std::vector<double>>& evaluate_in, const CrossQConfig& config, RngKey key,
                       const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                       const EvaluationObserver& observer = {});
PpoResult TrainAgent(const SimulatorFactory& factory, EpisodeSource& where,
                     const std::vector<std::vector<double>>& evaluate_in, const PpoConfig& config, RngKey key,
                     const std::filesystem::path& folder, const std::string& run_name, const RunContext& context);

}  // namespace oted
