#pragma once
/// BC+DR (the paper's Sec. 5.1): behavioural cloning on the logs together with simulated data collected under domain
/// randomisation. Who collects is not said: docs/deviations.md#bc-dr.

#include <string>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"
#include "oted/stages/behavior/clone.h"

namespace oted {

struct BcDrConfig {
  std::string collector = "dr";  ///< who acts in the randomised simulators: "dr", the agent trained there, or "clone"
  double ratio = 1;              ///< simulated transitions for each logged one
};

/// The first `n` transitions of whole episodes of `policy` with sampled actions, z drawn uniformly over the ranges for
/// each episode. Diverged steps are left out. @throws DataError when nothing but diverged steps come
Dataset CollectUnderRandomization(const SimulatorFactory& factory, const Policy& policy, int n, RngKey key,
                                  int n_threads);

/// A clone of the logs and of ratio * logs.size() simulated transitions, every transition of either weighing the same.
CloneResult CloneWithSimulated(const Dataset& logs, const SimulatorFactory& factory, const Policy& collector,
                               double ratio, const CloneConfig& config, RngKey key, const std::string& run_name,
                               const RunContext& context);

}  // namespace oted
