#include "oted/config/toml_sections.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <ostream>

#include "oted/base/error.h"
#include "oted/config/former_names.h"
#include "oted/config/toml_reader.h"
#include "oted/config/toml_writer.h"
#include "oted/stages/design/prior_source.h"

namespace oted {

using nlohmann::json;

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

std::vector<DataConfig::Recording> ReadRecordings(const toml::node& node, const std::string& file) {
  const std::string at = TomlPlace(file, node);
  const json list = TomlToJson(node, at);
  const auto refuse = [&](const std::string& what) {
    throw UsageError(
        fmt::format("{}: {}; wanted [\"monday.csv\", {{ path = \"friday.csv\", constants = {{ payload = "
                    "0.4 }} }}, ...]",
                    at, what));
  };
  if (!list.is_array() || list.empty()) refuse("data.recordings is no list of recordings");
  std::vector<DataConfig::Recording> recordings;
  for (json entry : list) {
    if (entry.is_string()) entry = {{"path", entry}};
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

void ReadSection(const toml::table& table, const std::string& file_name, FieldList& section) {
  for (const auto& [key, node] : table) {
    if (section.IsStructure(key.str())) continue;
    const std::string at = TomlPlace(file_name, node);
    RefuseFormerName(section.section(), key.str(), at);
    json value = TomlToJson(node, at);
    const OtherType other = OtherTypeOf(section.section(), key.str());
    if (other == OtherType::kInteger ? value.is_number_integer() : other == OtherType::kBoolean && value.is_boolean()) {
      value = value.dump();
    }
    section.Find(std::string(key.str()), at).FromJson(value, at);
  }
}

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
        out << "# " << field.name;
        if (design.method) {
          out << " = ";
          WriteTomlValue(out, field.ToJson());
          out << " (not given: as method and starts have it)";
        } else {
          out << ": " << DefaultInWords(section.section(), field.name);
        }
        if (with_help) out << "  # " << field.help;
        out << "\n";
      } else {
        WriteFields(out, {field}, with_help);
      }
    }
  }
}

}  // namespace oted
