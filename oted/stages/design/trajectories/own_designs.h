#pragma once
/// Designs from logs of a design's own, whose truth is known: how far the method comes to rest from it (a parametric
/// bootstrap; Efron and Tibshirani 1993, chapter 6).
///
/// Where starts of windows have local minima, as noisy ones through contact do, x comes to rest before it has arrived.
/// All windows share that, so no covariance of what they say tells of it: a leg's damping was 6 % low by five
/// recordings out of five, with an interval of 1 %.

#include <Eigen/Dense>
#include <vector>

#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/short_windows.h"
#include "oted/stages/design/trajectories/trajectories_config.h"

namespace oted {

/// Designs from logs of a design's own.
struct OwnDesigns {
  std::vector<Eigen::VectorXd> x;
  bool are_near = true;    ///< no farther from the design's x than its covariance says
  double times_fewer = 1;  ///< than the design's: the rows that they rest on
};

/// By the same method from the same starting points, without the last levels of more rows. Two of them; four where
/// these lie farther off than `covariance` says.
/// @param evidence  of the design: its noise
/// @return none where windows have no local minima, unless where something stands is searched
OwnDesigns DesignsFromOwnLogs(const ReplayProblem& problem, const TrajectoriesConfig& config, ShortWindows& design,
                              const FitEvidence& evidence, const Eigen::MatrixXd& covariance);

/// How far x lies from that of the design, what lies at or beyond a bound of its range as at it.
Eigen::VectorXd Off(const Eigen::VectorXd& x, const Eigen::VectorXd& of_design);

/// `covariance`, and in every direction as much wider as the mean square of `off` is more than `times_fewer` of it.
Eigen::MatrixXd AsWideAs(const std::vector<Eigen::VectorXd>& off, double times_fewer,
                         const Eigen::MatrixXd& covariance);

}  // namespace oted
