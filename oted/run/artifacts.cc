#include "oted/run/artifacts.h"

#include <nlohmann/json.hpp>

#include "oted/run/fingerprint.h"
#include "oted/run/records.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/method_choice.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

json TaskIdentity(const RunSetup& run) {
  json identity = run.config.task.Identity();
  // Agents, too, depend on the data where episodes begin there.
  if (run.config.task.has_model() && run.config.task.model.start == "logs") {
    identity["starts"] = {run.dataset.sha256, run.config.data.episodes};
  }
  return identity;
}

std::string DesignFingerprint(const RunSetup& run, const std::string& setting) {
  const DesignConfig& design = run.Designs(setting).config;
  json settings = design.ToJson();
  // An earlier design counts by what it found, not by its place.
  const Prior prior = design.MakePrior(run.parameters());
  if (!prior.uniform) settings["prior"] = {prior.ToJson(), prior.values};
  return Fingerprint(
      {"design", CloneArtifact(run).fingerprint, ParameterIdentity(run.parameters()), setting, settings});
}

std::string AgentFingerprint(const RunSetup& run, Ground ground) {
  AlgorithmSettings algorithms = run.config.algorithms;
  const json settings = run.config.Algorithm(run.spec()).fields(algorithms).ToJson();
  const bool designed = ground == Ground::kDesigned;
  json inputs = {"agent", designed, settings, run.config.run.seed, TaskIdentity(run), run.model_sha256};
  if (run.config.agents.device != "cpu") inputs.push_back(run.config.agents.device);  // other bits
  if (designed) {
    inputs.push_back(SelectionArtifact(run).fingerprint);
    if (run.config.agents.train_in != TrainIn::kModes) {
      inputs.push_back(NameOf(TrainInNames(), run.config.agents.train_in));
    }
  } else {
    for (const json& part : ComparedIdentity(ground, run.config, run.parameters())) inputs.push_back(part);
  }
  return Fingerprint(inputs);
}

}  // namespace

Artifact CloneArtifact(const RunSetup& run) {
  RunConfig copy = run.config;
  // The file counts by its content, not by its place.
  json data = copy.data.Fields().ToJson();
  data.erase("path");
  return {run.directory.clone() / "clone.json", CloneRecord::kSchema,
          Fingerprint({"clone", TaskIdentity(run), run.model_sha256, run.dataset.sha256, data, run.config.run.seed,
                       copy.clone.Fields().ToJson()})};
}

Artifact DesignArtifact(const RunSetup& run, const std::string& setting, int seed) {
  return {run.directory.design_seed(setting, seed) / "q.json", QRecord::kSchema, DesignFingerprint(run, setting)};
}

Artifact TrialArtifact(const RunSetup& run, const std::string& setting, const DesignConfig& design) {
  return {run.directory.trials(setting) / Describe(design.method).name / "q.json", QRecord::kSchema,
          Fingerprint({"trial", DesignFingerprint(run, setting), design.ToJson()})};
}

Artifact MethodChoiceArtifact(const RunSetup& run, const std::string& setting) {
  json others = json::array();
  for (const DesignMethod method : OtherMethods()) others.push_back(Describe(method).name);
  return {run.directory.trials(setting) / "choice.json", MethodChoiceRecord::kSchema,
          Fingerprint({"method choice", DesignFingerprint(run, setting), run.config.selection.n_seeds, others})};
}

Artifact SelectionArtifact(const RunSetup& run) {
  json inputs = {"selection"};
  for (const auto& [setting, asked] : run.config.DesignSettings()) {
    inputs.push_back(asked.method ? DesignFingerprint(run, setting) : MethodChoiceArtifact(run, setting).fingerprint);
  }
  SelectionConfig selection = run.config.selection;
  inputs.push_back(selection.Fields().ToJson());
  return {run.directory.root() / "design.json", DesignRecord::kSchema, Fingerprint(inputs)};
}

Artifact ReplayArtifact(const RunSetup& run) {
  return {run.directory.root() / "motion" / "replay.json", "oted.replay/1",
          Fingerprint({"replay", SelectionArtifact(run).fingerprint, run.config.report.replay_steps})};
}

Artifact AgentArtifact(const RunSetup& run, Ground ground, int index) {
  return {run.AgentFolder(ground, index) / "agent.json", AgentRecord::kSchema, AgentFingerprint(run, ground)};
}

Artifact BcDrArtifact(const RunSetup& run) {
  const BcDrConfig& settings = run.config.baselines.bc_dr;
  json inputs = {"bc_dr", CloneArtifact(run).fingerprint, static_cast<int>(settings.collector), settings.ratio};
  if (settings.collector == Collector::kRandomizedAgent) {
    inputs.push_back({AgentFingerprint(run, Ground::kDomainRandomization), run.config.agents.n_agents});
  } else {
    inputs.push_back(ComparedIdentity(Ground::kDomainRandomization, run.config, run.parameters()));
  }
  return {run.directory.baseline("bc_dr") / "clone.json", CloneRecord::kSchema, Fingerprint(inputs)};
}

Artifact PolicySelectionArtifact(const RunSetup& run) {
  const AgentsConfig& agents = run.config.agents;
  return {
      run.directory.root() / "policy_selection.json", PolicySelectionRecord::kSchema,
      Fingerprint({"policies", AgentFingerprint(run, Ground::kDesigned), agents.n_agents, agents.selection_episodes})};
}

Artifact EvaluationArtifact(const RunSetup& run) {
  const RunConfig& config = run.config;
  json inputs = {"evaluation", PolicySelectionArtifact(run).fingerprint, config.TruthVector(),
                 config.agents.target_episodes, config.agents.nominal};
  if (!config.agents.nominal_at.empty()) inputs.push_back(AgentFingerprint(run, Ground::kNominal));
  for (const Ground ground : run.Grounds()) {
    if (ground != Ground::kDesigned && ground != Ground::kNominal) inputs.push_back(AgentFingerprint(run, ground));
  }
  if (config.baselines.Runs(Baseline::kBcDr)) inputs.push_back(BcDrArtifact(run).fingerprint);
  return {run.directory.root() / "evaluation.json", EvaluationRecord::kSchema, Fingerprint(inputs)};
}

std::vector<Artifact> AllArtifacts(const RunSetup& run) {
  const RunConfig& config = run.config;
  std::vector<Artifact> all = {CloneArtifact(run)};
  for (const auto* settings : {&run.settings, &run.other_methods}) {
    for (const auto& [setting, unused] : *settings) {
      for (int seed = 1; seed <= config.selection.n_seeds; ++seed) all.push_back(DesignArtifact(run, setting, seed));
    }
  }
  for (const auto& [unused, other] : run.other_methods) {
    all.push_back(TrialArtifact(run, other.drawn_as, other.config));
    all.push_back(MethodChoiceArtifact(run, other.drawn_as));
  }
  all.push_back(SelectionArtifact(run));
  for (int j = 1; j <= config.agents.n_agents; ++j) {
    for (const Ground ground : run.Grounds()) all.push_back(AgentArtifact(run, ground, j));
  }
  if (config.baselines.Runs(Baseline::kBcDr)) all.push_back(BcDrArtifact(run));
  all.push_back(PolicySelectionArtifact(run));
  if (!config.truth.empty()) all.push_back(EvaluationArtifact(run));
  return all;
}

}  // namespace oted
