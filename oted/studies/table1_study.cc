#include "oted/studies/table1_study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <mutex>
#include <nlohmann/json.hpp>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/base/statistics.h"
#include "oted/baselines/bc_dr.h"
#include "oted/rl/batch_policy.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/run/pipeline.h"
#include "oted/run/run_inputs.h"
#include "oted/run/training_ground.h"
#include "oted/studies/cell_record.h"
#include "oted/studies/design_study.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kTable1Schema = "oted.table1_cell/1";

bool SeesLogs(const std::string& method) { return method == "bc" || method == "bc_dr" || method == "oted"; }

/// The method whose work bc_dr begins from.
std::string CollectorOf(const RunConfig& config) { return config.baselines.bc_dr.collector == "dr" ? "dr" : "bc"; }

Table1Cell CellOf(const std::string& method, const StudyCell& cell) {
  return {cell.task, SeesLogs(method) ? cell.dataset : "", method == "bc" ? "" : cell.parameters, method};
}

/// Of the algorithm that the study names.
json AgentSettings(const RunConfig& config) {
  CrossQConfig crossq = config.crossq;
  SacConfig sac = config.sac;
  return config.agents.algorithm == "crossq" ? crossq.Fields().ToJson() : sac.Fields().ToJson();
}

/// One seed of a cell, at work.
class Job {
 public:
  Job(const Table1Study& study, const Table1Cell& cell, int64_t seed, const fs::path& runs, LogSink& log, int n_threads,
      const RunContext& context)
      : cell_(cell),
        config_(study.ConfigOf(cell, seed)),
        runs_(runs),
        folder_(runs / cell.Name() / std::to_string(seed)),
        context_{&log, context.stop, n_threads} {
    config_.run.threads = n_threads;
  }

  json Run(const std::function<void(const fs::path&)>& run_complete) {
    if (cell_.method == "oted") return RunWhole(run_complete);
    factory_ = MakeSimulatorFactory(config_.task, config_.parameters);
    if (cell_.method == "bc") return RunClone(false);
    return cell_.method == "bc_dr" ? RunClone(true) : RunAgents();
  }

 private:
  fs::path PolicyFile() const { return folder_ / "policy.npz"; }

  /// As `oted run` evaluates: the same episodes, and so the same figures.
  json Judge() const {
    const std::unique_ptr<const Policy> policy = LoadPolicy(PolicyFile());
    const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("target");
    const PolicyEvaluation result = EvaluateBatchPolicy(*factory_, MeanActionPolicy(*policy), config_.TruthVector(),
                                                        config_.agents.target_episodes, context_.n_threads, key);
    return {{"mean_return", result.mean_return},
            {"std_return", result.std_return},
            {"n_diverged", result.n_diverged},
            {"score", factory_->spec().NormalizedScore(result.mean_return)}};
  }

  json RunAgents() {
    const RunDirectory directory(folder_);
    const json settings = AgentSettings(config_);
    json best;
    for (int j = 1; j <= config_.agents.n_agents; ++j) {
      const fs::path folder = directory.agent(j);
      const std::string fingerprint =
          Fingerprint({settings, config_.run.seed, config_.task.Identity(), factory_->model_sha256(),
                       ComparedIdentity(cell_.method, config_, factory_->parameters())});
      if (!directory.IsComplete(folder / "agent.json", fingerprint)) {
        const TrainingGround ground = ComparedGround(cell_.method, config_, *factory_);
        directory.Begin(folder, fingerprint);
        const LearningCurve curve =
            TrainAgentIn(ground, *factory_, config_, j, folder, directory.NameOf(folder), context_);
        json record = {{"schema", "oted.agent/1"},        {"agent", j},
                       {"baseline", cell_.method},        {"designed", false},
                       {"seed", config_.run.seed},        {"n_steps", settings.at("n_steps")},
                       {"eval_return", curve.eval_return}};
        for (const auto& [name, value] : ground.episodes->Figures()) record["episodes"][name] = value;
        directory.Complete(folder / "agent.json", record, fingerprint);
        directory.RemoveCheckpoint(folder);
      }
      const json agent = ReadJson(folder / "agent.json");
      if (best.is_null() || agent.at("eval_return") > best.at("eval_return")) best = agent;
    }
    LoadPolicy(directory.agent(best.at("agent").get<int>()) / "policy.npz")->Save(PolicyFile());
    json result = Judge();
    result["eval_return"] = best.at("eval_return");
    if (best.contains("episodes")) result["episodes"] = best.at("episodes");
    return result;
  }

  json RunClone(bool with_simulated) {
    const Dataset logs = ReadEpisodes(config_.data, factory_->spec());
    logs.CheckFits(config_.task.name, factory_->spec().obs_dim(), factory_->spec().act_dim);
    const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("clone");
    const auto clone = [&] {
      if (!with_simulated) return CloneBehavior(logs, factory_->spec(), config_.clone, key, "clone", context_);
      const std::string method = CollectorOf(config_);
      const Table1Cell collector = CellOf(method, {cell_.task, cell_.dataset, cell_.parameters});
      const auto policy = LoadPolicy(runs_ / collector.Name() / std::to_string(config_.run.seed) / "policy.npz");
      return CloneWithSimulated(logs, *factory_, *policy, config_.baselines.bc_dr.ratio, config_.clone,
                                BcDrKey(config_), "clone", context_);
    };
    clone().policy->Save(PolicyFile());
    json result = Judge();
    result["data_sha256"] = logs.sha256;
    result["n_transitions"] = logs.size();
    return result;
  }

  json RunWhole(const std::function<void(const fs::path&)>& run_complete) {
    Pipeline pipeline(config_, folder_, context_);
    pipeline.EvaluateInTarget();
    if (run_complete) run_complete(folder_);
    const json evaluation = ReadJson(folder_ / "evaluation.json"), design = ReadJson(folder_ / "design.json");
    json result;
    for (const json& policy : evaluation.at("policies")) {
      if (!policy.at("name").get<std::string>().starts_with("oted_")) continue;
      for (const char* key : {"mean_return", "std_return", "n_diverged", "score"}) result[key] = policy.at(key);
    }
    for (const json& parameter : evaluation.at("parameters")) {
      result["errors"][parameter.at("name").get<std::string>()] = parameter.at("absolute_error");
    }
    result["verdict"] = design.at("verdict");
    result["data_sha256"] = design.at("dataset").at("sha256");
    result["n_transitions"] = design.at("dataset").at("n_transitions");
    return result;
  }

  Table1Cell cell_;
  RunConfig config_;
  fs::path runs_, folder_;
  RunContext context_;
  std::unique_ptr<SimulatorFactory> factory_;
};

/// Passes a job's training on as the study's own progress, and its warnings with its name.
class JobSink : public NullSink {
 public:
  JobSink(LogSink& outer, std::string name) : outer_(outer), name_(std::move(name)) {}
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    if (stage == "train") outer_.Progress("table1", fmt::format("{} {}", name_, label), done, total, note);
  }
  void Warning(std::string_view message) override { outer_.Warning(fmt::format("{}: {}", name_, message)); }

 private:
  LogSink& outer_;
  std::string name_;
};

std::string LabelOf(const Table1Cell& cell, int64_t seed) { return fmt::format("{} seed {}", cell.Name(), seed); }

/// What a cell's results depend on, beside its seeds.
json IdentityOf(const Table1Study& study, const Table1Cell& cell) {
  const RunConfig config = study.ConfigOf(cell, study.first_seed);
  json identity = {{"task", cell.task},
                   {"dataset", cell.dataset.empty() ? json() : json(cell.dataset)},
                   {"parameters", cell.parameters.empty() ? json() : json(cell.parameters)},
                   {"method", cell.method},
                   {"steps", cell.method == "bc" ? json() : AgentSettings(config).at("n_steps")},
                   {"agents", cell.method == "bc" ? json() : json(config.agents.n_agents)},
                   {"assignments", study.assignments}};
  if (cell.method == "oted") identity["form"] = study.form;
  if (study.algorithm != "sac" && cell.method != "bc") identity["algorithm"] = study.algorithm;
  if (cell.method == "is" || cell.method == "undesigned") identity["start"] = config.agents.undesigned_at;
  return identity;
}

}  // namespace

std::string Table1Cell::Name() const {
  std::string name = task;
  for (const std::string& part : {dataset, parameters, method}) {
    if (!part.empty()) name += "-" + part;
  }
  return name;
}

const std::vector<std::string>& Table1Study::KnownMethods() {
  static const std::vector<std::string> known = {"bc", "dr", "is", "bc_dr", "oted", "undesigned"};
  return known;
}

void Table1Study::SetGuess(const std::string& assignment) {
  const size_t equals = assignment.find('=');
  char* end = nullptr;
  const double value = equals == std::string::npos ? 0 : std::strtod(assignment.c_str() + equals + 1, &end);
  const std::string name = assignment.substr(0, equals);
  if (equals == std::string::npos || equals + 1 == assignment.size() || *end != '\0' || !guess.contains(name)) {
    throw UsageError(fmt::format("--guess {}: wanted friction=, gain= or gravity= and a number", assignment));
  }
  guess[name] = value;
}

std::vector<Table1Cell> Table1Study::Cells() const {
  for (const std::string& method : methods) {
    if (std::ranges::find(KnownMethods(), method) != KnownMethods().end()) continue;
    throw UsageError(fmt::format("method '{}', wanted some of {}{}", method, fmt::join(KnownMethods(), "|"),
                                 DidYouMean(method, KnownMethods())));
  }
  DesignStudy study;
  study.tasks = tasks;
  study.datasets = datasets;
  study.parameters = parameters;
  std::vector<Table1Cell> cells;
  const auto add = [&](const Table1Cell& cell) {
    if (std::ranges::find(cells, cell) == cells.end()) cells.push_back(cell);
  };
  for (const StudyCell& at : study.Cells()) {
    for (const std::string& method : methods) {
      const Table1Cell cell = CellOf(method, at);
      if (method == "bc_dr") add(CellOf(CollectorOf(ConfigOf(cell, first_seed)), at));
      add(cell);
    }
  }
  return cells;
}

RunConfig Table1Study::ConfigOf(const Table1Cell& cell, int64_t seed) const {
  DesignStudy study;
  study.data_folder = data_folder;
  study.form = form;
  study.grid = false;
  study.assignments = {"agents.algorithm=" + algorithm, fmt::format("{}.n_steps={}", algorithm, steps),
                       "agents.n_agents=1", "agents.undesigned=false"};
  study.assignments.insert(study.assignments.end(), assignments.begin(), assignments.end());
  RunConfig config = study.ConfigOf({cell.task, cell.dataset, cell.parameters});
  config.task.Resolve();
  config.run.seed = seed;
  if (cell.dataset.empty()) config.data.path.clear();
  for (const ParameterSpec& spec : config.parameters) config.agents.undesigned_at.push_back(guess.at(spec.name));
  return config;
}

std::vector<json> RunTable1(const Table1Study& study, const fs::path& out, const std::string& command,
                            const Table1Hooks& hooks, const RunContext& context) {
  const std::vector<Table1Cell> cells = study.Cells();
  std::vector<CellRecord> records;
  struct Missing {
    size_t cell;
    int64_t seed;
    bool is_long;  // a whole run: it begins before the others, so that no core waits for it in the end
  };
  std::vector<Missing> first, second;  // bc_dr begins from what others leave
  for (const Table1Cell& cell : cells) {
    records.emplace_back(IdentityOf(study, cell), kTable1Schema, StudyFile(out), cell.Name(), command);
  }
  // The first seed of every cell comes before the second of any.
  for (int64_t seed = study.first_seed; seed < study.first_seed + study.n_seeds; ++seed) {
    for (size_t i = 0; i < cells.size(); ++i) {
      if (records[i].Has(seed)) continue;
      const RunConfig config = study.ConfigOf(cells[i], seed);
      config.baselines.Check();
      if (cells[i].method == "is") CheckIntervalSearch(config.baselines.is, SpecOf(config.task));
      if (!cells[i].dataset.empty() && !fs::exists(config.data.path)) {
        throw DataError(
            fmt::format("'{}' does not exist; name the folder with TASK-DATASET.hdf5 by --data", config.data.path));
      }
      ParameterSpace(config.parameters).CheckInside(config.agents.undesigned_at);
      (cells[i].method == "bc_dr" ? second : first).push_back({i, seed, cells[i].method == "oted"});
    }
  }
  std::stable_sort(first.begin(), first.end(), [](const Missing& a, const Missing& b) {
    return std::pair(a.seed, !a.is_long) < std::pair(b.seed, !b.is_long);
  });
  // The bar knows all the training before any of it starts.
  for (const Missing& job : first) {
    const RunConfig config = study.ConfigOf(cells[job.cell], job.seed);
    for (int j = 1; cells[job.cell].method != "bc" && j <= config.agents.n_agents; ++j) {
      JobSink(*context.log, LabelOf(cells[job.cell], job.seed))
          .Progress("train", fmt::format("agents/{}", j), 0, AgentSettings(config).at("n_steps"), "");
    }
  }
  std::mutex mutex;
  for (const std::vector<Missing>& jobs : {first, second}) {
    const int n_threads = std::max(1, context.n_threads / std::max(1, static_cast<int>(jobs.size())));
    ParallelFor(static_cast<int>(jobs.size()), context.n_threads, [&](int k) {
      context.ThrowIfStopped();
      const auto [i, seed, unused] = jobs[static_cast<size_t>(k)];
      const std::string name = cells[i].Name();
      JobSink progress(*context.log, LabelOf(cells[i], seed));
      const fs::path folder = out / "runs" / name / std::to_string(seed);
      const std::unique_ptr<LogSink> log = hooks.keep_curves ? hooks.keep_curves(folder, &progress) : nullptr;
      const auto start = std::chrono::steady_clock::now();
      Job job(study, cells[i], seed, out / "runs", log ? *log : progress, n_threads, context);
      json entry = job.Run(hooks.run_complete);
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      entry["seconds"] = std::round(10 * seconds.count()) / 10;
      const std::lock_guard lock(mutex);
      records[i].Add(seed, std::move(entry));
    });
  }
  std::vector<json> result;
  for (const CellRecord& record : records) result.push_back(record.record());
  return result;
}

}  // namespace oted
