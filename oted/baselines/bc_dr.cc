#include "oted/baselines/bc_dr.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/baselines/domain_randomization.h"
#include "oted/rl/batch_policy.h"
#include "oted/sim/episode_recorder.h"

namespace oted {

namespace {

constexpr int kLanes = 8;  // episodes at a time: few, so that little is simulated in vain

/// What a clone learns from, without what only one of the two parts may have.
Dataset Bare(const Dataset& dataset) {
  Dataset bare;
  bare.observations = dataset.observations;
  bare.actions = dataset.actions;
  bare.next_observations = dataset.next_observations;
  bare.terminals = dataset.terminals;
  bare.timeouts = dataset.timeouts;
  return bare;
}

}  // namespace

Dataset CollectUnderRandomization(const SimulatorFactory& factory, const Policy& policy, int n, RngKey key,
                                  int n_threads) {
  const auto simulator = factory.Make(kLanes, n_threads);
  Dataset logs;
  for (uint64_t batch = 0; logs.size() < n; ++batch) {
    EpisodeRecorder recorder(kLanes, LogPrecision::kDouble, factory.spec().has_reward);
    RunEpisodes(*simulator, UniformDraws(factory.parameters(), kLanes, key.Stage("parameters").Index(batch)),
                AsBatchPolicy(policy, ActionNoise::kSampled, key.Stage("actions").Index(batch).MakeRng()),
                key.Stage("episodes").Index(batch), recorder.Observer());
    const Dataset more = recorder.Logs();
    if (more.size() == 0) {
      throw DataError(
          fmt::format("every episode of task '{}' under domain randomisation diverged at its first step; "
                      "narrow the parameters' ranges",
                      factory.spec().task));
    }
    logs.Append(more);
  }
  std::vector<Episode> episodes = logs.Episodes();
  std::erase_if(episodes, [&](const Episode& episode) { return episode.begin >= n; });
  episodes.back().end = std::min(episodes.back().end, n);
  return logs.Select(episodes);
}

CloneResult CloneWithSimulated(const CloneJob& job, const SimulatorFactory& factory, const Policy& collector,
                               double ratio) {
  const int n = std::max(1, static_cast<int>(std::lround(ratio * job.dataset.size())));
  Dataset both = Bare(job.dataset);
  both.Append(
      Bare(CollectUnderRandomization(factory, collector, n, job.key.Stage("collection"), job.context.n_threads)));
  return CloneBehavior({both, job.spec, job.config, job.key.Stage("clone"), job.run_name, job.context});
}

}  // namespace oted
