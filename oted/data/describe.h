#pragma once
/// What a dataset holds, in numbers.

#include <string>
#include <vector>

#include "oted/data/checks.h"
#include "oted/data/dataset.h"

namespace oted {

/// One column, in its own unit.
struct ChannelSummary {
  std::string name;
  double low = 0, high = 0, mean = 0, std = 0;  ///< NaN where the column holds one
};

struct DatasetSummary {
  int n_transitions = 0;
  int n_episodes = 0;
  int shortest = 0, longest = 0;  ///< transitions of an episode
  double median_length = 0;
  int n_terminals = 0, n_timeouts = 0;  ///< rows marked
  std::vector<double> returns;          ///< of each episode, undiscounted; empty without rewards
  std::vector<ChannelSummary> observations, actions;
  int nq = 0, nv = 0;  ///< width of infos/qpos and infos/qvel; 0: not in the file
};

/// Names come from `facts`. @throws DataError without rows.
DatasetSummary Describe(const Dataset& dataset, const TaskFacts& facts);

}  // namespace oted
