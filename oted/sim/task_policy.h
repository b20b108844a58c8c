#pragma once
/// Episodes of policies that see a simulator's true state, such as those that a task brings along.

#include <functional>
#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/rollout.h"
#include "oted/sim/simulator.h"

namespace oted {

/// "expert" or "medium". @throws UsageError for another name
TaskPolicy TaskPolicyNamed(const std::string& name);

/// The task's own policy in RunEpisodes of `simulator`, which must outlive it and be the one that runs.
BatchPolicy OnTrueStates(const Simulator& simulator, TaskPolicy policy, Rng rng);

/// Chooses the action (act_dim) of one lane; `rng` is the lane's own stream.
using LanePolicy = std::function<void(int lane, Rng& rng, std::span<double> action)>;

/// One episode in every lane at parameters `z`, logged: observations (N, obs_dim), actions (N, act_dim), rewards,
/// terminals and timeouts, and nothing that names `z`. Episode i depends on key and i alone.
Dataset LogOnTrueStates(Simulator& simulator, const std::vector<double>& z, RngKey key, const LanePolicy& policy);

/// The same of `n_episodes` episodes of the task's own policy.
/// @throws UsageError unless there is at least one episode and the factory's has_expert()
Dataset CollectTaskPolicy(const SimulatorFactory& factory, const std::vector<double>& z, TaskPolicy policy,
                          int n_episodes, RngKey key, int n_threads);

}  // namespace oted
