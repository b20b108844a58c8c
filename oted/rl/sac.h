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
#include "oted/sim/rollout.h"
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

/// Draws the parameters z of a new episode.
using EpisodeParameters = std::function<std::vector<double>(Rng& rng)>;

/// Sees every evaluated policy: a recorder of snapshots.
using SacObserver = std::function<void(int64_t step, const TanhGaussianPolicy& policy, double eval_return)>;

struct SacResult {
  TanhGaussianPolicy policy;
  double eval_return = 0;            ///< mean return of `policy` in the simulators it was evaluated in
  int n_diverged = 0;                ///< of that evaluation's episodes
  std::vector<int64_t> eval_steps;   ///< learning curve: environment steps ...
  std::vector<double> eval_returns;  ///< ... and the mean return of the deterministic policy
};

/// Trains for config.n_steps control steps over all lanes. The work goes in segments of eval_interval steps: each
/// begins with fresh episodes, ends with an evaluation of the mean action (episode k in `eval_parameters[k mod size]`)
/// and a checkpoint in `folder`, so that a stopped run that goes on gives the same bytes as one that was not stopped.
/// Time limits and segment ends are not terminal: the target bootstraps through them.
/// The kept policy is that of the highest mean return (or the last); an evaluation in which every episode diverged is
/// below any other.
/// @param folder  of this agent: checkpoint.npz while it trains. Its learning curve goes to the log under `run_name`.
/// @throws Interrupted at a segment's end when a stop was requested.
SacResult TrainSac(const SimulatorFactory& factory, const EpisodeParameters& episode_parameters,
                   const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                   const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                   const SacObserver& observer = {});

/// `n_episodes` episodes of the mean action; episode k runs in `z[k mod z.size()]`.
std::vector<EpisodeResult> RunPolicy(const SimulatorFactory& factory, const TanhGaussianPolicy& policy,
                                     const std::vector<std::vector<double>>& z, int n_episodes, int n_threads,
                                     RngKey key);
/// Their mean return; a diverged episode counts as the lowest of them (ComparableReturns).
double EvaluatePolicy(const SimulatorFactory& factory, const TanhGaussianPolicy& policy,
                      const std::vector<std::vector<double>>& z, int n_episodes, int n_threads, RngKey key);

}  // namespace oted
