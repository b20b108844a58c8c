#pragma once
/// Logs of the point mass, for tests. Include from *_test.cc files only.

#include <memory>
#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/testing.h"

namespace oted {

/// One episode per lane of `simulator` at parameters `z` under uniformly random actions in (-1, 1).
inline Dataset RandomLogs(Simulator& simulator, const std::vector<double>& z) {
  const int n_episodes = simulator.n_lanes();
  Rng rng = RngKey(7).Stage("actions").MakeRng();
  const auto act = [&](std::span<const double>, int n, std::span<double> actions) {
    for (int i = 0; i < n; ++i) actions[static_cast<size_t>(i)] = rng.Uniform(-1, 1);
  };
  EpisodeRecorder recorder(n_episodes);
  RunEpisodes(simulator, std::vector(static_cast<size_t>(n_episodes), z), act, RngKey(7), recorder.Observer());
  return recorder.Logs();
}

/// `n_episodes` episodes of the point mass at parameters `z` under uniformly random actions.
inline Dataset PointMassLogs(const std::vector<double>& z, int n_episodes, const PointMassOptions& options = {}) {
  PointMass simulator(options, n_episodes, 1);
  return RandomLogs(simulator, z);
}

/// The point mass with its three parameters, and behind them one channel with the nominal value 0.
inline std::unique_ptr<SimulatorFactory> PointMassBehind(const std::string& path, double low, double high,
                                                         const PointMassOptions& options = {}) {
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.push_back({.name = "channel", .field = path, .low = low, .high = high, .scale = ParameterScale::kAbsolute});
  return std::make_unique<ChannelSimulatorFactory>(
      specs, [=](const auto&) { return std::make_unique<PointMassFactory>(options); });
}

}  // namespace oted
