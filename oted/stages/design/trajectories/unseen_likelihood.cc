#include "oted/stages/design/trajectories/unseen_likelihood.h"

#include <algorithm>
#include <limits>

#include "oted/stages/design/replay/prediction_ratios.h"
#include "oted/stages/design/replay/start_fit.h"
#include "oted/stages/design/replay/window_likelihood.h"

namespace oted {
namespace {

using Eigen::VectorXd;

constexpr int kUnseenIterations = 10;

WindowLikelihood LikelihoodOf(const ReadingModel& readings, const WindowNoise& noise, int n_steps) {
  if (noise.sensor.size() > 0) return WindowLikelihood::Growing(readings, noise.sensor, noise.variance, n_steps);
  return {readings, noise.variance, n_steps};
}

/// (windows): negative log densities of the windows that `level` grows into.
VectorXd CostsOf(WindowReplayer& replayer, Level level, int n_steps, const WindowNoise& noise,
                 const std::vector<double>& z) {
  const VectorXd start_step = replayer.readings().StartStep();
  while (!level.windows.empty()) {
    const int n = level.windows.front().n_steps;
    const WindowLikelihood likelihood = LikelihoodOf(replayer.readings(), noise, n);
    FittedStarts fitted =
        FitStarts(replayer, std::move(level.starts), {level.windows, z, likelihood, start_step, kUnseenIterations});
    level.starts = std::move(fitted.starts);
    if (2 * n > n_steps) {
      VectorXd costs(static_cast<Eigen::Index>(level.windows.size()));
      for (Eigen::Index w = 0; w < costs.size(); ++w) {
        const double cost = likelihood.Cost(fitted.residuals[static_cast<size_t>(w)]);
        costs[w] = std::min(cost, likelihood.CostOfWorstExplained());
      }
      return costs;
    }
    level = Joined(level);
  }
  return {};
}

}  // namespace

Estimated NatsGained(WindowReplayer& replayer, const Level& level, int n_steps, const WindowNoise& noise,
                     const std::vector<double>& a, const std::vector<double>& b) {
  const VectorXd gained = CostsOf(replayer, level, n_steps, noise, b) - CostsOf(replayer, level, n_steps, noise, a);
  if (gained.size() < 2) return {.value = 0, .error = std::numeric_limits<double>::infinity()};
  const Estimated mean = MeansOf(gained.transpose(), VectorXd::Ones(1)).OfAll();
  const double n = static_cast<double>(gained.size());
  return {.value = n * mean.value, .error = n * mean.error};
}

}  // namespace oted
