#pragma once
/// Which of a dataset's episodes are used.

#include <string>
#include <utility>
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

  /// In the dataset's order. @throws DataError when there are fewer
  Dataset Of(const Dataset& all) const;
  /// What to tell where others lie before or between them, as episodes are then counted among these; else "".
  std::string Renumbering() const;

 private:
  std::string text_, what_;
  std::vector<std::pair<size_t, size_t>> ranges_;  // first and last, from 1; none: all
};

}  // namespace oted
