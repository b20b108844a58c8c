#include "oted/stages/design/trajectories/own_logs.h"

#include <map>
#include <vector>

namespace oted {
namespace {

using Eigen::VectorXd;

/// Stretches of the log that explained windows cover without a gap, with the start of the first of these. The start of
/// a window that is not explained is none that the target was in.
struct Chains {
  std::vector<LogWindow> windows;
  std::vector<VectorXd> starts;
};

/// By their length.
std::map<int, Chains> ChainsOf(const LevelFit& fit, Through through) {
  const Level& level = fit.level();
  std::map<int, Chains> chains;
  for (size_t w = 0; w < level.windows.size();) {
    const size_t first = w;
    if (!fit.Explains(w++) && through == Through::kExplained) continue;
    LogWindow chain = level.windows[first];
    for (; w < level.windows.size() && level.stretch[w] == level.stretch[first]; ++w) {
      if (through == Through::kExplained && !fit.Explains(w)) break;
      if (level.windows[w].begin != chain.begin + chain.n_steps) break;
      chain.n_steps += level.windows[w].n_steps;
    }
    chains[chain.n_steps].windows.push_back(chain);
    chains[chain.n_steps].starts.push_back(level.starts[first]);
  }
  return chains;
}

}  // namespace

Dataset OwnLogs(WindowReplayer& replayer, const LevelFit& fit, const std::vector<double>& z, const VectorXd& noise_std,
                Through through, Rng& rng) {
  Dataset own = replayer.dataset();
  const Eigen::Index n_channels = noise_std.size();
  for (const auto& [n_steps, chains] : ChainsOf(fit, through)) {
    const std::vector<VectorXd> residuals = replayer.Residuals(chains.windows, chains.starts, z);
    for (size_t k = 0; k < residuals.size(); ++k) {
      if (residuals[k].size() == 0) continue;  // the physics broke down: these readings stay
      const LogWindow& chain = chains.windows[k];
      for (int t = 0; t <= n_steps; ++t) {
        const VectorXd simulated = replayer.Logged(chain, t) - residuals[k].segment(t * n_channels, n_channels);
        for (int c = 0; c < n_channels; ++c) {
          const double reading = simulated[c] + noise_std[c] * rng.Normal();
          if (t < n_steps) own.observations(chain.begin + t, c) = reading;
          if (t > 0) own.next_observations(chain.begin + t - 1, c) = reading;
        }
      }
    }
  }
  return own;
}

}  // namespace oted
