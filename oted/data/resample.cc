#include "oted/data/resample.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "oted/base/error.h"
#include "oted/base/statistics.h"

namespace oted {
namespace {

/// Share of a period: a grid point may lie this far behind the last sample.
constexpr double kSlack = 0.01;
/// Share of the period that a row may be early or late and still lie on an even grid.
constexpr double kJitter = 0.1;
/// Of what a row is off the grid, the share that moves the grid.
constexpr double kFollow = 0.2;
constexpr double kMaxPeriods = std::numeric_limits<int>::max() / 2;

std::string Called(const Stream& stream) {
  return fmt::format("channel '{}'{}", stream.name, stream.source.empty() ? "" : fmt::format(" ({})", stream.source));
}

/// Of rising times.
double TypicalStepOf(std::span<const double> times) {
  std::vector<double> steps;
  for (size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  return TypicalStep(std::move(steps));
}

/// The samples of a stream whose times rise.
struct Samples {
  std::vector<double> times, values;
  double step = 0;  ///< typical
  double hair() const { return kHair * step; }
};

Samples Sound(const Stream& stream, int& n_left_out) {
  const size_t n = stream.times.size();
  if (stream.values.size() != n) {
    throw UsageError(fmt::format("{}: got {} times and {} values, wanted a time for each value", Called(stream), n,
                                 stream.values.size()));
  }
  if (n < 2) {
    throw DataError(fmt::format("{} has {} samples, wanted at least 2; is its topic recorded?", Called(stream), n));
  }
  Samples samples;
  size_t n_bad = 0;
  for (size_t i = 0; i < n; ++i) {
    if (!std::isfinite(stream.times[i]) || !std::isfinite(stream.values[i])) {
      ++n_bad;
    } else if (samples.times.empty() || stream.times[i] > samples.times.back()) {
      samples.times.push_back(stream.times[i]);
      samples.values.push_back(stream.values[i]);
    }
  }
  if (n_bad > 0) {
    throw DataError(fmt::format("{}: {} of {} samples are not finite; leave them out", Called(stream), n_bad, n));
  }
  const size_t n_twice = n - samples.times.size();
  if (static_cast<double>(n_twice) > kMostTwice * static_cast<double>(n) || samples.times.size() < 2) {
    throw DataError(
        fmt::format("{}: {} of {} time stamps do not rise; use the recording's own times (time='log'), or "
                    "repair the clock",
                    Called(stream), n_twice, n));
  }
  n_left_out += static_cast<int>(n_twice);
  samples.step = TypicalStepOf(samples.times);
  return samples;
}

class StreamGrid {
 public:
  StreamGrid(const std::vector<Stream>& states, const std::vector<Stream>& actions, double period_s, double most_gap)
      : period_s_(period_s), most_gap_(most_gap) {
    to_.file = "logs";
    to_.period_s = period_s;
    int n_left_out = 0;
    double start = -std::numeric_limits<double>::infinity();
    const auto add = [&](const std::vector<Stream>& from, std::vector<Samples>& to, std::vector<std::string>& names) {
      for (const Stream& stream : from) {
        to.push_back(Sound(stream, n_left_out));
        names.push_back(stream.name);
        start = std::max(start, to.back().times.front());
      }
    };
    add(states, states_, to_.observation_names);
    add(actions, actions_, to_.action_names);
    // From here on times are small: a double resolves 0.2 microseconds in a time since 1970.
    for (std::vector<Samples>* all : {&states_, &actions_}) {
      for (Samples& samples : *all) {
        for (double& time : samples.times) time -= start;
      }
    }
    if (n_left_out > 0) {
      to_.warnings.push_back(fmt::format("{} samples whose times do not rise were left out", n_left_out));
    }
  }

  Recording Run() {
    CheckRates();
    const std::vector<Span> spans = Spans();
    ActionChanges all;
    for (const Span& span : spans) {
      if (WholePeriods(span.end - span.begin, period_s_) < 1) continue;
      const double start = BestStart(span);
      const int n = WholePeriods(span.end - start, period_s_);
      if (n < 1) continue;
      all.Add(ChangesFrom(start, n));
      AddRows(start, n + 1, span.end);
    }
    if (to_.runs.empty()) {
      throw DataError(
          fmt::format("no two rows of the grid lie outside of gaps; is a period of {} s right?", period_s_));
    }
    if (spans.size() > 1) {
      to_.warnings.push_back(
          fmt::format("{} gaps of more than {:g} steps of a channel cut the recording", spans.size() - 1, most_gap_));
    }
    const std::string& name = to_.action_names[static_cast<size_t>(all.column)];
    if (all.n_changed > 0) to_.warnings.push_back(all.InWords(fmt::format("'{}'", name)));
    return std::move(to_);
  }

 private:
  struct Span {
    double begin = 0, end = 0;
  };

  void CheckRates() {
    double fastest = std::numeric_limits<double>::infinity();
    for (const Samples& state : states_) fastest = std::min(fastest, state.step);
    if (fastest > (1 + kSameRate) * period_s_) {
      throw DataError(fmt::format(
          "the fastest state has one sample per {:.6g} s, but the control period is {:.6g} s, and what lies "
          "between the samples is not in the log; log faster, or set a longer period",
          fastest, period_s_));
    }
    for (size_t j = 0; j < states_.size(); ++j) {
      if (states_[j].step <= (1 + kSameRate) * period_s_) continue;
      to_.warnings.push_back(fmt::format(
          "channel '{}' has one sample per {:.6g} s, less than one per control period: rows between them are "
          "interpolated",
          to_.observation_names[j], states_[j].step));
    }
  }

  /// What lies between the gaps of all states, from the moment 0 at which every stream has begun.
  std::vector<Span> Spans() const {
    Span whole{0, std::numeric_limits<double>::infinity()};
    std::vector<Span> gaps;
    for (const Samples& state : states_) {
      whole.end = std::min(whole.end, state.times.back());
      for (size_t i = 1; i < state.times.size(); ++i) {
        const double from = state.times[i - 1], to = state.times[i];
        if (to > 0 && to - from > most_gap_ * state.step) gaps.push_back({from, to});
      }
    }
    if (WholePeriods(whole.end, period_s_) < 1) {
      throw DataError(
          fmt::format("the channels overlap for {:.3g} s, wanted at least two periods of {} s; are their clocks the "
                      "same? (time='log' takes the recording's)",
                      std::max(whole.end, 0.0), period_s_));
    }
    std::ranges::sort(gaps, {}, &Span::begin);
    std::vector<Span> spans;
    for (const Span& gap : gaps) {
      if (gap.begin > whole.end) break;
      if (gap.begin > whole.begin) spans.push_back({whole.begin, gap.begin});
      whole.begin = std::max(whole.begin, gap.end);
    }
    if (whole.end > whole.begin) spans.push_back(whole);
    return spans;
  }

  ActionChanges ChangesFrom(double start, int n) const {
    ActionChanges changes;
    changes.n_periods = n;
    std::vector<uint8_t> changed(static_cast<size_t>(n), 0);
    for (size_t j = 0; j < actions_.size(); ++j) {
      const Samples& action = actions_[j];
      int row = 0;
      for (int k = 0; k < n; ++k) {
        row = LastAtOrBefore(action.times, row, start + k * period_s_, action.hair());
        const double end = start + (k + 1) * period_s_ - action.hair();
        for (size_t i = static_cast<size_t>(row) + 1; i < action.times.size() && action.times[i] < end; ++i) {
          const double change = std::abs(action.values[i] - action.values[static_cast<size_t>(row)]);
          if (change == 0) continue;
          changed[static_cast<size_t>(k)] = 1;
          if (change > changes.largest) {
            changes.largest = change;
            changes.column = static_cast<int>(j);
          }
        }
      }
    }
    changes.n_changed = static_cast<int>(std::ranges::count(changed, 1));
    return changes;
  }

  /// The controller's clock need not begin with the span.
  double BestStart(const Span& span) const {
    std::set<double> moments;
    for (const Samples& action : actions_) {
      const double first = span.begin + action.hair(), last = span.begin + period_s_ - action.hair();
      for (auto i = std::ranges::upper_bound(action.times, first); i != action.times.end() && *i < last; ++i) {
        moments.insert(*i);
      }
    }
    double best = span.begin;
    ActionChanges fewest = ChangesFrom(best, WholePeriods(span.end - best, period_s_));
    for (const double moment : moments) {
      const int n = WholePeriods(span.end - moment, period_s_);
      if (n < 1) break;
      const ActionChanges changes = ChangesFrom(moment, n);
      if (!changes.IsFewerThan(fewest)) continue;
      fewest = changes;
      best = moment;
    }
    return best;
  }

  /// @param end  of what the states show: a row that lies a hair behind it shows what was there
  void AddRows(double start, int n, double end) {
    std::vector<int> seen(states_.size(), 0), held(actions_.size(), 0);
    std::vector<double> observation(states_.size()), action(actions_.size());
    const int begin = to_.observations.rows();
    for (int k = 0; k < n; ++k) {
      const double time = start + k * period_s_, shown = std::min(time, end);
      for (size_t j = 0; j < states_.size(); ++j) {
        const Samples& state = states_[j];
        seen[j] = LastAtOrBefore(state.times, seen[j], shown, state.hair());
        const auto i = static_cast<size_t>(seen[j]);
        const double share = ShareOfStep(state.times, seen[j], shown);
        observation[j] = state.values[i];
        if (share > 0) observation[j] += share * (state.values[i + 1] - state.values[i]);
      }
      for (size_t j = 0; j < actions_.size(); ++j) {
        held[j] = LastAtOrBefore(actions_[j].times, held[j], time, actions_[j].hair());
        action[j] = actions_[j].values[static_cast<size_t>(held[j])];
      }
      to_.observations.AppendRow(observation);
      to_.actions.AppendRow(action);
      to_.times.push_back(time);
    }
    to_.runs.push_back({begin, to_.observations.rows(), false});
  }

  double period_s_, most_gap_;
  std::vector<Samples> states_, actions_;
  Recording to_;
};

}  // namespace

double TypicalStep(std::vector<double> steps) {
  if (steps.empty()) return 0;
  const double median = Median(steps);
  std::erase_if(steps, [&](double step) { return std::abs(step - median) > 0.5 * median; });
  return Mean(steps);
}

double ResolutionOf(std::span<const double> times) {
  double resolution = 1;
  for (; resolution > 1e-7; resolution /= 10) {
    const auto is_multiple = [&](double time) {
      return std::abs(time / resolution - std::round(time / resolution)) < 1e-3;
    };
    if (std::ranges::all_of(times, is_multiple)) break;
  }
  return resolution;
}

void MeasureRun(std::span<const double> times, double period_s, double resolution, Recording::Run& run) {
  const auto at = [&](int row) { return times[static_cast<size_t>(row)]; };
  const double most = std::max(kJitter * period_s, 1.1 * resolution);
  int n_periods = 0;
  double grid = at(run.begin);  // follows the rows slowly, so that an early one and a late one are two
  for (int i = run.begin + 1; i < run.end; ++i) {
    const double late = at(i) - grid;
    const int n = std::max(1, static_cast<int>(std::lround(late / period_s)));
    run.is_even = run.is_even && n == 1 && std::abs(at(i) - at(i - 1) - period_s) <= most;
    n_periods += n;
    grid += n * period_s + kFollow * (late - n * period_s);
  }
  run.period_s = (at(run.end - 1) - at(run.begin)) / n_periods;
}

double PeriodOfRuns(const Recording& recording) {
  double time = 0, n = 0, longest = 0;
  for (const Recording::Run& run : recording.runs) {
    if (!(run.period_s > 0)) continue;
    const double span =
        recording.times[static_cast<size_t>(run.end) - 1] - recording.times[static_cast<size_t>(run.begin)];
    time += span;
    n += span / run.period_s;
    longest = std::max(longest, run.period_s);
  }
  if (n == 0) return 0;
  return longest > (1 + kSameRate) * time / n ? longest : time / n;
}

int WholePeriods(double seconds, double period_s) {
  const double periods = seconds / period_s + kSlack;
  return periods < kMaxPeriods ? static_cast<int>(std::floor(periods)) : std::numeric_limits<int>::max() / 2;
}

int LastAtOrBefore(std::span<const double> times, int from, double time, double hair) {
  size_t i = static_cast<size_t>(from);
  while (i + 1 < times.size() && times[i + 1] <= time + hair) ++i;
  return static_cast<int>(i);
}

double ShareOfStep(std::span<const double> times, int i, double time) {
  const size_t at = static_cast<size_t>(i);
  if (at + 1 >= times.size()) return 0;
  const double share = (time - times[at]) / (times[at + 1] - times[at]);
  return std::abs(share) < kHair ? 0 : std::clamp(share, 0.0, 1.0);
}

void ActionChanges::Add(const ActionChanges& other) {
  n_periods += other.n_periods;
  n_changed += other.n_changed;
  if (other.largest > largest) {
    largest = other.largest;
    column = other.column;
  }
}

bool ActionChanges::IsFewerThan(const ActionChanges& other) const {
  return int64_t{n_changed} * other.n_periods < int64_t{other.n_changed} * n_periods;
}

std::string ActionChanges::InWords(const std::string& name) const {
  if (n_changed == 0) return "";
  return fmt::format(
      "the action changed within {} of {} control periods, at most by {:.4g} (action {}): only the first value of "
      "each period is used",
      n_changed, n_periods, largest, name);
}

Recording FromStreams(const std::vector<Stream>& states, const std::vector<Stream>& actions, double period_s,
                      double most_gap) {
  if (states.empty() || actions.empty()) {
    throw UsageError(
        fmt::format("got {} states and {} actions, wanted at least one of each", states.size(), actions.size()));
  }
  if (!(period_s > 0) || !std::isfinite(period_s)) {
    throw UsageError(fmt::format("period: got {}, wanted a positive number of seconds", period_s));
  }
  if (!(most_gap > 1)) throw UsageError(fmt::format("most_gap: got {}, wanted more than 1 step", most_gap));
  return StreamGrid(states, actions, period_s, most_gap).Run();
}

}  // namespace oted
