// A study's last step: every policy in the target, which only EvaluateInTarget may look at.

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/base/statistics.h"
#include "oted/rl/batch_policy.h"
#include "oted/run/pipeline.h"
#include "oted/sim/task_policy.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

std::string NameOf(const std::string& algorithm) {
  return algorithm == "ppo" ? "PPO" : algorithm == "crossq" ? "CrossQ" : "SAC";
}

}  // namespace

void Pipeline::EvaluateInTarget() {
  if (config_.truth.empty()) return;
  SelectPolicy();
  const fs::path file = directory_.root() / "evaluation.json";
  if (directory_.IsComplete(file, EvaluationFingerprint())) return;
  const std::vector<double> truth = config_.TruthVector();
  const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("target");
  const SimulatorSpec& spec = factory_->spec();

  const ActionNoise noise = JudgedNoise();
  const std::string algorithm = config_.agents.AlgorithmFor(spec), name_of_it = NameOf(algorithm);
  const std::vector<std::vector<double>> z(static_cast<size_t>(config_.agents.target_episodes), truth);

  const int64_t total = 2 + static_cast<int64_t>(AgentGrounds().size()) + (config_.baselines.Runs("bc_dr") ? 1 : 0) +
                        (factory_->has_expert() ? 1 : 0);

  json policies = json::array();
  const auto record = [&](const std::string& name, const std::string& label,
                          const std::vector<EpisodeResult>& episodes) {
    const std::vector<double> returns = ComparableReturns(episodes);
    const double mean = Mean(returns);
    policies.push_back({{"name", name},
                        {"label", label},
                        {"mean_return", mean},
                        {"std_return", StandardDeviation(returns)},
                        {"n_diverged", CountDiverged(episodes)}});
    policies.back()["score"] = spec.has_score() ? json(spec.NormalizedScore(mean)) : json();
    context_.log->Progress("evaluate", "target", static_cast<int64_t>(policies.size()), total, label);
  };
  const auto judge = [&](const std::string& name, const std::string& label, const BatchPolicy& act) {
    const auto simulator = factory_->Make(config_.agents.target_episodes, context_.n_threads);
    record(name, label, RunEpisodes(*simulator, z, act, key));
  };
  const auto judge_policy = [&](const std::string& name, const std::string& label, const fs::path& path) {
    const std::unique_ptr<const Policy> policy = LoadPolicy(path);
    judge(name, label, AsBatchPolicy(*policy, noise, key.Stage(name).MakeRng()));
  };

  Rng random = key.Stage("random").MakeRng();
  judge("random", "random actions", UniformRandomPolicy(spec, random));
  judge_policy("clone", "clone of the logs", directory_.clone() / "policy.npz");
  // What is compared with, too, is the one of its m agents that does best where it was trained.
  const auto judge_best = [&](const std::string& where, const std::string& label) {
    judge_policy(algorithm + "_" + where, label, AgentFolder(where, BestAgent(where)) / "policy.npz");
  };
  if (config_.baselines.Runs("bc_dr")) {
    judge_policy("bc_dr", "clone of logs and data under DR (BC+DR)", directory_.baseline("bc_dr") / "policy.npz");
  }
  const std::vector<std::string> baselines = config_.baselines.Agents();
  for (const std::string& name : baselines) {
    judge_best(name, name_of_it + (name == "dr" ? ", domain randomisation (DR)" : ", interval search (IS)"));
  }
  if (ComparesUndesigned()) judge_best("undesigned", name_of_it + " in the un-designed simulator");
  const int selected = ReadJson(directory_.root() / "policy_selection.json").at("selected").get<int>();
  judge_policy("oted_" + algorithm, "OTED-" + name_of_it, directory_.agent(selected) / "policy.npz");
  if (factory_->has_expert()) {
    // What can be reached at most, by one who sees the whole grid; and with it a score.
    const auto simulator = factory_->Make(config_.agents.target_episodes, context_.n_threads);
    const BatchPolicy expert = OnTrueStates(*simulator, TaskPolicy::kExpert, key.Stage("expert").MakeRng());
    record("expert", "shortest paths, all in sight", RunEpisodes(*simulator, z, expert, key));
    const double low = policies.front().at("mean_return"), high = policies.back().at("mean_return");
    for (json& policy : policies) {
      if (high > low) policy["score"] = 100 * (policy.at("mean_return").get<double>() - low) / (high - low);
    }
  }

  json parameters = json::array();
  const json design = ReadJson(directory_.root() / "design.json");
  for (size_t i = 0; i < truth.size(); ++i) {
    const json& p = design.at("parameters").at(i);
    parameters.push_back({{"name", p.at("name")},
                          {"unit", p.at("unit")},
                          {"nominal", p.at("nominal")},
                          {"truth", truth[i]},
                          {"mode", p.at("mode")},
                          {"std", p.at("std")},
                          {"absolute_error", std::abs(p.at("mode").get<double>() - truth[i])}});
  }
  directory_.Complete(file,
                      {{"schema", "oted.evaluation/1"},
                       {"task", config_.task.name},
                       {"episodes", config_.agents.target_episodes},
                       {"parameters", parameters},
                       {"policies", policies}},
                      EvaluationFingerprint());
}

}  // namespace oted
