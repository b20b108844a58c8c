#pragma once
/// The algorithms that agents learn by: one table of what each is called, which actions it takes, its settings and its
/// training.

#include <memory>
#include <span>
#include <string>

#include "oted/base/fields.h"
#include "oted/rl/crossq.h"
#include "oted/rl/ppo.h"
#include "oted/rl/sac.h"

namespace oted {

enum class AgentAlgorithm { kSac, kCrossq, kPpo };

/// The settings of every algorithm. The agents of a run learn by one of them.
struct AlgorithmSettings {
  SacConfig sac;
  CrossQConfig crossq;
  PpoConfig ppo;
};

/// What training left, whatever the algorithm.
struct TrainedAgent {
  LearningCurve curve;
  std::unique_ptr<const Policy> policy;
};

/// One algorithm.
struct AlgorithmEntry {
  AgentAlgorithm algorithm;
  std::string name;       ///< "sac": in settings and files
  std::string title;      ///< "SAC": in reports
  bool discrete_actions;  ///< which it takes; otherwise continuous ones
  FieldList (*fields)(AlgorithmSettings& settings);
  int64_t (*n_steps)(const AlgorithmSettings& settings);    ///< control steps of one agent
  int (*eval_episodes)(const AlgorithmSettings& settings);  ///< of one evaluation
  ActionNoise (*noise)(const AlgorithmSettings& settings);  ///< how its policies act where they are judged
  /// @throws UsageError where training would end before its first gradient step
  void (*check)(const AlgorithmSettings& settings);
  /// @param device  of gradient steps; PPO makes them on the cpu alone
  TrainedAgent (*train)(const AgentJob& job, const AlgorithmSettings& settings, TrainingDevice device);
};

/// All of them.
std::span<const AlgorithmEntry> Algorithms();
const AlgorithmEntry& EntryOf(AgentAlgorithm algorithm);

}  // namespace oted
