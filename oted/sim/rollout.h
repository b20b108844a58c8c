#pragma once
/// Whole episodes in a vectorised simulator.

#include <functional>
#include <span>
#include <vector>

#include "oted/base/rng.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Maps observations (n, obs_dim) of the lanes that run to actions (n, act_dim). Sees all of them at once, never a
/// thread's share.
using BatchPolicy = std::function<void(std::span<const double> observations, int n, std::span<double> actions)>;

/// Uniform over the action bounds of `spec`, or over its discrete actions. Draws from `rng`, which must outlive the
/// policy.
BatchPolicy UniformRandomPolicy(const SimulatorSpec& spec, Rng& rng);

/// Called after each control step of a lane, before any reset: what a recorder needs.
struct StepView {
  int lane;
  std::span<const double> observation;       ///< s
  std::span<const double> action;            ///< a
  std::span<const double> next_observation;  ///< s'
  double reward;
  LaneStatus status;
};
using StepObserver = std::function<void(const StepView&)>;

struct EpisodeResult {
  double episode_return = 0;  ///< undiscounted, over the valid steps
  int n_steps = 0;            ///< valid control steps
  LaneStatus end = LaneStatus::kRunning;
};

/// One episode in every lane of `simulator`, lane k with parameters `z[k]` and start state from `key.Index(k)`; lanes
/// that end early wait. Diverged steps are not counted.
std::vector<EpisodeResult> RunEpisodes(Simulator& simulator, const std::vector<std::vector<double>>& z,
                                       const BatchPolicy& policy, RngKey key, const StepObserver& observer = {});

/// Mean of the returns.
double MeanReturn(const std::vector<EpisodeResult>& episodes);

}  // namespace oted
