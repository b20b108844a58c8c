#pragma once
/// Training one agent by Proximal Policy Optimisation (Schulman et al. 2017) in simulators with discrete actions, from
/// vectors or images. Knows nothing of the design: where an episode's parameters come from is a callback.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/log.h"
#include "oted/nn/categorical_policy.h"
#include "oted/rl/training.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Names and defaults are Stable-Baselines3's except where noted.
struct PpoConfig {
  int64_t n_steps = 500'000;
  int n_lanes = 16;         ///< Stable-Baselines3: 1 ...
  int rollout_steps = 128;  ///< ... with n_steps = 2048: as many samples per rollout
  int n_epochs = 10;
  int batch_size = 64;
  std::vector<int> hidden = {64, 64};
  std::vector<int> filters = {16, 32};
  double learning_rate = 3e-4;
  double gamma = 0.99;
  double gae_lambda = 0.95;
  double clip_range = 0.2;
  double ent_coef = 0.0;
  double vf_coef = 0.5;
  double max_grad_norm = 0.5;
  bool normalize_advantage = true;
  int64_t eval_interval = 50'000;
  int eval_episodes = 20;
  KeptPolicy keep = KeptPolicy::kBest;
  ActionNoise evaluate = ActionNoise::kSampled;  ///< how a policy over discrete actions acts where it is judged

  FieldList Fields();
};

struct PpoResult : LearningCurve {
  CategoricalPolicy policy;
};

/// Trains one agent by TrainInSegments, in whole rollouts: a segment, and the training, may end up to one rollout late.
/// The reward of a step that the clock ended gets gamma V(s') on top, and a rollout that ends within an episode
/// bootstraps through its last state. Indices in an observation are one-hot, quantities in spreads of a first play with
/// random actions, cut to +-10.
/// @throws UsageError for a task with continuous actions; as TrainInSegments
PpoResult TrainAgent(const AgentJob& job, const PpoConfig& config);

}  // namespace oted
