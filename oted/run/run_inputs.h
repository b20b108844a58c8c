#pragma once
/// Builds the simulator, data and parameters that a configuration refers to.

#include <memory>
#include <string>
#include <vector>

#include "oted/config/run_config.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

/// What a task observes and does, without its parameters. @throws UsageError, DataError
SimulatorSpec SpecOf(TaskConfig task);

/// How the logs of a task are read: what the configuration says, and the task's control period, time limit and names.
DataOptions DataOptionsFor(const DataConfig& config, const SimulatorSpec& spec);

/// All files that a configuration names, one after the other, each with the constants of its recording.
/// @throws UsageError, DataError
Dataset ReadFiles(const DataConfig& config, const DataOptions& options);

/// The logged episodes that a configuration names, for a task; of quantities, rows that stand there twice once
/// (copied_rows.h). @throws UsageError, DataError
Dataset ReadEpisodes(const DataConfig& config, const SimulatorSpec& spec);
/// The same with what the reader is told. @throws UsageError, DataError
Dataset ReadEpisodes(const DataConfig& config, const DataOptions& options);

/// `config` with its presets replaced by the parameters that they stand for in its task's model; `notes`, when given,
/// gets a line for each entry that the model does not have. @throws UsageError, DataError
RunConfig ExpandPresets(RunConfig config, std::vector<std::string>* notes = nullptr);

/// (n, obs_dim): where all logged episodes begin that a configuration names, for a task that starts there and a factory
/// that has no other use for logs. None for other tasks, and where no logs are named. @throws UsageError, DataError
Array2<double> LoggedStarts(const RunConfig& config);

/// The simulator of a task: a built-in one, one that a program registered (task_registry.h), or that of a model.
/// @param logged_starts (n, obs_dim): where logged episodes begin, for a task that starts there; otherwise not read
/// @throws UsageError, DataError
std::unique_ptr<SimulatorFactory> MakeSimulatorFactory(const TaskConfig& task,
                                                       const std::vector<ParameterSpec>& parameters,
                                                       const Array2<double>& logged_starts = {});

}  // namespace oted
