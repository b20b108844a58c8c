#include "oted/data/standing_rows.h"

#include <algorithm>
#include <cmath>

#include "oted/data/checks_channels.h"

namespace oted {
namespace {

constexpr int kNear = 4;           // rows: no log is written faster than this many times the sensors' rate
constexpr double kFewSteps = 2.5;  // a slow robot's reading changes by one step, at times by two

/// The step of each channel: that of the readings of rows that stand, which no resampling has moved, or of all.
std::vector<double> Steps(const Dataset& d, const std::vector<int>& standing) {
  std::vector<double> steps, column;
  for (int j = 0; j < d.obs_dim(); ++j) {
    column.clear();
    for (const int i : standing) column.push_back(d.observations(i, j));
    steps.push_back(column.empty() ? 0 : GridStep(column));
    if (steps.back() > 0) continue;
    column.clear();
    for (int i = 0; i < d.size(); ++i) column.push_back(d.observations(i, j));
    steps.back() = column.empty() ? 0 : GridStep(column);
  }
  return steps;
}

/// Whether the nearest row in this direction that does not stand, if near, goes farther than a few steps.
bool Moves(const Dataset& d, const Episode& episode, const std::vector<double>& steps, int row, int direction) {
  for (int i = row + direction, n = 0; n < kNear && i >= episode.begin && i < episode.end; i += direction, ++n) {
    if (Stands(d, i)) continue;
    for (int j = 0; j < d.obs_dim(); ++j) {
      const double change = std::abs(d.next_observations(i, j) - d.observations(i, j));
      if (change > kFewSteps * steps[static_cast<size_t>(j)]) return true;
    }
    return false;
  }
  return false;
}

}  // namespace

bool Stands(const Dataset& dataset, int row) {
  return std::ranges::equal(dataset.observations.row(row), dataset.next_observations.row(row));
}

StandingRows CountStandingRows(const Dataset& dataset, const std::vector<Episode>& episodes) {
  std::vector<int> standing;
  for (int i = 0; i < dataset.size(); ++i) {
    if (Stands(dataset, i)) standing.push_back(i);
  }
  StandingRows rows{.n = static_cast<int>(standing.size())};
  if (standing.empty()) return rows;
  rows.first = standing.front();
  const std::vector<double> steps = Steps(dataset, standing);
  const bool has_steps = !std::ranges::all_of(steps, [](double step) { return step == 0; });
  for (Episode episode : episodes) {
    // A robot waits before it begins, and when it is done.
    for (; episode.begin < episode.end && Stands(dataset, episode.begin); ++episode.begin) ++rows.n_at_rest;
    for (; episode.begin < episode.end && Stands(dataset, episode.end - 1); --episode.end) ++rows.n_at_rest;
    for (int i = episode.begin; has_steps && i < episode.end; ++i) {
      if (!Stands(dataset, i)) continue;
      rows.n_at_rest += !(Moves(dataset, episode, steps, i, -1) && Moves(dataset, episode, steps, i, 1));
    }
  }
  return rows;
}

}  // namespace oted
