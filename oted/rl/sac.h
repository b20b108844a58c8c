#pragma once
/// Training one Soft Actor-Critic agent in simulators (Algorithm 2 of the paper, one agent). Knows nothing of the
/// design: where an episode's parameters come from is a callback.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/log.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/training.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Defaults are Stable-Baselines3's except where noted.
struct SacConfig {
  int64_t n_steps = 300'000;
  int n_lanes = 1;
  double updates_per_step = 1.0;
  int64_t learning_starts = 1'000;  ///< Stable-Baselines3: 100; rl-zoo's MuJoCo settings: 10,000
  int batch_size = 256;
  int64_t buffer_size = 1'000'000;
  std::vector<int> hidden = {256, 256};
  double learning_rate = 3e-4;
  double gamma = 0.99;
  double tau = 0.005;
  int64_t eval_interval = 10'000;
  int eval_episodes = 5;
  std::string keep = "best";

  FieldList Fields(const std::string& section);
};

/// Sees every evaluated policy: a recorder of snapshots.
using SacObserver = std::function<void(int64_t step, const TanhGaussianPolicy& policy, double eval_return)>;

struct SacResult : LearningCurve {
  TanhGaussianPolicy policy;
};

/// Trains one agent by TrainInSegments. Time limits and segment ends are not terminal: the target bootstraps through
/// them.
/// @throws UsageError for a task with discrete actions; as TrainInSegments
SacResult TrainSac(const SimulatorFactory& factory, EpisodeSource& source,
                   const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                   const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                   const SacObserver& observer = {});
SacResult TrainSac(const SimulatorFactory& factory, const EpisodeParameters& episode_parameters,
                   const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                   const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                   const SacObserver& observer = {});

}  // namespace oted
