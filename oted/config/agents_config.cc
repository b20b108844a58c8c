/// How agents learn: [agents], and which of the algorithms' sections counts.

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/config/run_config.h"
#include "oted/rl/autograd/on_device.h"

namespace oted {

using nlohmann::json;

FieldList AgentsConfig::Fields() {
  FieldList fields("agents");
  fields.AddChoice(
      "algorithm", &algorithm,
      "how agents learn: crossq, or sac as the paper's, for continuous actions, ppo for discrete ones; auto: "
      "crossq or ppo",
      {"auto", "sac", "crossq", "ppo"});
  fields.Add("n_agents", &n_agents, "seeded agents to choose from (m in the paper)", AtLeast(1));
  fields.AddChoice("train_in", &train_in,
                   "where agents train, drawn anew for each episode: a mode of the seeds' q (Algorithm 2), a sample of "
                   "one of them (Sec. 4, step 3), or always the best-scoring seed's mode",
                   {"modes", "samples", "best"});
  fields.AddChoice("device", &device,
                   "where the gradient steps of crossq and sac are made: cpu, or cuda, by libtorch's autograd on a GPU",
                   {"cpu", "cuda"});
  fields.Add("undesigned", &undesigned, "with a known truth, also train in the un-designed simulator, to compare");
  fields.Add("undesigned_at", &undesigned_at,
             "what that simulator's parameters are, in the order of [parameters]; none: nominal");
  fields.Add("selection_episodes", &selection_episodes, "episodes per agent and designed simulator", AtLeast(1));
  fields.Add("target_episodes", &target_episodes, "with a known truth, episodes per policy in the target", AtLeast(1));
  return fields;
}

std::string AgentsConfig::AlgorithmFor(const SimulatorSpec& spec) const {
  const bool discrete = spec.n_discrete_actions > 0;
  if (algorithm == "auto") return discrete ? "ppo" : "crossq";
  if ((algorithm == "ppo") != discrete) {
    throw UsageError(
        fmt::format("agents.algorithm is {}, but task '{}' has {} actions, which it does not take; set it "
                    "to {} or auto",
                    algorithm, spec.task, discrete ? "discrete" : "continuous", discrete ? "ppo" : "crossq, sac"));
  }
  return algorithm;
}

void RunConfig::CheckAgentSettings(const SimulatorSpec& spec) const {
  const std::string algorithm = agents.AlgorithmFor(spec);
  const auto check = [&](auto given, auto defaults) {
    FieldList fields = given.Fields();
    if (fields.section() == algorithm) {
      if constexpr (requires { given.CheckLearns(algorithm); }) given.CheckLearns(algorithm);
      return;
    }
    const json ours = fields.ToJson(), unset = defaults.Fields().ToJson();
    for (const auto& [key, value] : ours.items()) {
      if (value == unset.at(key)) continue;
      throw UsageError(
          fmt::format("{0}.{1} is set, but the agents of task '{2}' learn by {3} (agents.algorithm = {4}); "
                      "set {3}.{1}, or agents.algorithm = {0}",
                      fields.section(), key, spec.task, algorithm, agents.algorithm));
    }
  };
  if (algorithm == "ppo" && agents.device != "cpu") {
    throw UsageError(fmt::format(
        "agents.device is {}, but the agents of task '{}' learn by ppo, whose gradient steps are made on the cpu alone",
        agents.device, spec.task));
  }
  CheckDevice(agents.device);
  check(sac, SacConfig());
  check(crossq, CrossQConfig());
  check(ppo, PpoConfig());
}

}  // namespace oted
