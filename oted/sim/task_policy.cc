#include "oted/sim/task_policy.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/base/fields.h"

namespace oted {

TaskPolicy TaskPolicyNamed(const std::string& name) {
  if (name == "expert") return TaskPolicy::kExpert;
  if (name == "medium") return TaskPolicy::kMedium;
  throw UsageError(fmt::format("got policy '{}'{}, wanted expert or medium for a task with policies of its own", name,
                               DidYouMean(name, {"expert", "medium"})));
}

BatchPolicy OnTrueStates(const Simulator& simulator, TaskPolicy policy, Rng rng) {
  return [&simulator, policy, rng](std::span<const double>, int n, std::span<double> actions) mutable {
    const size_t act_dim = static_cast<size_t>(simulator.spec().act_dim);
    // The rows are those of the lanes that run, in their order.
    size_t row = 0;
    for (int lane = 0; lane < simulator.n_lanes(); ++lane) {
      if (simulator.status(lane) != LaneStatus::kRunning) continue;
      simulator.TakeTaskPolicy(policy, lane, rng, actions.subspan(row++ * act_dim, act_dim));
    }
    OTED_CHECK(row == static_cast<size_t>(n));
  };
}

Dataset LogOnTrueStates(Simulator& simulator, const std::vector<double>& z, RngKey key, const LanePolicy& policy) {
  const size_t n_lanes = static_cast<size_t>(simulator.n_lanes());
  const size_t act_dim = static_cast<size_t>(simulator.spec().act_dim);
  std::vector<int> running;
  std::vector<Rng> streams;
  for (int lane = 0; lane < simulator.n_lanes(); ++lane) {
    const RngKey episode = key.Index(static_cast<uint64_t>(lane));
    simulator.SetParameters(lane, z);
    Rng start = episode.Stage("start").MakeRng();
    simulator.Reset(lane, start);
    streams.push_back(episode.Stage("policy").MakeRng());
    running.push_back(lane);
  }
  std::vector<Dataset> logs(n_lanes);
  std::vector<double> actions(n_lanes * act_dim);
  while (!running.empty()) {
    for (const int lane : running) {
      const auto i = static_cast<size_t>(lane);
      const std::span<double> action = std::span(actions).subspan(i * act_dim, act_dim);
      policy(lane, streams[i], action);
      logs[i].observations.AppendRow(simulator.observation(lane));
      logs[i].actions.AppendRow(action);
    }
    simulator.Step(running, actions);
    std::vector<int> still_running;
    for (const int lane : running) {
      Dataset& log = logs[static_cast<size_t>(lane)];
      const LaneStatus status = simulator.status(lane);
      log.next_observations.AppendRow(simulator.observation(lane));
      // D4RL's files hold float32: what is logged is what is read back.
      log.rewards.push_back(static_cast<double>(static_cast<float>(simulator.reward(lane))));
      log.terminals.push_back(status == LaneStatus::kTerminated);
      log.timeouts.push_back(status == LaneStatus::kTruncated);
      if (status == LaneStatus::kRunning) still_running.push_back(lane);
    }
    running = std::move(still_running);
  }
  Dataset dataset;
  for (const Dataset& log : logs) dataset.Append(log);
  return dataset;
}

Dataset CollectTaskPolicy(const SimulatorFactory& factory, const std::vector<double>& z, TaskPolicy policy,
                          int n_episodes, RngKey key, int n_threads) {
  if (n_episodes < 1) throw UsageError(fmt::format("got {} episodes, wanted at least 1", n_episodes));
  const auto simulator = factory.Make(n_episodes, n_threads);
  return LogOnTrueStates(*simulator, z, key, [&](int lane, Rng& rng, std::span<double> action) {
    simulator->TakeTaskPolicy(policy, lane, rng, action);
  });
}

}  // namespace oted
