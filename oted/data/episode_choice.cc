#include "oted/data/episode_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr size_t kLargestEpisode = 10'000'000;

/// A positive number, or 0.
size_t Count(std::string_view text) {
  size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value <= kLargestEpisode ? value : 0;
}

}  // namespace

EpisodeChoice::EpisodeChoice(std::string text, std::string what) : text_(std::move(text)), what_(std::move(what)) {
  all_ = text_ == "all";
  if (all_) return;
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
    for (size_t number = first; number <= last; ++number) numbers_.insert(number);
    begin = end + 1;
  }
}

std::vector<Episode> EpisodeChoice::Of(const Dataset& dataset) const {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (all_) return episodes;
  if (*numbers_.rbegin() > episodes.size()) {
    throw DataError(fmt::format("{} '{}' asks for episode {}, but '{}' holds {}; ask for fewer, or for all", what_,
                                text_, *numbers_.rbegin(), dataset.path, episodes.size()));
  }
  std::vector<Episode> chosen;
  for (const size_t number : numbers_) chosen.push_back(episodes[number - 1]);
  return chosen;
}

}  // namespace oted
