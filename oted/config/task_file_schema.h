#pragma once
/// What a task file may hold, as a JSON schema: editors complete and check by it.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace oted {

/// Name of the schema's file: docs/schemas has it, and `oted init --schema` writes it.
inline constexpr const char* kTaskFileSchemaName = "oted.task.1.schema.json";

/// From the fields that RunConfig::FromToml reads, so a new setting is in it by itself. Draft 7: what editors of TOML
/// know. It says less than FromToml: bounds that depend on other settings are not in it.
nlohmann::ordered_json TaskFileSchema();
/// The same as text: the bytes of the file.
std::string TaskFileSchemaText();

}  // namespace oted
