#pragma once
/// The start states of windows at given parameters: where each must begin for its replay to follow the readings.

#include <Eigen/Dense>
#include <vector>

#include "oted/stages/design/replay/window_likelihood.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {

/// Start states (state_dim) and what their replays leave, as WindowReplayer::Residuals.
struct FittedStarts {
  std::vector<Eigen::VectorXd> starts, residuals;
};

/// Which starts are fitted, and how. What it refers to must outlive the call.
struct StartProblem {
  const std::vector<LogWindow>& windows;
  const std::vector<double>& z;
  const WindowLikelihood& likelihood;
  Eigen::VectorXd start_step;  ///< (state_dim): of forward differences
  int n_iterations;
};

/// Levenberg-Marquardt, window by window: each keeps the better of its two starts at every step, and stays where a step
/// gains nothing.
/// @param starts  where to begin; noisy readings, say
FittedStarts FitStarts(WindowReplayer& replayer, std::vector<Eigen::VectorXd> starts, const StartProblem& problem);

}  // namespace oted
