#pragma once
/// What a TOML file holds, with the place of each thing for errors.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "oted/base/toml.h"

namespace oted {

/// "file:line" of a key, for errors.
std::string TomlPlace(const std::string& file_name, const toml::node& node);

/// @throws UsageError for dates and times, which no setting is
nlohmann::json TomlToJson(const toml::node& node, const std::string& where);

/// @param what  the setting's name, for the error
/// @throws UsageError unless the value is a number
double NumberAt(const nlohmann::json& value, const std::string& what, const std::string& where);

/// What a file may also write for a setting whose field is text: a count or a word, a choice that may be a truth value.
enum class OtherType { kNone, kInteger, kBoolean };
OtherType OtherTypeOf(std::string_view section, std::string_view setting);

/// A path in a configuration is relative to its folder.
std::string BesideFile(const std::string& path, const std::string& file_name);

}  // namespace oted
