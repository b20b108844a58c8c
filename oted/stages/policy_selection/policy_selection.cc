#include "oted/stages/policy_selection/policy_selection.h"

#include <atomic>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/base/statistics.h"
#include "oted/rl/policy_evaluation.h"

namespace oted {

PolicySelectionResult SelectPolicy(const PolicySelectionJob& job) {
  const std::vector<const Policy*>& agents = job.agents;
  const std::vector<std::vector<double>>& modes = job.modes;
  const int n_episodes = job.n_episodes;
  OTED_CHECK(!agents.empty() && !modes.empty());
  const int n_agents = static_cast<int>(agents.size()), n_modes = static_cast<int>(modes.size());
  PolicySelectionResult result;
  std::vector<std::vector<EpisodeResult>> episodes(static_cast<size_t>(n_agents * n_modes));
  std::atomic<int> n_done{0};
  ParallelFor(n_agents * n_modes, job.context.n_threads, [&](int cell) {
    job.context.ThrowIfStopped();
    const size_t j = static_cast<size_t>(cell / n_modes), i = static_cast<size_t>(cell % n_modes);
    episodes[static_cast<size_t>(cell)] = RunPolicy(
        job.factory, *agents[j], {.z = {modes[i]}, .n_episodes = n_episodes, .key = job.key, .noise = job.noise});
    job.context.log->Progress("select", "policies", ++n_done, n_agents * n_modes, "");
  });

  // A diverged episode counts as the lowest return of all that are compared here, not only of its own cell.
  std::vector<EpisodeResult> all;
  for (const auto& cell : episodes) all.insert(all.end(), cell.begin(), cell.end());
  const std::vector<double> returns = ComparableReturns(all);
  auto next = returns.begin();
  for (int j = 0; j < n_agents; ++j) {
    result.returns.emplace_back();
    result.n_diverged.push_back(0);
    for (int i = 0; i < n_modes; ++i, next += n_episodes) {
      result.returns.back().push_back(Mean({next, next + n_episodes}));
      result.n_diverged.back() += CountDiverged(episodes[static_cast<size_t>(j * n_modes + i)]);
    }
    result.mean_return.push_back(Mean(result.returns.back()));
  }
  for (int j = 1; j < n_agents; ++j) {
    const auto rank = [&](int k) {
      return std::pair(result.mean_return[static_cast<size_t>(k)], -result.n_diverged[static_cast<size_t>(k)]);
    };
    if (rank(j) > rank(result.selected)) result.selected = j;
  }
  return result;
}

}  // namespace oted
