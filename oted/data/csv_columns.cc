#include "oted/data/csv_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>
#include <span>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/data/csv.h"
#include "oted/data/time_column.h"

namespace oted {
namespace {

using Words = std::span<const std::string_view>;
constexpr std::array<std::string_view, 3> kObservationWords = {"observations", "observation", "obs"};
constexpr std::array<std::string_view, 3> kActionWords = {"actions", "action", "act"};
constexpr std::array<std::string_view, 1> kQposWords = {"infos/qpos"};
constexpr std::array<std::string_view, 1> kQvelWords = {"infos/qvel"};
constexpr std::array<std::string_view, 3> kEpisodeNames = {"episode", "episode_id", "episode_index"};
constexpr std::array<std::string_view, 2> kRewardNames = {"reward", "rewards"};
constexpr std::array<std::string_view, 4> kTerminalNames = {"terminal", "terminals", "terminated", "termination"};
constexpr std::array<std::string_view, 4> kTimeoutNames = {"timeout", "timeouts", "truncated", "truncation"};
constexpr size_t kShownColumns = 12;

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

/// What is left of a column's name behind one of the words and a separator; false when it begins otherwise.
bool StripPrefix(const std::string& name, Words words, std::string& rest) {
  const std::string lower = Lower(name);
  for (const std::string_view word : words) {
    if (!BeginsWithPrefix(lower, word)) continue;
    rest = name.substr(word.size());
    if (rest.empty() || rest[0] == '[' || std::isdigit(static_cast<unsigned char>(rest[0])) != 0) {
      rest = name;  // "obs0", "obs[3]", "action": no name of its own
      return true;
    }
    rest.erase(0, 1);
    if (rest.empty() || std::ranges::all_of(rest, [](unsigned char c) { return std::isdigit(c) != 0; })) rest = name;
    return true;
  }
  return false;
}

class Finder {
 public:
  Finder(const std::vector<std::string>& header, const std::string& file) : header_(header), file_(file) {
    for (size_t i = 0; i < header.size(); ++i) {
      if (header[i].empty()) continue;
      const auto [at, is_new] = index_.emplace(header[i], static_cast<int>(i));
      if (!is_new) {
        throw DataError(fmt::format("'{}' line 1: column '{}' stands there twice; rename one", file_, header[i]));
      }
    }
  }

  /// Of the listed names. @throws DataError when one is not there
  int Named(const std::string& name, const char* setting) {
    const auto found = index_.find(name);
    if (found == index_.end()) {
      throw DataError(fmt::format("'{}' has no column '{}' (data.{}){}; its columns are {}", file_, name, setting,
                                  DidYouMean(name, header_), Shown()));
    }
    return Use(found->second, setting);
  }

  std::vector<int> Named(const std::vector<std::string>& names, const char* setting) {
    std::vector<int> columns;
    for (const std::string& name : names) columns.push_back(Named(name, setting));
    return columns;
  }

  /// Columns of these names, -1 for those that are not there; empty where none is.
  std::vector<int> Optional(const std::vector<std::string>& names) {
    std::vector<int> columns;
    for (const std::string& name : names) {
      const auto found = index_.find(name);
      columns.push_back(found == index_.end() ? -1 : Use(found->second, "recordings"));
    }
    return std::ranges::all_of(columns, [](int column) { return column < 0; }) ? std::vector<int>{} : columns;
  }

  bool HasAll(const std::vector<std::string>& names) const {
    return !names.empty() && std::ranges::all_of(names, [&](const std::string& n) { return index_.contains(n); });
  }

  int ByConvention(Words names) {
    for (const std::string_view wanted : names) {
      for (size_t i = 0; i < header_.size(); ++i) {
        if (Lower(header_[i]) == wanted && !used_.contains(static_cast<int>(i))) {
          used_.insert(static_cast<int>(i));
          return static_cast<int>(i);
        }
      }
    }
    return -1;
  }

  int Times() {
    const int column = FindTimeColumn(header_);
    return column >= 0 && used_.insert(column).second ? column : -1;
  }

  std::vector<int> ByPrefix(Words words, std::vector<std::string>& names) {
    std::vector<int> columns;
    for (size_t i = 0; i < header_.size(); ++i) {
      std::string rest;
      if (used_.contains(static_cast<int>(i)) || !StripPrefix(header_[i], words, rest)) continue;
      used_.insert(static_cast<int>(i));
      columns.push_back(static_cast<int>(i));
      names.push_back(rest);
    }
    return columns;
  }

  std::vector<std::string> Unused() const {
    std::vector<std::string> unused;
    for (size_t i = 0; i < header_.size(); ++i) {
      if (!header_[i].empty() && !used_.contains(static_cast<int>(i))) unused.push_back(header_[i]);
    }
    return unused;
  }

  /// @param names  what the task calls them
  [[noreturn]] void FailMissing(const char* what, const char* prefix, const char* setting,
                                const std::vector<std::string>& names) const {
    const auto missing = std::ranges::find_if(names, [&](const std::string& name) { return !index_.contains(name); });
    const bool has_others = std::ranges::any_of(names, [&](const std::string& name) { return index_.contains(name); });
    if (has_others && missing != names.end()) {
      std::vector<std::string> others = Unused();
      std::erase_if(others, [&](const std::string& name) { return std::ranges::find(names, name) != names.end(); });
      throw DataError(fmt::format(
          "'{}' has columns of the task's {}, but none '{}'{}; rename the column, or name all of them in data.{} = "
          "[...]. Its columns are {}",
          file_, what, *missing, DidYouMean(*missing, others), setting, Shown()));
    }
    const std::string called =
        names.empty() ? "" : fmt::format(", and none is '{}'{}", names.front(), DidYouMean(names.front(), Unused()));
    throw DataError(fmt::format(
        "'{}' has no column of {}: none begins with '{}'{}; name them in data.{} = [...] of a task file, which "
        "'oted init MODEL.xml {}' writes. Its columns are {}",
        file_, what, prefix, called, setting, file_, Shown()));
  }

 private:
  int Use(int column, const char* setting) {
    if (!used_.insert(column).second) {
      throw DataError(
          fmt::format("'{}': column '{}' is named twice in the data settings (again in data.{}); each column "
                      "holds one thing",
                      file_, header_[static_cast<size_t>(column)], setting));
    }
    return column;
  }

  std::string Shown() const {
    const size_t n = std::min(header_.size(), kShownColumns);
    const std::span<const std::string> first(header_.data(), n);
    return fmt::format("'{}'{}", fmt::join(first, "', '"),
                       n < header_.size() ? fmt::format(" and {} more", header_.size() - n) : "");
  }

  const std::vector<std::string>& header_;
  const std::string& file_;
  std::map<std::string, int> index_;
  std::set<int> used_;
};

std::vector<std::string> StripNames(const std::vector<std::string>& names, Words words) {
  std::vector<std::string> stripped = names;
  for (std::string& name : stripped) {
    std::string rest;
    if (StripPrefix(name, words, rest)) name = rest;
  }
  return stripped;
}

}  // namespace

bool BeginsWithPrefix(std::string_view name, std::string_view word) {
  return name.starts_with(word) &&
         (name.size() == word.size() ||
          std::string_view("._/: [0123456789").find(name[word.size()]) != std::string_view::npos);
}

CsvColumns FindColumns(const std::vector<std::string>& header, const DataOptions& options, const std::string& file) {
  CheckSeparator(header, file);
  const CsvLayout& layout = options.columns;
  Finder finder(header, file);
  CsvColumns columns;
  // What the user names comes first: a listed column is not taken for something else.
  if (!layout.observations.empty()) columns.observations = finder.Named(layout.observations, "observations");
  if (!layout.actions.empty()) columns.actions = finder.Named(layout.actions, "actions");
  const auto named = [&](const std::string& name, const char* setting) {
    return name.empty() ? -1 : finder.Named(name, setting);
  };
  columns.episode = named(layout.episode, "episode");
  columns.time = named(layout.time, "time");
  columns.reward = named(layout.reward, "reward");
  columns.terminal = named(layout.terminal, "terminal");
  columns.timeout = named(layout.timeout, "timeout");
  columns.constants = finder.Optional(options.constant_names);
  if (columns.observations.empty() && finder.HasAll(options.observation_names)) {
    columns.observations = finder.Named(options.observation_names, "observations");
    columns.observation_names = options.observation_names;
  } else if (columns.observations.empty()) {
    columns.observations = finder.ByPrefix(kObservationWords, columns.observation_names);
  } else {
    columns.observation_names = StripNames(layout.observations, kObservationWords);
  }
  if (columns.actions.empty() && finder.HasAll(options.action_names)) {
    columns.actions = finder.Named(options.action_names, "actions");
    columns.action_names = options.action_names;
  } else if (columns.actions.empty()) {
    columns.actions = finder.ByPrefix(kActionWords, columns.action_names);
  } else {
    columns.action_names = StripNames(layout.actions, kActionWords);
  }
  if (columns.observations.empty()) {
    finder.FailMissing("observations", "obs", "observations", options.observation_names);
  }
  if (columns.actions.empty()) finder.FailMissing("actions", "act", "actions", options.action_names);
  std::vector<std::string> unnamed;
  columns.qpos = finder.ByPrefix(kQposWords, unnamed);
  columns.qvel = finder.ByPrefix(kQvelWords, unnamed);
  if (columns.episode < 0) columns.episode = finder.ByConvention(kEpisodeNames);
  if (columns.time < 0) columns.time = finder.Times();
  if (columns.reward < 0) columns.reward = finder.ByConvention(kRewardNames);
  if (columns.terminal < 0) columns.terminal = finder.ByConvention(kTerminalNames);
  if (columns.timeout < 0) columns.timeout = finder.ByConvention(kTimeoutNames);
  columns.unused = finder.Unused();
  return columns;
}

}  // namespace oted
