#include "oted/stages/design/trajectories/start_fit.h"

#include <algorithm>

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

FittedStarts FitStarts(WindowReplayer& replayer, std::vector<VectorXd> starts, const StartProblem& problem) {
  const auto& [windows, z, likelihood, start_step, n_iterations] = problem;
  FittedStarts fitted{std::move(starts), {}};
  fitted.residuals = replayer.Residuals(windows, fitted.starts, z);
  std::vector<double> damping(windows.size(), 1e-2);
  const std::vector<VectorXd> steps(windows.size(), start_step);
  for (int i = 0; i < n_iterations; ++i) {
    const auto linear = replayer.Linearize(windows, fitted.starts, z, {}, {}, steps);
    std::vector<VectorXd> moved = fitted.starts;
    for (size_t w = 0; w < windows.size(); ++w) {
      if (!linear[w].valid) continue;
      const MatrixXd weighted = likelihood.precision().asDiagonal() * linear[w].d_start;
      MatrixXd damped = linear[w].d_start.transpose() * weighted;
      damped.diagonal() *= 1 + damping[w];
      moved[w] += damped.ldlt().solve(weighted.transpose() * linear[w].residual);
    }
    const std::vector<VectorXd> residuals = replayer.Residuals(windows, moved, z);
    for (size_t w = 0; w < windows.size(); ++w) {
      const bool better = likelihood.Cost(residuals[w]) < likelihood.Cost(fitted.residuals[w]);
      damping[w] = better ? std::max(1e-6, damping[w] * 0.2) : std::min(1e4, damping[w] * 6);
      if (!better) continue;
      fitted.starts[w] = moved[w];
      fitted.residuals[w] = residuals[w];
    }
  }
  return fitted;
}

}  // namespace oted
