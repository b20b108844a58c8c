#include "oted/stages/design/trajectories/unseen_likelihood.h"

#include <algorithm>
#include <cmath>
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

}  // namespace

WindowCosts CostsOf(WindowReplayer& replayer, const Level& level, int n_steps, const WindowNoise& noise,
                    const std::vector<double>& z) {
  const VectorXd start_step = replayer.readings().StartStep();
  for (Level grown = level; !grown.windows.empty(); grown = Joined(grown)) {
    const int n = grown.windows.front().n_steps;
    const WindowLikelihood likelihood = LikelihoodOf(replayer.readings(), noise, n);
    FittedStarts fitted =
        FitStarts(replayer, std::move(grown.starts), {grown.windows, z, likelihood, start_step, kUnseenIterations});
    grown.starts = std::move(fitted.starts);
    if (CanGrow(n, n_steps)) continue;
    WindowCosts::Part part{{}, VectorXd(static_cast<Eigen::Index>(grown.windows.size()))};
    for (size_t w = 0; w < grown.windows.size(); ++w) {
      const double cost = std::min(likelihood.Cost(fitted.residuals[w]), likelihood.CostOfWorstExplained());
      part.rows.push_back(grown.windows[w].begin);
      part.costs[static_cast<Eigen::Index>(w)] = cost + likelihood.LogScale();
    }
    return {{part}};
  }
  return {{WindowCosts::Part{}}};
}

std::optional<Estimated> NatsGained(const WindowCosts& a, const WindowCosts& b) {
  Estimated sum{.value = 0, .error = 0};
  for (size_t k = 0; k < std::min(a.parts.size(), b.parts.size()); ++k) {
    if (a.parts[k].rows != b.parts[k].rows) return std::nullopt;
    const VectorXd gained = b.parts[k].costs - a.parts[k].costs;
    if (gained.size() < 2) return Estimated{.value = 0, .error = std::numeric_limits<double>::infinity()};
    const Estimated mean = MeansOf(gained.transpose(), VectorXd::Ones(1)).OfAll();
    const double n = static_cast<double>(gained.size());
    sum = {.value = sum.value + n * mean.value, .error = std::hypot(sum.error, n * mean.error)};
  }
  return sum;
}

}  // namespace oted
