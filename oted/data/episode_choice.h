#pragma once
/// Which of a dataset's episodes are used.

#include <set>
#include <string>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

inline constexpr const char* kEpisodeChoiceHelp =
    "which episodes: 5 (the first five), 3-7, 1-2,4-7 (all but the third of seven), or all";

/// "all"; "5", the first five; "3-7", the third to the seventh; "1,3-7", those and the first.
class EpisodeChoice {
 public:
  /// @param what  named in errors: "data.episodes"  @throws UsageError when `text` is none of these
  EpisodeChoice(std::string text, std::string what);

  /// In the dataset's order. @throws DataError when it has fewer episodes
  std::vector<Episode> Of(const Dataset& dataset) const;

 private:
  std::string text_, what_;
  bool all_ = false;
  std::set<size_t> numbers_;  // from 1
};

}  // namespace oted
