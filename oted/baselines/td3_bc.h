#pragma once
/// TD3+BC (Fujimoto and Gu 2021) and ReBRAC (Tarasov et al. 2023): offline learners that readers compare with today.
/// The paper has neither: docs/deviations.md#offline-baselines.

#include <memory>
#include <vector>

#include "oted/base/fields.h"
#include "oted/baselines/offline_learner.h"

namespace oted {

/// What both have. Defaults: docs/deviations.md#offline-baselines.
struct Td3Config {
  int64_t n_steps = 100'000;
  int batch_size = 256;
  std::vector<int> hidden = {256, 256};
  double learning_rate = 3e-4;
  double gamma = 0.99;
  double tau = 0.005;
  double noise = 0.2;
  double noise_clip = 0.5;
  int policy_delay = 2;

 protected:
  void AddFields(FieldList& fields);
};

struct Td3BcConfig : Td3Config {
  double alpha = 2.5;
  FieldList Fields();
};

struct RebracConfig : Td3Config {
  double actor_penalty = 0.01;
  double critic_penalty = 0.01;
  RebracConfig();
  FieldList Fields();
};

/// Observations in units (s - mean) / (deviation + 0.001); plain critics; the actor climbs Q_1.
std::unique_ptr<OfflineLearner> MakeTd3Bc(const OfflineJob& job, const Td3BcConfig& config);
/// Raw observations; critics with layer normalisation; the actor climbs the smaller one; the target has a penalty, too,
/// so that rows after which no action was logged are left out.
std::unique_ptr<OfflineLearner> MakeRebrac(const OfflineJob& job, const RebracConfig& config);

}  // namespace oted
