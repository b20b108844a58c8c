#include "oted/matching/held_out.h"

#include <algorithm>

namespace oted {
namespace {
constexpr double kJudgeShare = 0.2;
}

std::vector<int> RowsOf(const std::vector<Episode>& episodes) {
  std::vector<int> rows;
  for (const Episode& episode : episodes) {
    for (int row = episode.begin; row < episode.end; ++row) rows.push_back(row);
  }
  return rows;
}

std::vector<int> EpisodesOf(const std::vector<int>& rows, const std::vector<Episode>& episodes) {
  std::vector<int> of_rows;
  for (const int row : rows) {
    const auto after = std::ranges::upper_bound(episodes, row, {}, &Episode::begin);
    of_rows.push_back(static_cast<int>(after - episodes.begin()) - 1);
  }
  return of_rows;
}

HeldOutParts HoldOut(const Dataset& dataset, RngKey key) {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (episodes.size() == 1) {
    const Episode whole = episodes[0];
    const int middle = whole.begin + std::max(1, static_cast<int>((1 - kJudgeShare) * whole.size()));
    if (middle >= whole.end) {
      return {.learn = dataset, .judge = dataset, .learned_rows = RowsOf(episodes), .judged_rows = RowsOf(episodes)};
    }
    const std::vector<Episode> first = {{whole.begin, middle, false}}, last = {{middle, whole.end, whole.terminated}};
    return {.learn = dataset.Select(first),
            .judge = dataset.Select(last),
            .learned_rows = RowsOf(first),
            .judged_rows = RowsOf(last)};
  }
  Rng rng = key.MakeRng();
  std::vector<Episode> learn, judge;
  int n_judge = 0;
  for (const int k : RandomPermutation(static_cast<int>(episodes.size()), rng)) {
    const Episode& episode = episodes[static_cast<size_t>(k)];
    const bool judges = judge.empty() || n_judge + episode.size() <= kJudgeShare * dataset.size();
    (judges ? judge : learn).push_back(episode);
    if (judges) n_judge += episode.size();
  }
  return {.learn = dataset.Select(learn),
          .judge = dataset.Select(judge),
          .learned_rows = RowsOf(learn),
          .judged_rows = RowsOf(judge),
          .n_whole = static_cast<int>(judge.size())};
}

}  // namespace oted
