#include "oted/config/agents_config.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/config/run_config.h"
#include "oted/rl/autograd/on_device.h"

namespace oted {

using nlohmann::json;

namespace {

NamedValues<std::optional<AgentAlgorithm>> AlgorithmNames() {
  NamedValues<std::optional<AgentAlgorithm>> names = {{std::nullopt, "auto"}};
  for (const AlgorithmEntry& entry : Algorithms()) names.emplace_back(entry.algorithm, entry.name);
  return names;
}

}  // namespace

const NamedValues<TrainIn>& TrainInNames() {
  static const NamedValues<TrainIn> names = {
      {TrainIn::kModes, "modes"}, {TrainIn::kSamples, "samples"}, {TrainIn::kBest, "best"}};
  return names;
}

FieldList AgentsConfig::Fields() {
  FieldList fields("agents");
  fields.AddChoice("algorithm", &algorithm,
                   "how agents learn: sac (the paper's) or crossq for continuous actions, ppo for discrete ones; auto: "
                   "sac or ppo",
                   AlgorithmNames());
  fields.Add("n_agents", &n_agents, "seeded agents to choose from (m in the paper)", Between(1, 10000));
  fields.AddChoice("train_in", &train_in,
                   "simulator of each training episode: a random seed's mode (Algorithm 2), a sample of a random "
                   "seed's q (Sec. 4, step 3), or the best seed's mode",
                   TrainInNames());
  fields.AddChoice("device", &device,
                   "device of crossq's and sac's gradient steps: cpu, or cuda (libtorch's autograd on a GPU)",
                   TrainingDeviceNames());
  fields.Add("nominal", &nominal, "with a known truth, also train agents in the nominal simulator, to compare");
  fields.Add("nominal_at", &nominal_at,
             "that simulator's parameters, in the order of [parameters]; none: their nominal values");
  fields.Add("selection_episodes", &selection_episodes, "episodes per agent and designed simulator", AtLeast(1));
  fields.Add("target_episodes", &target_episodes, "with a known truth, episodes per policy in the target", AtLeast(1));
  return fields;
}

AgentAlgorithm AgentsConfig::AlgorithmFor(const SimulatorSpec& spec) const {
  const bool discrete = spec.n_discrete_actions > 0;
  if (!algorithm) return discrete ? AgentAlgorithm::kPpo : AgentAlgorithm::kSac;
  const AlgorithmEntry& entry = EntryOf(*algorithm);
  if (entry.discrete_actions != discrete) {
    throw UsageError(
        fmt::format("agents.algorithm is {}, but task '{}' has {} actions, which it does not take; set it "
                    "to {} or auto",
                    entry.name, spec.task, discrete ? "discrete" : "continuous", discrete ? "ppo" : "sac, crossq"));
  }
  return entry.algorithm;
}

void RunConfig::CheckAgentSettings(const SimulatorSpec& spec) const {
  const AlgorithmEntry& used = Algorithm(spec);
  if (used.algorithm == AgentAlgorithm::kPpo && agents.device != TrainingDevice::kCpu) {
    throw UsageError(fmt::format(
        "agents.device is {}, but the agents of task '{}' learn by ppo, whose gradient steps are made on the cpu alone",
        NameOf(TrainingDeviceNames(), agents.device), spec.task));
  }
  CheckDevice(agents.device);
  AlgorithmSettings given = algorithms, defaults;
  for (const AlgorithmEntry& entry : Algorithms()) {
    if (entry.algorithm == used.algorithm) {
      entry.check(given);
      continue;
    }
    const json ours = entry.fields(given).ToJson(), unset = entry.fields(defaults).ToJson();
    for (const auto& [key, value] : ours.items()) {
      if (value == unset.at(key)) continue;
      throw UsageError(
          fmt::format("{0}.{1} is set, but the agents of task '{2}' learn by {3} (agents.algorithm = {4}); "
                      "set {3}.{1}, or agents.algorithm = {0}",
                      entry.name, key, spec.task, used.name, NameOf(AlgorithmNames(), agents.algorithm)));
    }
  }
}

}  // namespace oted
