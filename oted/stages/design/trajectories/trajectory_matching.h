#pragma once
/// Trajectory matching, the design for simulators whose state can be set: q(z) from windows of the log that the
/// simulator replays, with the windows' start states unknown as well as z. Not in the paper; see
/// docs/deviations.md#trajectory-matching.

#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/trajectories_config.h"

namespace oted {

/// Minimises over x and over the start state s_w of every window w
///
///   sum_w rho( sum_t,c (o_wtc - M_c(s_w, a_w, t; z(x)))^2 / sigma_c^2 ) - log p(x)
///
/// where rho is the negative log density of a scale mixture (Student's t over a window), so that windows which no
/// parameters explain count less, and sigma_c, the noise of channel c, is estimated along with the rest
/// (noise_estimate.h). Gauss-Newton with the start states eliminated window by window; Levenberg damping of its own for
/// x and for every s_w.
///
/// Windows of 2 control steps come first: their replays are almost linear in x and find the basin. They are joined to
/// windows of 4, 8, ... as long as the longer ones are explained as well, that is, the noise estimate does not grow by
/// more than a quarter: long windows tell more under noise, but contact makes them chaotic.
///
/// Where it does grow, or where all of these windows are shorter than 0.1 s and the logs are noisy, windows of 0.1 to 1
/// s take their place if they predict logs kept aside better (long_windows.h).
///
/// The starts have local minima, where noise or a poor guess has put a foot into the ground or off it. Such windows are
/// told by squared errors that noise does not reach; they are fitted again from other starts, and those that remain do
/// not count (LevelFit::TryOtherStarts, CountExplainedAlone).
///
/// The last step and the covariance: level_fit.h, Finish, and stretch_estimate.h.
ReplayFit MatchTrajectories(const ReplayProblem& problem, const TrajectoriesConfig& config);

}  // namespace oted
