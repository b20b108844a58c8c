#include "oted/sim/rollout.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/statistics.h"

namespace oted {

BatchPolicy UniformRandomPolicy(const SimulatorSpec& spec, Rng& rng) {
  if (spec.n_discrete_actions > 0) {
    return [n = static_cast<uint64_t>(spec.n_discrete_actions), &rng](std::span<const double>, int,
                                                                      std::span<double> actions) {
      for (double& action : actions) action = static_cast<double>(rng.Below(n));
    };
  }
  return
      [low = spec.action_low, high = spec.action_high, &rng](std::span<const double>, int, std::span<double> actions) {
        for (size_t i = 0; i < actions.size(); ++i) actions[i] = rng.Uniform(low[i % low.size()], high[i % low.size()]);
      };
}

std::vector<EpisodeResult> RunEpisodes(Simulator& simulator, const std::vector<std::vector<double>>& z,
                                       const BatchPolicy& policy, RngKey key, const StepObserver& observer,
                                       int max_steps) {
  const int n_lanes = simulator.n_lanes();
  const size_t obs_dim = static_cast<size_t>(simulator.spec().obs_dim());
  const size_t act_dim = static_cast<size_t>(simulator.spec().act_dim);
  OTED_CHECK(static_cast<int>(z.size()) == n_lanes);
  if (max_steps < 1 && simulator.spec().max_episode_steps < 1) {
    throw UsageError(
        fmt::format("task '{}' has no time limit, and its episodes need not end; give it max_episode_steps",
                    simulator.spec().task));
  }

  std::vector<EpisodeResult> results(static_cast<size_t>(n_lanes));
  std::vector<int> running;
  for (int lane = 0; lane < n_lanes; ++lane) {
    simulator.SetParameters(lane, z[static_cast<size_t>(lane)]);
    Rng rng = key.Index(static_cast<uint64_t>(lane)).MakeRng();
    simulator.Reset(lane, rng);
    running.push_back(lane);
  }

  if (policy.begin) policy.begin(n_lanes);

  std::vector<double> observations(static_cast<size_t>(n_lanes) * obs_dim), packed(observations.size());
  std::vector<double> actions(static_cast<size_t>(n_lanes) * act_dim), packed_actions(actions.size());
  for (int step = 1; !running.empty(); ++step) {
    for (size_t i = 0; i < running.size(); ++i) {
      const auto observation = simulator.observation(running[i]);
      std::copy(observation.begin(), observation.end(), packed.begin() + static_cast<ptrdiff_t>(i * obs_dim));
    }
    const int n = static_cast<int>(running.size());
    policy({packed.data(), running.size() * obs_dim}, n, {packed_actions.data(), running.size() * act_dim});
    for (size_t i = 0; i < running.size(); ++i) {
      std::copy_n(packed_actions.begin() + static_cast<ptrdiff_t>(i * act_dim), act_dim,
                  actions.begin() + static_cast<ptrdiff_t>(static_cast<size_t>(running[i]) * act_dim));
    }
    simulator.Step(running, actions);
    std::vector<int> still_running, kept;
    for (size_t i = 0; i < running.size(); ++i) {
      const int lane = running[i];
      EpisodeResult& result = results[static_cast<size_t>(lane)];
      result.end = simulator.status(lane);
      if (result.end == LaneStatus::kRunning && step == max_steps) result.end = LaneStatus::kTruncated;
      if (!result.diverged()) {
        result.episode_return += simulator.reward(lane);
        ++result.n_steps;
      }
      if (observer) {
        observer({lane,
                  {packed.data() + i * obs_dim, obs_dim},
                  {packed_actions.data() + i * act_dim, act_dim},
                  simulator.observation(lane),
                  simulator.reward(lane),
                  result.end});
      }
      if (result.end != LaneStatus::kRunning) continue;
      still_running.push_back(lane);
      kept.push_back(static_cast<int>(i));
    }
    if (policy.keep && kept.size() < running.size()) policy.keep(kept);
    running = std::move(still_running);
  }
  return results;
}

std::vector<double> ComparableReturns(const std::vector<EpisodeResult>& episodes) {
  std::vector<double> returns;
  for (const EpisodeResult& episode : episodes) returns.push_back(episode.episode_return);
  if (returns.empty()) return returns;
  const double lowest = *std::min_element(returns.begin(), returns.end());
  for (size_t k = 0; k < episodes.size(); ++k) {
    if (episodes[k].diverged()) returns[k] = lowest;
  }
  return returns;
}

double MeanReturn(const std::vector<EpisodeResult>& episodes) { return Mean(ComparableReturns(episodes)); }

int CountDiverged(const std::vector<EpisodeResult>& episodes) {
  return static_cast<int>(std::count_if(episodes.begin(), episodes.end(), [](const auto& e) { return e.diverged(); }));
}

}  // namespace oted
