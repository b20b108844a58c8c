#pragma once
/// MBOP of the paper's Table 1: model-based offline planning (Argenson and Dulac-Arnold 2021). Three ensembles are
/// fitted to the logs; the policy plans with them (oted/nn/planner_policy.h). docs/deviations.md#offline-baselines.

#include <memory>
#include <vector>

#include "oted/base/fields.h"
#include "oted/baselines/offline_learner.h"

namespace oted {

struct MbopConfig {
  int64_t n_steps = 10'000;
  int batch_size = 512;
  int members = 3;
  std::vector<int> hidden = {256, 256};
  double learning_rate = 1e-3;
  int horizon = 8;
  int trajectories = 200;
  double noise = 0.1;
  double keep = 0;
  double sharpness = 0.1;

  FieldList Fields();
};

/// @throws DataError where no episode is as long as the horizon
void CheckMbop(const Dataset& dataset, const MbopConfig& config);

/// Members learn by mean squared error, each from batches of its own: the model from all transitions, the prior from
/// the action before, which is 0 at an episode's start, the value from the rows that have the sum of the next `horizon`
/// rewards.
std::unique_ptr<OfflineLearner> MakeMbop(const OfflineJob& job, const MbopConfig& config);

}  // namespace oted
