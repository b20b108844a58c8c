#pragma once
/// BC+DR (the paper's Sec. 5.1): behavioural cloning on the logs together with simulated data collected under domain
/// randomisation. Who collects is not said: docs/deviations.md#bc-dr.

#include <string>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"
#include "oted/stages/clone/clone.h"

namespace oted {

/// Who acts in the randomised simulators: the agent trained in them, or the clone of the logs.
enum class Collector { kRandomizedAgent, kClone };

struct BcDrConfig {
  Collector collector = Collector::kRandomizedAgent;
  double ratio = 1;  ///< simulated transitions for each logged one
};

/// The first `n` transitions of whole episodes of `policy` with sampled actions, z drawn uniformly over the ranges for
/// each episode. Diverged steps are left out. @throws DataError when nothing but diverged steps come
Dataset CollectUnderRandomization(const SimulatorFactory& factory, const Policy& policy, int n, RngKey key,
                                  int n_threads);

/// A clone of the logs `job.dataset` and of ratio * logs.size() simulated transitions, every transition of either
/// weighing the same.
CloneResult CloneWithSimulated(const CloneJob& job, const SimulatorFactory& factory, const Policy& collector,
                               double ratio);

}  // namespace oted
