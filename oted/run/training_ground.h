#pragma once
/// Where an agent trains: the designed simulators, the un-designed one, or those of a baseline.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/config/run_config.h"
#include "oted/matching/designer.h"
#include "oted/rl/training.h"
#include "oted/sim/simulator.h"

namespace oted {

/// What begins an agent's episodes, and the simulators in which its checkpoints are compared.
struct TrainingGround {
  std::unique_ptr<EpisodeSource> episodes;
  std::vector<std::vector<double>> evaluate_in;
};

/// What the design left for agents to train in.
struct DesignedSimulators {
  std::vector<std::vector<double>> modes;  ///< z_i of the selected setting's seeds
  std::vector<double> best;                ///< the mode of the best-scoring seed
  std::vector<Designer> q;                 ///< of the seeds; read where agents.train_in is "samples" alone
};

/// As agents.train_in says. Checkpoints of "samples" are compared in the modes, as the policy selection does.
TrainingGround DesignedGround(const AgentsConfig& config, const DesignedSimulators& designed);

/// z of the un-designed simulator: agents.undesigned_at, else the nominal values.
std::vector<double> UndesignedParameters(const AgentsConfig& config, const ParameterSpace& space);

/// The ground of an agent to compare with, which knows nothing of logs and design.
/// @param name  "undesigned", or of BaselinesConfig::Known() one that is an agent
TrainingGround ComparedGround(const std::string& name, const RunConfig& config, const SimulatorFactory& factory);

/// Names everything that an agent to compare with depends on, beside what it shares with the designed agents (the
/// algorithm's settings, seed, task and model).
nlohmann::json ComparedIdentity(const std::string& name, const RunConfig& config, const ParameterSpace& space);

/// The random streams of BC+DR in a run.
RngKey BcDrKey(const RunConfig& config);

/// What `use` makes of the settings of the algorithm that the agents learn by: a SacConfig, CrossQConfig or PpoConfig.
template <class Use>
auto WithAgentSettings(const RunConfig& config, const SimulatorSpec& spec, const Use& use) {
  const std::string algorithm = config.agents.AlgorithmFor(spec);
  if (algorithm == "ppo") return use(config.ppo);
  return algorithm == "crossq" ? use(config.crossq) : use(config.sac);
}

/// Trains agent `index` (from 1) of a run by the algorithm that its actions ask for, and leaves policy.npz in `folder`.
/// Agents of the same index have the same random streams wherever they train: a paired comparison.
LearningCurve TrainAgentIn(const TrainingGround& ground, const SimulatorFactory& factory, const RunConfig& config,
                           int index, const std::filesystem::path& folder, const std::string& run_name,
                           const RunContext& context);

}  // namespace oted
