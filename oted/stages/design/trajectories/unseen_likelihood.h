#pragma once
/// How likely simulators make logs that neither was fitted to.

#include <Eigen/Dense>
#include <optional>
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

/// How unlikely a simulator makes windows of the logs, in one part of the logs or several.
struct WindowCosts {
  struct Part {
    std::vector<int> rows;  ///< the first of each window
    Eigen::VectorXd costs;  ///< (windows): negative log densities
  };
  std::vector<Part> parts;
};

/// Of the simulator at z. The start of each window is fitted to its readings. A window that noise does not explain
/// counts as the worst that it does: such a start is mostly caught in a local minimum.
/// @param replayer  of logs that were not learned from
/// @param level     windows of `n_steps`, or brief ones: noisy readings are no starts of long windows, so brief ones
///                  are joined, and started where these began, until they are as long
WindowCosts CostsOf(WindowReplayer& replayer, const Level& level, int n_steps, const WindowNoise& noise,
                    const std::vector<double>& z);

/// Nats by which `a` makes windows likelier than `b`, in all, in the parts that both have. What chance makes likelier
/// in both cancels. The error is a jackknife over ten blocks of neighbouring windows of each part, infinite where one
/// has less than two. None where the windows are not the same.
std::optional<Estimated> NatsGained(const WindowCosts& a, const WindowCosts& b);

}  // namespace oted
