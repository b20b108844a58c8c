#include "oted/stages/policy_selection/policy_selection.h"

#include <algorithm>
#include <atomic>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/rl/sac.h"

namespace oted {

PolicySelectionResult SelectPolicy(const SimulatorFactory& factory, const std::vector<TanhGaussianPolicy>& agents,
                                   const std::vector<std::vector<double>>& modes, int n_episodes, RngKey key,
                                   const RunContext& context) {
  OTED_CHECK(!agents.empty() && !modes.empty());
  const int n_agents = static_cast<int>(agents.size()), n_modes = static_cast<int>(modes.size());
  PolicySelectionResult result;
  result.returns.assign(agents.size(), std::vector<double>(modes.size(), 0.0));
  std::atomic<int> n_done{0};
  ParallelFor(n_agents * n_modes, context.n_threads, [&](int cell) {
    context.ThrowIfStopped();
    const size_t j = static_cast<size_t>(cell / n_modes), i = static_cast<size_t>(cell % n_modes);
    result.returns[j][i] = EvaluatePolicy(factory, agents[j], {modes[i]}, n_episodes, 1, key);
    context.log->Progress("select", "policies", ++n_done, n_agents * n_modes, "");
  });
  for (const std::vector<double>& returns : result.returns) {
    double sum = 0;
    for (const double value : returns) sum += value;
    result.mean_return.push_back(sum / n_modes);
  }
  result.selected = static_cast<int>(std::max_element(result.mean_return.begin(), result.mean_return.end()) -
                                     result.mean_return.begin());
  return result;
}

}  // namespace oted
