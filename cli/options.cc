#include "cli/options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "cli/numbers.h"
#include "cli/value_kinds.h"
#include "oted/base/error.h"
#include "oted/data/episode_choice.h"
#include "oted/run/provenance.h"
#include "oted/sim/presets.h"
#include "oted/sim/sysid_file.h"
#include "oted/stages/design/design_method.h"

namespace oted::cli {

namespace {

void AddDesignOptions(CLI::App& app, Options& options) {
  app.add_option("--seeds", options.n_seeds,
                 fmt::format("seeded designs per setting [default: {}]", DefaultSeedsInWords()))
      ->check(PositiveNumber());
  app.add_flag(
      "--grow", options.grow,
      "where the design leaves more than the sensors explain, add the suspect that is surely better to the parameters, "
      "up to three times (design.grow)");
  app.add_flag("--require-identified", options.require_identified, "exit with 4 when a parameter is not identified");
}

}  // namespace

void AddParameterOptions(CLI::App& app, Options& options) {
  app.add_option("--param", options.parameters,
                 "a parameter: name=path:low:high[:log][:absolute][:prior=MEAN,STD], bounds in multiples of nominal; "
                 "repeatable")
      ->allow_extra_args(false);
  app.add_option("--preset", options.presets,
                 fmt::format("add the parameters that are usually off and that the model has: {}; repeatable; a "
                             "--param of the same name replaces one",
                             fmt::join(PresetNames(), ", ")))
      ->type_name(value_kind::kPreset)
      ->allow_extra_args(false);
  app.add_option("--params", options.parameter_file,
                 "parameter file of mujoco.sysid (YAML) with names, bounds and nominal values; replaces "
                 "parameters.sysid of the configuration");
}

void AddSeed(CLI::App& verb, long& seed) {
  verb.add_option("--seed", seed, "seed of every random stream [default: 1]")->check(NonNegativeNumber());
}

uint64_t SeedOf(long seed) { return seed < 0 ? 1 : static_cast<uint64_t>(seed); }

void AddThreads(CLI::App& verb, int& threads) {
  verb.add_option("--threads", threads, "maximum number of threads [default: all processors]")
      ->check(NonNegativeNumber());
}

void AddRunOptions(CLI::App& app, Options& options, const Makes& makes) {
  app.add_option("CONFIG,--config", options.config,
                 "configuration file (TOML); default: the run directory's own run.toml");
  app.add_option("--task", options.task, kTaskHelp)->type_name(value_kind::kTask);
  app.add_option("--data", options.data, "logged trajectories: .hdf5, .npz, .csv, or a Minari folder");
  app.add_option("--episodes", options.episodes, kEpisodeChoiceHelp);
  AddParameterOptions(app, options);
  app.add_option("--truth", options.truth,
                 "name=value, if the truth is known; only what prints results reads it; repeatable")
      ->allow_extra_args(false);
  AddSeed(app, options.seed);
  if (makes.designs) AddDesignOptions(app, options);
  if (makes.agents) {
    app.add_option("--device", options.device, "device of the agents' gradient steps: cpu or cuda [default: cpu]")
        ->type_name(value_kind::kDevice);
  }
  app.add_option("--threads", options.threads,
                 "maximum number of threads; results do not depend on it [default: all processors]")
      ->check(NonNegativeNumber());
  app.add_option("--out", options.out, "run directory")->required()->check([](const std::string& folder) {
    return std::string(folder.empty() ? "names no folder" : "");
  });
  app.add_option("--set", options.assignments, "section.key=value, any setting of the configuration; repeatable")
      ->type_name(value_kind::kSetting)
      ->allow_extra_args(false);
  app.add_flag("--json", options.json, "print the result as JSON");
  app.add_flag("--quiet", options.quiet, "no progress on stderr");
  app.add_flag("--strict", options.strict, "a parameter without measured effect is an error");
}

namespace {

/// An algorithm that the command line names takes the place of the file's, whose settings would then do nothing.
void ForgetOtherAlgorithms(const std::vector<std::string>& assignments, RunConfig& config) {
  constexpr std::string_view kSetting = "agents.algorithm=";
  for (const std::string& assignment : assignments) {
    if (!assignment.starts_with(kSetting)) continue;
    AlgorithmSettings kept;
    bool is_known = false;
    for (const AlgorithmEntry& entry : Algorithms()) {
      if (entry.name != assignment.substr(kSetting.size())) continue;
      is_known = true;
      entry.fields(kept).FromJson(entry.fields(config.algorithms).ToJson(), "--set");
    }
    if (is_known) config.algorithms = kept;
  }
}

}  // namespace

RunConfig ResolveConfig(const Options& options) {
  RunConfig config;
  const std::filesystem::path out = options.out;
  if (!options.config.empty()) {
    config = RunConfig::FromTomlFile(options.config, options.parameters.empty() ? options.parameter_file : "");
  } else if (!options.out.empty() && std::filesystem::exists(out / "run.toml")) {
    config = ReadKeptConfig(out);
  }
  if (!options.task.empty()) config.task = TaskConfig::FromArgument(options.task);
  if (!options.data.empty()) config.data.Take(options.data);
  if (!options.episodes.empty()) config.data.episodes = options.episodes;
  const bool from_file = !options.parameter_file.empty() && options.config.empty();
  if (!options.presets.empty() || !options.parameters.empty() || from_file) config.presets = options.presets;
  if (!options.parameters.empty() || from_file) {
    config.parameters.clear();
    if (!options.truth.empty()) config.truth.clear();  // of parameters that are no longer there
    for (const std::string& text : options.parameters) config.parameters.push_back(ParseParameterSpec(text));
    if (!options.parameter_file.empty()) {
      config.parameter_file = options.parameter_file;
      const std::vector<bool> has_range(config.parameters.size(), true);
      config.parameters =
          MergeSysid(ReadSysidFile(options.parameter_file), options.parameter_file, config.parameters, has_range);
    }
  }
  for (const std::string& text : options.truth) config.SetTruth(text);
  if (options.seed >= 0) config.run.seed = options.seed;
  if (options.threads >= 0) config.run.threads = options.threads;
  if (options.n_seeds > 0) config.Set(fmt::format("selection.n_seeds={}", options.n_seeds));
  if (!options.device.empty()) config.Set("agents.device=" + options.device);
  if (options.strict) config.run.strict = true;
  if (options.grow) config.Set("design.grow=true");
  ForgetOtherAlgorithms(options.assignments, config);
  for (const std::string& assignment : options.assignments) config.Set(assignment);
  config.task.Resolve();
  return config;
}

std::vector<double> TargetParameters(const ParameterSpace& space, const std::map<std::string, double>& truth) {
  std::vector<double> z = space.Nominal();
  size_t n_found = 0;
  for (int i = 0; i < space.size(); ++i) {
    const auto found = truth.find(space[i].name);
    if (found == truth.end()) continue;
    z[static_cast<size_t>(i)] = found->second;
    ++n_found;
  }
  if (n_found == truth.size()) return z;
  for (const auto& [name, unused] : truth) {
    const auto is_it = [&, &wanted = name](const ParameterSpec& spec) { return spec.name == wanted; };
    if (std::none_of(space.specs().begin(), space.specs().end(), is_it)) {
      throw UsageError(fmt::format("--truth {} names no parameter; declare it with --param", name));
    }
  }
  return z;
}

std::string AtParameters(const ParameterSpace& space, const std::vector<double>& z) {
  std::vector<std::string> names;
  for (int i = 0; i < space.size(); ++i) {
    const double value = z[static_cast<size_t>(i)];
    if (value != space[i].nominal) names.push_back(fmt::format("{} {:g}", space[i].name, value));
  }
  return names.empty() ? "" : fmt::format(" at {}", fmt::join(names, ", "));
}

}  // namespace oted::cli
