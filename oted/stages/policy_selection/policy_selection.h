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

/// Which agents are compared, and where.
struct PolicySelectionJob {
  const SimulatorFactory& factory;
  std::vector<const Policy*> agents;       ///< (m), at least one
  std::vector<std::vector<double>> modes;  ///< (n simulators, parameters), at least one
  int n_episodes = 1;                      ///< per agent and simulator
  ActionNoise noise = ActionNoise::kMean;  ///< how they act
  RngKey key;
  RunContext context;
};

/// Steps 3 and 4: evaluates every policy pi_j in every M(z_i), `n_episodes` episodes each, and
/// picks the highest average. All agents meet the same start states. A diverged episode is a failure: it counts as the
/// lowest return of all episodes of all agents. Among equal averages the agent with fewer of them is taken, then the
/// first.
PolicySelectionResult SelectPolicy(const PolicySelectionJob& job);

}  // namespace oted
