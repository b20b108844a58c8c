/// A run's configuration from TOML, and back.

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/config/former_names.h"
#include "oted/config/parameters_toml.h"
#include "oted/config/run_config.h"
#include "oted/config/toml_reader.h"
#include "oted/config/toml_text.h"
#include "oted/config/toml_writer.h"
#include "oted/stages/design/prior_source.h"

namespace oted {

using nlohmann::json;

namespace {

/// [task.quantities]: name = "path".
void ReadQuantities(const toml::node& node, const std::string& file, std::map<std::string, std::string>& quantities) {
  if (!node.is_table()) {
    throw UsageError(
        fmt::format("{}: task.quantities is no table; write [task.quantities] and NAME = \"PATH\" below it",
                    TomlPlace(file, node)));
  }
  for (const auto& [key, value] : *node.as_table()) {
    const auto path = value.value_exact<std::string>();
    if (!path) {
      throw UsageError(fmt::format("{}: task.quantities.{} is not text, wanted a path such as \"body/torso/xpos[2]\"",
                                   TomlPlace(file, value), std::string(key.str())));
    }
    quantities[std::string(key.str())] = *path;
  }
}

toml::table Parsed(const std::string& text, const std::string& file_name) {
  CheckTomlCharacters(text, file_name);
  try {
    return toml::parse(text, file_name);
  } catch (const toml::parse_error& e) {
    throw UsageError(fmt::format("{}:{}: {}", file_name, e.source().begin.line, std::string(e.description())));
  }
}

/// data.recordings = [{ path = "monday.csv", constants = { payload = 0.4 } }], or [[data.recordings]].
std::vector<DataConfig::Recording> ReadRecordings(const toml::node& node, const std::string& file) {
  const std::string at = TomlPlace(file, node);
  const json list = TomlToJson(node, at);
  const auto refuse = [&](const std::string& what) {
    throw UsageError(
        fmt::format("{}: {}; wanted [{{ path = \"monday.csv\", constants = {{ payload = 0.4 }} }}, ...]", at, what));
  };
  if (!list.is_array() || list.empty()) refuse("data.recordings is no list of recordings");
  std::vector<DataConfig::Recording> recordings;
  for (const json& entry : list) {
    if (!entry.is_object() || !entry.contains("path") || !entry["path"].is_string() || entry["path"] == "") {
      refuse("an entry of data.recordings has no path");
    }
    for (const auto& [key, value] : entry.items()) {
      if (key != "path" && key != "constants") refuse(fmt::format("data.recordings.{} is no setting", key));
    }
    DataConfig::Recording recording{BesideFile(entry["path"].get<std::string>(), file), {}};
    const json constants = entry.value("constants", json::object());
    if (!constants.is_object()) refuse("the constants of a recording are no table");
    for (const auto& [name, value] : constants.items()) {
      recording.constants[name] = NumberAt(value, "data.recordings.constants." + name, at);
    }
    recordings.push_back(std::move(recording));
  }
  return recordings;
}

/// A section of plain settings. What is no setting in it, such as [task.quantities], is read apart.
void ReadSection(const toml::table& table, const std::string& file_name, FieldList& section) {
  for (const auto& [key, node] : table) {
    const std::string setting = fmt::format("{}.{}", section.section(), key.str()), at = TomlPlace(file_name, node);
    if (setting == "task.quantities" || setting == "task.constants" || setting == "data.recordings") continue;
    RefuseFormerName(section.section(), key.str(), at);
    json value = TomlToJson(node, at);
    const OtherType other = OtherTypeOf(section.section(), key.str());
    if (other == OtherType::kInteger ? value.is_number_integer() : other == OtherType::kBoolean && value.is_boolean()) {
      value = value.dump();
    }
    section.Find(std::string(key.str()), at).FromJson(value, at);
  }
}

/// [design], or one of [design.settings]: settings, and sections of them.
void ReadDesign(const toml::table& table, const std::string& file_name, DesignChoice& design) {
  for (const auto& [key, node] : table) {
    const std::string name(key.str()), at = TomlPlace(file_name, node);
    if (name == "settings") continue;
    if (const toml::table* section = node.as_table()) {
      for (const auto& [inner, value] : *section) {
        const std::string place = TomlPlace(file_name, value);
        design.Set(fmt::format("{}.{}", name, inner.str()), TomlToJson(value, place), place);
      }
      continue;
    }
    json value = TomlToJson(node, at);
    // The path among what a prior can be is relative to the file's folder.
    if (name == "prior" && value.is_string() && PriorSourceOf(value.get<std::string>()) == PriorSource::kDesign) {
      value = BesideFile(value.get<std::string>(), file_name);
    }
    design.Set(name, value, at);
  }
}

/// [design.settings.NAME]: the settings h start from [design] and change what they name.
std::map<std::string, DesignChoice> ReadDesignSettings(const toml::node& node, const DesignChoice& design,
                                                       const std::string& file_name) {
  const auto refuse = [](const std::string& at) {
    throw UsageError(fmt::format("{}: design.settings is no table; write [design.settings.NAME] for each setting", at));
  };
  if (!node.is_table()) refuse(TomlPlace(file_name, node));
  std::map<std::string, DesignChoice> settings;
  for (const auto& [key, changed] : *node.as_table()) {
    if (!changed.is_table()) refuse(TomlPlace(file_name, changed));
    DesignChoice setting = design;
    ReadDesign(*changed.as_table(), file_name, setting);
    settings[std::string(key.str())] = setting;
  }
  return settings;
}

void WriteFields(std::ostream& out, const std::vector<Field>& fields, bool with_help) {
  for (const Field& field : fields) {
    out << field.name << " = ";
    WriteTomlValue(out, field.ToJson());
    if (with_help) out << "  # " << field.help;
    out << "\n";
  }
}

/// A default that differs between methods is a comment: what a file says counts as given, whatever method runs.
void WriteDesign(std::ostream& out, const std::string& name, const DesignChoice& design, bool with_help) {
  DesignChoice choice = design;
  DesignConfig config = design.Assumed();
  for (const FieldList& section : config.Sections()) {
    const std::string below = section.section().substr(std::string("design").size());
    out << "\n[" << name << below << "]\n";
    if (below.empty()) WriteFields(out, {choice.MethodField()}, with_help);
    for (const Field& field : section.fields()) {
      const std::string key = below.empty() ? field.name : below.substr(1) + "." + field.name;
      if (!design.Has(key) && DependsOnMethod(section.section(), field.name)) {
        out << "# " << field.name << ": " << DefaultInWords(section.section(), field.name);
        if (with_help) out << "  # " << field.help;
        out << "\n";
      } else {
        WriteFields(out, {field}, with_help);
      }
    }
  }
}

}  // namespace

RunConfig RunConfig::FromToml(const std::string& text, const std::string& file_name,
                              const std::string& parameter_file) {
  const toml::table document = Parsed(text, file_name);
  RunConfig config;
  std::vector<FieldList> sections = PlainSections(config);
  std::vector<std::string> names = {"parameters", "truth", "design"};
  for (const FieldList& section : sections) names.push_back(section.section());
  for (const auto& [key, node] : document) {
    const std::string name(key.str());
    const std::string where = TomlPlace(file_name, node);
    if (!node.is_table()) {
      throw UsageError(fmt::format("{}: '{}' stands outside of a section{}; the sections are {}", where, name,
                                   DidYouMean(name, names), fmt::join(names, ", ")));
    }
    const toml::table& table = *node.as_table();
    if (name == "parameters") {
      config.presets = PresetsFromToml(table, file_name);
      config.parameters = ParametersFromToml(table, file_name, parameter_file);
    } else if (name == "design") {
      ReadDesign(table, file_name, config.design);
    } else if (name == "truth") {
      for (const auto& [parameter, value] : table) {
        const std::string at = TomlPlace(file_name, value), what(parameter.str());
        config.truth[what] = NumberAt(TomlToJson(value, at), "truth." + what, at);
      }
    } else {
      const auto section = std::ranges::find(sections, name, &FieldList::section);
      if (section == sections.end()) {
        throw UsageError(fmt::format("{}: [{}] is not a section{}; the sections are {}", where, name,
                                     DidYouMean(name, names), fmt::join(names, ", ")));
      }
      ReadSection(table, file_name, *section);
    }
  }
  if (const toml::node* quantities = document["task"]["quantities"].node()) {
    ReadQuantities(*quantities, file_name, config.task.model.quantities);
  }
  if (const toml::node* constants = document["task"]["constants"].node()) {
    config.task.constants = ConstantsFromToml(*constants, file_name);
  }
  if (const toml::node* recordings = document["data"]["recordings"].node()) {
    config.data.recordings = ReadRecordings(*recordings, file_name);
  }
  if (const toml::node* settings = document["design"]["settings"].node()) {
    config.settings = ReadDesignSettings(*settings, config.design, file_name);
  }
  // Without a [parameters] section there is nothing to add to the file.
  if (!parameter_file.empty() && !document.contains("parameters")) {
    config.parameters = ParametersFromToml({}, file_name, parameter_file);
  }
  config.data.path = BesideFile(config.data.path, file_name);
  std::string& model = config.task.model.model;
  if (!model.starts_with("package:")) model = BesideFile(model, file_name);
  try {
    config.task.Resolve();
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", file_name, e.what()));
  }
  return config;
}

RunConfig RunConfig::FromTomlFile(const std::string& path, const std::string& parameter_file) {
  return FromToml(ReadFile(path), path, parameter_file);
}

json RunConfig::ToJson() const {
  RunConfig copy = *this;
  json object;
  for (const FieldList& section : PlainSections(copy)) object[section.section()] = section.ToJson();
  object["task"] = task.ToJson();
  if (!data.recordings.empty()) object["data"]["recordings"] = data.RecordingsToJson();
  if (!task.is_grid()) object.erase("grid");
  object["design"] = design.ToJson();
  for (const auto& [name, setting] : settings) object["design"]["settings"][name] = setting.ToJson();
  object["parameters"] = json::object();
  if (!presets.empty()) object["parameters"]["preset"] = presets;
  for (const ParameterSpec& spec : parameters) object["parameters"][spec.name] = ParameterToJson(spec);
  if (!truth.empty()) object["truth"] = truth;
  return object;
}

std::string RunConfig::ToToml() const {
  RunConfig copy = *this;
  std::ostringstream out;
  out << "# The resolved configuration of this run: every setting, defaults included.\n";
  for (const FieldList& section : PlainSections(copy)) {
    if (section.section() == "grid") continue;  // with the task
    if (section.section() == "task") {
      out << "\n" << task.ToToml();
      continue;
    }
    out << "\n[" << section.section() << "]\n";
    WriteFields(out, section.fields(), true);
    if (section.section() == "data" && !data.recordings.empty()) {
      out << "recordings = ";
      WriteTomlValue(out, data.RecordingsToJson());
      out << "\n";
    }
    if (section.section() == "run") {
      out << "\n[parameters]\n";
      if (!presets.empty()) out << "preset = " << json(presets).dump() << "\n";
      for (const ParameterSpec& spec : parameters) {
        out << spec.name << " = ";
        WriteTomlValue(out, ParameterToJson(spec));
        out << "\n";
      }
    }
    if (section.section() == "clone") {
      WriteDesign(out, "design", design, true);
      for (const auto& [name, setting] : settings) WriteDesign(out, "design.settings." + name, setting, false);
    }
  }
  if (!truth.empty()) {
    out << "\n[truth]  # read by the evaluation and the report only\n";
    for (const auto& [name, value] : truth) out << name << " = " << json(value).dump() << "\n";
  }
  return out.str();
}

}  // namespace oted
