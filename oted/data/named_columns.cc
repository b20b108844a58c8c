#include "oted/data/named_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "oted/base/glob.h"

namespace oted {

std::map<int, std::string> MatchingColumns(const std::string& pattern, const std::vector<std::string>& names,
                                           const std::vector<std::string>& task_names) {
  std::map<int, std::string> found;
  for (const std::vector<std::string>* known : {&names, &task_names}) {
    for (size_t j = 0; j < known->size(); ++j) {
      if (MatchesGlob(pattern, (*known)[j])) found.emplace(static_cast<int>(j), (*known)[j]);
    }
    if (!found.empty()) break;
  }
  return found;
}

std::string NoSuchColumn(const std::string& file, const std::string& what, const std::string& pattern,
                         const std::vector<std::string>& names, const std::vector<std::string>& task_names) {
  const std::vector<std::string>& known = names.empty() ? task_names : names;
  return fmt::format("'{}' has no {} '{}'; it has {}", file, what, pattern,
                     known.empty() ? "no names: give them, or a task" : fmt::format("{}", fmt::join(known, ", ")));
}

}  // namespace oted
