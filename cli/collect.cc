// oted collect: demonstrations of a policy in a target. oted behavior: the policies themselves.

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "cli/options.h"
#include "cli/verbs.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/collect/demonstrations.h"
#include "oted/collect/excitation.h"
#include "oted/data/dataset_files.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/task_policy.h"

namespace oted::cli {

namespace {

struct CollectOptions : Options {
  std::vector<std::string> policies;
  std::string output;
  int n_episodes = 5;
  double noise = 0;
};

/// The task, its parameters and their true values. A file that describes the whole study says what its target is.
RunConfig TargetOf(const CollectOptions& options) {
  RunConfig config = options.task.ends_with(".toml") ? RunConfig::FromTomlFile(options.task) : RunConfig();
  config.task = TaskConfig::FromArgument(options.task);
  if (!options.parameters.empty()) config.parameters.clear();
  for (const std::string& text : options.parameters) config.parameters.push_back(ParseParameterSpec(text));
  if (!options.truth.empty() || !options.parameters.empty()) config.truth.clear();
  for (const std::string& text : options.truth) config.SetTruth(text);
  if (options.noise > 0) {
    // A name that no parameter of the user's can have.
    const std::string name = "--noise";
    config.parameters.push_back({.name = name,
                                 .field = "obs/*/noise_std",
                                 .low = 0,
                                 .high = options.noise,
                                 .scale = ParameterScale::kAbsolute});
    config.truth[name] = options.noise;
  }
  return config;
}

/// `n` episodes of the policy that `name` stands for: one of the task's own, an excitation, or a file.
Dataset CollectNamed(const std::string& name, const SimulatorFactory& factory, const std::vector<double>& z, int n,
                     RngKey key, int n_threads) {
  const SimulatorSpec& spec = factory.spec();
  if (factory.has_expert()) {
    const TaskPolicy policy = TaskPolicyNamed(name);
    return n > 0 ? CollectTaskPolicy(factory, z, policy, n, key, n_threads) : Dataset();
  }
  if (const auto excitation = Excitation::Parse(name)) {
    return n > 0 ? CollectExcitation(factory, z, *excitation, n, key, n_threads) : Dataset();
  }
  const TanhGaussianPolicy policy = TanhGaussianPolicy::Load(name);
  if (policy.obs_dim() != spec.obs_dim() || policy.act_dim() != spec.act_dim) {
    throw DataError(fmt::format(
        "policy '{}' maps {} observations to {} actions, task '{}' has {} and {}; name a policy of this task", name,
        policy.obs_dim(), policy.act_dim(), spec.task, spec.obs_dim(), spec.act_dim));
  }
  return n > 0 ? CollectDemonstrations(factory, z, policy, n, key, n_threads) : Dataset();
}

void Write(Dataset& dataset, const SimulatorSpec& spec, const CollectOptions& options) {
  dataset.period_s = spec.control_period_s;
  dataset.observation_names = spec.observation_names;
  dataset.action_names = spec.action_names;
  WriteOptions write;
  write.environment = options.task;
  write.action_low = spec.action_low;
  write.action_high = spec.action_high;
  write.n_discrete_actions = spec.n_discrete_actions;
  if (!spec.image_shape.empty() && !spec.observation_levels.empty()) {
    write.image_shape = spec.image_shape;
    write.index_name = "direction";  // as Minigrid's own observations call it
    write.n_index = spec.observation_levels.back();
  }
  WriteDataset(dataset, options.output, write);
}

void Collect(const CollectOptions& options) {
  const RunConfig config = TargetOf(options);
  const auto factory = MakeSimulatorFactory(config.task, config.parameters);
  const std::vector<double> z = TargetParameters(factory->parameters(), config.truth);
  NullSink log;
  const RunContext context = MakeContext(log, options.threads);
  const RngKey key = RngKey(static_cast<uint64_t>(std::max(1L, options.seed))).Stage("collect");
  Dataset dataset;
  const int n_policies = static_cast<int>(options.policies.size());
  for (int p = 0; p < n_policies; ++p) {
    // Two policies share the episodes; the later one takes what is odd: medium-expert is two medium and three expert.
    const int n = options.n_episodes * (p + 1) / n_policies - options.n_episodes * p / n_policies;
    const Dataset logs = CollectNamed(options.policies[static_cast<size_t>(p)], *factory, z, n,
                                      key.Index(static_cast<uint64_t>(p)), context.n_threads);
    if (logs.size() > 0) dataset.Append(logs);
  }
  Write(dataset, factory->spec(), options);
  double sum = 0;
  const std::vector<double> returns = dataset.EpisodeReturns();
  for (const double r : returns) sum += r;
  const int decimals = ReturnDecimals(returns, 1);
  fmt::print(
      "{}: {} transitions in {} episodes{}\n", options.output, dataset.size(), dataset.Episodes().size(),
      returns.empty() ? "" : fmt::format(", mean return {:.{}f}", sum / static_cast<double>(returns.size()), decimals));
}

}  // namespace

void AddCollectVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("collect", "log demonstrations of a policy in a simulator that stands for the target");
  auto options = std::make_shared<CollectOptions>();
  verb->add_option("--task", options->task, kTaskHelp)->required();
  verb->add_option(
          "--policy", options->policies,
          "policy.npz, or open-loop excitation: random, noise:STD[:SECONDS], sine[:AMPLITUDE] (fractions of the "
          "action range), or expert or medium for a MiniGrid task; give two to draw half of the episodes from each")
      ->required();
  verb->add_option("--param", options->parameters,
                   "a parameter that differs from nominal: name=path:low:high; repeatable; default: [parameters] of "
                   "--task's file");
  verb->add_option("--truth", options->truth,
                   "name=value for every parameter; repeatable; default: [truth] of --task's file")
      ->allow_extra_args(false);
  verb->add_option("--episodes", options->n_episodes, "episodes to log")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  verb->add_option(
          "--noise", options->noise,
          "standard deviation of the sensors' noise, the same on every observation and in its unit; the policy "
          "sees it too [default: none]")
      ->check(CLI::PositiveNumber);
  verb->add_option("--seed", options->seed, "names every random stream [default: 1]");
  verb->add_option("--threads", options->threads, "threads at most [default: all processors]");
  verb->add_option("--out", options->output, "dataset to write: .hdf5 (D4RL layout), .npz, .csv, or NAME-v0 (Minari)")
      ->required();
  verb->callback([options] { Collect(*options); });
}

void AddBehaviorVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("behavior", "train the medium and the expert behaviour policy of a study");
  struct BehaviorOptions : Options {
    std::string algorithm = "sac";
  };
  auto options = std::make_shared<BehaviorOptions>();
  verb->add_option("--task", options->task, kTaskHelp)->required();
  verb->add_option("--seed", options->seed, "names every random stream [default: 1]");
  verb->add_option("--threads", options->threads, "threads at most [default: all processors]");
  verb->add_option("--out", options->out, "folder for expert.npz, medium.npz and training.json")->required();
  verb->add_option("--algorithm", options->algorithm, "sac (the shipped policies') or crossq")
      ->check(CLI::IsMember({"sac", "crossq"}))
      ->capture_default_str();
  verb->add_option("--set", options->assignments, "sac.key=value or crossq.key=value; repeatable")
      ->allow_extra_args(false);
  verb->add_flag("--quiet", options->quiet, "no progress on stderr");
  verb->footer(SettingsHelp({"sac", "crossq"}));
  verb->callback([options] {
    RunConfig config;
    for (const std::string& assignment : options->assignments) config.Set(assignment);
    const TaskConfig task = TaskConfig::FromArgument(options->task);
    const auto factory = MakeSimulatorFactory(task, {});
    if (factory->has_expert()) {
      throw UsageError(
          fmt::format("task '{}' has its expert and medium policy built in: oted collect --policy expert", task.name));
    }
    if (!factory->spec().has_reward) {
      throw UsageError(
          fmt::format("task '{}' has no reward to train a policy with; add task.reward = \"...\"", task.name));
    }
    TerminalSink terminal(options->quiet);
    FileSink log(options->out, &terminal);
    std::variant<SacConfig, CrossQConfig> agent = config.sac;
    if (options->algorithm == "crossq") agent = config.crossq;
    const BehaviorPolicies policies =
        TrainBehaviorPolicies(*factory, agent, static_cast<uint64_t>(std::max(1L, options->seed)), options->out,
                              MakeContext(log, options->threads));
    fmt::print("{}: expert {:.1f} at {} steps, medium {:.1f} at {}, random {:.1f}\n", task.name, policies.expert_return,
               policies.expert_step, policies.medium_return, policies.medium_step, policies.random_return);
  });
}

}  // namespace oted::cli
