#include "cli/verbs/collect.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/options.h"
#include "cli/result.h"
#include "cli/session.h"
#include "cli/settings_help.h"
#include "cli/value_kinds.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/statistics.h"
#include "oted/collect/collect.h"
#include "oted/collect/demonstrations.h"
#include "oted/data/dataset_files.h"
#include "oted/nn/onnx_export.h"
#include "oted/rl/batch_policy.h"
#include "oted/run/run_inputs.h"
#include "oted/run/run_lock.h"

namespace oted::cli {

namespace {

struct CollectOptions : Options {
  std::vector<std::string> policies;
  std::string output;
  int n_episodes = 5;
  double noise = 0;
};

/// The task, its parameters and their true values. A file that describes the whole study says what its target is.
RunConfig TargetOf(const Options& options, double noise = 0) {
  RunConfig config = options.task.ends_with(".toml") ? RunConfig::FromTomlFile(options.task) : RunConfig();
  config.task = TaskConfig::FromArgument(options.task);
  if (!options.parameters.empty()) config.parameters.clear();
  for (const std::string& text : options.parameters) config.parameters.push_back(ParseParameterSpec(text));
  if (!options.parameters.empty()) config.truth.clear();
  for (const std::string& text : options.truth) config.SetTruth(text);
  if (noise > 0) {
    // A name that no parameter of the user's can have.
    const std::string name = "--noise";
    config.parameters.push_back(
        {.name = name, .field = "obs/*/noise_std", .low = 0, .high = noise, .scale = ParameterScale::kAbsolute});
    config.truth[name] = noise;
  }
  return config;
}

void AddTargetOptions(CLI::App& verb, Options& options) {
  verb.add_option("--param", options.parameters,
                  "a parameter that differs from nominal: name=path:low:high; repeatable; default: [parameters] of "
                  "--task's file");
  verb.add_option("--truth", options.truth,
                  "name=value, in place of [truth] of --task's file; repeatable; parameters without: nominal")
      ->allow_extra_args(false);
}

/// @throws UsageError where the output would take the place of the logs that the task's file is about
void CheckKeepsLogs(const RunConfig& config, const CollectOptions& options) {
  for (const std::string& log : config.data.AllFiles()) {
    std::error_code none;
    if (!std::filesystem::equivalent(log, options.output, none)) continue;
    throw UsageError(fmt::format("'{}' holds the logs that '{}' names as its data; choose another --out, or remove it",
                                 options.output, options.task));
  }
}

void Collect(const CollectOptions& options) {
  const RunConfig config = TargetOf(options, options.noise);
  CheckKeepsLogs(config, options);
  const auto factory = MakeSimulatorFactory(config.task, config.parameters, LoggedStarts(config));
  NullSink log;
  const CollectJob job{.factory = *factory,
                       .z = TargetParameters(factory->parameters(), config.truth),
                       .policies = options.policies,
                       .n_episodes = options.n_episodes,
                       .key = RngKey(SeedOf(options.seed)).Stage("collect"),
                       .n_threads = MakeContext(log, options.threads).n_threads};
  const Dataset dataset = Collect(job);
  WriteDataset(dataset, options.output, WriteOptionsFor(factory->spec(), options.task));
  const std::vector<double> returns = dataset.EpisodeReturns();
  Print("{}: {} transitions in {} episodes{}\n", options.output, dataset.size(), dataset.Episodes().size(),
        returns.empty() ? "" : fmt::format(", mean return {:.{}f}", Mean(returns), ReturnDecimals(returns, 1)));
}

}  // namespace

void AddCollectVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "collect", "log demonstrations in a simulated target, with a policy or with excitation");
  auto options = std::make_shared<CollectOptions>();
  verb->add_option("--task", options->task, kTaskHelp)->type_name(value_kind::kTask)->required();
  verb->add_option(
          "--policy", options->policies,
          "policy.npz, or open-loop excitation: random, noise:STD[:SECONDS], sine[:AMPLITUDE] (fractions of the "
          "action range), or expert or medium for a MiniGrid task; two policies share the episodes")
      ->required();
  AddTargetOptions(*verb, *options);
  verb->add_option("--episodes", options->n_episodes, "episodes to log")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb->add_option("--noise", options->noise,
                   "standard deviation of sensor noise on every observation, in its own unit; the policy "
                   "sees it too [default: none]")
      ->check(PositiveNumber());
  AddSeed(*verb, options->seed);
  AddThreads(*verb, options->threads);
  verb->add_option("--out", options->output, "dataset to write: .hdf5 (D4RL layout), .npz, .csv, or NAME-v0 (Minari)")
      ->required();
  verb->callback([options] { Collect(*options); });
}

namespace {

struct BehaviorOptions : Options {
  std::string algorithm = "sac";
};

/// The settings of a file that describes the task, then those of the command line.
std::variant<SacConfig, CrossQConfig> AgentOf(const BehaviorOptions& options, RunConfig config) {
  for (const std::string& assignment : options.assignments) {
    if (!assignment.starts_with(options.algorithm + ".")) {
      const bool has_section = assignment.find('.') < assignment.find('=');
      throw UsageError(fmt::format("--set {}: only settings of {}, which trains here, mean anything: {}", assignment,
                                   options.algorithm,
                                   has_section ? "see --algorithm" : options.algorithm + "." + assignment));
    }
    config.Set(assignment);
  }
  if (options.algorithm == "crossq") {
    config.algorithms.crossq.CheckLearns("crossq");
    return config.algorithms.crossq;
  }
  config.algorithms.sac.CheckLearns("sac");
  return config.algorithms.sac;
}

void TrainBehavior(const BehaviorOptions& options) {
  const RunConfig target = TargetOf(options);
  const TaskConfig& task = target.task;
  const auto agent = AgentOf(options, target);
  const Array2<double> starts = LoggedStarts(target);
  const auto factory = MakeSimulatorFactory(task, target.parameters, starts);
  if (factory->has_expert()) {
    throw UsageError(
        fmt::format("task '{}' has its expert and medium policy built in: oted collect --policy expert", task.name));
  }
  if (!factory->spec().has_reward) {
    throw UsageError(
        fmt::format("task '{}' has no reward to train a policy with; add task.reward = \"...\"", task.name));
  }
  nlohmann::json identity = task.Identity();
  if (starts.rows() > 0) {
    const auto bytes = std::as_bytes(starts.values());
    identity["starts"] = Sha256({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  MakeFolders(options.out);
  const RunLock lock(options.out);
  BehaviorPolicies policies;
  {
    TerminalSink terminal(options.quiet);
    FileSink log(options.out, &terminal);
    policies = TrainBehaviorPolicies({.factory = *factory,
                                      .task = identity,
                                      .z = TargetParameters(factory->parameters(), target.truth),
                                      .agent = agent,
                                      .seed = SeedOf(options.seed)},
                                     options.out, MakeContext(log, options.threads));
  }
  WriteOnnx(policies.expert, PolicyMetadata(factory->spec(), fmt::format("behavior of seed {}", SeedOf(options.seed))),
            std::filesystem::path(options.out) / "expert.onnx");
  Print("{}{}: expert {:.1f} at {} steps, medium {:.1f} at {}{}, random {:.1f}\n", task.name,
        AtParameters(factory->parameters(), TargetParameters(factory->parameters(), target.truth)),
        policies.expert_return, policies.expert_step, policies.medium_return, policies.medium_step,
        policies.medium_is_near ? "" : " (none was near a third of the way up)", policies.random_return);
}

}  // namespace

void AddBehaviorVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "behavior", "train an agent in one simulator: the expert and medium policy of a study");
  auto options = std::make_shared<BehaviorOptions>();
  verb->add_option("--task", options->task, kTaskHelp)->type_name(value_kind::kTask)->required();
  AddTargetOptions(*verb, *options);
  AddSeed(*verb, options->seed);
  AddThreads(*verb, options->threads);
  verb->add_option("--out", options->out, "folder for expert.npz, expert.onnx, medium.npz and training.json")
      ->required();
  verb->add_option("--algorithm", options->algorithm, "sac (the shipped policies') or crossq")
      ->check(CLI::IsMember({"sac", "crossq"}))
      ->capture_default_str();
  verb->add_option("--set", options->assignments, "sac.key=value or crossq.key=value; repeatable")
      ->type_name(value_kind::kSetting)
      ->allow_extra_args(false);
  verb->add_flag("--quiet", options->quiet, "no progress on stderr");
  verb->footer(SettingsHelp({"sac", "crossq"}));
  verb->callback([options] { TrainBehavior(*options); });
}

}  // namespace oted::cli
