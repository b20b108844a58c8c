#pragma once
/// Logs of policies in a simulator that stands for the target: what `oted collect` writes.

#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/dataset_files.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Which policies are logged, and where.
struct CollectJob {
  const SimulatorFactory& factory;
  std::vector<double> z;  ///< the target's parameters
  /// Of each: "expert" or "medium" of a task with policies of its own; an excitation (Excitation::Parse); or the path
  /// of a policy.npz. They share the episodes.
  std::vector<std::string> policies;
  int n_episodes = 5;
  RngKey key;
  int n_threads = 1;
};

/// The episodes of all policies, one policy after the other, with the task's names and its control period.
/// @throws UsageError, DataError for a policy that is none of the task's
Dataset Collect(const CollectJob& job);

/// What a dataset file says of the task beside the logs. @param environment  its name there
WriteOptions WriteOptionsFor(const SimulatorSpec& spec, const std::string& environment);

}  // namespace oted
