#include "oted/config/parameters_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/config/toml_reader.h"
#include "oted/sim/presets.h"
#include "oted/sim/sysid_file.h"

namespace oted {

using nlohmann::json;
using nlohmann::ordered_json;

const ordered_json& ParameterSchema() {
  const ordered_json number = {{"type", "number"}}, text = {{"type", "string"}};
  static const ordered_json schema = {
      {"type", "object"},
      {"required", {"field"}},
      {"additionalProperties", false},
      {"properties",
       {{"field",
         {{"anyOf", {text, {{"type", "array"}, {"items", text}, {"minItems", 1}}}},
          {"description", "path of the numbers, as geom/*/friction[0]; a list of paths ties them together"}}},
        {"range",
         {{"type", "array"},
          {"items", number},
          {"minItems", 2},
          {"maxItems", 2},
          {"description", "[low, high]: multiples of nominal, or with scale = \"absolute\" the values themselves"}}},
        {"scale", {{"enum", {"nominal", "absolute"}}, {"default", "nominal"}, {"description", "what range counts in"}}},
        {"log", {{"type", "boolean"}, {"default", false}, {"description", "search in the logarithm"}}},
        {"unit", {{"type", "string"}, {"description", "for tables and the report"}}},
        {"prior",
         {{"type", "object"},
          {"required", {"mean", "std"}},
          {"additionalProperties", false},
          {"properties", {{"mean", number}, {"std", number}}},
          {"description", "a belief, which design.prior = \"gaussian\" uses"}}}}}};
  return schema;
}

ordered_json ConstantSchema() {
  ordered_json schema = ParameterSchema(), properties;
  for (const char* key : {"field", "scale", "unit"}) properties[key] = schema["properties"][key];
  properties["scale"]["description"] = "what the recordings' values count in";
  schema["properties"] = properties;
  return schema;
}

namespace {

std::vector<std::string> KeysOf(const ordered_json& schema) {
  std::vector<std::string> keys;
  for (const auto& [key, unused] : schema.at("properties").items()) keys.push_back(key);
  return keys;
}

/// A path, or a list of paths that are tied together.
bool IsPath(const json& field) {
  if (field.is_string()) return true;
  return field.is_array() && !field.empty() &&
         std::ranges::all_of(field, [](const json& path) { return path.is_string(); });
}

/// What parameters and constants have in common. @param keys  that the table may have
ParameterSpec FieldFromJson(const char* section, const std::string& name, const json& table, const std::string& where,
                            const std::vector<std::string>& keys) {
  ParameterSpec spec;
  spec.name = name;
  if (!table.is_object() || !table.contains("field") || !IsPath(table["field"])) {
    throw UsageError(
        fmt::format("{}: {}.{} needs a field, for example field = \"geom/*/friction[0]\"; a list of paths "
                    "ties them together",
                    where, section, name));
  }
  for (const auto& [key, value] : table.items()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      throw UsageError(fmt::format("{}: {}.{}.{} is not a setting{}; it has {}", where, section, name, key,
                                   DidYouMean(key, keys), fmt::join(keys, ", ")));
    }
  }
  for (const json& path : table["field"].is_array() ? table["field"] : json::array({table["field"]})) {
    spec.field += (spec.field.empty() ? "" : " + ") + path.get<std::string>();
  }
  const std::string prefix = fmt::format("{}.{}.", section, name);
  if (table.contains("scale")) {
    if (table["scale"] != "nominal" && table["scale"] != "absolute") {
      throw UsageError(
          fmt::format("{}: {}scale is {}, wanted \"nominal\" (multiples of the nominal value) or \"absolute\"", where,
                      prefix, table["scale"].dump()));
    }
    if (table["scale"] == "absolute") spec.scale = ParameterScale::kAbsolute;
  }
  if (table.contains("unit")) {
    if (!table["unit"].is_string())
      throw UsageError(fmt::format("{}: {}unit is {}, wanted text", where, prefix, table["unit"].dump()));
    spec.unit = table["unit"].get<std::string>();
  }
  return spec;
}

/// @param needs_range  of an absolute parameter; false where a parameter file gives it
ParameterSpec ParameterFromJson(const std::string& name, const json& table, const std::string& where,
                                bool needs_range) {
  ParameterSpec spec = FieldFromJson("parameters", name, table, where, KeysOf(ParameterSchema()));
  const std::string prefix = fmt::format("parameters.{}.", name);
  if (table.contains("range")) {
    const json& range = table["range"];
    if (!range.is_array() || range.size() != 2) {
      throw UsageError(fmt::format("{}: {}range is {}, wanted [low, high]", where, prefix, range.dump()));
    }
    spec.low = NumberAt(range[0], prefix + "range[0]", where);
    spec.high = NumberAt(range[1], prefix + "range[1]", where);
  } else if (spec.scale == ParameterScale::kAbsolute && needs_range) {
    throw UsageError(
        fmt::format("{}: {}range is missing; an absolute parameter needs range = [low, high]", where, prefix));
  }
  if (table.contains("log")) {
    if (!table["log"].is_boolean())
      throw UsageError(fmt::format("{}: {}log is {}, wanted true|false", where, prefix, table["log"].dump()));
    spec.logarithmic = table["log"].get<bool>();
  }
  if (table.contains("prior")) {
    const json& prior = table["prior"];
    if (!prior.is_object() || prior.size() != 2 || !prior.contains("mean") || !prior.contains("std")) {
      throw UsageError(
          fmt::format("{}: {}prior is {}, wanted {{ mean = 1.0, std = 0.1 }}", where, prefix, prior.dump()));
    }
    spec.prior = ParameterSpec::Belief{NumberAt(prior["mean"], prefix + "prior.mean", where),
                                       NumberAt(prior["std"], prefix + "prior.std", where)};
  }
  try {
    // A range that a parameter file gives is not known yet: the whole is checked again.
    ParameterSpec known = spec;
    if (!table.contains("range") && !needs_range) known.prior.reset();
    known.Check();
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", where, e.what()));
  }
  return spec;
}

/// The keys as they stand in the file.
std::vector<std::string> InOrder(const toml::table& section) {
  std::vector<std::pair<toml::source_position, std::string>> order;
  for (const auto& [key, node] : section) order.push_back({node.source().begin, std::string(key.str())});
  std::sort(order.begin(), order.end());
  std::vector<std::string> keys;
  for (auto& [position, key] : order) keys.push_back(std::move(key));
  return keys;
}

}  // namespace

ordered_json ParametersSchema() {
  const ordered_json preset = {{"enum", PresetNames()}};
  const ordered_json parameter = {{"$ref", "#/definitions/parameter"}};
  const auto or_parameter = [&](const ordered_json& plain, const char* help) {
    ordered_json schema = {{"anyOf", plain}, {"description", help}};
    schema["anyOf"].push_back(parameter);  // a parameter may be called so
    return schema;
  };
  return {
      {"type", "object"},
      {"properties",
       {{"preset", or_parameter({preset, {{"type", "array"}, {"items", preset}}},
                                "parameters that are usually off: a preset's name, or a list of names")},
        {"sysid", or_parameter({{{"type", "string"}, {"minLength", 1}}}, "a parameter file of mujoco.sysid (YAML)")}}},
      {"additionalProperties", parameter}};
}

std::vector<std::string> PresetsFromToml(const toml::table& section, const std::string& file_name) {
  std::vector<std::string> presets;
  const toml::node* preset = section.get("preset");
  if (preset == nullptr || preset->is_table()) return presets;  // a parameter may be called so
  const std::string where = TomlPlace(file_name, *preset);
  const json value = TomlToJson(*preset, where);
  for (const json& name : value.is_array() ? value : json::array({value})) {
    if (!name.is_string()) {
      throw UsageError(fmt::format("{}: parameters.preset is {}, wanted a preset's name or a list of names, of {}",
                                   where, value.dump(), fmt::join(PresetNames(), ", ")));
    }
    presets.push_back(name.get<std::string>());
  }
  return presets;
}

std::string SysidFileOf(const toml::table& section, const std::string& file_name) {
  const toml::node* named = section.get("sysid");
  if (named == nullptr || !named->is_string()) return "";
  if ((**named->as_string()).empty()) {
    throw UsageError(
        fmt::format("{}: parameters.sysid names no file; name one, or remove the line", TomlPlace(file_name, *named)));
  }
  return BesideFile(**named->as_string(), file_name);
}

std::vector<ParameterSpec> ParametersFromToml(const toml::table& section, const std::string& file_name,
                                              const std::string& parameter_file) {
  const bool names_file = !SysidFileOf(section, file_name).empty();
  const std::vector<SysidParameter> given =
      parameter_file.empty() ? std::vector<SysidParameter>{} : ReadSysidFile(parameter_file);
  std::vector<ParameterSpec> declared;
  std::vector<bool> has_range;
  for (const std::string& name : InOrder(section)) {
    if ((name == "sysid" && names_file) || (name == "preset" && !section.get(name)->is_table())) continue;
    const std::string at = TomlPlace(file_name, *section.get(name));
    const json entry = TomlToJson(*section.get(name), at);
    const bool in_file = std::ranges::any_of(given, [&](const auto& p) { return p.spec.name == name; });
    declared.push_back(ParameterFromJson(name, entry, at, !in_file));
    has_range.push_back(entry.contains("range"));
  }
  return parameter_file.empty() ? declared : MergeSysid(given, parameter_file, declared, has_range);
}

std::vector<ParameterSpec> ConstantsFromToml(const toml::node& section, const std::string& file_name) {
  constexpr double kAny = 1e9;  // values come with the recordings
  if (!section.is_table()) {
    throw UsageError(
        fmt::format("{}: task.constants is no table; write [task.constants] and NAME = {{ field = \"PATH\" }} below it",
                    TomlPlace(file_name, section)));
  }
  std::vector<ParameterSpec> constants;
  for (const std::string& name : InOrder(*section.as_table())) {
    const toml::node& node = *section.as_table()->get(name);
    const std::string at = TomlPlace(file_name, node);
    constants.push_back(FieldFromJson("task.constants", name, TomlToJson(node, at), at, KeysOf(ConstantSchema())));
    constants.back().is_known = true;
    constants.back().low = -kAny;
    constants.back().high = kAny;
  }
  return constants;
}

json ConstantToJson(const ParameterSpec& constant) {
  return {{"field", constant.field},
          {"scale", constant.scale == ParameterScale::kAbsolute ? "absolute" : "nominal"},
          {"unit", constant.unit}};
}

json ParameterToJson(const ParameterSpec& spec) {
  const bool is_absolute = spec.scale == ParameterScale::kAbsolute;
  json table = {{"field", spec.field},
                {"range", {spec.low, spec.high}},
                {"scale", is_absolute ? "absolute" : "nominal"},
                {"log", spec.logarithmic}};
  // A value whose unit nobody gave has the unit of its field, which the simulator knows.
  if (!is_absolute || spec.unit != ParameterSpec().unit) table["unit"] = spec.unit;
  if (spec.prior) table["prior"] = {{"mean", spec.prior->mean}, {"std", spec.prior->std}};
  return table;
}

std::string ParameterLine(const ParameterSpec& spec, size_t width) {
  std::string field;
  const std::vector<std::string> paths = TiedPaths(spec.field);  // several are a list in a file
  for (const std::string& path : paths) field += (field.empty() ? "" : ", ") + json(path).dump();
  if (paths.size() > 1) field = "[" + field + "]";
  return fmt::format("{:<{}} = {{ field = {}, range = [{:g}, {:g}]{}{} }}", spec.name, width, field, spec.low,
                     spec.high, spec.scale == ParameterScale::kAbsolute ? ", scale = \"absolute\"" : "",
                     spec.logarithmic ? ", log = true" : "");
}

}  // namespace oted
