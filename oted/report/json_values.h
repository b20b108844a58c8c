#pragma once
/// Reads values from result files in which some may be missing: a field that is not there, is null or has another type
/// is not known, and the page says so.

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace oted {

inline std::optional<double> AsNumber(const nlohmann::json& value) {
  if (!value.is_number()) return std::nullopt;
  const double number = value.get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

inline std::optional<double> NumberAt(const nlohmann::json& object, const char* key) {
  if (!object.is_object() || !object.contains(key)) return std::nullopt;
  return AsNumber(object[key]);
}

/// Text, or a number or truth value as text; else "".
inline std::string AsText(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.is_number() || value.is_boolean() ? value.dump() : "";
}

inline std::string TextAt(const nlohmann::json& object, const char* key) {
  return object.is_object() && object.contains(key) ? AsText(object[key]) : "";
}

inline const nlohmann::json& EmptyList() {
  static const nlohmann::json kEmpty = nlohmann::json::array();
  return kEmpty;
}

/// The list at `key`, or an empty one. Valid as long as `object`.
inline const nlohmann::json& ListAt(const nlohmann::json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key].is_array() ? object[key] : EmptyList();
}

}  // namespace oted
