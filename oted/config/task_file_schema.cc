#include "oted/config/task_file_schema.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "oted/config/parameters_toml.h"
#include "oted/config/run_config.h"
#include "oted/config/toml_reader.h"

namespace oted {
namespace {

using nlohmann::ordered_json;

template <class T>
constexpr const char* kJsonType = "number";
template <>
constexpr const char* kJsonType<bool> = "boolean";
template <>
constexpr const char* kJsonType<int> = "integer";
template <>
constexpr const char* kJsonType<int64_t> = "integer";
template <>
constexpr const char* kJsonType<std::string> = "string";
template <>
constexpr const char* kJsonType<NamedTarget> = "string";

void AddRange(ordered_json& schema, const Range& range) {
  if (std::isfinite(range.low)) schema[range.low_open ? "exclusiveMinimum" : "minimum"] = range.low;
  if (std::isfinite(range.high)) schema[range.high_open ? "exclusiveMaximum" : "maximum"] = range.high;
}

template <class T>
ordered_json SchemaOfBound(const std::vector<T>*, const Range& range) {
  ordered_json items = {{"type", kJsonType<T>}};
  AddRange(items, range);
  return {{"type", "array"}, {"items", items}};
}
template <class T>
ordered_json SchemaOfBound(const std::map<std::string, T>*, const Range& range) {
  ordered_json values = {{"type", kJsonType<T>}};
  AddRange(values, range);
  return {{"type", "object"}, {"additionalProperties", values}};
}
template <class T>
ordered_json SchemaOfBound(const T*, const Range& range) {
  ordered_json schema = {{"type", kJsonType<T>}};
  AddRange(schema, range);
  return schema;
}

/// A default that depends on the method stands in the description alone.
ordered_json SchemaOf(const std::string& section, const Field& field) {
  ordered_json schema = std::visit(
      [&](const auto& bound) {
        if constexpr (std::is_pointer_v<std::decay_t<decltype(bound)>>) return SchemaOfBound(bound, field.range);
        return SchemaOfBound(&bound, field.range);
      },
      field.target);
  if (!field.choices.empty()) schema["enum"] = field.choices;
  if (const OtherType other = OtherTypeOf(section, field.name); other != OtherType::kNone) {
    const ordered_json text = std::exchange(schema, ordered_json::object());
    schema["anyOf"] = {text, {{"type", other == OtherType::kInteger ? "integer" : "boolean"}}};
  }
  schema["description"] = field.help;
  return schema;
}

ordered_json Table(ordered_json properties) {
  return {{"type", "object"}, {"properties", std::move(properties)}, {"additionalProperties", false}};
}

ordered_json SchemaOf(const FieldList& section) {
  ordered_json properties = ordered_json::object();
  for (const Field& field : section.fields()) {
    properties[field.name] = SchemaOf(section.section(), field);
    properties[field.name]["default"] = field.ToJson();
  }
  return Table(properties);
}

/// [design] without [design.settings]: settings, and sections of them.
ordered_json DesignProperties() {
  DesignChoice choice;
  DesignConfig config = choice.Assumed();
  const Field method = choice.MethodField();
  ordered_json properties = {{method.name, SchemaOf("design", method)}};
  properties[method.name]["default"] = method.ToJson();
  for (const FieldList& section : config.Sections()) {
    ordered_json table = SchemaOf(section);
    for (const Field& field : section.fields()) {
      if (!DependsOnMethod(section.section(), field.name)) continue;
      ordered_json& setting = table["properties"][field.name];
      setting.erase("default");
      setting["description"] =
          fmt::format("{}. Default: {}", field.help, DefaultInWords(section.section(), field.name));
    }
    const size_t dot = section.section().find('.');
    if (dot == std::string::npos) {
      properties.update(table["properties"]);
    } else {
      properties[section.section().substr(dot + 1)] = table;
    }
  }
  return properties;
}

ordered_json DesignSchema() {
  ordered_json properties = DesignProperties(), of_setting;
  for (const auto& [key, unused] : properties.items())
    of_setting[key] = {{"$ref", "#/properties/design/properties/" + key}};
  properties["settings"] = {
      {"type", "object"},
      {"additionalProperties", Table(of_setting)},
      {"description", "[design.settings.NAME]: hyperparameter settings to select from; each changes what it names"}};
  return Table(properties);
}

}  // namespace

ordered_json TaskFileSchema() {
  RunConfig defaults;
  ordered_json sections = ordered_json::object();
  for (const FieldList& section : PlainSections(defaults)) {
    sections[section.section()] = SchemaOf(section);
    if (section.section() == "data") sections["parameters"] = ParametersSchema();
    if (section.section() == "clone") sections["design"] = DesignSchema();
  }
  sections["task"]["properties"]["quantities"] = {{"type", "object"},
                                                  {"additionalProperties", {{"type", "string"}}},
                                                  {"description", "NAME = \"PATH\": what expressions may read"}};
  sections["task"]["properties"]["constants"] = {
      {"type", "object"},
      {"additionalProperties", ConstantSchema()},
      {"description", "NAME = { field = \"PATH\" }: known numbers that differ between recordings"}};
  const ordered_json file = {{"type", "string"}, {"minLength", 1}};
  ordered_json recording =
      Table({{"path", file}, {"constants", {{"type", "object"}, {"additionalProperties", {{"type", "number"}}}}}});
  recording["required"] = {"path"};
  sections["data"]["properties"]["recordings"] = {{"type", "array"},
                                                  {"minItems", 1},
                                                  {"items", {{"anyOf", {file, recording}}}},
                                                  {"description", "several files, with the constants of each"}};
  sections["truth"] = {{"type", "object"},
                       {"additionalProperties", {{"type", "number"}}},
                       {"description", "NAME = value, where it is known; only what prints results reads it"}};
  ordered_json schema = {{"$schema", "http://json-schema.org/draft-07/schema#"},
                         {"title", "oted.task/1"},
                         {"description", "A task file of oted: docs/configuration.md, docs/task_files.md"}};
  schema.update(Table(sections));
  schema["definitions"] = {{"parameter", ParameterSchema()}};
  return schema;
}

std::string TaskFileSchemaText() { return TaskFileSchema().dump(2) + "\n"; }

}  // namespace oted
