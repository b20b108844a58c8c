#pragma once
/// F-BRC of the paper's Table 1: Fisher-BRC (Kostrikov et al. 2021). docs/deviations.md#offline-baselines.

#include <memory>
#include <vector>

#include "oted/base/fields.h"
#include "oted/baselines/offline_learner.h"

namespace oted {

/// Defaults are the authors' but for the numbers of steps and the early stop of phase 1.
struct FisherBrcConfig {
  int64_t behavior_steps = 20'000;
  std::vector<int> behavior_hidden = {256, 256};
  double behavior_rate = 1e-3;
  double held_out = 0.15;
  int check_interval = 250;
  int patience = 10;
  int64_t n_steps = 30'000;
  int batch_size = 256;
  std::vector<int> hidden = {256, 256, 256};
  double learning_rate = 3e-4;
  double gamma = 0.99;
  double tau = 0.005;
  double gradient_penalty = 0.1;
  double reward_bonus = 5;

  FieldList Fields();
};

/// Phase 1 fits the behaviour policy mu to all but the held-out transitions and keeps the one under which those are
/// most likely; phase 2 learns actor and critics from all of them.
std::unique_ptr<OfflineLearner> MakeFisherBrc(const OfflineJob& job, const FisherBrcConfig& config);

}  // namespace oted
