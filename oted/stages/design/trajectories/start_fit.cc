#include "oted/stages/design/trajectories/start_fit.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kSettledCost = 0.01;  // of the negative log density: no start is known so well

template <class T>
std::vector<T> At(const std::vector<size_t>& which, const std::vector<T>& all) {
  std::vector<T> some;
  some.reserve(which.size());
  for (const size_t w : which) some.push_back(all[w]);
  return some;
}

}  // namespace

FittedStarts FitStarts(WindowReplayer& replayer, std::vector<VectorXd> starts, const StartProblem& problem) {
  const auto& [windows, z, likelihood, start_step, n_iterations] = problem;
  FittedStarts fitted{std::move(starts), {}};
  fitted.residuals = replayer.Residuals(windows, fitted.starts, z);
  std::vector<double> damping(windows.size(), 1e-2);
  std::vector<size_t> moving(windows.size());
  std::iota(moving.begin(), moving.end(), size_t{0});
  for (int i = 0; i < n_iterations && !moving.empty(); ++i) {
    const std::vector<LogWindow> some = At(moving, windows);
    std::vector<VectorXd> moved = At(moving, fitted.starts);
    const auto linear = replayer.Linearize(some, moved, z, {}, {}, std::vector<VectorXd>(moving.size(), start_step));
    for (size_t k = 0; k < moving.size(); ++k) {
      if (!linear[k].valid) continue;
      const MatrixXd weighted = likelihood.precision().asDiagonal() * linear[k].d_start;
      MatrixXd damped = linear[k].d_start.transpose() * weighted;
      damped.diagonal() *= 1 + damping[moving[k]];
      moved[k] += damped.ldlt().solve(weighted.transpose() * linear[k].residual);
    }
    std::vector<VectorXd> residuals = replayer.Residuals(some, moved, z);
    std::vector<size_t> go_on;
    for (size_t k = 0; k < moving.size(); ++k) {
      const size_t w = moving[k];
      const double gain = likelihood.Cost(fitted.residuals[w]) - likelihood.Cost(residuals[k]);
      damping[w] = gain > 0 ? std::max(1e-6, damping[w] * 0.2) : std::min(1e4, damping[w] * 6);
      if (!(gain >= 0 && gain < kSettledCost)) go_on.push_back(w);
      if (!(gain > 0)) continue;
      fitted.starts[w] = std::move(moved[k]);
      fitted.residuals[w] = std::move(residuals[k]);
    }
    moving = std::move(go_on);
  }
  return fitted;
}

}  // namespace oted
