#pragma once
/// [task]: a built-in task, or a model with what is seen of it and what it pays.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/sim/minigrid/task.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// What is simulated: one of the built-in tasks by its name, or a model (docs/task_files.md).
struct TaskConfig {
  std::string name;   ///< with a model, what reports call the task
  ModelTask model;    ///< unused while model.model is empty
  GridSettings grid;  ///< [grid]; unused by all but the grid worlds
  /// [task.constants]: what is known of each recording and differs between them (oted/sim/known_constants.h).
  std::vector<ParameterSpec> constants;
  FieldList Fields();

  bool has_model() const { return !model.model.empty(); }
  bool is_grid() const { return !has_model() && IsMinigridTask(name); }
  /// Fills in the name. @throws UsageError for a setting that makes no sense without a model.
  void Resolve();
  /// What --task takes: a built-in task's name, or the path of a TOML file whose [task] is read.
  static TaskConfig FromArgument(const std::string& name_or_file);
  std::vector<std::string> ConstantNames() const;
  /// [task], [task.quantities], [task.constants] and [grid], every setting written out.
  std::string ToToml() const;
  nlohmann::json ToJson() const;
  /// What results depend on, beside the model itself: the name of a built-in task, the settings of a model's.
  nlohmann::json Identity() const;
};

}  // namespace oted
