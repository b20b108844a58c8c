#include "oted/run/run_inputs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/config/task_registry.h"
#include "oted/data/copied_rows.h"
#include "oted/data/dataset_files.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/known_constants.h"
#include "oted/sim/minigrid/minigrid_simulator.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/presets.h"

namespace oted {

namespace {

/// One file, its constants by `names`. @throws DataError where the file and the configuration both give one
Dataset ReadRecording(const DataConfig::Recording& recording, const DataOptions& options) {
  const std::vector<std::string>& names = options.constant_names;
  Dataset logs = ReadDataset(recording.path, options);
  if (names.empty()) return logs;
  if (logs.constants.empty()) {
    logs.constant_names = names;
    logs.constants = Array2<double>(logs.size(), static_cast<int>(names.size()));
    std::ranges::fill(logs.constants.values(), std::numeric_limits<double>::quiet_NaN());
  }
  for (size_t k = 0; k < names.size(); ++k) {
    const auto known = recording.constants.find(names[k]);
    if (known == recording.constants.end()) continue;
    for (int i = 0; i < logs.size(); ++i) {
      double& value = logs.constants(i, static_cast<int>(k));
      if (!std::isnan(value)) {
        throw DataError(fmt::format("'{}' has a column '{}', and data.recordings gives it as well; keep one of them",
                                    recording.path, names[k]));
      }
      value = known->second;
    }
  }
  return logs;
}

/// @throws DataError where it cannot be appended to `first`
void CheckAlike(const Dataset& first, const Dataset& other) {
  const auto has = [](bool yes, const char* what) { return fmt::format("has {}{}", yes ? "" : "no ", what); };
  std::string difference;
  if (other.obs_dim() != first.obs_dim() || other.act_dim() != first.act_dim()) {
    difference = fmt::format("has observations of {} and actions of {} numbers, wanted {} and {}", other.obs_dim(),
                             other.act_dim(), first.obs_dim(), first.act_dim());
  } else if (other.rewards.empty() != first.rewards.empty()) {
    difference = has(!other.rewards.empty(), "rewards");
  } else if (other.qpos.cols() != first.qpos.cols() || other.qvel.cols() != first.qvel.cols()) {
    difference = has(other.has_states(), "such columns infos/qpos and infos/qvel");
  }
  if (difference.empty()) return;
  throw DataError(
      fmt::format("'{}' {}, unlike '{}'; data.recordings need the same columns", other.path, difference, first.path));
}

}  // namespace

Dataset ReadFiles(const DataConfig& config, const DataOptions& options) {
  config.CheckConstants(options.constant_names);
  if (config.recordings.empty()) return ReadRecording({config.path, {}}, options);
  Dataset all;
  std::string path, hashes;
  std::map<std::string, int> told;  // what the reader says, and of how many recordings
  for (const DataConfig::Recording& recording : config.recordings) {
    const Dataset one = ReadRecording(recording, options);
    if (all.size() > 0) CheckAlike(all, one);
    if (path.empty()) path = one.path;
    all.path = path;
    hashes += fmt::format("{} {}\n", one.sha256, nlohmann::json(recording.constants).dump());
    all.Append(one);
    for (const std::string& text : one.remarks) ++told[text];
    for (const std::string& text : one.warnings) ++told[text];
  }
  for (std::vector<std::string>* texts : {&all.remarks, &all.warnings}) {
    for (std::string& text : *texts) {
      if (const int n = told[text]; n > 1) text += fmt::format(" (in each of {} recordings)", n);
    }
  }
  all.path = config.Files();
  all.sha256 = Sha256(hashes);
  return all;
}

Dataset ReadEpisodes(const DataConfig& config, const SimulatorSpec& spec) {
  Dataset logs = ReadEpisodes(config, DataOptionsFor(config, spec));
  // In a world of few states the same steps come again and again.
  const bool is_few_states = spec.n_discrete_actions > 0 || !spec.image_shape.empty();
  return is_few_states ? logs : WithoutCopies(std::move(logs));
}

Dataset ReadEpisodes(const DataConfig& config, const DataOptions& options) {
  config.CheckNamed();
  for (const std::string& file : config.AllFiles()) {
    if (std::filesystem::exists(file)) continue;
    throw DataError(
        fmt::format("the logs '{}' are not there; check the path, or name their new place with --data", file));
  }
  const Dataset all = ReadFiles(config, options);
  return config.ChosenEpisodes().Of(all);
}

namespace {

/// What a preset believes counts where nobody asked for another prior.
void UseBeliefs(RunConfig& config) {
  const auto use = [](DesignChoice& design, const std::string& where) {
    if (!design.Has("prior")) design.Set("prior", "gaussian", where);
  };
  use(config.design, "design.prior");
  for (auto& [name, design] : config.settings) use(design, fmt::format("design.settings.{}.prior", name));
}

}  // namespace

RunConfig ExpandPresets(RunConfig config, std::vector<std::string>* notes) {
  if (config.presets.empty() || config.task.name.empty()) return config;
  ExpandedPresets expanded =
      ExpandPresets(config.presets, config.parameters, *MakeSimulatorFactory(config.task, {}, LoggedStarts(config)));
  if (expanded.parameters.empty()) {
    throw UsageError(
        fmt::format("the model of task '{}' has nothing that preset {} names; 'oted params list' shows what "
                    "it has",
                    config.task.name, fmt::join(config.presets, ", ")));
  }
  config.parameters = std::move(expanded.parameters);
  config.presets.clear();
  if (expanded.has_beliefs) UseBeliefs(config);
  if (notes != nullptr) *notes = std::move(expanded.skipped);
  return config;
}

Array2<double> LoggedStarts(const RunConfig& config) {
  if (!config.task.has_model() || !config.task.model.starts_in_logs() || config.data.empty()) return {};
  return ReadEpisodes(config.data, SpecOf(config.task)).EpisodeStarts();
}

std::unique_ptr<SimulatorFactory> MakeSimulatorFactory(const TaskConfig& task,
                                                       const std::vector<ParameterSpec>& parameters,
                                                       const Array2<double>& logged_starts) {
  // By value: the factory makes further ones of the same task later (SimulatorFactory::With).
  const auto make = [task, logged_starts](std::vector<ParameterSpec> own) -> std::unique_ptr<SimulatorFactory> {
    if (task.has_model()) return std::make_unique<MujocoSimulatorFactory>(task.model, std::move(own), logged_starts);
    if (task.is_grid()) {
      return std::make_unique<MinigridSimulatorFactory>(task.grid.ApplyTo(FindMinigridTask(task.name)), std::move(own));
    }
    if (auto registered = MakeRegisteredTask(task.name, own)) return registered;
    return std::make_unique<MujocoSimulatorFactory>(task.name, std::move(own));
  };
  return WithConstants(parameters, task.constants,
                       [make](const std::vector<ParameterSpec>& all) { return WithChannels(all, make); });
}

SimulatorSpec SpecOf(TaskConfig task) {
  // Where episodes begin says nothing about what is observed; the logs that say where may not have been read yet.
  task.model.start = "default";
  return MakeSimulatorFactory(task, {})->spec();
}

DataOptions DataOptionsFor(const DataConfig& config, const SimulatorSpec& spec) {
  DataOptions options = config.Options();
  options.control_period_s = spec.control_period_s;
  options.max_episode_steps = spec.max_episode_steps;
  options.observation_names = spec.observation_names;
  options.action_names = spec.action_names;
  options.constant_names = spec.constant_names;
  return options;
}

}  // namespace oted
