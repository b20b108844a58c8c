#include "oted/pipeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/matching/verdict.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/rollout.h"
#include "oted/stages/agent/agent.h"
#include "oted/stages/behavior/behavioral_cloning.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/effects.h"
#include "oted/stages/policy_selection/policy_selection.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr int kEffectEpisodes = 3;

Dataset ReadEpisodes(const DataConfig& config) {
  if (config.path.empty())
    throw UsageError("no data are named; add --data demos.hdf5, or [data] path to the configuration");
  const Dataset all = ReadDataset(config.path);
  if (config.episodes == "all") return all;
  std::vector<Episode> episodes = all.Episodes();
  const size_t wanted = std::stoul(config.episodes);
  if (wanted > episodes.size()) {
    throw DataError(fmt::format("data.episodes asks for {} episodes, but '{}' holds {}; ask for fewer, or for all",
                                wanted, config.path, episodes.size()));
  }
  episodes.resize(wanted);
  return all.Select(episodes);
}

json ParametersJson(const ParameterSpace& space) {
  json list = json::array();
  for (const ParameterSpec& spec : space.specs()) {
    list.push_back(
        {spec.name, spec.field, spec.low, spec.high, spec.logarithmic, spec.scale == ParameterScale::kAbsolute});
  }
  return list;
}

/// Jobs side by side on the cores: each gets its share of the threads.
RunContext ShareOf(const RunContext& context, size_t n_jobs) {
  RunContext share = context;
  share.n_threads = std::max(1, context.n_threads / static_cast<int>(std::max<size_t>(1, n_jobs)));
  return share;
}

double StandardDeviation(const std::vector<double>& values, double mean) {
  double square = 0;
  for (const double v : values) square += (v - mean) * (v - mean);
  return values.size() < 2 ? 0 : std::sqrt(square / static_cast<double>(values.size() - 1));
}

}  // namespace

std::unique_ptr<SimulatorFactory> MakeSimulatorFactory(const std::string& task,
                                                       const std::vector<ParameterSpec>& parameters) {
  return std::make_unique<MujocoSimulatorFactory>(task, parameters);
}

Pipeline::Pipeline(RunConfig config, const fs::path& out, RunContext context)
    : config_((config.Check(), std::move(config))),
      context_(context),
      factory_(MakeSimulatorFactory(config_.task.name, config_.parameters)),
      model_sha256_(static_cast<const MujocoSimulatorFactory&>(*factory_).model_sha256()),
      dataset_(ReadEpisodes(config_.data)),
      directory_(CheckRequest(out)) {
  CheckDirectory();
  WriteProvenance();
}

const fs::path& Pipeline::CheckRequest(const fs::path& out) {
  context_.n_threads = config_.Threads();
  dataset_.CheckFits(config_.task.name, factory_->spec().obs_dim(), factory_->spec().act_dim);
  if (!config_.truth.empty()) factory_->parameters().CheckInside(config_.TruthVector());
  if (config_.run.strict) ParametersWithEffect();
  return out;
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
  check(directory_.root() / "design.json", SelectionFingerprint());
  for (int j = 1; j <= config_.agents.n_agents; ++j) {
    check(directory_.agent(j) / "agent.json", AgentFingerprint(true));
    if (ComparesUndesigned()) check(directory_.undesigned(j) / "agent.json", AgentFingerprint(false));
  }
  check(directory_.root() / "policy_selection.json", PolicySelectionFingerprint());
  if (!config_.truth.empty()) check(directory_.root() / "evaluation.json", EvaluationFingerprint());
}

Pipeline::~Pipeline() = default;

void Pipeline::Run() {
  CloneBehavior();
  Design();
  SelectSimulator();
  TrainAgents();
  SelectPolicy();
  EvaluateInTarget();
}

// ---------------------------------------------------------------- stage 1: behaviour

void Pipeline::CloneBehavior() {
  const fs::path folder = directory_.clone();
  if (directory_.IsComplete(folder / "clone.json", CloneFingerprint())) return;
  const CloneResult clone = ::oted::CloneBehavior(dataset_, factory_->spec(), config_.clone,
                                                  RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("clone"),
                                                  directory_.NameOf(folder), context_);
  clone.policy.Save(folder / "policy.npz");
  directory_.Complete(folder / "clone.json",
                      {{"schema", "oted.clone/1"},
                       {"train_loss", clone.train_loss},
                       {"held_out_loss", clone.held_out_loss},
                       {"n_steps", clone.n_steps}},
                      CloneFingerprint());
}

// ---------------------------------------------------------------- stage 2: design

void Pipeline::Design() {
  CloneBehavior();
  const TanhGaussianPolicy clone = TanhGaussianPolicy::Load(directory_.clone() / "policy.npz");
  struct Job {
    std::string setting;
    DesignConfig config;
    int seed;
  };
  std::vector<Job> jobs;
  for (const auto& [setting, design] : config_.DesignSettings()) {
    for (int seed = 1; seed <= config_.selection.n_seeds; ++seed) {
      if (directory_.IsComplete(directory_.design_seed(setting, seed) / "q.json", DesignFingerprint(setting))) continue;
      jobs.push_back({setting, design, seed});
    }
  }
  if (jobs.empty()) return;
  ParametersWithEffect();
  // The bar knows all the work before any of it starts.
  for (const Job& job : jobs) {
    const std::string name = directory_.NameOf(directory_.design_seed(job.setting, job.seed));
    context_.log->Progress("design", name, 0, job.config.n_iterations, "");
  }
  const RunContext share = ShareOf(context_, jobs.size());
  ParallelFor(static_cast<int>(jobs.size()), context_.n_threads, [&](int i) {
    context_.ThrowIfStopped();
    const Job& job = jobs[static_cast<size_t>(i)];
    const fs::path folder = directory_.design_seed(job.setting, job.seed);
    const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed))
                           .Stage("design")
                           .Stage(job.setting)
                           .Index(static_cast<uint64_t>(job.seed));
    directory_.Begin(folder, DesignFingerprint(job.setting));
    const DesignResult design =
        LearnDesign(*factory_, dataset_, &clone, job.config, key, folder, directory_.NameOf(folder), share);
    NpzArrays arrays;
    design.g.Save(arrays);
    WriteNpz(arrays, folder / "discriminator.npz");
    json q = design.q.ToJson(job.config.lambda);
    q["learning_progress"] = design.learning_progress;
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

void Pipeline::SelectSimulator() {
  Design();
  const fs::path file = directory_.root() / "design.json";
  if (directory_.IsComplete(file, SelectionFingerprint())) return;
  const TanhGaussianPolicy clone = TanhGaussianPolicy::Load(directory_.clone() / "policy.npz");
  const std::vector<bool>& has_effect = ParametersWithEffect();

  std::vector<Candidate> candidates;
  for (const auto& [setting, design] : config_.DesignSettings()) {
    for (int seed = 1; seed <= config_.selection.n_seeds; ++seed) {
      const fs::path folder = directory_.design_seed(setting, seed);
      const json q = ReadJson(folder / "q.json");
      Candidate candidate;
      candidate.setting = setting;
      candidate.seed = seed;
      candidate.q = Designer::FromJson(q, factory_->parameters(), (folder / "q.json").string());
      candidate.evidence = design.Evidence();
      Rng unused(0);
      candidate.g =
          Discriminator(DatasetFeatures(dataset_, candidate.evidence.transitions), design.Discriminator(), unused);
      candidate.g.Restore(ReadNpz(folder / "discriminator.npz"), (folder / "discriminator.npz").string());
      candidate.learning_progress = q.value("learning_progress", 0.0);
      candidates.push_back(std::move(candidate));
    }
  }
  const SelectionResult result =
      ::oted::SelectSimulator(*factory_, dataset_, &clone, candidates, config_.selection,
                              RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("simulator selection"), context_);
  const SettingScore& selected = result.settings[static_cast<size_t>(result.selected_setting)];

  std::vector<Designer> mixture;
  int best = 0;
  json mixture_json = json::array();
  for (const int i : selected.candidates) {
    const Candidate& candidate = candidates[static_cast<size_t>(i)];
    if (i == result.best_candidate) best = static_cast<int>(mixture.size());
    mixture.push_back(candidate.q);
    mixture_json.push_back({{"seed", candidate.seed}, {"mode", candidate.q.Mode()}, {"std", candidate.q.Std()}});
  }
  const auto summaries = SummarizeParameters(mixture, best, has_effect);
  const DesignVerdict verdict = JudgeDesign(result.nominal_common, selected.common);

  json design;
  design["schema"] = "oted.design/1";
  design["task"] = config_.task.name;
  design["warnings"] = json::array();
  for (int i = 0; i < factory_->parameters().size(); ++i) {
    const ParameterSpec& spec = factory_->parameters()[i];
    const ParameterSummary& s = summaries[static_cast<size_t>(i)];
    design["parameters"].push_back({{"name", spec.name},
                                    {"field", spec.field},
                                    {"unit", spec.unit},
                                    {"nominal", spec.nominal},
                                    {"bounds", {spec.low, spec.high}},
                                    {"mode", s.mode},
                                    {"std", s.std},
                                    {"interval90", {s.interval90_low, s.interval90_high}},
                                    {"verdict", ToString(s.verdict)}});
    if (!has_effect[static_cast<size_t>(i)]) {
      design["warnings"].push_back(
          fmt::format("parameter '{}' has no measured effect on the logged episodes", spec.name));
    }
    std::vector<double> row(static_cast<size_t>(factory_->parameters().size()), 0.0);
    row[static_cast<size_t>(i)] = 1.0;
    design["correlation"].push_back(row);
  }
  design["selected"] = selected.setting;
  design["mixture"] = mixture_json;
  design["score"] = config_.selection.score == "paper" ? selected.c : selected.common;
  design["score_name"] = config_.selection.score;
  design["verdict"] = ToString(verdict);
  design["log2"] = std::numbers::ln2;
  design["nominal_common"] = result.nominal_common;
  for (const SettingScore& setting : result.settings) {
    json seeds = json::array();
    for (const int i : setting.candidates) {
      const Candidate& candidate = candidates[static_cast<size_t>(i)];
      const CandidateScore& score = result.candidates[static_cast<size_t>(i)];
      seeds.push_back({{"seed", candidate.seed},
                       {"mode", candidate.q.Mode()},
                       {"std", candidate.q.Std()},
                       {"c", score.c},
                       {"common", score.common},
                       {"learning_progress", candidate.learning_progress}});
    }
    const std::map<std::string, DesignConfig> settings = config_.DesignSettings();
    design["settings"].push_back({{"name", setting.setting},
                                  {"form", settings.at(setting.setting).form},
                                  {"c", setting.c},
                                  {"common", setting.common},
                                  {"design_deviation", setting.design_deviation},
                                  {"learning_progress", setting.learning_progress},
                                  {"seeds", seeds}});
  }
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

// ---------------------------------------------------------------- stage 4: agents

struct Pipeline::AgentJob {
  fs::path folder;
  int index;
  bool designed;
};

void Pipeline::TrainAgents() {
  SelectSimulator();
  std::vector<AgentJob> jobs;
  for (int j = 1; j <= config_.agents.n_agents; ++j) {
    jobs.push_back({directory_.agent(j), j, true});
    if (ComparesUndesigned()) jobs.push_back({directory_.undesigned(j), j, false});
  }
  std::erase_if(jobs, [&](const AgentJob& job) {
    return directory_.IsComplete(job.folder / "agent.json", AgentFingerprint(job.designed));
  });
  const std::vector<std::vector<double>> modes = MixtureModes();
  for (const AgentJob& job : jobs) {
    context_.log->Progress("train", directory_.NameOf(job.folder), 0, config_.sac.n_steps, "");
  }
  const RunContext share = ShareOf(context_, jobs.size());
  ParallelFor(static_cast<int>(jobs.size()), context_.n_threads, [&](int i) {
    context_.ThrowIfStopped();
    const AgentJob& job = jobs[static_cast<size_t>(i)];
    // Agent j has the same random streams in the designed and in the un-designed simulators: a paired comparison.
    const RngKey key =
        RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("agent").Index(static_cast<uint64_t>(job.index));
    const std::vector<std::vector<double>> where =
        job.designed ? modes : std::vector<std::vector<double>>{factory_->parameters().Nominal()};
    directory_.Begin(job.folder, AgentFingerprint(job.designed));
    const SacResult agent =
        TrainAgent(*factory_, where, config_.sac, key, job.folder, directory_.NameOf(job.folder), share);
    agent.policy.Save(job.folder / "policy.npz");
    directory_.Complete(job.folder / "agent.json",
                        {{"schema", "oted.agent/1"},
                         {"agent", job.index},
                         {"designed", job.designed},
                         {"seed", config_.run.seed},
                         {"n_steps", config_.sac.n_steps},
                         {"eval_return", agent.eval_return}},
                        AgentFingerprint(job.designed));
    directory_.RemoveCheckpoint(job.folder);
  });
}

// ---------------------------------------------------------------- stage 5: policy selection

void Pipeline::SelectPolicy() {
  TrainAgents();
  const fs::path file = directory_.root() / "policy_selection.json";
  if (directory_.IsComplete(file, PolicySelectionFingerprint())) return;
  std::vector<TanhGaussianPolicy> agents;
  for (int j = 1; j <= config_.agents.n_agents; ++j) {
    agents.push_back(TanhGaussianPolicy::Load(directory_.agent(j) / "policy.npz"));
  }
  const PolicySelectionResult result =
      ::oted::SelectPolicy(*factory_, agents, MixtureModes(), config_.agents.selection_episodes,
                           RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("policy selection"), context_);
  const json design = ReadJson(directory_.root() / "design.json");
  json selection = {{"schema", "oted.policy_selection/1"}, {"selected", result.selected + 1}};
  for (const json& member : design.at("mixture")) {
    selection["simulators"].push_back({{"seed", member.at("seed")}, {"mode", member.at("mode")}});
  }
  for (size_t j = 0; j < agents.size(); ++j) {
    selection["agents"].push_back(
        {{"agent", j + 1}, {"returns", result.returns[j]}, {"mean_return", result.mean_return[j]}});
  }
  directory_.Complete(file, selection, PolicySelectionFingerprint());
}

// ---------------------------------------------------------------- a study's last step: the target

void Pipeline::EvaluateInTarget() {
  if (config_.truth.empty()) return;
  SelectPolicy();
  const fs::path file = directory_.root() / "evaluation.json";
  if (directory_.IsComplete(file, EvaluationFingerprint())) return;
  const std::vector<double> truth = config_.TruthVector();
  const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("target");
  const SimulatorSpec& spec = factory_->spec();

  json policies = json::array();
  const auto judge = [&](const std::string& name, const std::string& label, const BatchPolicy& act) {
    const auto simulator = factory_->Make(config_.agents.target_episodes, context_.n_threads);
    const std::vector<std::vector<double>> z(static_cast<size_t>(config_.agents.target_episodes), truth);
    std::vector<double> returns;
    const auto episodes = RunEpisodes(*simulator, z, act, key);
    for (const EpisodeResult& episode : episodes) returns.push_back(episode.episode_return);
    const double mean = MeanReturn(episodes);
    policies.push_back(
        {{"name", name}, {"label", label}, {"mean_return", mean}, {"std_return", StandardDeviation(returns, mean)}});
    policies.back()["score"] = spec.has_score() ? json(spec.NormalizedScore(mean)) : json();
    context_.log->Progress("evaluate", "target", static_cast<int64_t>(policies.size()), 4, label);
  };
  const auto judge_policy = [&](const std::string& name, const std::string& label, const fs::path& path,
                                ActionNoise noise) {
    const TanhGaussianPolicy policy = TanhGaussianPolicy::Load(path);
    PolicyRunner runner(policy, noise);
    Rng rng = key.Stage(name).MakeRng();
    judge(name, label, [&](std::span<const double> observations, int n, std::span<double> actions) {
      runner.Act(observations, n, rng, actions);
    });
  };

  Rng random = key.Stage("random").MakeRng();
  judge("random", "random actions", [&](std::span<const double>, int, std::span<double> actions) {
    for (size_t i = 0; i < actions.size(); ++i) {
      const size_t j = i % static_cast<size_t>(spec.act_dim);
      actions[i] = random.Uniform(spec.action_low[j], spec.action_high[j]);
    }
  });
  judge_policy("clone", "clone of the logs", directory_.clone() / "policy.npz", ActionNoise::kMean);
  if (ComparesUndesigned()) {
    // The un-designed agent, too, is the one of its m that does best where it was trained.
    int best = 1;
    const auto own_return = [&](int j) {
      return ReadJson(directory_.undesigned(j) / "agent.json").at("eval_return").get<double>();
    };
    for (int j = 2; j <= config_.agents.n_agents; ++j) best = own_return(j) > own_return(best) ? j : best;
    judge_policy("sac_undesigned", "SAC in the un-designed simulator", directory_.undesigned(best) / "policy.npz",
                 ActionNoise::kMean);
  }
  const int selected = ReadJson(directory_.root() / "policy_selection.json").at("selected").get<int>();
  judge_policy("oted_sac", "OTED-SAC", directory_.agent(selected) / "policy.npz", ActionNoise::kMean);

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

// ---------------------------------------------------------------- provenance

void Pipeline::WriteProvenance() const {
  WriteFileAtomically(directory_.root() / "run.toml", config_.ToToml());
  const std::vector<Episode> episodes = dataset_.Episodes();
  WriteJson(directory_.root() / "dataset.json", {{"schema", "oted.dataset/1"},
                                                 {"path", config_.data.path},
                                                 {"sha256", dataset_.sha256},
                                                 {"n_transitions", dataset_.size()},
                                                 {"n_episodes", episodes.size()},
                                                 {"episode_returns", dataset_.EpisodeReturns()},
                                                 {"obs_dim", dataset_.obs_dim()},
                                                 {"act_dim", dataset_.act_dim()}});
}

std::string Pipeline::CloneFingerprint() const {
  RunConfig copy = config_;
  return Fingerprint({"clone", config_.task.name, model_sha256_, dataset_.sha256, config_.data.episodes,
                      config_.run.seed, copy.clone.Fields().ToJson()});
}

std::string Pipeline::DesignFingerprint(const std::string& setting) const {
  DesignConfig design = config_.DesignSettings().at(setting);
  return Fingerprint(
      {"design", CloneFingerprint(), ParametersJson(factory_->parameters()), setting, design.Fields().ToJson()});
}

std::string Pipeline::SelectionFingerprint() const {
  json inputs = {"selection"};
  for (const auto& [setting, unused] : config_.DesignSettings()) inputs.push_back(DesignFingerprint(setting));
  SelectionConfig selection = config_.selection;
  inputs.push_back(selection.Fields().ToJson());
  return Fingerprint(inputs);
}

std::string Pipeline::AgentFingerprint(bool designed) const {
  SacConfig sac = config_.sac;
  json inputs = {"agent", designed, sac.Fields("sac").ToJson(), config_.run.seed, config_.task.name, model_sha256_};
  if (designed) inputs.push_back(SelectionFingerprint());
  return Fingerprint(inputs);
}

std::string Pipeline::PolicySelectionFingerprint() const {
  return Fingerprint({"policies", AgentFingerprint(true), config_.agents.n_agents, config_.agents.selection_episodes});
}

std::string Pipeline::EvaluationFingerprint() const {
  return Fingerprint({"evaluation", PolicySelectionFingerprint(), config_.TruthVector(), config_.agents.target_episodes,
                      config_.agents.undesigned});
}

}  // namespace oted
