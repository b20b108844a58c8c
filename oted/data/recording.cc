#include "oted/data/recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/data/resample.h"

namespace oted {
namespace {

class Resampler {
 public:
  Resampler(const Recording& from, double control_period_s) : from_(from), control_period_s_(control_period_s) {
    to_.file = from.file;
    to_.period_s = control_period_s;
    to_.observation_names = from.observation_names;
    to_.action_names = from.action_names;
    to_.constant_names = from.constant_names;
    to_.remarks = from.remarks;
    to_.warnings = from.warnings;
  }

  Recording Run() {
    ActionChanges all;
    int n_short = 0, n_lost_ends = 0, n_faster = 0, n_uneven = 0, n_filled = 0;
    for (const Recording::Run& run : from_.runs) {
      if (IsAtRate(run) && run.is_even) {
        AppendAsItIs(run);
        continue;
      }
      period_s_ = IsAtRate(run) ? from_.PeriodOf(run) : control_period_s_;
      const int start = IsAtRate(run) ? run.begin : BestStart(run);
      const int n = PeriodsFrom(run, start);
      if (n < 1) {
        ++n_short;
        continue;
      }
      ++(IsAtRate(run) ? n_uneven : n_faster);
      if (IsAtRate(run)) {
        n_filled += std::max(0, n + 1 - (run.end - run.begin));
      } else {
        all.Add(ChangesFrom(run, start, n));
      }
      const bool meets_end = from_.times[run.end - 1] - TimeOf(start, n) < 0.5 * from_.PeriodOf(run);
      n_lost_ends += run.terminated && !meets_end;
      const int begin = to_.observations.rows();
      Append(run, start, n);
      to_.runs.push_back({begin, begin + n + 1, run.terminated && meets_end});
    }
    if (n_faster > 0) {
      to_.remarks.push_back(fmt::format(
          "{}resampled from one row per {:.6g} s to the control period of {:.6g} s: observations interpolated, "
          "actions held",
          InWords(n_faster), from_.period_s, control_period_s_));
    }
    if (n_uneven > 0) {
      to_.remarks.push_back(
          fmt::format("{}rows made even: observations interpolated between uneven rows", InWords(n_uneven)));
    }
    if (n_filled > 0) {
      to_.warnings.push_back(
          fmt::format("{} missing rows filled in: observations interpolated, actions held", n_filled));
    }
    if (all.n_changed > 0) to_.warnings.push_back(all.InWords(ActionName(all.column)));
    if (n_short > 0) to_.remarks.push_back(fmt::format("{} episodes shorter than a control period left out", n_short));
    if (n_lost_ends > 0) {
      to_.warnings.push_back(fmt::format(
          "{} terminal states lie between two control periods and were dropped: their episodes count as cut",
          n_lost_ends));
    }
    return std::move(to_);
  }

 private:
  bool IsAtRate(const Recording::Run& run) const {
    return std::abs(from_.PeriodOf(run) / control_period_s_ - 1) <= kSameRate;
  }
  /// "2 of 5 episodes ", or nothing where it is all of them.
  std::string InWords(int n_episodes) const {
    if (n_episodes == static_cast<int>(from_.runs.size())) return "";
    return fmt::format("{} of {} episodes ", n_episodes, from_.runs.size());
  }

  void AppendAsItIs(const Recording::Run& run) {
    const int begin = to_.observations.rows();
    for (int row = run.begin; row < run.end; ++row) {
      AppendBetween(from_.observations, row, 0, to_.observations);
      AppendBetween(from_.qpos, row, 0, to_.qpos);
      AppendBetween(from_.qvel, row, 0, to_.qvel);
      AppendBetween(from_.constants, row, 0, to_.constants);
      to_.actions.AppendRow(from_.actions.row(row));
      to_.times.push_back(from_.times[static_cast<size_t>(row)]);
      if (!from_.rewards.empty()) to_.rewards.push_back(from_.rewards[static_cast<size_t>(row)]);
    }
    to_.runs.push_back({begin, to_.observations.rows(), run.terminated});
  }

  double TimeOf(int start, int k) const { return from_.times[start] + k * period_s_; }

  /// Whole control periods from row `start` to the episode's end.
  int PeriodsFrom(const Recording::Run& run, int start) const {
    return WholePeriods(from_.times[run.end - 1] - from_.times[start], period_s_);
  }

  /// The last row at or before the time, from `row` on; a hair's breadth counts as "at".
  int RowAt(const Recording::Run& run, int row, double time) const {
    const std::span<const double> until_end(from_.times.data(), static_cast<size_t>(run.end));
    return LastAtOrBefore(until_end, row, time, Hair(run));
  }
  double Hair(const Recording::Run& run) const { return kHair * from_.PeriodOf(run); }

  ActionChanges ChangesFrom(const Recording::Run& run, int start, int n) const {
    ActionChanges changes;
    changes.n_periods = n;
    int row = start;
    for (int k = 0; k < n; ++k) {
      row = RowAt(run, row, TimeOf(start, k));
      const std::span<const double> held = from_.actions.row(row);
      bool changed = false;
      const double end = TimeOf(start, k + 1) - Hair(run);
      for (int i = row + 1; i + 1 < run.end && from_.times[i] < end; ++i) {
        for (int j = 0; j < from_.actions.cols(); ++j) {
          const double change = std::abs(from_.actions(i, j) - held[static_cast<size_t>(j)]);
          if (change == 0) continue;
          changed = true;
          if (change > changes.largest) {
            changes.largest = change;
            changes.column = j;
          }
        }
      }
      changes.n_changed += changed;
    }
    return changes;
  }

  /// The controller's clock need not begin with the log: of the rows within the first period, the one from which the
  /// smallest share of the periods sees a change.
  int BestStart(const Recording::Run& run) const {
    int best = run.begin;
    ActionChanges fewest;
    for (int start = run.begin; start + 1 < run.end; ++start) {
      if (from_.times[start] - from_.times[run.begin] >= period_s_ - Hair(run)) break;
      const int n = PeriodsFrom(run, start);
      if (n < 1) break;
      const ActionChanges changes = ChangesFrom(run, start, n);
      const bool is_first = fewest.n_periods == 0;
      if (is_first || changes.IsFewerThan(fewest)) {
        fewest = changes;
        best = start;
      }
    }
    return best;
  }

  void AppendBetween(const Array2<double>& from, int row, double share, Array2<double>& to) {
    if (from.empty()) return;
    std::vector<double> values(from.row(row).begin(), from.row(row).end());
    if (share > 0) {
      for (size_t j = 0; j < values.size(); ++j) values[j] += share * (from(row + 1, static_cast<int>(j)) - values[j]);
    }
    to.AppendRow(values);
  }

  void Append(const Recording::Run& run, int start, int n) {
    int row = start;
    int summed = start;
    for (int k = 0; k <= n; ++k) {
      const double time = TimeOf(start, k);
      row = RowAt(run, row, time);
      const std::span<const double> until_end(from_.times.data(), static_cast<size_t>(run.end));
      const double share = ShareOfStep(until_end, row, time);
      AppendBetween(from_.observations, row, share, to_.observations);
      AppendBetween(from_.qpos, row, share, to_.qpos);
      AppendBetween(from_.qvel, row, share, to_.qvel);
      AppendBetween(from_.constants, run.begin, 0, to_.constants);
      // The last row of an episode has no action of its own.
      const int in_force = IsAtRate(run) ? RowAt(run, row, time + 0.5 * period_s_) : row;
      to_.actions.AppendRow(from_.actions.row(std::min(in_force, run.end - 2)));
      to_.times.push_back(time);
      if (from_.rewards.empty()) continue;
      const double end = TimeOf(start, k + 1) - Hair(run);
      double sum = 0;
      for (; summed + 1 < run.end && from_.times[summed] < end; ++summed) sum += from_.rewards[summed];
      to_.rewards.push_back(sum);
    }
  }

  std::string ActionName(int column) const {
    return from_.action_names.empty() ? fmt::format("{}", column) : fmt::format("'{}'", from_.action_names[column]);
  }

  const Recording& from_;
  double control_period_s_;
  double period_s_ = 0;  // of the grid of the episode at hand
  Recording to_;
};

}  // namespace

Recording Resample(const Recording& recording, double control_period_s) {
  OTED_CHECK(control_period_s > 0);
  if (recording.times.empty() || recording.period_s <= 0) return recording;
  bool is_as_wanted = true;
  for (const Recording::Run& run : recording.runs) {
    const double period = recording.PeriodOf(run), ratio = period / control_period_s;
    if (ratio > 1 + kSameRate) {
      throw DataError(fmt::format(
          "'{}' has one row per {:.6g} s, but the task's control period is {:.6g} s, and what lies between the "
          "rows is not in the log; log faster, set the task's control period, or check that its times are "
          "seconds",
          recording.file, period, control_period_s));
    }
    is_as_wanted = is_as_wanted && run.is_even && ratio >= 1 - kSameRate;
  }
  return is_as_wanted ? recording : Resampler(recording, control_period_s).Run();
}

Dataset ToDataset(const Recording& recording) {
  Dataset dataset;
  dataset.period_s = recording.period_s;
  dataset.observation_names = recording.observation_names;
  dataset.action_names = recording.action_names;
  dataset.constant_names = recording.constant_names;
  dataset.remarks = recording.remarks;
  dataset.warnings = recording.warnings;
  for (const Recording::Run& run : recording.runs) {
    for (int i = run.begin; i + 1 < run.end; ++i) {
      const bool last = i + 2 == run.end;
      dataset.observations.AppendRow(recording.observations.row(i));
      dataset.next_observations.AppendRow(recording.observations.row(i + 1));
      dataset.actions.AppendRow(recording.actions.row(i));
      if (!recording.rewards.empty()) dataset.rewards.push_back(recording.rewards[i]);
      if (!recording.qpos.empty()) dataset.qpos.AppendRow(recording.qpos.row(i));
      if (!recording.qvel.empty()) dataset.qvel.AppendRow(recording.qvel.row(i));
      if (!recording.constants.empty()) dataset.constants.AppendRow(recording.constants.row(i));
      dataset.terminals.push_back(last && run.terminated);
      dataset.timeouts.push_back(last && !run.terminated);
    }
  }
  if (dataset.size() == 0 && recording.n_without_action == recording.observations.rows()) {
    throw DataError(
        fmt::format("'{}' holds no transition: none of its {} rows has an action; fill in the columns of "
                    "actions, or name others",
                    recording.file, recording.n_without_action));
  }
  if (dataset.size() == 0) {
    throw DataError(fmt::format(
        "'{}' holds no transition: no episode has two rows (one per control step{}, the next row is s'); record longer "
        "episodes, or check that times are seconds",
        recording.file, recording.period_s > 0 ? fmt::format(" of {} s", recording.period_s) : ""));
  }
  return dataset;
}

}  // namespace oted
