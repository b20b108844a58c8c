#include "oted/studies/table1_study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
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
#include "oted/run/agents_step.h"
#include "oted/run/fingerprint.h"
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

std::optional<OfflineBaseline> OfflineOf(Table1Method method) {
  switch (method) {
    case Table1Method::kFisherBrc:
      return OfflineBaseline::kFisherBrc;
    case Table1Method::kMbop:
      return OfflineBaseline::kMbop;
    case Table1Method::kTd3Bc:
      return OfflineBaseline::kTd3Bc;
    case Table1Method::kRebrac:
      return OfflineBaseline::kRebrac;
    default:
      return std::nullopt;
  }
}

/// Methods that need no simulator.
bool IsOffline(Table1Method method) { return method == Table1Method::kBc || OfflineOf(method); }

bool SeesLogs(Table1Method method) {
  return IsOffline(method) || method == Table1Method::kBcDr || method == Table1Method::kOted;
}

/// The method whose work BC+DR begins from.
Table1Method CollectorOf(const RunConfig& config) {
  return config.baselines.bc_dr.collector == Collector::kRandomizedAgent ? Table1Method::kDr : Table1Method::kBc;
}

/// Where the agents of a method train that is no design.
Ground GroundOf(Table1Method method) {
  switch (method) {
    case Table1Method::kDr:
      return Ground::kDomainRandomization;
    case Table1Method::kIs:
      return Ground::kIntervalSearch;
    case Table1Method::kNominal:
      return Ground::kNominal;
    default:
      throw InternalError("a method without agents of its own");
  }
}

Table1Cell CellOf(Table1Method method, const StudyCell& cell) {
  return {cell.task, SeesLogs(method) ? cell.dataset : "", IsOffline(method) ? "" : cell.parameters, method};
}

/// The algorithm that the study names, and its settings.
const AlgorithmEntry& AlgorithmOf(const RunConfig& config) {
  return EntryOf(config.agents.algorithm.value_or(AgentAlgorithm::kSac));
}
json AgentSettings(const RunConfig& config) {
  AlgorithmSettings settings = config.algorithms;
  return AlgorithmOf(config).fields(settings).ToJson();
}

/// One seed of a cell, at work.
class Job {
 public:
  Job(const Table1Study& study, const Table1Cell& cell, int64_t seed, const fs::path& runs, const RunContext& context)
      : cell_(cell),
        config_(study.ConfigOf(cell, seed)),
        runs_(runs),
        folder_(runs / cell.Name() / std::to_string(seed)),
        context_(context) {
    config_.run.threads = context.n_threads;
  }

  json Run(const std::function<void(const fs::path&)>& run_complete) {
    if (cell_.method == Table1Method::kOted) return RunWhole(run_complete);
    factory_ = MakeSimulatorFactory(config_.task, config_.parameters);
    if (!SeesLogs(cell_.method)) return RunAgents();
    if (const auto baseline = OfflineOf(cell_.method)) return RunOffline(*baseline);
    return RunClone(cell_.method == Table1Method::kBcDr);
  }

 private:
  fs::path PolicyFile() const { return folder_ / "policy.npz"; }

  /// As `oted run` evaluates: the same episodes, and so the same figures.
  json Judge() const {
    const std::unique_ptr<const Policy> policy = LoadPolicy(PolicyFile());
    const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("target");
    Rng rng = key.Stage(NameOf(Table1MethodNames(), cell_.method)).MakeRng();
    const PolicyEvaluation result =
        EvaluateBatchPolicy(*factory_, AsBatchPolicy(*policy, ActionNoise::kMean, rng), config_.TruthVector(),
                            config_.agents.target_episodes, context_.n_threads, key);
    return {{"mean_return", result.mean_return},
            {"std_return", result.std_return},
            {"n_diverged", result.n_diverged},
            {"score", factory_->spec().NormalizedScore(result.mean_return)}};
  }

  TrainedRecord RunAgent(const RunDirectory& directory, int index) const {
    const fs::path folder = directory.agent(index);
    const Ground ground = GroundOf(cell_.method);
    const Artifact artifact{.file = folder / "agent.json",
                            .schema = AgentRecord::kSchema,
                            .fingerprint = Fingerprint({AgentSettings(config_), config_.run.seed,
                                                        config_.task.Identity(), factory_->model_sha256(),
                                                        ComparedIdentity(ground, config_, factory_->parameters())}),
                            .files = {"policy.npz"}};
    TrainedRecord agent;
    agent.record = OnceAs<AgentRecord>(directory, artifact, [&] {
      agent = TrainOneAgent({*factory_, config_, ground, index, folder, directory.NameOf(folder), context_},
                            ComparedGround(ground, config_, *factory_));
      return agent.record;
    });
    if (agent.policy == nullptr) agent.policy = LoadPolicy(folder / "policy.npz");
    return agent;
  }

  json RunAgents() {
    const RunDirectory directory(folder_, context_.log);
    TrainedRecord best;
    for (int j = 1; j <= config_.agents.n_agents; ++j) {
      TrainedRecord agent = RunAgent(directory, j);
      if (best.policy == nullptr || agent.record.eval_return > best.record.eval_return) best = std::move(agent);
    }
    best.policy->Save(PolicyFile());
    json result = Judge();
    result["eval_return"] = best.record.eval_return;
    for (const auto& [name, value] : best.record.episodes) result["episodes"][name] = value;
    return result;
  }

  Dataset Logs() const {
    Dataset logs = ReadEpisodes(config_.data, factory_->spec());
    logs.CheckFits(config_.task.name, factory_->spec().obs_dim(), factory_->spec().act_dim);
    return logs;
  }

  json RunOffline(OfflineBaseline baseline) {
    const Dataset logs = Logs();
    const OfflineEntry& entry = EntryOf(baseline);
    const RunDirectory directory(folder_);
    const fs::path folder = directory.baseline(entry.name);
    OfflineSettings settings = config_.baselines.offline;
    const Artifact artifact{folder / "offline.json", OfflineRecord::kSchema,
                            Fingerprint({entry.fields(settings).ToJson(), config_.run.seed, config_.task.Identity(),
                                         logs.sha256, config_.data.episodes})};
    OnceAs<OfflineRecord>(directory, artifact, [&] {
      return LearnOneBaseline({config_, logs, factory_->spec(), baseline, folder, directory.NameOf(folder), context_})
          .record;
    });
    LoadPolicy(folder / "policy.npz")->Save(PolicyFile());
    json result = Judge();
    result["data_sha256"] = logs.sha256;
    result["n_transitions"] = logs.size();
    return result;
  }

  json RunClone(bool with_simulated) {
    const Dataset logs = Logs();
    const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("clone");
    const auto clone = [&] {
      CloneJob job{logs, factory_->spec(), config_.clone, key, "clone", context_};
      if (!with_simulated) return CloneBehavior(job);
      job.key = BaselineKey(config_, "bc_dr");
      const Table1Cell collector = CellOf(CollectorOf(config_), {cell_.task, cell_.dataset, cell_.parameters});
      const auto policy = LoadPolicy(runs_ / collector.Name() / std::to_string(config_.run.seed) / "policy.npz");
      return CloneWithSimulated(job, *factory_, *policy, config_.baselines.bc_dr.ratio);
    };
    clone().policy->Save(PolicyFile());
    json result = Judge();
    result["data_sha256"] = logs.sha256;
    result["n_transitions"] = logs.size();
    return result;
  }

  json RunWhole(const std::function<void(const fs::path&)>& run_complete) {
    Pipeline pipeline(config_, folder_, context_);
    const std::optional<EvaluationRecord>& evaluation = pipeline.EvaluateInTarget();
    if (run_complete) run_complete(folder_);
    OTED_CHECK(evaluation);
    json result;
    for (const EvaluationRecord::PolicyResult& policy : evaluation->policies) {
      if (!policy.name.starts_with("oted_")) continue;
      result = {{"mean_return", policy.mean_return},
                {"std_return", policy.std_return},
                {"n_diverged", policy.n_diverged},
                {"score", policy.score ? json(*policy.score) : json()}};
    }
    for (const EvaluationRecord::Parameter& parameter : evaluation->parameters) {
      result["errors"][parameter.name] = parameter.absolute_error;
    }
    const DesignRecord& design = pipeline.SelectSimulator().record;
    result["verdict"] = ToString(design.verdict);
    result["data_sha256"] = design.dataset.sha256;
    result["n_transitions"] = design.dataset.n_transitions;
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
  const bool has_agents = !IsOffline(cell.method);
  json identity = {{"task", cell.task},
                   {"dataset", cell.dataset.empty() ? json() : json(cell.dataset)},
                   {"parameters", cell.parameters.empty() ? json() : json(cell.parameters)},
                   {"method", NameOf(Table1MethodNames(), cell.method)},
                   {"steps", has_agents ? AgentSettings(config).at("n_steps") : json()},
                   {"agents", has_agents ? json(config.agents.n_agents) : json()},
                   {"assignments", study.assignments}};
  if (cell.method == Table1Method::kOted) identity["design_method"] = study.design_method;
  if (config.agents.algorithm != AgentAlgorithm::kSac && has_agents) identity["algorithm"] = study.algorithm;
  if (cell.method == Table1Method::kIs || cell.method == Table1Method::kNominal) {
    identity["start"] = config.agents.nominal_at;
  }
  return identity;
}

}  // namespace

std::string Table1Cell::Name() const {
  std::string name = task;
  for (const std::string& part : {dataset, parameters, NameOf(Table1MethodNames(), method)}) {
    if (!part.empty()) name += "-" + part;
  }
  return name;
}

const NamedValues<Table1Method>& Table1MethodNames() {
  static const NamedValues<Table1Method> names = [] {
    NamedValues<Table1Method> all = {{Table1Method::kBc, "bc"}};
    for (const Table1Method method :
         {Table1Method::kFisherBrc, Table1Method::kMbop, Table1Method::kTd3Bc, Table1Method::kRebrac}) {
      all.emplace_back(method, EntryOf(*OfflineOf(method)).name);
    }
    for (const auto& [method, name] : NamedValues<Table1Method>{{Table1Method::kDr, "dr"},
                                                                {Table1Method::kIs, "is"},
                                                                {Table1Method::kBcDr, "bc_dr"},
                                                                {Table1Method::kOted, "oted"},
                                                                {Table1Method::kNominal, "nominal"}}) {
      all.emplace_back(method, name);
    }
    return all;
  }();
  return names;
}

const std::vector<std::string>& Table1Study::KnownMethods() {
  static const std::vector<std::string> known = [] {
    std::vector<std::string> names;
    for (const auto& [unused, name] : Table1MethodNames()) names.push_back(name);
    return names;
  }();
  return known;
}

std::vector<Table1Cell> Table1Study::Cells() const {
  std::vector<Table1Method> wanted;
  for (const std::string& method : methods) {
    const auto known = std::ranges::find(Table1MethodNames(), method, &std::pair<Table1Method, std::string>::second);
    if (known == Table1MethodNames().end()) {
      throw UsageError(fmt::format("method '{}', wanted some of {}{}", method, fmt::join(KnownMethods(), "|"),
                                   DidYouMean(method, KnownMethods())));
    }
    wanted.push_back(known->first);
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
    for (const Table1Method method : wanted) {
      const Table1Cell cell = CellOf(method, at);
      if (method == Table1Method::kBcDr) add(CellOf(CollectorOf(ConfigOf(cell, first_seed)), at));
      add(cell);
    }
  }
  return cells;
}

RunConfig Table1Study::ConfigOf(const Table1Cell& cell, int64_t seed) const {
  DesignStudy study;
  study.data_folder = data_folder;
  study.design_method = design_method;
  study.grid = false;
  study.assignments = {"agents.algorithm=" + algorithm, fmt::format("{}.n_steps={}", algorithm, steps),
                       "agents.n_agents=1", "agents.nominal=false"};
  study.assignments.insert(study.assignments.end(), assignments.begin(), assignments.end());
  RunConfig config = study.ConfigOf({cell.task, cell.dataset, cell.parameters});
  config.task.Resolve();
  config.run.seed = seed;
  if (cell.dataset.empty()) config.data.path.clear();
  for (const ParameterSpec& spec : config.parameters) config.agents.nominal_at.push_back(guess.at(spec.name));
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
      if (cells[i].method == Table1Method::kIs) CheckIntervalSearch(config.baselines.is, SpecOf(config.task));
      if (!cells[i].dataset.empty() && !fs::exists(config.data.path)) {
        throw DataError(
            fmt::format("'{}' does not exist; name the folder with TASK-DATASET.hdf5 by --data", config.data.path));
      }
      ParameterSpace(config.parameters).CheckInside(config.agents.nominal_at);
      (cells[i].method == Table1Method::kBcDr ? second : first)
          .push_back({i, seed, cells[i].method == Table1Method::kOted});
    }
  }
  std::stable_sort(first.begin(), first.end(), [](const Missing& a, const Missing& b) {
    return std::pair(a.seed, !a.is_long) < std::pair(b.seed, !b.is_long);
  });
  // The bar knows all the training before any of it starts.
  for (const Missing& job : first) {
    const RunConfig config = study.ConfigOf(cells[job.cell], job.seed);
    for (int j = 1; !IsOffline(cells[job.cell].method) && j <= config.agents.n_agents; ++j) {
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
      Job job(study, cells[i], seed, out / "runs", {log ? log.get() : &progress, context.stop, n_threads});
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
