#pragma once
/// How likely simulators make logs that neither was fitted to.

#include <Eigen/Dense>
#include <vector>

#include "oted/matching/held_out_prediction.h"
#include "oted/stages/design/replay/windows.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// A simulator, and the sensors' noise that it leaves in the logs that it was fitted to.
struct Explanation {
  std::vector<double> z;
  Eigen::VectorXd variance;  ///< (obs_dim)
};

/// Nats by which `a` makes windows of the logs likelier than `b` does, in all. The start of each window is fitted to its
/// readings, by each simulator for itself. The error is a jackknife over ten blocks of neighbouring windows.
/// @param replayer  of logs that were not learned from, by the simulator of both
/// @param level     brief windows: noisy readings are no starts of long ones, so these are joined, and started where the
///                  brief ones were, until they have `n_steps`
/// @return an infinite error where less than two windows are that long
Estimated NatsGained(WindowReplayer& replayer, const Level& level, int n_steps, const Explanation& a,
                     const Explanation& b);

}  // namespace oted
