#include "oted/config/task_config.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "oted/base/error.h"
#include "oted/config/parameters_toml.h"
#include "oted/config/run_config.h"
#include "oted/config/toml_writer.h"

namespace oted {

using nlohmann::json;

FieldList TaskConfig::Fields() {
  FieldList fields("task");
  fields.Add("name", &name,
             "a built-in task: Hopper-v5, HalfCheetah-v5, Walker2d-v5, or their -v4 and -v2; with model, a label");
  fields.Add("model", &model.model,
             "MJCF or URDF file, relative to this file, or package:NAME/... of a Python package");
  fields.Add("motors", &model.motors, "joints that get a motor of their own: joint/NAME");
  fields.Add("control_period", &model.control_period,
             "time between two actions [s], a multiple of the model's time step", AtLeast(0));
  fields.Add("observations", &model.observations, "observations, in this order: paths");
  fields.Add("unobserved", &model.unobserved, "paths of coordinates that keep their start value when a state is set");
  fields.Add("actions", &model.actions, "actions, in this order: actuator/NAME");
  fields.Add("action_range", &model.action_range, "[low, high] of controls that the model gives no ctrlrange");
  fields.Add("start", &model.start, "where episodes begin: default, keyframe/NAME, or logs (the data's own starts)");
  fields.Add("start_qpos", &model.start_qpos, "positions of the start state, one per number of qpos [m, rad]");
  fields.Add("start_noise", &model.start_noise, "half width of uniform noise on qpos and qvel [m, rad, m/s, rad/s]",
             AtLeast(0));
  fields.Add("reward", &model.reward, "expression, paid every control step; only agents need it");
  fields.Add("terminate", &model.terminate, "expression; the episode ends when it is not 0");
  fields.Add("max_episode_steps", &model.max_episode_steps, "control steps after which an episode is cut", AtLeast(1));
  fields.AddStructure("quantities");
  fields.AddStructure("constants");
  return fields;
}

std::vector<std::string> TaskConfig::ConstantNames() const {
  std::vector<std::string> names;
  for (const ParameterSpec& constant : constants) names.push_back(constant.name);
  return names;
}

void TaskConfig::Resolve() {
  if (has_model()) {
    model.name = name.empty() ? std::filesystem::path(model.model).stem().string() : name;
    name = model.name;
    return;
  }
  TaskConfig defaults;
  if (is_grid() && !constants.empty()) {
    throw UsageError("task.constants are of models, and a grid world has none; leave them out");
  }
  if (!is_grid() && grid != defaults.grid) {
    throw UsageError(
        fmt::format("[grid] is of grid worlds, and the task is '{}'; leave it out, or name a MiniGrid task", name));
  }
  const FieldList own = Fields(), plain = defaults.Fields();
  for (size_t i = 0; i < own.fields().size(); ++i) {
    const Field& field = own.fields()[i];
    if (field.name == "name" || field.ToJson() == plain.fields()[i].ToJson()) continue;
    throw UsageError(
        fmt::format("task.{} describes a model, and task.model names none; add model = \"robot.xml\"", field.name));
  }
  if (!model.quantities.empty()) {
    throw UsageError("task.quantities describe a model, and task.model names none; add model = \"robot.xml\"");
  }
}

TaskConfig TaskConfig::FromArgument(const std::string& name_or_file) {
  if (name_or_file.ends_with(".toml")) {
    TaskConfig task = RunConfig::FromTomlFile(name_or_file).task;
    if (task.name.empty()) {
      throw UsageError(fmt::format("'{}' has no [task]; add one with a name or a model", name_or_file));
    }
    return task;
  }
  TaskConfig task;
  task.name = name_or_file;
  return task;
}

json TaskConfig::ToJson() const {
  TaskConfig copy = *this;
  // [grid] is a section of its own.
  json object = has_model() ? copy.Fields().ToJson() : json{{"name", name}};
  if (!model.quantities.empty()) object["quantities"] = model.quantities;
  for (const ParameterSpec& constant : constants) object["constants"][constant.name] = ConstantToJson(constant);
  return object;
}

std::string TaskConfig::ToToml() const {
  TaskConfig copy = *this;
  std::ostringstream out;
  out << "[task]\n";
  const FieldList fields = copy.Fields();
  for (const Field& field : fields.fields()) {
    if (!has_model() && field.name != "name") continue;
    out << field.name << " = ";
    WriteTomlValue(out, field.ToJson());
    out << "  # " << field.help << "\n";
  }
  if (is_grid()) {
    out << "\n[grid]\n";
    const FieldList settings = copy.grid.Fields();
    for (const Field& field : settings.fields()) {
      out << field.name << " = ";
      WriteTomlValue(out, field.ToJson());
      out << "  # " << field.help << "\n";
    }
  }
  if (!model.quantities.empty()) out << "\n[task.quantities]\n";
  for (const auto& [quantity, path] : model.quantities) {
    out << quantity << " = ";
    WriteTomlValue(out, path);
    out << "\n";
  }
  if (!constants.empty()) out << "\n[task.constants]\n";
  for (const ParameterSpec& constant : constants) {
    out << constant.name << " = ";
    WriteTomlValue(out, ConstantToJson(constant));
    out << "\n";
  }
  return out.str();
}

json TaskConfig::Identity() const {
  if (is_grid()) {
    GridSettings settings = grid;
    return {name, settings.Fields().ToJson()};
  }
  json object = ToJson();
  if (!has_model()) return constants.empty() ? json(name) : object;
  object.erase("name");
  object.erase("model");
  return object;
}

}  // namespace oted
