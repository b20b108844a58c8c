#pragma once
/// The start states of windows at given parameters: where each must begin for its replay to follow the readings.

#include <Eigen/Dense>
#include <vector>

#include "oted/stages/design/replay/window_likelihood.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {

/// Start states (obs_dim) and what their replays leave, as WindowReplayer::Residuals.
struct FittedStarts {
  std::vector<Eigen::VectorXd> starts, residuals;
};

/// Levenberg-Marquardt, window by window: each keeps the better of its two starts at every step.
/// @param starts      where to begin; noisy readings, say
/// @param start_step  (obs_dim): of forward differences
FittedStarts FitStarts(WindowReplayer& replayer, const std::vector<LogWindow>& windows,
                       std::vector<Eigen::VectorXd> starts, const std::vector<double>& z,
                       const WindowLikelihood& likelihood, const Eigen::VectorXd& start_step, int n_iterations);

}  // namespace oted
