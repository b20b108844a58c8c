#pragma once
/// Stretches of the log from which rollouts begin, and what was logged before them.

#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Rows [begin, begin + n_steps) of the dataset: n_steps actions between n_steps + 1 observations.
struct LogWindow {
  int begin = 0;
  int n_steps = 0;
  int episode_begin = 0;  ///< first row of the episode: a simulator with delays reaches back to it
};

/// The window of `n_steps` rows from row `begin` on, with its episode.
LogWindow WindowAt(const Dataset& dataset, int begin, int n_steps);

/// What was logged in the window's episode before it.
LoggedHistory HistoryBefore(const Dataset& dataset, const LogWindow& window);

}  // namespace oted
