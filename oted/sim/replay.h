#pragma once
/// Open-loop replay: a simulator gets the logged actions, from a logged state or from one that was fitted to the logs.
/// Beside the log it shows what a score cannot: in which channel, and after how many steps, simulator and target part.

#include <functional>
#include <span>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Where a replay begins.
struct ReplayStart {
  int row = 0;                ///< of the logs
  std::vector<double> state;  ///< as Simulator::SetState takes it; empty: what was logged there
};

/// First rows of at most `n_windows` stretches of `n_steps` rows, spread evenly over the logs, ascending. A stretch
/// lies within one episode and starts in a state that the simulator can be set to; where logs show a state in part,
/// behind the actions that still act there. Uses lane 0.
/// @throws UsageError when the simulator's state cannot be set at all (SimulatorSpec::can_replay).
std::vector<int> ReplayStarts(Simulator& simulator, const Dataset& dataset, int n_steps, int n_windows);

/// What was logged from row `begin` on: (n_steps + 1, obs_dim), the start state first.
Array2<double> LoggedWindow(const Dataset& dataset, int begin, int n_steps);

/// Replays one window per lane, all at `z`, for `n_steps` steps.
/// @param starts  one for each lane of the simulator
/// @param seen    called with t = 0 .. n_steps after the states were set and after each step; may be empty
/// @return        per window (n_steps + 1, obs_dim), the start state first; NaN from the step on that diverged. A lane
///                that terminates goes on: its pose is still to be compared.
std::vector<Array2<double>> ReplayWindows(Simulator& simulator, const Dataset& dataset,
                                          std::span<const ReplayStart> starts, int n_steps, std::span<const double> z,
                                          const std::function<void(int t)>& seen = {});

/// Starts as they were logged.
std::vector<ReplayStart> AsLogged(std::span<const int> rows);

/// Standard deviation of every observed channel over the logs, the unit in which channels are compared; 0 for one that
/// stands still.
std::vector<double> ChannelSpreads(const Dataset& dataset);

/// Distance of two windows at each step: the root mean square, over the channels that vary in the logs, of the
/// difference in units of `spreads`; infinite where one of the numbers is not finite.
std::vector<double> ReplayError(const Array2<double>& logged, const Array2<double>& replayed,
                                std::span<const double> spreads);

}  // namespace oted
