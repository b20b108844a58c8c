#pragma once
/// Checks of how fast and how cleanly a log moves.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Measurement noise of one observation channel, in the channel's unit. The residual r of a linear fit of s' - s on
/// (s, a) has, under white measurement noise of variance sigma^2 on a slowly moving channel, the lag-1 covariance
/// -sigma^2 and correlation -1/2; model error gives a correlation near or above 0. Residuals are clipped at 3 robust
/// standard deviations, so that impacts do not hide the noise.
struct ChannelNoise {
  double sigma = 0;         ///< estimated standard deviation where the noise is visible, otherwise 0
  double below = 0;         ///< upper bound of the standard deviation: noise above this would have been seen
  double correlation = 0;   ///< lag-1, of the residual; below -0.25 the noise counts as visible
  double std = 0;           ///< of the channel itself
  double rms_change = 0;    ///< root mean square of s' - s
  double rms_residual = 0;  ///< of what the fit leaves of it, for its degrees of freedom
  double r_squared = 0;     ///< share of the variance of s' that the fit explains, adjusted for its degrees of freedom
  bool assessable = false;  ///< false: constant, or r_squared < 0.5: too coarse in time to tell noise from motion
  bool visible = false;
};

/// One entry per observation channel; empty with fewer than 50 rows or 5 per coefficient of the fit.
std::vector<ChannelNoise> EstimateNoise(const Dataset& dataset);

/// Control rate and measurement noise, from one linear fit of s' - s on (s, a).
void CheckDynamics(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
