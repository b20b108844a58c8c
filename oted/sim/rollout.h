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
struct BatchPolicy : std::function<void(std::span<const double> observations, int n, std::span<double> actions)> {
  using function::function;
  /// What one that remembers is told by RunEpisodes; empty for others. `begin`: n lanes begin episodes. `keep`: of the
  /// rows of the last call, these (ascending) go on, the others are over.
  std::function<void(int n)> begin = {};
  std::function<void(std::span<const int> rows)> keep = {};
};

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
  double episode_return = 0;  ///< undiscounted, over the valid steps; of a diverged episode: up to there
  int n_steps = 0;            ///< valid control steps
  LaneStatus end = LaneStatus::kRunning;
  /// The physics broke down: an episode that stopped there is no measure of a policy (see ComparableReturns).
  bool diverged() const { return end == LaneStatus::kDiverged; }
};

/// One episode in every lane of `simulator`, lane k with parameters `z[k]` and start state from `key.Index(k)`; lanes
/// that end early wait. Diverged steps are not counted.
/// @param max_steps  a clock beside the simulator's own: a lane that still runs after so many steps is truncated.
/// 0: the simulator's clock alone.
/// @throws UsageError when neither the simulator nor the call has a clock: such an episode need not end.
std::vector<EpisodeResult> RunEpisodes(Simulator& simulator, const std::vector<std::vector<double>>& z,
                                       const BatchPolicy& policy, RngKey key, const StepObserver& observer = {},
                                       int max_steps = 0);

/// The returns by which policies are compared, in the order of `episodes`. A diverged episode is a failure: it counts
/// as the lowest return of them all. Its return so far would favour whoever breaks the physics early where rewards
/// are negative, and a policy that found a flaw of the simulator where they are not.
std::vector<double> ComparableReturns(const std::vector<EpisodeResult>& episodes);
/// The mean of ComparableReturns.
double MeanReturn(const std::vector<EpisodeResult>& episodes);
int CountDiverged(const std::vector<EpisodeResult>& episodes);

}  // namespace oted
