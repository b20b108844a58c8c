#pragma once
/// How well a policy does in simulators.

#include <vector>

#include "oted/nn/policy.h"
#include "oted/sim/rollout.h"

namespace oted {

struct PolicyEvaluation {
  std::vector<EpisodeResult> episodes;
  /// Over ComparableReturns: a diverged episode counts as the lowest return of them all.
  double mean_return = 0, std_return = 0, min_return = 0, max_return = 0;
  double mean_length = 0;  ///< valid control steps
  int n_terminated = 0, n_truncated = 0, n_diverged = 0;
};

/// `n_episodes` episodes of `policy` in the simulator at parameters `z`; episode k starts from `key.Index(k)`.
PolicyEvaluation EvaluateBatchPolicy(const SimulatorFactory& factory, const BatchPolicy& policy,
                                     const std::vector<double>& z, int n_episodes, int n_threads, RngKey key);

/// Episodes in which a policy is looked at.
struct PolicyEpisodes {
  std::vector<std::vector<double>> z;  ///< at least one; episode k runs in z[k mod z.size()]
  int n_episodes = 0;
  RngKey key;  ///< episode k starts from key.Index(k)
  int n_threads = 1;
  ActionNoise noise = ActionNoise::kMean;
};
/// What became of them; MeanReturn says how good the policy is.
std::vector<EpisodeResult> RunPolicy(const SimulatorFactory& factory, const Policy& policy,
                                     const PolicyEpisodes& episodes);

}  // namespace oted
