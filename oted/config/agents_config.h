#pragma once
/// How agents learn: [agents], and which of the algorithms' sections counts.

#include <optional>
#include <vector>

#include "oted/base/fields.h"
#include "oted/rl/autograd/on_device.h"
#include "oted/sim/simulator.h"
#include "oted/stages/agent/algorithm.h"

namespace oted {

/// Where agents of the design train, drawn anew for each episode.
enum class TrainIn {
  kModes,    ///< "modes": a mode of the seeds' q (Algorithm 2)
  kSamples,  ///< "samples": a sample of one of them (Sec. 4, step 3)
  kBest,     ///< "best": always the best-scoring seed's mode
};
const NamedValues<TrainIn>& TrainInNames();

/// Stages 4 and 5: which agents, how many, and how they are compared.
struct AgentsConfig {
  std::optional<AgentAlgorithm> algorithm;  ///< none: auto
  int n_agents = 2;
  TrainIn train_in = TrainIn::kModes;
  TrainingDevice device = TrainingDevice::kCpu;
  bool nominal = true;             ///< with a known truth, also train agents in the nominal simulator
  std::vector<double> nominal_at;  ///< z of that simulator; empty: the parameters' nominal values
  int selection_episodes = 10;
  int target_episodes = 20;
  /// As the task's actions ask for. @throws UsageError when `algorithm` does not take them
  AgentAlgorithm AlgorithmFor(const SimulatorSpec& spec) const;
  FieldList Fields();
};

}  // namespace oted
