#pragma once
/// Stage 4 of a run: agents in the designed simulators, and those to compare with.

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "oted/baselines/offline_baselines.h"
#include "oted/nn/policy.h"
#include "oted/run/policy_records.h"
#include "oted/run/run_setup.h"
#include "oted/run/selection_step.h"

namespace oted {

/// A policy, and the file that it came to.
struct StoredPolicy {
  std::shared_ptr<const Policy> policy;
  std::string source;  ///< its name in the run and what it was made from
};

struct TrainedRecord : StoredPolicy {
  AgentRecord record;
};

/// What stage 4 leaves.
struct Agents {
  std::map<Ground, std::vector<TrainedRecord>> of;  ///< m agents of each ground
  StoredPolicy bc_dr;                               ///< the clone of the baseline BC+DR; null where it is not run
  std::vector<std::pair<OfflineBaseline, StoredPolicy>> offline;  ///< what learned from the logs alone

  /// Of the agents that train there, the one that does best there.
  const TrainedRecord& Best(Ground ground) const;
};

/// @throws UsageError for a task without a reward
void CheckHasReward(const SimulatorSpec& spec);

/// policy.npz, policy.onnx (but of a planner) and agent.json of every agent, each in a folder of its own; those of the
/// baselines beside them.
Agents TrainAgents(const RunSetup& run, const SelectedDesign& design, const Policy& clone);

/// An agent's policy.npz in `job.folder`. Agents of the same index have the same random streams wherever they train: a
/// paired comparison.
struct AgentTraining {
  const SimulatorFactory& factory;
  const RunConfig& config;
  Ground ground = Ground::kDesigned;
  int index = 1;  ///< from 1
  std::filesystem::path folder;
  std::string run_name;  ///< of its curves
  RunContext context;
};
/// @param where  the ground's simulators
TrainedRecord TrainOneAgent(const AgentTraining& training, TrainingGround where);

/// A baseline's policy.npz in `folder`, learned from `dataset` alone.
struct OfflineTraining {
  const RunConfig& config;
  const Dataset& dataset;
  const SimulatorSpec& spec;
  OfflineBaseline baseline;
  std::filesystem::path folder;
  std::string run_name;  ///< of its curves
  RunContext context;
};
struct LearnedRecord : StoredPolicy {
  OfflineRecord record;
};
LearnedRecord LearnOneBaseline(const OfflineTraining& training);

/// `policy` as ONNX. Equal runs give equal bytes: it says what it was made from, not where it lies.
void ExportPolicy(const RunSetup& run, const StoredPolicy& policy, const std::filesystem::path& path);

}  // namespace oted
