#include "oted/stages/design/replay/kept_aside.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

namespace oted {
namespace {

constexpr size_t kManyEpisodes = 5;
constexpr int kBlocksPerJudged = 5;
constexpr double kBlock = 2.0;          // [s]
constexpr double kShortestBlock = 0.7;  // [s]: holds the horizon that is shown, half a second, and the lead before it

}  // namespace

HeldOutParts KeepAside(const Dataset& dataset, double period_s, RngKey key) {
  const bool are_many = dataset.Episodes().size() >= kManyEpisodes;
  if (!(period_s > 0)) return HoldOut(dataset, key);
  HeldOutParts parts = are_many
                           ? HoldOut(dataset, key)
                           : HeldOutParts{.learn = dataset, .judge = {}, .learned_rows = RowsOf(dataset.Episodes())};
  const auto rows = [&](double seconds) { return std::max(1, static_cast<int>(std::lround(seconds / period_s))); };
  std::vector<Episode> learn, judge;
  const std::vector<Episode> logged = dataset.Episodes();
  int recording = 0;
  for (const Episode& episode : parts.learn.Episodes()) {
    const int fifth = episode.size() / kBlocksPerJudged;
    // Where whole episodes judge already, short ones learn whole.
    const int block = are_many && fifth < rows(kShortestBlock) ? episode.size() : std::min(rows(kBlock), fifth);
    if (block < 1)
      return {.learn = dataset, .judge = dataset, .learned_rows = RowsOf(logged), .judged_rows = RowsOf(logged)};
    int begin = episode.begin;  // of what was not given to either
    for (int k = kBlocksPerJudged - 1; episode.begin + (k + 1) * block <= episode.end; k += kBlocksPerJudged) {
      const int middle = episode.begin + k * block, end = middle + block;
      learn.push_back({begin, middle, false});
      judge.push_back({middle, end, episode.terminated && end == episode.end});
      begin = end;
    }
    if (begin < episode.end) learn.push_back({begin, episode.end, episode.terminated});
    parts.recording.resize(learn.size(), recording++);
    parts.logged_as.push_back(EpisodesOf({parts.learned_rows[static_cast<size_t>(episode.begin)]}, logged).front());
  }
  parts.judge.Append(parts.learn.Select(judge));
  parts.learn = parts.learn.Select(learn);
  const auto in_logs = [&](std::vector<int> some) {
    for (int& row : some) row = parts.learned_rows[static_cast<size_t>(row)];
    return some;
  };
  std::ranges::copy(in_logs(RowsOf(judge)), std::back_inserter(parts.judged_rows));
  parts.learned_rows = in_logs(RowsOf(learn));
  return parts;
}

}  // namespace oted
