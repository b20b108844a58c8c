#include "oted/rl/policy_evaluation.h"

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/rl/batch_policy.h"

namespace oted {

PolicyEvaluation EvaluateBatchPolicy(const SimulatorFactory& factory, const BatchPolicy& policy,
                                     const std::vector<double>& z, int n_episodes, int n_threads, RngKey key) {
  OTED_CHECK(n_episodes > 0);
  const auto simulator = factory.Make(n_episodes, n_threads);
  PolicyEvaluation result;
  result.episodes = RunEpisodes(*simulator, std::vector(static_cast<size_t>(n_episodes), z), policy, key);
  const std::vector<double> returns = ComparableReturns(result.episodes);
  result.mean_return = Mean(returns);
  result.std_return = StandardDeviation(returns);
  result.min_return = *std::min_element(returns.begin(), returns.end());
  result.max_return = *std::max_element(returns.begin(), returns.end());
  for (const EpisodeResult& episode : result.episodes) {
    result.mean_length += episode.n_steps;
    result.n_terminated += episode.end == LaneStatus::kTerminated;
    result.n_truncated += episode.end == LaneStatus::kTruncated;
  }
  result.mean_length /= n_episodes;
  result.n_diverged = CountDiverged(result.episodes);
  return result;
}

std::vector<EpisodeResult> RunPolicy(const SimulatorFactory& factory, const Policy& policy,
                                     const PolicyEpisodes& episodes) {
  const auto& [z, n_episodes, key, n_threads, noise] = episodes;
  OTED_CHECK(!z.empty());
  const auto simulator = factory.Make(n_episodes, n_threads);
  std::vector<std::vector<double>> lane_z;
  for (int k = 0; k < n_episodes; ++k) lane_z.push_back(z[static_cast<size_t>(k) % z.size()]);
  return RunEpisodes(*simulator, lane_z, AsBatchPolicy(policy, noise, key.Stage("actions").MakeRng()), key);
}

}  // namespace oted
