#include "oted/run/artifacts.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "oted/run/design_record.h"
#include "oted/run/fingerprint.h"
#include "oted/run/policy_records.h"
#include "oted/run/records.h"
#include "oted/run/replay_record.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/method_choice.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

InputsOfRun InputsOf(const RunSetup& run) { return {run.config, run.model_sha256, run.dataset.sha256}; }

std::string DesignFingerprint(const RunSetup& run, const std::string& setting) {
  const DesignConfig& design = run.Designs(setting).config;
  json settings = design.ToJson();
  // An earlier design counts by what it found, not by its place.
  const Prior prior = design.MakePrior(run.parameters());
  if (!prior.uniform) settings["prior"] = {prior.ToJson(), prior.values};
  const bool uses_clone = design.UsesClone();
  return Fingerprint({"design", uses_clone ? json(CloneArtifact(run).fingerprint) : DataIdentity(InputsOf(run)),
                      ParameterIdentity(run.parameters()), setting, settings});
}

std::string GrowthFingerprint(const RunSetup& run, int round) {
  return Fingerprint({"growth", round, DesignFingerprint(run, run.settings.begin()->first)});
}

std::string AgentFingerprint(const RunSetup& run, Ground ground) {
  AlgorithmSettings algorithms = run.config.algorithms;
  const json settings = run.config.Algorithm(run.spec()).fields(algorithms).ToJson();
  const bool designed = ground == Ground::kDesigned;
  json inputs = {"agent", designed, settings, run.config.run.seed, TaskIdentity(InputsOf(run)), run.model_sha256};
  if (const TrainingDevice device = run.config.agents.device; device != TrainingDevice::kCpu) {
    inputs.push_back(NameOf(TrainingDeviceNames(), device));  // other bits
  }
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

/// The clone's record where the clone acts in a design.
std::vector<fs::path> CloneUsedBy(const RunSetup& run, const DesignConfig& design) {
  if (!design.UsesClone()) return {};
  return {run.directory.clone() / "clone.json"};
}

/// The records of the rounds in which the parameters grew.
std::vector<fs::path> RoundsBefore(const RunSetup& run, int round) {
  std::vector<fs::path> records;
  for (int before = 1; before < round; ++before) records.push_back(run.directory.growth(before) / "growth.json");
  return records;
}

/// The records of a setting's designs.
void AddDesigns(const RunSetup& run, const std::string& setting, std::vector<fs::path>& records) {
  for (int seed = 1; seed <= run.NSeeds(setting); ++seed) {
    for (const char* name : {"q.json", "prediction.json"}) {
      records.push_back(run.directory.design_seed(setting, seed) / name);
    }
  }
}

/// How a design predicts, beside it.
Artifact PredictionOf(const Artifact& design) {
  return {.file = design.file.parent_path() / "prediction.json",
          .schema = PredictionRecord::kSchema,
          .fingerprint = Fingerprint({"prediction", design.fingerprint}),
          .made_from = {design.file},
          .is_guest = true};
}

fs::path SelectionFile(const RunSetup& run) { return run.directory.root() / "design.json"; }

/// The records of all agents that trained there.
void AddAgents(const RunSetup& run, Ground ground, std::vector<fs::path>& records) {
  for (int j = 1; j <= run.config.agents.n_agents; ++j) records.push_back(run.AgentFolder(ground, j) / "agent.json");
}

}  // namespace

Artifact CloneArtifact(const RunSetup& run) {
  RunConfig copy = run.config;
  return {.file = run.directory.clone() / "clone.json",
          .schema = CloneRecord::kSchema,
          .fingerprint = Fingerprint({"clone", DataIdentity(InputsOf(run)), copy.clone.Fields().ToJson()}),
          .files = {"policy.npz"}};
}

Artifact GrowthArtifact(const RunSetup& run, int round) {
  std::vector<fs::path> made_from = RoundsBefore(run, round);
  made_from.push_back(GrowthDesignArtifact(run, round).file);
  made_from.push_back(GrowthPredictionArtifact(run, round).file);
  return {.file = run.directory.growth(round) / "growth.json",
          .schema = GrowthRecord::kSchema,
          .fingerprint = GrowthFingerprint(run, round),
          .made_from = std::move(made_from)};
}

Artifact GrowthDesignArtifact(const RunSetup& run, int round) {
  return {.file = run.directory.growth_design(round) / "q.json",
          .schema = QRecord::kSchema,
          .fingerprint = GrowthFingerprint(run, round),
          .made_from = RoundsBefore(run, round)};
}

Artifact GrowthPredictionArtifact(const RunSetup& run, int round) {
  return PredictionOf(GrowthDesignArtifact(run, round));
}

Artifact DesignArtifact(const RunSetup& run, const std::string& setting, int seed) {
  std::vector<fs::path> made_from = CloneUsedBy(run, run.Designs(setting).config);
  std::ranges::move(RoundsBefore(run, static_cast<int>(run.growth.size()) + 1), std::back_inserter(made_from));
  return {.file = run.directory.design_seed(setting, seed) / "q.json",
          .schema = QRecord::kSchema,
          .fingerprint = DesignFingerprint(run, setting),
          .files = {"discriminator.npz", "policy.npz"},
          .made_from = std::move(made_from)};
}

Artifact PredictionArtifact(const RunSetup& run, const std::string& setting, int seed) {
  return PredictionOf(DesignArtifact(run, setting, seed));
}

Artifact TrialArtifact(const RunSetup& run, const std::string& setting, const DesignConfig& design) {
  return {.file = run.directory.trials(setting) / Describe(design.method).name / "q.json",
          .schema = QRecord::kSchema,
          .fingerprint = Fingerprint({"trial", DesignFingerprint(run, setting), design.ToJson()}),
          .made_from = CloneUsedBy(run, design)};
}

Artifact MethodChoiceArtifact(const RunSetup& run, const std::string& setting) {
  json others = json::array();
  std::vector<fs::path> made_from;
  AddDesigns(run, setting, made_from);
  made_from.push_back(run.directory.trials(setting) / Describe(run.settings.at(setting).config.method).name / "q.json");
  for (const DesignMethod method : OtherMethods()) {
    others.push_back(Describe(method).name);
    made_from.push_back(run.directory.trials(setting) / Describe(method).name / "q.json");
  }
  return {.file = run.directory.trials(setting) / "choice.json",
          .schema = MethodChoiceRecord::kSchema,
          .fingerprint = Fingerprint({"method choice", DesignFingerprint(run, setting), run.NSeeds(setting), others}),
          .made_from = std::move(made_from)};
}

Artifact SelectionArtifact(const RunSetup& run) {
  json inputs = {"selection"};
  for (const auto& [setting, asked] : run.config.DesignSettings()) {
    inputs.push_back(asked.method ? DesignFingerprint(run, setting) : MethodChoiceArtifact(run, setting).fingerprint);
  }
  SelectionConfig selection = run.config.selection;
  inputs.push_back(selection.Fields().ToJson());
  std::vector<fs::path> made_from;
  for (const auto& [setting, unused] : run.settings) {
    AddDesigns(run, setting, made_from);
    made_from.push_back(run.directory.trials(setting) / "choice.json");
  }
  for (const auto& [setting, unused] : run.other_methods) AddDesigns(run, setting, made_from);
  return {.file = SelectionFile(run),
          .schema = DesignRecord::kSchema,
          .fingerprint = Fingerprint(inputs),
          .made_from = std::move(made_from)};
}

Artifact ReplayArtifact(const RunSetup& run) {
  return {.file = run.directory.root() / "motion" / "replay.json",
          .schema = kReplaySchema,
          .fingerprint = Fingerprint({"replay", SelectionArtifact(run).fingerprint, run.config.report.replay_steps}),
          .made_from = {SelectionFile(run)},
          .is_replaceable = true};
}

Artifact FilmArtifact(const RunSetup& run) {
  const Artifact replay = ReplayArtifact(run);
  std::vector<std::string> films;
  for (const char* panel : kFilmPanels) films.push_back(FilmOf(panel));
  return {.file = run.directory.root() / "motion" / "motion.json",
          .schema = kMotionSchema,
          .fingerprint = replay.fingerprint,
          .files = std::move(films),
          .made_from = {replay.file},
          .is_replaceable = true};
}

Artifact AgentArtifact(const RunSetup& run, Ground ground, int index) {
  std::vector<fs::path> made_from;
  if (ground == Ground::kDesigned) made_from.push_back(SelectionFile(run));
  return {.file = run.AgentFolder(ground, index) / "agent.json",
          .schema = AgentRecord::kSchema,
          .fingerprint = Fingerprint({AgentFingerprint(run, ground), index}),
          .files = {"policy.npz"},
          .derived = {"policy.onnx"},
          .made_from = std::move(made_from)};
}

Artifact BcDrArtifact(const RunSetup& run) {
  const BcDrConfig& settings = run.config.baselines.bc_dr;
  json inputs = {"bc_dr", CloneArtifact(run).fingerprint, static_cast<int>(settings.collector), settings.ratio};
  std::vector<fs::path> made_from = {run.directory.clone() / "clone.json"};
  if (settings.collector == Collector::kRandomizedAgent) {
    AddAgents(run, Ground::kDomainRandomization, made_from);
    inputs.push_back({AgentFingerprint(run, Ground::kDomainRandomization), run.config.agents.n_agents});
  } else {
    inputs.push_back(ComparedIdentity(Ground::kDomainRandomization, run.config, run.parameters()));
  }
  return {.file = run.directory.baseline("bc_dr") / "clone.json",
          .schema = CloneRecord::kSchema,
          .fingerprint = Fingerprint(inputs),
          .files = {"policy.npz"},
          .derived = {"policy.onnx"},
          .made_from = std::move(made_from)};
}

Artifact OfflineArtifact(const RunSetup& run, OfflineBaseline baseline) {
  const OfflineEntry& entry = EntryOf(baseline);
  OfflineSettings settings = run.config.baselines.offline;
  return {.file = run.directory.baseline(entry.name) / "offline.json",
          .schema = OfflineRecord::kSchema,
          .fingerprint = Fingerprint({"offline", entry.name, entry.fields(settings).ToJson(),
                                      DataIdentity(InputsOf(run)), TaskIdentity(InputsOf(run))}),
          .files = {"policy.npz"},
          .derived = {"policy.onnx"}};
}

Artifact PolicySelectionArtifact(const RunSetup& run) {
  const AgentsConfig& agents = run.config.agents;
  std::vector<fs::path> made_from = {SelectionFile(run)};
  AddAgents(run, Ground::kDesigned, made_from);
  return {.file = run.directory.root() / "policy_selection.json",
          .schema = PolicySelectionRecord::kSchema,
          .fingerprint = Fingerprint(
              {"policies", AgentFingerprint(run, Ground::kDesigned), agents.n_agents, agents.selection_episodes}),
          .derived = {"policy.onnx"},
          .made_from = std::move(made_from)};
}

Artifact EvaluationArtifact(const RunSetup& run) {
  const RunConfig& config = run.config;
  json inputs = {"evaluation", PolicySelectionArtifact(run).fingerprint, config.TruthVector(),
                 config.agents.target_episodes, config.agents.nominal};
  if (!config.agents.nominal_at.empty()) inputs.push_back(AgentFingerprint(run, Ground::kNominal));
  for (const Ground ground : run.Grounds()) {
    if (ground != Ground::kDesigned && ground != Ground::kNominal) inputs.push_back(AgentFingerprint(run, ground));
  }
  std::vector<fs::path> made_from = {run.directory.clone() / "clone.json", SelectionFile(run),
                                     run.directory.root() / "policy_selection.json"};
  for (const Ground ground : run.Grounds()) AddAgents(run, ground, made_from);
  if (config.baselines.Runs(Baseline::kBcDr)) {
    const Artifact clone = BcDrArtifact(run);
    inputs.push_back(clone.fingerprint);
    made_from.push_back(clone.file);
  }
  for (const OfflineBaseline baseline : config.baselines.Offline()) {
    const Artifact offline = OfflineArtifact(run, baseline);
    inputs.push_back(offline.fingerprint);
    made_from.push_back(offline.file);
  }
  return {.file = run.directory.root() / "evaluation.json",
          .schema = EvaluationRecord::kSchema,
          .fingerprint = Fingerprint(inputs),
          .made_from = std::move(made_from)};
}

std::vector<Artifact> AllArtifacts(const RunSetup& run) {
  const RunConfig& config = run.config;
  std::vector<Artifact> all = {CloneArtifact(run)};
  for (const auto* settings : {&run.settings, &run.other_methods}) {
    for (const auto& [setting, unused] : *settings) {
      for (int seed = 1; seed <= run.NSeeds(setting); ++seed) {
        all.push_back(DesignArtifact(run, setting, seed));
        all.push_back(PredictionArtifact(run, setting, seed));
      }
    }
  }
  std::set<std::string> left_to_auto;
  for (const auto& [unused, other] : run.other_methods) {
    all.push_back(TrialArtifact(run, other.drawn_as, other.config));
    left_to_auto.insert(other.drawn_as);
  }
  for (const std::string& setting : left_to_auto) {
    all.push_back(TrialArtifact(run, setting, run.settings.at(setting).config));
    all.push_back(MethodChoiceArtifact(run, setting));
  }
  all.push_back(SelectionArtifact(run));
  for (int j = 1; j <= config.agents.n_agents; ++j) {
    for (const Ground ground : run.Grounds()) all.push_back(AgentArtifact(run, ground, j));
  }
  if (config.baselines.Runs(Baseline::kBcDr)) all.push_back(BcDrArtifact(run));
  for (const OfflineBaseline baseline : config.baselines.Offline()) all.push_back(OfflineArtifact(run, baseline));
  all.push_back(PolicySelectionArtifact(run));
  if (!config.truth.empty()) all.push_back(EvaluationArtifact(run));
  return all;
}

}  // namespace oted
