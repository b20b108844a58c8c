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

HeldOutParts HoldOut(const Dataset& dataset, RngKey key) {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (episodes.size() == 1) {
    const Episode whole = episodes[0];
    const int middle = whole.begin + std::max(1, static_cast<int>((1 - kJudgeShare) * whole.size()));
    if (middle >= whole.end) return {.learn = dataset, .judge = dataset, .learned_rows = RowsOf(episodes)};
    const std::vector<Episode> first = {{whole.begin, middle, false}};
    return {.learn = dataset.Select(first),
            .judge = dataset.Select({{middle, whole.end, whole.terminated}}),
            .learned_rows = RowsOf(first)};
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
          .n_whole = static_cast<int>(judge.size())};
}

}  // namespace oted
