#pragma once
/// How likely simulators make logs that neither was fitted to.

#include <Eigen/Dense>
#include <vector>

#include "oted/matching/held_out_prediction.h"
#include "oted/stages/design/replay/windows.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// The noise by which windows are judged.
struct WindowNoise {
  Eigen::VectorXd variance;     ///< (obs_dim); where errors grow, of what they have grown to at a window's end
  Eigen::VectorXd sensor = {};  ///< (obs_dim): variance of the sensors' noise where errors grow; else empty
};

/// Nats by which the simulator at `a` makes windows of the logs likelier than at `b`, in all. The start of each window
/// is fitted to its readings, at either for itself. A window that noise does not explain counts as the worst that it
/// does: such a start is mostly caught in a local minimum. The error is a jackknife over ten blocks of neighbouring
/// windows.
/// @param replayer  of logs that were not learned from
/// @param level     windows of `n_steps`, or brief ones: noisy readings are no starts of long windows, so brief ones
/// are
///                  joined, and started where these began, until they are as long
/// @return an infinite error where less than two windows are that long
Estimated NatsGained(WindowReplayer& replayer, const Level& level, int n_steps, const WindowNoise& noise,
                     const std::vector<double>& a, const std::vector<double>& b);

}  // namespace oted
