#pragma once
/// Do the logs come from another version of their task? D4RL's files were recorded with an older MuJoCo, whose capsules
/// weigh less (docs/legacy_engine.md): in today's task that looks like a gap in the parameters.

#include <optional>
#include <string>

#include "oted/data/dataset.h"
#include "oted/sim/one_step.h"
#include "oted/sim/simulator.h"

namespace oted {

struct EngineMatch {
  std::string task;  ///< the version in which the logged steps repeat best
  double ratio = 0;  ///< its median one-step error, as a share of the change (OneStepError::median_ratio)
};

/// Of the other versions of a built-in MuJoCo task the one whose one-step error is less than half of `here`, the error
/// in `task` itself; nothing when there is none, when `here` is at the logs' rounding, or for another kind of task.
std::optional<EngineMatch> FindBetterEngine(const std::string& task, const OneStepError& here, const Dataset& dataset,
                                            int max_rows, int n_threads);

}  // namespace oted
