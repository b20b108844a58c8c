// oted data info | check | convert: what a log holds, whether it is sound, and the same in another format.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/data_report.h"
#include "cli/options.h"
#include "cli/verbs.h"
#include "oted/base/error.h"
#include "oted/data_check.h"

namespace oted::cli {
namespace {

/// The file's transitions, of the chosen episodes, whatever they hold.
Dataset ReadChosen(const Options& options) {
  const Dataset all = ReadDatasetUnchecked(options.data);
  if (options.episodes.empty() || options.episodes == "all") return all;
  return all.Select(ChooseEpisodes(all, options.episodes));
}

std::unique_ptr<SimulatorFactory> TaskOf(const Options& options) {
  if (options.task.empty()) {
    if (!options.parameters.empty()) {
      throw UsageError("--param belongs to a task's simulator; name it with --task");
    }
    return nullptr;
  }
  // A file that describes the whole study declares its parameters too.
  const bool study = options.task.ends_with(".toml");
  RunConfig config = study ? RunConfig::FromTomlFile(options.task) : RunConfig();
  config.task = TaskConfig::FromArgument(options.task);
  if (!options.parameters.empty()) config.parameters.clear();
  for (const std::string& text : options.parameters) config.parameters.push_back(ParseParameterSpec(text));
  Array2<double> starts;
  if (config.task.model.start == "logs") starts = ReadDatasetUnchecked(options.data).EpisodeStarts();
  return MakeSimulatorFactory(config.task, config.parameters, starts);
}

std::string FormatOf(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  return ending == ".npz" ? "npz, D4RL's names" : "HDF5, D4RL's layout";
}

void AddCommon(CLI::App& verb, Options& options) {
  verb.add_option("PATH,--data", options.data, "logged trajectories, .hdf5 (D4RL layout) or .npz")->required();
  verb.add_option("--task", options.task, "simulator: Hopper-v5, ...; names the channels and allows more checks");
  verb.add_option("--episodes", options.episodes, "which episodes: a number (the first so many), 3-7, or all");
  verb.add_flag("--json", options.json, "print the result as JSON");
}

void AddInfo(CLI::App& data) {
  CLI::App* verb = data.add_subcommand("info", "what a file holds: counts, returns, ranges, hash");
  auto options = std::make_shared<Options>();
  AddCommon(*verb, *options);
  verb->callback([options] {
    const Dataset dataset = ReadChosen(*options);
    const auto factory = TaskOf(*options);
    const SimulatorSpec* spec = factory ? &factory->spec() : nullptr;
    if (spec != nullptr) dataset.CheckFits(spec->task, spec->obs_dim(), spec->act_dim);
    const DatasetSummary summary = Describe(dataset, spec != nullptr ? FactsOf(*spec) : TaskFacts{});
    if (options->json) {
      nlohmann::json record = DataInfoRecord(dataset, spec, summary);
      record["format"] = FormatOf(options->data);
      fmt::print("{}\n", record.dump(2));
    } else {
      PrintDataInfo(dataset, FormatOf(options->data), spec, summary);
    }
  });
}

void AddCheck(CLI::App& data, Program& program) {
  CLI::App* verb = data.add_subcommand(
      "check", "what is wrong with a file, what it means and what to do; with --task also: is there a gap at all?");
  auto options = std::make_shared<Options>();
  AddCommon(*verb, *options);
  verb->add_option("--param", options->parameters,
                   "a parameter whose effect on the logged episodes is to be measured: name=path:low:high; repeatable")
      ->allow_extra_args(false);
  verb->add_option("--seed", options->seed, "names every random stream [default: 1]")->check(CLI::NonNegativeNumber);
  verb->add_option("--threads", options->threads, "threads at most [default: all processors]");
  verb->add_flag("--strict", options->strict, "exit with 3 also for warnings");
  verb->footer(
      "Exit code: 0 without errors, 3 with errors (--strict: or warnings). docs/data_checks.md explains each.");
  verb->callback([&program, options] {
    const auto factory = TaskOf(*options);
    const Dataset dataset = ReadChosen(*options);
    const SimulatorSpec* spec = factory ? &factory->spec() : nullptr;
    TerminalSink log(true);
    const DataCheck check =
        CheckData(dataset, factory.get(), options->seed < 0 ? 1 : static_cast<uint64_t>(options->seed),
                  MakeContext(log, options->threads));
    if (options->json) {
      fmt::print("{}\n", DataCheckRecord(dataset, spec, check).dump(2));
    } else {
      PrintDataCheck(dataset, spec, check);
    }
    const bool failed = CountOf(check.findings, Severity::kError) > 0 ||
                        (options->strict && CountOf(check.findings, Severity::kWarning) > 0);
    program.exit_code = static_cast<int>(failed ? ExitCode::kDataOrModel : ExitCode::kDone);
  });
}

void AddConvert(CLI::App& data) {
  CLI::App* verb =
      data.add_subcommand("convert", "the same transitions in another format, by the endings of the paths");
  auto options = std::make_shared<Options>();
  verb->add_option("IN,--data", options->data, "file to read")->required();
  verb->add_option("OUT,--out", options->out, "file to write")->required();
  verb->add_option("--task", options->task, "the task that the data must fit");
  verb->add_option("--episodes", options->episodes, "which episodes: a number (the first so many), 3-7, or all");
  verb->callback([options] {
    std::error_code error;
    if (std::filesystem::equivalent(options->data, options->out, error)) {
      throw UsageError(fmt::format("'{}' would be written over itself; name another file", options->data));
    }
    const auto factory = TaskOf(*options);
    const Dataset dataset = ReadChosen(*options);
    dataset.Check();
    if (factory) {
      dataset.CheckFits(factory->spec().task, factory->spec().obs_dim(), factory->spec().act_dim);
    }
    WriteDataset(dataset, options->out);
    // What was lost is what reading it back does not give.
    const Dataset back = ReadDataset(options->out);
    fmt::print("{}: {} transitions in {} episodes\n", options->out, back.size(), back.Episodes().size());
    const std::vector<std::string> losses = Losses(dataset, back);
    for (const std::string& loss : losses) fmt::print("lost: {}\n", loss);
    if (losses.empty()) fmt::print("nothing was lost: every number and flag reads back as it was\n");
  });
}

}  // namespace

void AddDataVerb(Program& program) {
  CLI::App* data = program.app.add_subcommand("data", "look at logged trajectories: info, check, convert");
  data->require_subcommand(1);
  AddInfo(*data);
  AddCheck(*data, program);
  AddConvert(*data);
}

}  // namespace oted::cli
