#pragma once
/// The section [parameters] of a configuration (docs/parameters.md).

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/toml.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// One parameter's table as a JSON schema: the reader takes the keys from here.
const nlohmann::ordered_json& ParameterSchema();
/// [parameters] likewise; a parameter's schema stands in "definitions" (task_file_schema.h).
nlohmann::ordered_json ParametersSchema();
/// The same of one entry of [task.constants].
nlohmann::ordered_json ConstantSchema();

/// preset = "arm", or ["arm", "gripper"]; none where there is no such line.
std::vector<std::string> PresetsFromToml(const toml::table& section, const std::string& file_name);

/// The mujoco.sysid file that the section names; empty: none. @throws UsageError where the name is empty
std::string SysidFileOf(const toml::table& section, const std::string& file_name);

/// In the order of the file, which is the order of z; those of a mujoco.sysid file come first.
/// @param parameter_file  the mujoco.sysid file to read: the section's own or one in its place; empty: none
/// @throws UsageError with file and line
std::vector<ParameterSpec> ParametersFromToml(const toml::table& section, const std::string& file_name,
                                              const std::string& parameter_file);

/// [task.constants], in the order of the file. @throws UsageError with file and line
std::vector<ParameterSpec> ConstantsFromToml(const toml::node& section, const std::string& file_name);
nlohmann::json ConstantToJson(const ParameterSpec& constant);

/// One parameter as [parameters] has it.
nlohmann::json ParameterToJson(const ParameterSpec& spec);
/// "delay = { field = "action/delay", range = [0, 3], scale = "absolute" }": what adds it to [parameters], without a
/// belief and a unit. @param width  of the name
std::string ParameterLine(const ParameterSpec& spec, size_t width = 0);

}  // namespace oted
