#include "oted/sim/mujoco/object_path.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>

#include "oted/base/error.h"
#include "oted/base/fields.h"

namespace oted {

bool MatchesPattern(std::string_view pattern, std::string_view text) {
  if (pattern.empty()) return text.empty();
  if (pattern.front() == '*') {
    return MatchesPattern(pattern.substr(1), text) || (!text.empty() && MatchesPattern(pattern, text.substr(1)));
  }
  return !text.empty() && (pattern.front() == '?' || pattern.front() == text.front()) &&
         MatchesPattern(pattern.substr(1), text.substr(1));
}

FieldRef ParseField(std::string_view text, const std::string& what) {
  FieldRef ref{std::string(text)};
  const size_t open = text.find('[');
  if (open == std::string_view::npos) return ref;
  ref.name = text.substr(0, open);
  const std::string_view inside = text.substr(open + 1, text.size() - open - 2);
  if (text.back() != ']') throw UsageError(fmt::format("{}: '[' without a final ']'", what));
  if (inside == "*") return ref;
  const auto [end, error] = std::from_chars(inside.data(), inside.data() + inside.size(), ref.index);
  if (error != std::errc{} || end != inside.data() + inside.size() || ref.index < 0) {
    throw UsageError(fmt::format("{}: got index '{}', wanted a number from 0 on, or *", what, inside));
  }
  return ref;
}

std::string ObjectName(const mjModel& model, mjtObj type, int id) {
  const char* name = type == mjOBJ_UNKNOWN ? nullptr : mj_id2name(&model, type, id);
  return name == nullptr || *name == '\0' ? fmt::format("#{}", id) : name;
}

std::vector<int> MatchObjects(const mjModel& model, const ObjectKind& kind, std::string_view pattern,
                              const std::string& what) {
  std::vector<int> ids;
  std::vector<std::string> candidates;
  for (int id = 0; id < kind.count; ++id) {
    const char* name = kind.type == mjOBJ_UNKNOWN ? nullptr : mj_id2name(&model, kind.type, id);
    const std::string by_id = fmt::format("#{}", id);
    if (pattern == by_id || MatchesPattern(pattern, name == nullptr ? "" : name)) ids.push_back(id);
    candidates.push_back(ObjectName(model, kind.type, id));
  }
  if (ids.empty()) {
    throw UsageError(fmt::format("{}: no {} matches '{}'{}; there are {}", what, kind.word, pattern,
                                 DidYouMean(pattern, candidates),
                                 candidates.empty() ? "none" : fmt::format("{}", fmt::join(candidates, ", "))));
  }
  return ids;
}

}  // namespace oted
