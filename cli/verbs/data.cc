#include "cli/verbs/data.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "cli/data_report.h"
#include "cli/numbers.h"
#include "cli/options.h"
#include "cli/session.h"
#include "cli/value_kinds.h"
#include "oted/base/error.h"
#include "oted/checks/data_check.h"
#include "oted/checks/data_record.h"
#include "oted/data/dataset_files.h"
#include "oted/data/episode_choice.h"
#include "oted/data/sensor_noise.h"
#include "oted/run/run_inputs.h"

namespace oted::cli {
namespace {

/// The study that the options name: a file that describes it (as PATH or with --task) says how its logs are read.
RunConfig StudyOf(const Options& options) {
  const bool path_is_study = options.data.ends_with(".toml");
  const std::string file = path_is_study ? options.data : options.task;
  RunConfig config = file.ends_with(".toml") ? RunConfig::FromTomlFile(file) : RunConfig();
  if (!options.task.empty()) config.task = TaskConfig::FromArgument(options.task);
  if (!path_is_study) config.data.Take(options.data);
  if (config.data.empty()) {
    throw UsageError(fmt::format("'{}' names no data; add [data] path = \"...\" to it, or give the data's path", file));
  }
  config.task.Resolve();
  if (!options.parameters.empty()) config.parameters.clear();
  for (const std::string& text : options.parameters) config.parameters.push_back(ParseParameterSpec(text));
  if (config.task.name.empty() && !config.parameters.empty()) {
    throw UsageError("--param needs a simulator; name its task with --task");
  }
  return config;
}

/// Its transitions, of the chosen episodes, whatever they hold.
Dataset ReadChosen(const RunConfig& config, const std::string& episodes) {
  DataOptions how = config.task.name.empty() ? config.data.Options() : DataOptionsFor(config.data, SpecOf(config.task));
  how.check = false;
  const Dataset all = ReadFiles(config.data, how);
  const EpisodeChoice choice = episodes.empty() ? config.data.ChosenEpisodes() : EpisodeChoice(episodes, "--episodes");
  Dataset chosen = choice.Of(all);
  if (const std::string told = choice.Renumbering(); !told.empty()) Say(fmt::format("note: {}\n", told));
  return chosen;
}

/// What every other command refuses is told.
void WarnOfDefects(const Dataset& dataset) {
  try {
    dataset.Check();
  } catch (const DataError& e) {
    Say(fmt::format("warning: {}\n", e.what()));
  }
}

/// Null without a task.
std::unique_ptr<SimulatorFactory> FactoryOf(const RunConfig& config, const Dataset& dataset) {
  if (config.task.name.empty()) return nullptr;
  return MakeSimulatorFactory(config.task, config.parameters, dataset.EpisodeStarts());
}

std::string FormatOf(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".npz") return "npz, D4RL's names";
  if (ending == ".csv" || ending == ".gz") return "CSV";
  return ending == ".hdf5" || ending == ".h5" ? "HDF5" : "Minari";
}

void AddCommon(CLI::App& verb, Options& options) {
  verb.add_option("PATH,--data", options.data,
                  "logged trajectories: .hdf5, .npz, .csv, a Minari folder, or a configuration file that names "
                  "data and task")
      ->required();
  verb.add_option("--task", options.task,
                  "simulator: Hopper-v5, ...; adds channel names and the checks that need a simulator")
      ->type_name(value_kind::kTask);
  verb.add_option("--episodes", options.episodes, kEpisodeChoiceHelp);
  verb.add_flag("--json", options.json, "print the result as JSON");
}

void AddInfo(CLI::App& data) {
  CLI::App* verb = data.add_subcommand("info", "show counts, returns, ranges and hash of a file");
  auto options = std::make_shared<Options>();
  AddCommon(*verb, *options);
  verb->callback([options] {
    const RunConfig config = StudyOf(*options);
    const Dataset dataset = ReadChosen(config, options->episodes);
    WarnOfDefects(dataset);
    const auto factory = FactoryOf(config, dataset);
    const SimulatorSpec* spec = factory ? &factory->spec() : nullptr;
    if (spec != nullptr) dataset.CheckFits(spec->task, spec->obs_dim(), spec->act_dim);
    const DatasetSummary summary = Describe(dataset, spec != nullptr ? FactsOf(*spec) : TaskFacts{});
    if (options->json) {
      nlohmann::json record = DataInfoRecord(dataset, spec, summary);
      record["format"] = FormatOf(config.data.AllFiles().front());
      Print("{}\n", record.dump(2));
    } else {
      PrintDataInfo(dataset, FormatOf(config.data.AllFiles().front()), spec, summary);
    }
  });
}

void AddCheck(CLI::App& data, Program& program) {
  CLI::App* verb = data.add_subcommand(
      "check", "find defects of a file, what they mean and what to do; with --task also whether there is a gap");
  auto options = std::make_shared<Options>();
  AddCommon(*verb, *options);
  verb->add_option("--param", options->parameters,
                   "measure this parameter's effect on the logged episodes: name=path:low:high; repeatable")
      ->allow_extra_args(false);
  AddSeed(*verb, options->seed);
  AddThreads(*verb, options->threads);
  verb->add_flag("--strict", options->strict, "exit with 3 also for warnings");
  verb->add_flag("--quiet", options->quiet, "no progress on stderr");
  verb->footer(
      "Exit code: 0 without errors, 3 with errors (--strict: or warnings). docs/data_checks.md explains each.");
  verb->callback([&program, options] {
    const RunConfig config = StudyOf(*options);
    const Dataset dataset = ReadChosen(config, options->episodes);
    const auto factory = FactoryOf(config, dataset);
    const SimulatorSpec* spec = factory ? &factory->spec() : nullptr;
    TerminalSink log(options->quiet || options->json);
    const DataCheck check =
        CheckData(dataset, factory.get(), SeedOf(options->seed), MakeContext(log, options->threads));
    if (options->json) {
      Print("{}\n", DataCheckRecord(dataset, spec, check).dump(2));
    } else {
      PrintDataCheck(dataset, spec, check);
    }
    const bool failed = CountOf(check.findings, Severity::kError) > 0 ||
                        (options->strict && CountOf(check.findings, Severity::kWarning) > 0);
    program.exit_code = static_cast<int>(failed ? ExitCode::kDataOrModel : ExitCode::kDone);
  });
}

void AddConvert(CLI::App& data) {
  CLI::App* verb = data.add_subcommand(
      "convert", "write the same transitions in another format; the paths' endings name the formats");
  struct ConvertOptions : Options {
    double noise = 0;
  };
  auto options = std::make_shared<ConvertOptions>();
  verb->add_option("IN,--data", options->data, "file to read")->required();
  verb->add_option("OUT,--out", options->out, "file to write")->required();
  verb->add_option("--task", options->task, "the task that the data must fit")->type_name(value_kind::kTask);
  verb->add_option("--episodes", options->episodes, kEpisodeChoiceHelp);
  verb->add_option("--noise", options->noise,
                   "add sensor noise of this standard deviation to every observation, in its own unit; full states "
                   "(infos/qpos, infos/qvel) are left out")
      ->check(PositiveNumber());
  verb->add_option("--seed", options->seed, "of --noise [default: 1]")->check(NonNegativeNumber());
  verb->callback([options] {
    std::error_code error;
    if (std::filesystem::equivalent(options->data, options->out, error)) {
      throw UsageError(fmt::format("'{}' is input and output; name another output", options->data));
    }
    const RunConfig config = StudyOf(*options);
    Dataset dataset = ReadChosen(config, options->episodes);
    const auto factory = FactoryOf(config, dataset);
    dataset.Check();
    const bool drops_states = options->noise > 0 && dataset.has_states();
    if (options->noise > 0) {
      const uint64_t seed = SeedOf(options->seed);
      dataset = WithSensorNoise(dataset, options->noise, RngKey(seed).Stage("sensor noise"));
    }
    if (factory) {
      dataset.CheckFits(factory->spec().task, factory->spec().obs_dim(), factory->spec().act_dim);
    }
    WriteOptions how;
    if (factory) {
      how.environment = factory->spec().task;
      how.action_low = factory->spec().action_low;
      how.action_high = factory->spec().action_high;
    }
    WriteDataset(dataset, options->out, how);
    // What was lost is what reading it back does not give.
    const Dataset back = ReadDataset(options->out);
    Print("{}: {} transitions in {} episodes\n", options->out, back.size(), back.Episodes().size());
    std::vector<std::string> losses = Losses(dataset, back);
    if (drops_states) losses.push_back("infos/qpos and infos/qvel, which would reveal the noise");
    for (const std::string& loss : losses) Print("lost: {}\n", loss);
    if (losses.empty()) Print("nothing was lost: every number and flag reads back the same\n");
  });
}

}  // namespace

void AddDataVerb(Program& program) {
  CLI::App* data = program.app.add_subcommand("data", "show, check and convert logged trajectories");
  data->require_subcommand(1);
  AddInfo(*data);
  AddCheck(*data, program);
  AddConvert(*data);
}

}  // namespace oted::cli
