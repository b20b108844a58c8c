#include "oted/config/toml_reader.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"

namespace oted {

using nlohmann::json;

std::string TomlPlace(const std::string& file_name, const toml::node& node) {
  return fmt::format("{}:{}", file_name, node.source().begin.line);
}

json TomlToJson(const toml::node& node, const std::string& where) {
  if (const auto* table = node.as_table()) {
    json object = json::object();
    for (const auto& [key, value] : *table) object[std::string(key.str())] = TomlToJson(value, where);
    return object;
  }
  if (const auto* array = node.as_array()) {
    json values = json::array();
    for (const auto& value : *array) values.push_back(TomlToJson(value, where));
    return values;
  }
  if (const auto value = node.value_exact<std::string>()) return *value;
  if (const auto value = node.value_exact<int64_t>()) return *value;
  if (const auto value = node.value_exact<double>()) return *value;
  if (const auto value = node.value_exact<bool>()) return *value;
  throw UsageError(fmt::format("{}: dates and times are no settings", where));
}

double NumberAt(const json& value, const std::string& what, const std::string& where) {
  if (!value.is_number()) throw UsageError(fmt::format("{}: {} is {}, wanted a number", where, what, value.dump()));
  return value.get<double>();
}

OtherType OtherTypeOf(std::string_view section, std::string_view setting) {
  if (section == "data" && setting == "episodes") return OtherType::kInteger;
  if (section == "report" && setting == "motion") return OtherType::kBoolean;
  return OtherType::kNone;
}

std::string BesideFile(const std::string& path, const std::string& file_name) {
  const std::filesystem::path folder = std::filesystem::path(file_name).parent_path();
  return path.empty() || std::filesystem::path(path).is_absolute() ? path : (folder / path).lexically_normal().string();
}

}  // namespace oted
