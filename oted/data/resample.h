#pragma once
/// The rules by which what was logged at times of its own becomes rows of one grid: those of a table
/// (oted/data/recording.h) and those of channels with clocks of their own (FromStreams). docs/file_formats.md states
/// them for users.

#include <span>
#include <string>
#include <vector>

#include "oted/data/recording.h"

namespace oted {

/// Typical steps between two samples from which on nobody knows what lay between: more than two samples are missing.
inline constexpr double kMostGap = 3.5;
/// Share of the samples that may repeat a time.
inline constexpr double kMostTwice = 0.01;
/// Share of a step by which a sample may lie behind a moment and still be at it.
inline constexpr double kHair = 1e-6;

/// The mean of those steps that are within a half of their median, since times in whole milliseconds have no typical
/// one. 0 where there are none.
double TypicalStep(std::vector<double> steps);

/// What the times were rounded to [s], a power of ten of at least 1e-7: those in whole milliseconds are up to half of
/// one off.
double ResolutionOf(std::span<const double> times);

/// Fills in how the rows of a run lie in time: its period, and whether they are even. A row may lie a tenth of the
/// period off its grid, or the times' resolution if that is more.
/// @param period_s  roughly
void MeasureRun(std::span<const double> times, double period_s, double resolution, Recording::Run& run);

/// The mean of the runs' periods; where they differ, the longest, which all can be resampled to. 0 where none has one.
double PeriodOfRuns(const Recording& recording);

/// Whole periods in a span of time; its last sample may be a hundredth of one early.
int WholePeriods(double seconds, double period_s);

/// The last of the rising times at or before `time` (a hair's breadth counts as "at"), from index `from` on.
int LastAtOrBefore(std::span<const double> times, int from, double time, double hair);

/// The share of the way from sample `i` to the next one at which `time` lies: 0 where it is at `i`, or after the last
/// one.
double ShareOfStep(std::span<const double> times, int i, double time);

/// How often and how far the action leaves, within a period, the value that is held over it.
struct ActionChanges {
  int n_periods = 0;
  int n_changed = 0;
  double largest = 0;
  int column = 0;

  void Add(const ActionChanges& other);
  bool IsFewerThan(const ActionChanges& other) const;
  /// For a recording's warnings; "" where there was no change. @param name  of the action `column`
  std::string InWords(const std::string& name) const;
};

/// One number over time, by a clock that all streams share.
struct Stream {
  std::string name;
  std::string source;         ///< for errors: topic and field
  std::vector<double> times;  ///< [s]
  std::vector<double> values;
};

/// Rows `period_s` apart, from the moment when every stream has begun to the moment when the first state ends. States
/// are interpolated linearly, actions are held. Where two samples of a state are more than `most_gap` typical steps
/// apart, an episode ends before and another begins behind, with a grid of its own. Of the moments within an episode's
/// first period, its grid starts at the one from which the smallest share of the periods sees an action change, and how
/// many do is a warning. A sample whose time does not rise is left out.
/// @throws UsageError, DataError naming the stream; DataError when no state has a sample for each period
Recording FromStreams(const std::vector<Stream>& states, const std::vector<Stream>& actions, double period_s,
                      double most_gap = kMostGap);

}  // namespace oted
