#include "oted/stages/design/trajectories/first_level.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

using Eigen::VectorXd;

Level FirstLevel(WindowReplayer& replayer, const Dataset& dataset, int length, int n_steps, int n_rows, Rng& rng) {
  Level stretches{.windows = DrawStretches(dataset, length, n_rows, rng), .starts = {}, .stretch = {}};
  stretches.stretch.resize(stretches.windows.size());
  std::iota(stretches.stretch.begin(), stretches.stretch.end(), 0);
  return Cut(replayer, stretches, n_steps);
}

Level Cut(WindowReplayer& replayer, const Level& longer, int n_steps) {
  Level pieces;
  for (size_t w = 0; w < longer.windows.size(); ++w) {
    const LogWindow& window = longer.windows[w];
    for (int i = 0; i + n_steps <= window.n_steps; i += n_steps) {
      const LogWindow piece{window.begin + i, n_steps, window.episode_begin};
      if (!replayer.CanStart(piece)) continue;
      pieces.windows.push_back(piece);
      pieces.starts.push_back(replayer.Guess(piece));
      pieces.stretch.push_back(longer.stretch[w]);
    }
  }
  return pieces;
}

Level Leading(const Level& level, size_t n) {
  Level part = level;
  part.windows.resize(std::min(n, level.windows.size()));
  part.starts.resize(part.windows.size());
  part.stretch.resize(part.windows.size());
  return part;
}

std::unique_ptr<LevelFit> FitGrowing(Level level, VectorXd x, int n_steps, size_t n_fewest,
                                     const std::function<std::unique_ptr<LevelFit>(Level, VectorXd)>& make,
                                     const std::function<void(LevelFit&, bool)>& descend) {
  std::unique_ptr<LevelFit> fit;
  while (level.windows.size() >= n_fewest) {
    const bool is_last = !CanGrow(level.windows.front().n_steps, n_steps), is_first = fit == nullptr;
    fit = make(std::move(level), x);
    descend(*fit, is_first);
    x = fit->x();
    level = is_last ? Level{} : Joined(fit->level());
  }
  return fit;
}

double CoarseCost(WindowReplayer& replayer, const Level& level, const VectorXd& scale, const std::vector<double>& z) {
  const std::vector<VectorXd> residuals = replayer.Residuals(level.windows, level.starts, z);
  const int n_steps = level.windows.front().n_steps;
  double cost = 0;
  for (int c = 0; c < scale.size(); ++c) {
    std::vector<double> errors;
    for (const VectorXd& residual : residuals) {
      double error = 1e6;
      if (residual.size() > 0) {
        error = 0;
        for (int t = 1; t <= n_steps; ++t) {
          if (replayer.readings().IsHeld(c, t)) error += std::pow(residual[t * scale.size() + c] / scale[c], 2);
        }
      }
      errors.push_back(error);
    }
    std::sort(errors.begin(), errors.end());
    errors.resize(std::max<size_t>(1, errors.size() * 4 / 5));
    cost += std::log(std::accumulate(errors.begin(), errors.end(), 1e-14) / static_cast<double>(errors.size()));
  }
  return cost;
}

}  // namespace oted
