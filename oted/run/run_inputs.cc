#include "oted/run/run_inputs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "oted/base/error.h"
#include "oted/config/task_registry.h"
#include "oted/data/dataset_files.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/minigrid/minigrid_simulator.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/presets.h"

namespace oted {

Dataset ReadEpisodes(const DataConfig& config, const SimulatorSpec& spec) {
  if (config.path.empty())
    throw UsageError("no data are named; add --data demos.hdf5, or [data] path to the configuration");
  const Dataset all = ReadDataset(config.path, DataOptionsFor(config, spec));
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

RunConfig ExpandPresets(RunConfig config, std::vector<std::string>* notes) {
  if (config.presets.empty() || config.task.name.empty()) return config;
  ExpandedPresets expanded = ExpandPresets(config.presets, config.parameters, *MakeSimulatorFactory(config.task, {}));
  if (expanded.parameters.empty()) {
    throw UsageError(
        fmt::format("the model of task '{}' has nothing that preset {} names; 'oted params list' shows what "
                    "it has",
                    config.task.name, fmt::join(config.presets, ", ")));
  }
  config.parameters = std::move(expanded.parameters);
  config.presets.clear();
  if (notes != nullptr) *notes = std::move(expanded.skipped);
  return config;
}

std::unique_ptr<SimulatorFactory> MakeSimulatorFactory(const TaskConfig& task,
                                                       const std::vector<ParameterSpec>& parameters,
                                                       const Array2<double>& logged_starts) {
  // By value: the factory makes further ones of the same task later (SimulatorFactory::With).
  return WithChannels(parameters,
                      [task, logged_starts](std::vector<ParameterSpec> own) -> std::unique_ptr<SimulatorFactory> {
                        if (task.has_model())
                          return std::make_unique<MujocoSimulatorFactory>(task.model, std::move(own), logged_starts);
                        if (task.is_grid()) {
                          return std::make_unique<MinigridSimulatorFactory>(
                              task.grid.ApplyTo(FindMinigridTask(task.name)), std::move(own));
                        }
                        if (auto registered = MakeRegisteredTask(task.name, own)) return registered;
                        return std::make_unique<MujocoSimulatorFactory>(task.name, std::move(own));
                      });
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
  return options;
}

}  // namespace oted
