// What a pipeline checks before it writes anything, and what each result depends on.

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/matching/experience.h"
#include "oted/run/pipeline.h"
#include "oted/run/training_ground.h"
#include "oted/sim/mujoco/mujoco_simulator.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

const fs::path& Pipeline::CheckRequest(const fs::path& out) {
  context_.n_threads = config_.Threads();
  AdaptDesign();
  dataset_.CheckFits(config_.task.name, factory_->spec().obs_dim(), factory_->spec().act_dim);
  if (!config_.truth.empty()) factory_->parameters().CheckInside(config_.TruthVector());
  if (!config_.agents.undesigned_at.empty()) factory_->parameters().CheckInside(config_.agents.undesigned_at);
  config_.CheckAgentSettings(factory_->spec());
  if (config_.baselines.Runs("is")) CheckIntervalSearch(config_.baselines.is, factory_->spec());
  config_.clone.MethodFor(factory_->spec());
  for (const auto& [name, design] : designs_) {
    FeatureShape(factory_->spec(), design.adversarial.Evidence(factory_->spec()));
    design.MakePrior(factory_->parameters());
    design.Check();  // once more, as the method that auto became
  }
  CheckCanDraw();
  if (config_.run.strict) ParametersWithEffect();
  return out;
}

void Pipeline::AdaptDesign() {
  const SimulatorSpec& spec = factory_->spec();
  bool adapted = false;
  for (const auto& [name, choice] : config_.DesignSettings()) {
    const DesignConfig design = choice.Resolved(factory_->parameters(), spec);
    // Of images auto has a method of its own: nothing was given up.
    adapted = adapted || (!spec.can_set_state && design.method != DesignMethod::kImages &&
                          (!choice.method || choice.Assumed().adversarial.starts == RolloutStarts::kDataset));
    designs_.emplace(name, design);
    if (choice.method || design.method != DesignMethod::kTrajectories) continue;
    for (const DesignMethod method : OtherMethods()) {
      const std::string other = fmt::format("{}-{}", name, Describe(method).name);
      if (config_.settings.contains(other)) {
        throw UsageError(
            fmt::format("design.settings.{} has the name that '{}' takes when auto picks the method {}; choose another",
                        other, name, Describe(method).name));
      }
      other_methods_[other] = {choice.Resolved(method, spec), name};
    }
  }
  if (!adapted) return;
  const auto* model = dynamic_cast<const MujocoSimulatorFactory*>(&factory_->plant());
  context_.log->Warning(fmt::format(
      "task '{}' cannot be set to a logged state{}: rollouts begin at the task's own starts and the clone acts "
      "(design.adversarial.starts = initial, actions = clone, horizon = {})",
      config_.task.name, model == nullptr ? "" : fmt::format(" ({})", model->why_not_settable()),
      designs_.begin()->second.adversarial.horizon));
}

json Pipeline::TaskIdentity() const {
  json identity = config_.task.Identity();
  // Agents, too, depend on the data where episodes begin there.
  if (config_.task.has_model() && config_.task.model.start == "logs") {
    identity["starts"] = {dataset_.sha256, config_.data.episodes};
  }
  return identity;
}

void Pipeline::KeepModel() const {
  if (!config_.task.has_model()) return;
  const fs::path folder = directory_.root() / "model", file = FindModelFile(config_.task.model.model);
  TaskConfig kept = config_.task;
  kept.model.model = file.filename().string();
  WriteFileAtomically(folder / file.filename(), ReadFile(file));
  WriteFileAtomically(folder / "task.toml", kept.ToToml());
  WriteFileAtomically(folder / "compiled.mjb", CompileToMjb(config_.task.model));
}

void Pipeline::CheckDirectory() const {
  const auto check = [&](const fs::path& file, const std::string& fingerprint) {
    if (!directory_.IsComplete(file, fingerprint) && file.parent_path() != directory_.root()) {
      directory_.CheckCheckpoint(file.parent_path(), fingerprint);
    }
  };
  check(directory_.clone() / "clone.json", CloneFingerprint());
  for (const auto& [setting, unused] : config_.DesignSettings()) {
    for (int seed = 1; seed <= config_.selection.n_seeds; ++seed) {
      check(directory_.design_seed(setting, seed) / "q.json", DesignFingerprint(setting));
    }
  }
  for (const auto& [setting, other] : other_methods_) {
    for (int seed = 1; seed <= config_.selection.n_seeds; ++seed) {
      check(directory_.design_seed(setting, seed) / "q.json", DesignFingerprint(setting));
    }
    const fs::path trials = directory_.root() / "design" / other.drawn_as / "methods";
    check(trials / Describe(other.config.method).name / "q.json", TrialFingerprint(other.drawn_as, other.config));
    check(trials / "choice.json", MethodChoiceFingerprint(other.drawn_as));
  }
  check(directory_.root() / "design.json", SelectionFingerprint());
  for (int j = 1; j <= config_.agents.n_agents; ++j) {
    for (const std::string& where : AgentGrounds()) {
      check(AgentFolder(where, j) / "agent.json", AgentFingerprint(where));
    }
  }
  if (config_.baselines.Runs("bc_dr")) check(directory_.baseline("bc_dr") / "clone.json", BcDrFingerprint());
  check(directory_.root() / "policy_selection.json", PolicySelectionFingerprint());
  if (!config_.truth.empty()) check(directory_.root() / "evaluation.json", EvaluationFingerprint());
}

void Pipeline::WriteProvenance() const {
  // As in every configuration file, the data's path is relative to the file's own folder.
  RunConfig written = config_;
  written.data.path = fs::proximate(config_.data.path, directory_.root()).string();
  std::string& model = written.task.model.model;
  if (!model.empty() && !model.starts_with("package:")) model = fs::proximate(model, directory_.root()).string();
  const auto place_prior = [&](DesignChoice& design) {
    const std::string prior = design.Assumed().prior;
    if (prior == "uniform" || prior == "gaussian") return;
    design.Set("prior", fs::proximate(prior, directory_.root()).string(), "design");
  };
  place_prior(written.design);
  for (auto& [unused, setting] : written.settings) place_prior(setting);
  KeepModel();
  WriteFileAtomically(directory_.root() / "run.toml", written.ToToml());
  const std::vector<Episode> episodes = dataset_.Episodes();
  WriteJson(directory_.root() / "dataset.json", {{"schema", "oted.dataset/1"},
                                                 {"path", config_.data.path},
                                                 {"sha256", dataset_.sha256},
                                                 {"n_transitions", dataset_.size()},
                                                 {"n_episodes", episodes.size()},
                                                 {"episode_returns", dataset_.EpisodeReturns()},
                                                 {"obs_dim", dataset_.obs_dim()},
                                                 {"act_dim", dataset_.act_dim()},
                                                 {"observation_names", dataset_.observation_names},
                                                 {"action_names", dataset_.action_names},
                                                 {"period_s", dataset_.period_s},
                                                 {"remarks", dataset_.remarks},
                                                 {"warnings", dataset_.warnings}});
}

std::string Pipeline::CloneFingerprint() const {
  RunConfig copy = config_;
  // The file counts by its content, not by its place.
  json data = copy.data.Fields().ToJson();
  data.erase("path");
  return Fingerprint(
      {"clone", TaskIdentity(), model_sha256_, dataset_.sha256, data, config_.run.seed, copy.clone.Fields().ToJson()});
}

std::string Pipeline::DesignFingerprint(const std::string& setting) const {
  const auto other = other_methods_.find(setting);
  const DesignConfig& design = other != other_methods_.end() ? other->second.config : designs_.at(setting);
  json settings = design.ToJson();
  // An earlier design counts by what it found, not by its place.
  const Prior prior = design.MakePrior(factory_->parameters());
  if (!prior.uniform) settings["prior"] = {prior.ToJson(), prior.values};
  return Fingerprint({"design", CloneFingerprint(), ParameterIdentity(factory_->parameters()), setting, settings});
}

std::string Pipeline::SelectionFingerprint() const {
  json inputs = {"selection"};
  for (const auto& [setting, design] : config_.DesignSettings()) {
    inputs.push_back(design.method ? DesignFingerprint(setting) : MethodChoiceFingerprint(setting));
  }
  SelectionConfig selection = config_.selection;
  inputs.push_back(selection.Fields().ToJson());
  return Fingerprint(inputs);
}

std::string Pipeline::AgentFingerprint(const std::string& where) const {
  const bool designed = where == "designed";
  const json settings =
      WithAgentSettings(config_, factory_->spec(), [](auto agent) { return agent.Fields().ToJson(); });
  json inputs = {"agent", designed, settings, config_.run.seed, TaskIdentity(), model_sha256_};
  if (config_.agents.device != "cpu") inputs.push_back(config_.agents.device);  // other bits
  if (designed) {
    inputs.push_back(SelectionFingerprint());
    if (config_.agents.train_in != "modes") inputs.push_back(config_.agents.train_in);
  } else {
    for (const json& part : ComparedIdentity(where, config_, factory_->parameters())) inputs.push_back(part);
  }
  return Fingerprint(inputs);
}

fs::path Pipeline::AgentFolder(const std::string& where, int index) const {
  if (where == "designed") return directory_.agent(index);
  return where == "undesigned" ? directory_.undesigned(index) : directory_.baseline(where, index);
}

std::vector<std::string> Pipeline::AgentGrounds() const {
  std::vector<std::string> grounds = {"designed"};
  if (ComparesUndesigned()) grounds.push_back("undesigned");
  for (const std::string& name : config_.baselines.Agents()) grounds.push_back(name);
  return grounds;
}

std::string Pipeline::PolicySelectionFingerprint() const {
  return Fingerprint(
      {"policies", AgentFingerprint("designed"), config_.agents.n_agents, config_.agents.selection_episodes});
}

std::string Pipeline::EvaluationFingerprint() const {
  json inputs = {"evaluation", PolicySelectionFingerprint(), config_.TruthVector(), config_.agents.target_episodes,
                 config_.agents.undesigned};
  if (!config_.agents.undesigned_at.empty()) inputs.push_back(AgentFingerprint("undesigned"));
  for (const std::string& name : config_.baselines.Agents()) inputs.push_back(AgentFingerprint(name));
  if (config_.baselines.Runs("bc_dr")) inputs.push_back(BcDrFingerprint());
  return Fingerprint(inputs);
}

}  // namespace oted
