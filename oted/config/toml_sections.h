#pragma once
/// The sections of a run's TOML, read and written. What is wrong in one is a UsageError with file and line.

#include <iosfwd>
#include <map>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/toml.h"
#include "oted/config/run_config.h"

namespace oted {

/// A section of plain settings. What is no setting in it, such as [task.quantities], is read apart.
void ReadSection(const toml::table& table, const std::string& file_name, FieldList& section);
/// [task.quantities]: name = "path".
void ReadQuantities(const toml::node& node, const std::string& file, std::map<std::string, std::string>& quantities);
/// data.recordings = ["monday.csv", { path = "friday.csv", constants = { payload = 0.4 } }], or [[data.recordings]].
std::vector<DataConfig::Recording> ReadRecordings(const toml::node& node, const std::string& file);
/// [design], or one of [design.settings]: settings, and sections of them.
void ReadDesign(const toml::table& table, const std::string& file_name, DesignChoice& design);
/// [design.settings.NAME]: the settings h start from [design] and change what they name.
std::map<std::string, DesignChoice> ReadDesignSettings(const toml::node& node, const DesignChoice& design,
                                                       const std::string& file_name);
/// "name = value" lines. @param with_help  what each is, as a comment behind it
void WriteFields(std::ostream& out, const std::vector<Field>& fields, bool with_help);
/// [design] or [design.settings.NAME] and its sections. A default that differs between methods is a comment: what a
/// file says counts as given, whatever method runs.
void WriteDesign(std::ostream& out, const std::string& name, const DesignChoice& design, bool with_help);

}  // namespace oted
