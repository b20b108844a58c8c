#pragma once
/// Stage 5 (paper, Sec. 4.2, "Simulator-based policy selection"): rank agents without touching the target.

#include <vector>

#include "oted/base/log.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"

namespace oted {

struct PolicySelectionResult {
  std::vector<std::vector<double>> returns;  ///< (m agents, n simulators): mean return of agent j in M(z_i)
  std::vector<double> mean_return;           ///< (m), over simulators
  std::vector<int> n_diverged;               ///< (m), episodes that diverged, over all simulators
  int selected = 0;                          ///< index of the agent with the highest mean
};

/// Steps 3 and 4: evaluates every policy pi_j in every M(z_i), `n_episodes` episodes each acting as `noise` says, and
/// picks the highest average. All agents meet the same start states. A diverged episode is a failure: it counts as the
/// lowest return of all episodes of all agents. Among equal averages the agent with fewer of them is taken, then the
/// first.
PolicySelectionResult SelectPolicy(const SimulatorFactory& factory, const std::vector<const Policy*>& agents,
                                   const std::vector<std::vector<double>>& modes, int n_episodes, ActionNoise noise,
                                   RngKey key, const RunContext& context);

}  // namespace oted
