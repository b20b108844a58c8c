#pragma once
/// Settings as --help shows them.

#include <string>
#include <vector>

namespace oted::cli {

/// The settings of the named sections, of all where none is named, with types, defaults and units, for a verb's --help.
std::string SettingsHelp(const std::vector<std::string>& sections = {});

}  // namespace oted::cli
