#include "cli/value_kinds.h"

#include <functional>
#include <map>

#include "oted/config/run_config.h"
#include "oted/sim/minigrid/task.h"
#include "oted/sim/mujoco/task.h"
#include "oted/sim/presets.h"
#include "oted/stages/design/design_method.h"
#include "oted/studies/table1_study.h"

namespace oted::cli {
namespace {

using Words = std::vector<std::string>;

void AddSettings(const FieldList& section, std::map<std::string, Words>& settings) {
  for (const Field& field : section.fields()) {
    const bool is_switch = std::holds_alternative<bool*>(field.target);
    settings[section.section() + "." + field.name] = is_switch ? Words{"true", "false"} : field.choices;
  }
}

/// "section.key" of every setting, with its values where they have names.
std::map<std::string, Words> Settings() {
  std::map<std::string, Words> settings;
  RunConfig defaults;
  for (const FieldList& section : PlainSections(defaults)) AddSettings(section, settings);
  DesignConfig design = defaults.design.Assumed();
  for (const FieldList& section : design.Sections()) AddSettings(section, settings);
  settings["design.method"] = defaults.design.MethodField().choices;
  return settings;
}

Words SettingWords(const std::string& typed) {
  const size_t equals = typed.find('=');
  const std::string key = typed.substr(0, equals);
  Words words;
  for (const auto& [setting, values] : Settings()) {
    if (equals == std::string::npos) words.push_back(setting + "=");
    if (equals == std::string::npos || setting != key) continue;
    for (const std::string& value : values) words.push_back(setting + "=" + value);
  }
  return words;
}

Words Tasks() {
  Words tasks = TaskNames();
  const Words grids = MinigridTaskNames();
  tasks.insert(tasks.end(), grids.begin(), grids.end());
  return tasks;
}

}  // namespace

Words ValuesOfKind(const std::string& kind, const std::string& typed) {
  using namespace value_kind;
  static const std::map<std::string, std::function<Words()>> kinds = {
      {kTask, Tasks},
      {kPreset, PresetNames},
      {kMethod, [] { return Settings().at("design.method"); }},
      {kDevice, [] { return Settings().at("agents.device"); }},
      {kRobot, [] { return Table1Study().tasks; }},
      {kDataset, [] { return Table1Study().datasets; }},
      {kParameter, [] { return Table1Study().parameters; }},
      {kLearner, [] { return Table1Study::KnownMethods(); }}};
  if (kind == kSetting) return SettingWords(typed);
  const auto found = kinds.find(kind);
  return found == kinds.end() ? Words() : found->second();
}

}  // namespace oted::cli
