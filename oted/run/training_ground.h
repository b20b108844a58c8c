#pragma once
/// Where an agent trains: the designed simulators, the nominal one, or those of a baseline.

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/config/run_config.h"
#include "oted/matching/designer.h"
#include "oted/rl/training.h"
#include "oted/sim/simulator.h"

namespace oted {

enum class Ground {
  kDesigned,             ///< "designed": as agents.train_in says
  kNominal,              ///< "nominal": one simulator, at agents.nominal_at
  kDomainRandomization,  ///< "dr"
  kIntervalSearch,       ///< "is"
};
const NamedValues<Ground>& GroundNames();

/// What begins an agent's episodes, and the simulators in which its checkpoints are compared.
struct TrainingGround {
  std::unique_ptr<EpisodeSource> episodes;
  std::vector<std::vector<double>> evaluate_in;
};

/// What the design left for agents to train in.
struct DesignedSimulators {
  std::vector<std::vector<double>> modes;  ///< z_i of the selected setting's seeds
  std::vector<double> best;                ///< the mode of the best-scoring seed
  std::vector<Designer> q;                 ///< of the seeds
};

/// As agents.train_in says. Checkpoints of "samples" are compared in the modes, as the policy selection does.
TrainingGround DesignedGround(TrainIn train_in, const DesignedSimulators& designed);

/// z of the nominal simulator: agents.nominal_at, else the parameters' nominal values.
std::vector<double> NominalParameters(const AgentsConfig& config, const ParameterSpace& space);

/// The ground of an agent to compare with, which knows nothing of logs and design. @param ground  not kDesigned
TrainingGround ComparedGround(Ground ground, const RunConfig& config, const SimulatorFactory& factory);

/// Names everything that an agent to compare with depends on, beside what it shares with the designed agents (the
/// algorithm's settings, seed, task and model).
nlohmann::json ComparedIdentity(Ground ground, const RunConfig& config, const ParameterSpace& space);

/// The random streams of a baseline that is no agent: "bc_dr", or an offline one.
RngKey BaselineKey(const RunConfig& config, const std::string& name);

}  // namespace oted
