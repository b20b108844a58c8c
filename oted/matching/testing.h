#pragma once
/// Logs of the point mass, for tests. Include from *_test.cc files only.

#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/testing.h"

namespace oted {

/// `n_episodes` episodes of the point mass at parameters `z` under uniformly random actions.
inline Dataset PointMassLogs(const std::vector<double>& z, int n_episodes, const PointMassOptions& options = {}) {
  PointMass simulator(options, n_episodes, 1);
  Rng rng = RngKey(7).Stage("actions").MakeRng();
  const auto act = [&](std::span<const double>, int n, std::span<double> actions) {
    for (int i = 0; i < n; ++i) actions[static_cast<size_t>(i)] = rng.Uniform(-1, 1);
  };
  EpisodeRecorder recorder(n_episodes);
  RunEpisodes(simulator, std::vector(static_cast<size_t>(n_episodes), z), act, RngKey(7), recorder.Observer());
  return recorder.Logs();
}

}  // namespace oted
