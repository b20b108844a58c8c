#pragma once
/// Which columns of a log a setting means.

#include <map>
#include <string>
#include <vector>

namespace oted {

/// The columns whose names match `pattern` (MatchesGlob), by number, with the name that the pattern meant: among the
/// log's names, or the task's where the log has none of these.
std::map<int, std::string> MatchingColumns(const std::string& pattern, const std::vector<std::string>& names,
                                           const std::vector<std::string>& task_names);

/// "'LOG' has no WHAT 'PATTERN'; it has a, b"
std::string NoSuchColumn(const std::string& file, const std::string& what, const std::string& pattern,
                         const std::vector<std::string>& names, const std::vector<std::string>& task_names);

}  // namespace oted
