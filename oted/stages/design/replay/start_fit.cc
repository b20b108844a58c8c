#include "oted/stages/design/replay/start_fit.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "oted/base/picked.h"
#include "oted/stages/design/replay/kept_derivatives.h"

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kSettledCost = 0.01;  // of the negative log density: no start is known so well

}  // namespace

FittedStarts FitStarts(WindowReplayer& replayer, std::vector<VectorXd> starts, const StartProblem& problem) {
  const auto& [windows, z, likelihood, start_step, n_iterations] = problem;
  FittedStarts fitted{std::move(starts), {}};
  fitted.residuals = replayer.Residuals(windows, fitted.starts, z);
  std::vector<double> damping(windows.size(), 1e-2);
  std::vector<WindowReplayer::Linearization> linear(windows.size());
  // Whether a window's derivatives do for the next step, and whether they are those of its present start.
  std::vector<char> kept(windows.size(), 0), fresh(windows.size(), 0);
  std::vector<size_t> moving(windows.size());
  std::iota(moving.begin(), moving.end(), size_t{0});
  for (int i = 0; i < n_iterations && !moving.empty(); ++i) {
    std::vector<size_t> old;
    std::ranges::copy_if(moving, std::back_inserter(old), [&](size_t w) { return kept[w] == 0; });
    std::vector<WindowReplayer::Linearization> anew = replayer.Linearize(
        Picked(windows, old), Picked(fitted.starts, old), z, {}, {}, std::vector<VectorXd>(old.size(), start_step));
    for (size_t k = 0; k < old.size(); ++k) {
      linear[old[k]] = std::move(anew[k]);
      fresh[old[k]] = 1;
    }
    std::vector<VectorXd> moved = Picked(fitted.starts, moving);
    for (size_t k = 0; k < moving.size(); ++k) {
      const WindowReplayer::Linearization& of_window = linear[moving[k]];
      if (!of_window.valid) continue;
      const MatrixXd weighted = likelihood.precision().asDiagonal() * of_window.d_start;
      MatrixXd damped = of_window.d_start.transpose() * weighted;
      damped.diagonal() *= 1 + damping[moving[k]];
      moved[k] += damped.ldlt().solve(weighted.transpose() * of_window.residual);
    }
    std::vector<VectorXd> residuals = replayer.Residuals(Picked(windows, moving), moved, z);
    std::vector<size_t> go_on;
    for (size_t k = 0; k < moving.size(); ++k) {
      const size_t w = moving[k];
      const double gain = likelihood.Cost(fitted.residuals[w]) - likelihood.Cost(residuals[k]);
      damping[w] = gain > 0 ? std::max(1e-6, damping[w] * 0.2) : std::min(1e4, damping[w] * 6);
      // A step that old derivatives spoil tells nothing of the start.
      const bool is_judged = fresh[w] != 0 || gain > 0;
      if (!is_judged || !(gain >= 0 && gain < kSettledCost)) go_on.push_back(w);
      if (!(gain > 0)) {
        kept[w] = fresh[w];
        continue;
      }
      kept[w] = ForetoldBy(linear[w], moved[k] - fitted.starts[w], {}, residuals[k], likelihood.precision());
      fresh[w] = 0;
      linear[w].residual = residuals[k];
      fitted.starts[w] = std::move(moved[k]);
      fitted.residuals[w] = std::move(residuals[k]);
    }
    moving = std::move(go_on);
  }
  return fitted;
}

}  // namespace oted
