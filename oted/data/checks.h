#pragma once
/// Checks of logged trajectories that need no simulator. Statistics and thresholds: docs/data_checks.md.

#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/finding.h"

namespace oted {

/// What is known of the task that the data were logged from; empty or 0 where it is not known.
struct TaskFacts {
  std::vector<std::string> observation_names = {};
  std::vector<std::string> action_names = {};
  std::vector<double> action_low = {}, action_high = {};  ///< in the actions' own unit
  int max_episode_steps = 0;
  bool flat_observations = true;   ///< a vector of quantities; false: an image, whose pixels are not checked one by one
  bool continuous_actions = true;  ///< false: numbers of discrete actions
  bool mujoco_observations = true;  ///< observations may be [qpos without the root's first numbers, qvel]

  /// The task's name of a column, or "observations[3]".
  std::string ObservationName(int j) const;
  std::string ActionName(int j) const;
};

/// All of the below, cheap ones: linear in the number of rows but for sorting. Never throws for what the data hold:
/// values that are not finite and arrays that disagree are findings, and then the only ones.
std::vector<Finding> CheckDataset(const Dataset& dataset, const TaskFacts& facts);

/// Rows and episodes: duplicates, rows that stand still, missed boundaries, jumps, lengths, amount.
void CheckRows(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);
/// Single channels: constant, clipped, outside their bounds, quantised, half precision.
void CheckChannels(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);
/// Observations against infos/qpos and infos/qvel, where the file has them.
void CheckStates(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);
/// Control rate and measurement noise, from one linear fit of s' - s on (s, a).
void CheckDynamics(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

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
  double r_squared = 0;     ///< share of the variance of s' that the fit explains, adjusted for its degrees of freedom
  bool assessable = false;  ///< false: constant, or r_squared < 0.5: too coarse in time to tell noise from motion
  bool visible = false;
};

/// One entry per observation channel; empty with fewer than 50 rows or 5 per coefficient of the fit.
std::vector<ChannelNoise> EstimateNoise(const Dataset& dataset);

}  // namespace oted
