#pragma once
/// Logs whose truth is known: what a fit's simulator makes of the logged actions.

#include <Eigen/Dense>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/stages/design/replay/windows.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// Which windows are replayed. Replays through all of them are the simulator's own course from where the fit begins
/// each stretch, which need not be that of the logs.
enum class Through { kExplained, kAll };

/// The replayer's logs, with what the simulator makes of the fitted windows in place of their readings: the same
/// actions from the fitted starts, and the sensors' noise. Windows that follow each other are replayed as one.
/// @param noise_std  (obs_dim)
Dataset OwnLogs(WindowReplayer& replayer, const LevelFit& fit, const std::vector<double>& z,
                const Eigen::VectorXd& noise_std, Through through, Rng& rng);

}  // namespace oted
