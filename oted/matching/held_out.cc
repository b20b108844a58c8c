#include "oted/matching/held_out.h"

#include <algorithm>

namespace oted {
namespace {
constexpr double kJudgeShare = 0.2;
}

HeldOutParts HoldOut(const Dataset& dataset, RngKey key) {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (episodes.size() == 1) {
    const Episode whole = episodes[0];
    const int middle = whole.begin + std::max(1, static_cast<int>((1 - kJudgeShare) * whole.size()));
    if (middle >= whole.end) return {dataset, dataset};
    return {.learn = dataset.Select({{whole.begin, middle, false}}),
            .judge = dataset.Select({{middle, whole.end, whole.terminated}})};
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
  return {.learn = dataset.Select(learn), .judge = dataset.Select(judge), .n_whole = static_cast<int>(judge.size())};
}

}  // namespace oted
