#include "oted/data/episode_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <string_view>
#include <utility>

#include "oted/base/error.h"

namespace oted {
namespace {

/// A positive number, or 0.
size_t Count(std::string_view text) {
  size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? value : 0;
}

}  // namespace

EpisodeChoice::EpisodeChoice(std::string text, std::string what) : text_(std::move(text)), what_(std::move(what)) {
  if (text_ == "all") return;
  const bool is_count = text_.find_first_of(",-") == std::string::npos;
  for (size_t begin = 0; begin <= text_.size();) {
    const size_t end = std::min(text_.find(',', begin), text_.size());
    const std::string_view part = std::string_view(text_).substr(begin, end - begin);
    const size_t dash = part.find('-');
    const size_t last = Count(dash == std::string_view::npos ? part : part.substr(dash + 1));
    const size_t first = is_count ? 1 : Count(part.substr(0, dash));
    if (first < 1 || last < first) {
      throw UsageError(fmt::format(
          "{} is '{}', wanted a number (the first so many), ranges such as 3-7 or 1,3-7 (counted from 1), or all",
          what_, text_));
    }
    ranges_.emplace_back(first, last);
    begin = end + 1;
  }
}

Dataset EpisodeChoice::Of(const Dataset& all) const {
  if (ranges_.empty()) return all;
  const std::vector<Episode> episodes = all.Episodes();
  std::set<size_t> numbers;
  for (const auto& [first, last] : ranges_) {
    if (last > episodes.size()) {
      throw DataError(fmt::format("{} '{}' asks for episode {}, but '{}' holds {}; ask for fewer, or for all", what_,
                                  text_, last, all.path, episodes.size()));
    }
    for (size_t number = first; number <= last; ++number) numbers.insert(number);
  }
  std::vector<Episode> chosen;
  for (const size_t number : numbers) chosen.push_back(episodes[number - 1]);
  return all.Select(chosen);
}

std::string EpisodeChoice::Renumbering() const {
  std::vector<std::pair<size_t, size_t>> ascending = ranges_;
  std::ranges::sort(ascending);
  size_t n_from_first = 0;
  for (const auto& [first, last] : ascending) {
    if (first > n_from_first + 1) {
      return fmt::format("the episodes {} of the data are counted from 1 from here on", text_);
    }
    n_from_first = std::max(n_from_first, last);
  }
  return "";
}

}  // namespace oted
