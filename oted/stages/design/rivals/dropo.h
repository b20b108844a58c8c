#pragma once
/// DROPO (Tiboni, Arndt, Kyrki 2023, Robotics and Autonomous Systems 166, arXiv:2201.08434): the distribution of
/// parameters under which the logged next states are likeliest. A rival of trajectory matching under the same report;
/// docs/design_methods.md says when it fits, docs/deviations.md#dropo where this differs from the authors'.

#include <Eigen/Dense>

#include "oted/base/fields.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

/// [design.dropo]
struct DropoConfig {
  int horizon = 1;             ///< lambda: control steps from a logged state to the one that is predicted
  int transitions = 100;       ///< logged states that are predicted, at most
  int samples = 20;            ///< draws of the parameters for each prediction
  int budget = 800;            ///< distributions that CMA-ES evaluates
  double epsilon = 1e-5;       ///< added to every variance of a prediction, in channel scales squared
  bool learn_epsilon = false;  ///< CMA-ES moves it too, between 1e-15 and 0.1, from `epsilon`

  FieldList Fields();
};

/// Maximises over q = N(mean, diag(std^2)) in the search coordinates x, cut off at two spreads,
///
///   sum_i log N(s'_i; m_i, C_i + epsilon I),   m_i, C_i: mean and covariance of M(s_i, a_i.., z_k) over draws z_k ~ q
///
/// where a prediction starts at the logged state, replays `horizon` logged actions and is compared at its end, every
/// channel in units of its standard deviation over the logs. By CMA-ES, whose every generation draws its own standard
/// normals, the same for all of its distributions. The covariance is that of the q found: the spread of the target's
/// parameters that the logs show, not the uncertainty of an estimate.
ReplayFit FitDropo(const ReplayProblem& problem, const DropoConfig& config);

/// log N(observed; mean and covariance of the rows of `predictions`, to whose diagonal epsilon is added). At least two
/// rows; epsilon > 0.
double PredictionLogDensity(const Eigen::MatrixXd& predictions, const Eigen::VectorXd& observed, double epsilon);

}  // namespace oted
