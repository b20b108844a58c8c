#include "oted/run/pipeline.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/checks/data_check.h"
#include "oted/rl/batch_policy.h"
#include "oted/run/design_record.h"
#include "oted/run/run_inputs.h"
#include "oted/stages/behavior/clone.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/effects.h"
#include "oted/stages/policy_selection/policy_selection.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr int kEffectEpisodes = 3;

RunConfig ExpandAndCheck(RunConfig config, const RunContext& context) {
  config.task.Resolve();
  std::vector<std::string> notes;
  RunConfig expanded = ExpandPresets(std::move(config), &notes);
  expanded.Check();
  for (const std::string& note : notes) context.log->Warning("left out: " + note);
  return expanded;
}

/// The checks of data that need no simulator: told before long work starts, and no more than told.
void WarnAboutData(const Dataset& dataset, const SimulatorSpec& spec, LogSink& log) {
  for (const Finding& f : CheckDataset(dataset, FactsOf(spec))) {
    if (f.severity == Severity::kNote) continue;
    log.Warning(fmt::format("data, {}: {}; {}; 'oted data check' has more", f.check, f.what, f.meaning));
  }
}

}  // namespace

Pipeline::Pipeline(RunConfig config, const fs::path& out, RunContext context)
    : config_(ExpandAndCheck(std::move(config), context)),
      context_(context),
      dataset_(ReadEpisodes(config_.data, SpecOf(config_.task))),
      factory_(MakeSimulatorFactory(config_.task, config_.parameters, dataset_.EpisodeStarts())),
      model_sha256_(factory_->model_sha256()),
      directory_(CheckRequest(out)) {
  CheckDirectory();
  for (const std::string& warning : dataset_.warnings) {
    context_.log->Warning(fmt::format("'{}': {}", config_.data.path, warning));
  }
  WriteProvenance();
}

Pipeline::~Pipeline() = default;

void Pipeline::Run() {
  CloneBehavior();
  Design();
  SelectSimulator();
  ReplayLogs();
  if (!factory_->spec().has_reward) {
    context_.log->Warning(fmt::format(
        "task '{}' has no reward: the simulator is designed and no agent is trained; add task.reward to train one",
        config_.task.name));
    return;
  }
  TrainAgents();
  SelectPolicy();
  EvaluateInTarget();
}

// ---------------------------------------------------------------- stage 1: behaviour

void Pipeline::CloneBehavior() {
  const fs::path folder = directory_.clone();
  if (directory_.IsComplete(folder / "clone.json", CloneFingerprint())) return;
  WarnAboutData(dataset_, factory_->spec(), *context_.log);
  const CloneResult clone = ::oted::CloneBehavior(dataset_, factory_->spec(), config_.clone,
                                                  RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("clone"),
                                                  directory_.NameOf(folder), context_, factory_.get());
  clone.policy->Save(folder / "policy.npz");
  json record = {{"schema", "oted.clone/1"},
                 {"method", clone.method},
                 {"train_loss", clone.train_loss},
                 {"held_out_loss", clone.held_out_loss},
                 {"n_steps", clone.n_steps}};
  if (clone.choice) {
    const auto evidence = [](const MethodEvidence& method) {
      json object = {{"held_out_loss", method.held_out_loss}, {"closeness", nullptr}};
      if (method.closeness) object["closeness"] = *method.closeness;
      return object;
    };
    record["choice"] = {{"n_held_out", clone.choice->n_held_out},
                        {"bc", evidence(clone.choice->bc)},
                        {"valuedice", evidence(clone.choice->valuedice)},
                        {"reason", clone.choice->reason}};
  }
  directory_.Complete(folder / "clone.json", record, CloneFingerprint());
}

// ---------------------------------------------------------------- stage 2: design

void Pipeline::Design() {
  std::map<std::string, SettingDesigns> settings;
  for (const auto& [setting, design] : designs_) settings[setting] = {design, setting};
  DesignAll(settings);
}

void Pipeline::DesignAll(const std::map<std::string, SettingDesigns>& settings) {
  CloneBehavior();
  const std::unique_ptr<const Policy> clone = LoadPolicy(directory_.clone() / "policy.npz");
  struct Job {
    std::string setting;
    SettingDesigns designs;
    int seed;
  };
  std::vector<Job> jobs;
  for (const auto& [setting, designs] : settings) {
    for (int seed = 1; seed <= config_.selection.n_seeds; ++seed) {
      if (directory_.IsComplete(directory_.design_seed(setting, seed) / "q.json", DesignFingerprint(setting))) continue;
      jobs.push_back({setting, designs, seed});
    }
  }
  if (jobs.empty()) return;
  ParametersWithEffect();
  // The bar knows all the work before any of it starts.
  for (const Job& job : jobs) {
    const std::string name = directory_.NameOf(directory_.design_seed(job.setting, job.seed));
    context_.log->Progress("design", name, 0, job.designs.config.n_iterations(), "");
  }
  const RunContext share = context_.ShareOf(jobs.size());
  ParallelFor(static_cast<int>(jobs.size()), context_.n_threads, [&](int i) {
    context_.ThrowIfStopped();
    const Job& job = jobs[static_cast<size_t>(i)];
    const DesignConfig& config = job.designs.config;
    const fs::path folder = directory_.design_seed(job.setting, job.seed);
    const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed))
                           .Stage("design")
                           .Stage(job.designs.drawn_as)
                           .Index(static_cast<uint64_t>(job.seed));
    directory_.Begin(folder, DesignFingerprint(job.setting));
    const DesignResult design = LearnDesign({.factory = *factory_,
                                             .dataset = dataset_,
                                             .clone = clone.get(),
                                             .key = key,
                                             .folder = folder,
                                             .run_name = directory_.NameOf(folder),
                                             .context = share},
                                            config);
    NpzArrays arrays;
    design.g.Save(arrays);
    WriteNpz(arrays, folder / "discriminator.npz");
    if (design.clone) design.clone->Save(folder / "policy.npz");
    json q = design.q.ToJson(config.adversarial.lambda);
    q["learning_progress"] = design.learning_progress;
    if (design.fit) q["fit"] = ToJson(*design.fit);
    directory_.Complete(folder / "q.json", q, DesignFingerprint(job.setting));
    directory_.RemoveCheckpoint(folder);
  });
}

const std::vector<bool>& Pipeline::ParametersWithEffect() {
  if (!has_effect_.empty()) return has_effect_;
  const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("effects");
  const auto effects = MeasureEffects(*factory_, dataset_, kEffectEpisodes, key, context_.n_threads);
  for (size_t i = 0; i < effects.size(); ++i) {
    const ParameterSpec& spec = config_.parameters[i];
    has_effect_.push_back(effects[i].largest_change > 0);
    if (has_effect_.back()) continue;
    const std::string message = fmt::format(
        "parameter '{}' ({}) changes nothing that the logged episodes show, from {} to {}: it will be reported as not "
        "identified; check the path, or remove the parameter",
        spec.name, spec.field, spec.low, spec.high);
    if (config_.run.strict) throw UsageError(message + " (run.strict)");
    context_.log->Warning(message);
  }
  return has_effect_;
}

// ---------------------------------------------------------------- stage 3: simulator selection

void Pipeline::AddCandidates(const std::string& setting, const DesignConfig& design,
                             std::vector<Candidate>* candidates) const {
  for (int seed = 1; seed <= config_.selection.n_seeds; ++seed) {
    const fs::path folder = directory_.design_seed(setting, seed);
    const json q = ReadJson(folder / "q.json");
    Candidate candidate;
    candidate.setting = setting;
    candidate.method = Describe(design.method).name;
    candidate.seed = seed;
    candidate.q = Designer::FromJson(q, factory_->parameters(), (folder / "q.json").string());
    candidate.evidence = design.adversarial.Evidence(factory_->spec());
    Rng unused(0);
    candidate.g = Discriminator(DatasetFeatures(dataset_, candidate.evidence), design.discriminator, unused,
                                FeatureShape(factory_->spec(), candidate.evidence));
    candidate.g.Restore(ReadNpz(folder / "discriminator.npz"), (folder / "discriminator.npz").string());
    candidate.learning_progress = q.value("learning_progress", 0.0);
    if (design.adversarial.clone_updates > 0) candidate.clone = LoadPolicy(folder / "policy.npz");
    if (q.contains("fit")) candidate.fit = FitEvidenceFromJson(q.at("fit"));
    candidates->push_back(std::move(candidate));
  }
}

void Pipeline::SelectSimulator() {
  Design();
  const fs::path file = directory_.root() / "design.json";
  if (directory_.IsComplete(file, SelectionFingerprint())) return;
  const std::unique_ptr<const Policy> clone = LoadPolicy(directory_.clone() / "policy.npz");
  const std::vector<bool>& has_effect = ParametersWithEffect();

  std::vector<Candidate> candidates;
  for (const auto& [setting, design] : designs_) AddCandidates(setting, design, &candidates);
  const auto select = [&] {
    return ::oted::SelectSimulator(*factory_, dataset_, clone.get(), candidates, config_.selection,
                                   RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("simulator selection"),
                                   context_);
  };
  SelectionResult result = select();
  const std::vector<MethodChoice> choices = ChooseMethods(candidates, result);
  if (DesignInChosenMethods(choices, &candidates)) result = select();
  json design = DesignRecord(config_, factory_->parameters(), candidates, result, choices, has_effect,
                             factory_->spec().observation_names);
  design["dataset"] = {{"path", config_.data.path}, {"sha256", dataset_.sha256}, {"n_transitions", dataset_.size()}};
  design["model"] = {{"task", config_.task.name}, {"sha256", model_sha256_}};
  design["versions"] = {{"oted", OTED_VERSION}, {"mujoco", "4.0.0"}};
  directory_.Complete(file, design, SelectionFingerprint());
}

std::vector<std::vector<double>> Pipeline::MixtureModes() const {
  std::vector<std::vector<double>> modes;
  const json design = ReadJson(directory_.root() / "design.json");
  for (const json& member : design.at("mixture")) {
    modes.push_back(member.at("mode").get<std::vector<double>>());
  }
  return modes;
}

DesignedSimulators Pipeline::Designed() const {
  DesignedSimulators designed;
  designed.modes = MixtureModes();
  const json design = ReadJson(directory_.root() / "design.json");
  for (const json& parameter : design.at("parameters")) designed.best.push_back(parameter.at("mode").get<double>());
  if (config_.agents.train_in != "samples") return designed;
  for (const json& member : design.at("mixture")) {
    const fs::path file =
        directory_.design_seed(design.at("selected").get<std::string>(), member.at("seed").get<int>()) / "q.json";
    designed.q.push_back(Designer::FromJson(ReadJson(file), factory_->parameters(), file.string()));
  }
  return designed;
}

// ---------------------------------------------------------------- stage 4: agents

struct Pipeline::AgentJob {
  fs::path folder;
  int index;
  std::string where;
};

void Pipeline::TrainAgents() {
  if (!factory_->spec().has_reward) {
    throw UsageError(
        fmt::format("task '{}' has no reward to train agents with; add task.reward = \"...\"", config_.task.name));
  }
  ReplayLogs();
  std::vector<AgentJob> jobs;
  for (int j = 1; j <= config_.agents.n_agents; ++j) {
    for (const std::string& where : AgentGrounds()) jobs.push_back({AgentFolder(where, j), j, where});
  }
  std::erase_if(jobs, [&](const AgentJob& job) {
    const std::string fingerprint = AgentFingerprint(job.where);
    const bool is_complete = directory_.IsComplete(job.folder / "agent.json", fingerprint);
    // Agents of earlier versions of the program have none.
    if (is_complete && !fs::exists(job.folder / "policy.onnx")) {
      ExportAgent(job.folder, fingerprint, job.folder / "policy.onnx");
    }
    return is_complete;
  });
  const DesignedSimulators designed = Designed();
  const std::string algorithm = config_.agents.AlgorithmFor(factory_->spec());
  const int64_t n_steps = WithAgentSettings(config_, factory_->spec(), [](const auto& agent) { return agent.n_steps; });
  for (const AgentJob& job : jobs) {
    context_.log->Progress("train", directory_.NameOf(job.folder), 0, n_steps, "");
  }
  const RunContext share = context_.ShareOf(jobs.size());
  ParallelFor(static_cast<int>(jobs.size()), context_.n_threads, [&](int i) {
    context_.ThrowIfStopped();
    const AgentJob& job = jobs[static_cast<size_t>(i)];
    const std::string fingerprint = AgentFingerprint(job.where);
    const bool is_designed = job.where == "designed";
    const TrainingGround ground =
        is_designed ? DesignedGround(config_.agents, designed) : ComparedGround(job.where, config_, *factory_);
    directory_.Begin(job.folder, fingerprint);
    const LearningCurve curve =
        TrainAgentIn(ground, *factory_, config_, job.index, job.folder, directory_.NameOf(job.folder), share);
    ExportAgent(job.folder, fingerprint, job.folder / "policy.onnx");
    json record = {{"schema", "oted.agent/1"}, {"agent", job.index}, {"designed", is_designed},
                   {"seed", config_.run.seed}, {"n_steps", n_steps}, {"eval_return", curve.eval_return}};
    if (algorithm != "sac") record["algorithm"] = algorithm;
    if (is_designed && config_.agents.train_in != "modes") record["train_in"] = config_.agents.train_in;
    if (!is_designed && job.where != "undesigned") record["baseline"] = job.where;
    for (const auto& [name, value] : ground.episodes->Figures()) record["episodes"][name] = value;
    directory_.Complete(job.folder / "agent.json", record, fingerprint);
    directory_.RemoveCheckpoint(job.folder);
  });
  if (config_.baselines.Runs("bc_dr")) CloneUnderRandomization();
}

ActionNoise Pipeline::JudgedNoise() const {
  return factory_->spec().n_discrete_actions > 0 ? config_.ppo.EvaluationNoise() : ActionNoise::kMean;
}

void Pipeline::ExportAgent(const fs::path& folder, const std::string& fingerprint, const fs::path& path) const {
  // The name and what it was made from, not where it lies: equal runs give equal bytes.
  const std::string source = fmt::format("{} {}", directory_.NameOf(folder), fingerprint);
  WriteOnnx(*LoadPolicy(folder / "policy.npz"), PolicyMetadata(factory_->spec(), source), path);
}

// ---------------------------------------------------------------- stage 5: policy selection

void Pipeline::SelectPolicy() {
  TrainAgents();
  const fs::path file = directory_.root() / "policy_selection.json";
  const fs::path selected_policy = directory_.root() / "policy.onnx";
  if (directory_.IsComplete(file, PolicySelectionFingerprint())) {
    if (!fs::exists(selected_policy)) {
      ExportAgent(directory_.agent(ReadJson(file).at("selected").get<int>()), AgentFingerprint("designed"),
                  selected_policy);
    }
    return;
  }
  std::vector<std::unique_ptr<const Policy>> policies;
  std::vector<const Policy*> agents;
  for (int j = 1; j <= config_.agents.n_agents; ++j) {
    policies.push_back(LoadPolicy(directory_.agent(j) / "policy.npz"));
    agents.push_back(policies.back().get());
  }
  const PolicySelectionResult result =
      ::oted::SelectPolicy(*factory_, agents, MixtureModes(), config_.agents.selection_episodes, JudgedNoise(),
                           RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("policy selection"), context_);
  const json design = ReadJson(directory_.root() / "design.json");
  json selection = {{"schema", "oted.policy_selection/1"}, {"selected", result.selected + 1}};
  for (const json& member : design.at("mixture")) {
    selection["simulators"].push_back({{"seed", member.at("seed")}, {"mode", member.at("mode")}});
  }
  for (size_t j = 0; j < agents.size(); ++j) {
    selection["agents"].push_back({{"agent", j + 1},
                                   {"returns", result.returns[j]},
                                   {"mean_return", result.mean_return[j]},
                                   {"n_diverged", result.n_diverged[j]}});
  }
  ExportAgent(directory_.agent(result.selected + 1), AgentFingerprint("designed"), selected_policy);
  directory_.Complete(file, selection, PolicySelectionFingerprint());
}

}  // namespace oted
