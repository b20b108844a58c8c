#pragma once
/// The target's side of a study: behaviour policies trained in it, and the demonstrations that they log. A user with a
/// robot brings logs instead; nothing here is read by the design.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

#include "oted/base/log.h"
#include "oted/collect/excitation.h"
#include "oted/data/dataset.h"
#include "oted/rl/crossq.h"
#include "oted/rl/sac.h"

namespace oted {

/// One training run of behaviour policies.
struct BehaviorTraining {
  const SimulatorFactory& factory;
  nlohmann::json task;    ///< what is simulated and paid, beside the model: TaskConfig::Identity, logged starts
  std::vector<double> z;  ///< (parameters): of the target
  std::variant<SacConfig, CrossQConfig> agent;  ///< the algorithm, by its settings
  uint64_t seed = 1;
};

/// What one training run gave.
struct BehaviorPolicies {
  TanhGaussianPolicy expert, medium;
  int64_t expert_step = 0, medium_step = 0;     ///< control steps at which they were saved
  double expert_return = 0, medium_return = 0;  ///< mean over 20 fresh episodes, mean action
  double random_return = 0;                     ///< of uniform random actions, 20 episodes
  /// Whether the medium one is nearer a third of the way up than half as far off as the expert.
  bool medium_is_near = false;
};

/// Trains one agent in the simulator at the target's parameters. The expert is the best over 20 fresh episodes of the
/// five policies that were evaluated best; the medium one is the snapshot until then whose return over these episodes
/// is nearest a third of the way from that of random actions to the expert's (D4RL's convention: a third of the
/// expert's). Snapshots of every evaluation lie in `folder` while it trains, so that a stopped run goes on. Writes
/// expert.npz, medium.npz and training.json into `folder`, and first what is trained (behavior.json): only
/// more steps of the same may follow there. Warns of an expert that is no better than random actions.
/// @throws UsageError where `folder` holds another training
BehaviorPolicies TrainBehaviorPolicies(const BehaviorTraining& training, const std::filesystem::path& folder,
                                       const RunContext& context);

/// Logs `n_episodes` episodes of `policy` with sampled actions in the simulator at parameters `z`: the dataset D with
/// rewards, terminals and timeouts, rounded to float32 as D4RL's files are, and nothing that names `z`. No rewards for
/// a task without.
Dataset CollectDemonstrations(const SimulatorFactory& factory, const std::vector<double>& z,
                              const TanhGaussianPolicy& policy, int n_episodes, RngKey key, int n_threads);

/// The same with open-loop actions, each episode with its own: for logs of a target that nobody has a policy for.
Dataset CollectExcitation(const SimulatorFactory& factory, const std::vector<double>& z, const Excitation& excitation,
                          int n_episodes, RngKey key, int n_threads);

}  // namespace oted
