#include "cli/verbs/evaluate.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cli/console.h"
#include "cli/options.h"
#include "cli/result.h"
#include "cli/session.h"
#include "cli/settings_help.h"
#include "cli/terminal.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/nn/onnx_hash.h"
#include "oted/nn/onnx_policy.h"
#include "oted/report/report.h"
#include "oted/rl/batch_policy.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/rl/policy_origin.h"
#include "oted/run/run_inputs.h"

namespace oted::cli {
namespace {

using nlohmann::json;

struct EvaluateOptions : Options {
  std::string policy;
};

void EvaluateRun(Program& program, const Options& options) {
  if (options.out.empty()) {
    throw UsageError("evaluate needs --out RUN_DIR for a study, or --policy FILE for one policy");
  }
  if (ResolveConfig(options).truth.empty()) {
    throw UsageError(
        "evaluate needs the truth of a study: add --truth name=value for every parameter, or a [truth] section");
  }
  {
    Session session(options, program.command_line);
    session.pipeline().EvaluateInTarget();
    WriteReport(options.out);
  }
  program.exit_code = PrintResult(options.out, options);
}

int Episodes(const std::string& text) {
  if (text.empty()) return 20;
  if (text.size() > 6 || text.find_first_not_of("0123456789") != std::string::npos || std::stoi(text) < 1) {
    throw UsageError(fmt::format("--episodes is '{}', wanted how many to run with --policy, at least 1", text));
  }
  return std::stoi(text);
}

/// The task that the options name, else the one that the policy says it was trained for.
TaskConfig TaskOf(const RunConfig& config, const std::string& policy) {
  if (!config.task.name.empty()) return config.task;
  if (policy.ends_with(".onnx")) {
    const auto metadata = OnnxPolicy::Load(policy).metadata();
    const auto task = metadata.find("task");
    if (task != metadata.end()) return TaskConfig::FromArgument(Printable(task->second));
  }
  throw UsageError(fmt::format("'{}' does not say its task; add --task", policy));
}

/// A file that describes the whole study says what its target is, as for collect and behavior; the command line has the
/// last word.
void TakeStudy(const RunConfig& study, RunConfig& config) {
  if (config.data.empty()) config.data = study.data;
  if (!config.parameters.empty()) return;
  config.parameters = study.parameters;
  std::map<std::string, double> truth = study.truth;
  for (const auto& [name, value] : config.truth) truth[name] = value;
  config.truth = std::move(truth);
}

std::string PolicySha256(const std::string& policy) {
  return policy.ends_with(".onnx") ? Sha256OfOnnx(policy) : Sha256OfFile(policy);
}

const char* EpisodeEnd(const EpisodeResult& episode) {
  if (episode.diverged()) return "diverged";
  return episode.end == LaneStatus::kTerminated ? "terminated" : "time limit";
}

void EvaluateFile(const EvaluateOptions& options) {
  RunConfig config = ResolveConfig(options);
  config.task.Resolve();
  config.task = TaskOf(config, options.policy);
  if (options.task.ends_with(".toml")) TakeStudy(RunConfig::FromTomlFile(options.task), config);
  const auto factory = MakeSimulatorFactory(config.task, config.parameters, LoggedStarts(config));
  const std::vector<double> z = TargetParameters(factory->parameters(), config.truth);
  factory->parameters().CheckInside(z);
  const int n_episodes = Episodes(options.episodes);
  NullSink log;
  const RngKey key = RngKey(static_cast<uint64_t>(config.run.seed)).Stage("evaluate");
  const BatchPolicy policy =
      LoadBatchPolicy(options.policy, factory->spec(), config.algorithms.ppo.evaluate, key.Stage("actions").MakeRng());
  std::vector<std::string> warnings = OtherThanItsTask(options.policy, factory->spec());
  for (std::string& w : warnings) w = fmt::format("{}; its actions may mean something else there", w);
  const PolicyEvaluation result =
      EvaluateBatchPolicy(*factory, policy, z, n_episodes, MakeContext(log, config.run.threads).n_threads, key);
  const SimulatorSpec& spec = factory->spec();
  const json score = spec.has_score() ? json(spec.NormalizedScore(result.mean_return)) : json();
  if (options.json) {
    json parameters = json::object(), episodes = json::array();
    for (int i = 0; i < factory->parameters().size(); ++i) {
      parameters[factory->parameters()[i].name] = z[static_cast<size_t>(i)];
    }
    for (const EpisodeResult& e : result.episodes) {
      episodes.push_back({{"return", e.episode_return}, {"length", e.n_steps}, {"end", EpisodeEnd(e)}});
    }
    Print("{}\n", json{{"schema", "oted.policy_evaluation/1"},
                       {"policy", options.policy},
                       {"policy_sha256", PolicySha256(options.policy)},
                       {"task", config.task.name},
                       {"parameters", parameters},
                       {"seed", config.run.seed},
                       {"mean_return", result.mean_return},
                       {"std_return", result.std_return},
                       {"min_return", result.min_return},
                       {"max_return", result.max_return},
                       {"score", score},
                       {"mean_length", result.mean_length},
                       {"n_diverged", result.n_diverged},
                       {"episodes", episodes},
                       {"warnings", warnings}}
                      .dump(2));
    return;
  }
  TerminalSink console(false);
  for (const std::string& warning : warnings) console.Warning(warning);
  Print("{} in {}{}, {} episodes\n", options.policy, config.task.name, AtParameters(factory->parameters(), z),
        n_episodes);
  const int decimals = ReturnDecimals({result.min_return, result.max_return}, 1);
  Print("return   {:.{}f} +- {:.{}f}, from {:.{}f} to {:.{}f}\n", result.mean_return, decimals, result.std_return,
        decimals, result.min_return, decimals, result.max_return, decimals);
  if (!score.is_null()) Print("score    {:.1f}\n", score.get<double>());
  Print("length   {:.1f} control steps; {} terminated, {} at the time limit, {} diverged\n", result.mean_length,
        result.n_terminated, result.n_truncated, result.n_diverged);
}

}  // namespace

void AddEvaluateVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "evaluate", "run every policy in a target with a known truth; with --policy, run one policy file in a simulator");
  auto options = std::make_shared<EvaluateOptions>();
  AddRunOptions(*verb, *options);
  verb->get_option("--out")->required(false);
  verb->get_option("--episodes")
      ->description("episodes of the data to use; with --policy: episodes to run [default: 20]");
  verb->add_option("--policy", options->policy,
                   "policy.npz, or policy.onnx of this or another program: runs its deterministic action, or as "
                   "ppo.evaluate says where actions are discrete, at nominal parameters, or at those of --param and "
                   "--truth; needs no --out, and --data only where task.start is \"logs\"");
  verb->footer(SettingsHelp({"agents", "ppo", "baselines"}));
  verb->callback([&program, options] {
    if (options->policy.empty()) {
      EvaluateRun(program, *options);
    } else {
      EvaluateFile(*options);
    }
  });
}

}  // namespace oted::cli
